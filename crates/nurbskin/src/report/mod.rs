//! The report of a fit, a deviation or a file: one page of HTML that works offline, with the surface in 3-D.
//!
//! A [`Subject`] is what a verb of the pipeline has found; [`document()`] makes the data of the page of it, in the scale
//! of a screen, and [`page()`] puts them into the template. What the page says in numbers comes from the JSON of the
//! verb, so that both say the same.
//!
//! | module | does |
//! |---|---|
//! | [`document`](mod@document) | the data of the page |
//! | `scene` | puts them together |
//! | `surface`, `colours` | triangles of the faces with curvature, and with the deviation of the points near them |
//! | `lines` | edges, seams, poles, lines of parameters, control nets |
//! | `points`, `histogram`, `worst` | the points and their deviations |
//! | `trade` | what control points buy |
//! | `tables`, `text` | figures as people read them |
//! | `source` | size and SHA-256 of the files that were read |
//! | `page` | the template |

mod colours;
pub mod document;
mod histogram;
mod lines;
mod page;
#[cfg(test)]
mod page_tests;
mod points;
mod scene;
mod source;
mod surface;
mod tables;
#[cfg(test)]
mod tests;
mod text;
mod trade;
mod worst;

pub use document::Document;
pub use page::page;
pub use scene::{Kind, Measured, Subject, document};
pub use source::Source;

use glam::DVec3;

/// A number as it is shown: pages hold 32 bits of each.
#[expect(clippy::cast_possible_truncation, reason = "for the eye")]
fn small(x: f64) -> f32 {
    x as f32
}

/// Coordinates as they are shown.
fn place(p: DVec3) -> [f32; 3] {
    p.to_array().map(small)
}

/// A number of things; there are never more than 2^32 - 1.
fn number(k: usize) -> u32 {
    u32::try_from(k).unwrap_or(u32::MAX)
}
