//! The report of a fit, a deviation or a file: one page of HTML that works offline, with the surface in 3-D.
//!
//! A [`Subject`] is the result of a verb of the pipeline. [`document()`] converts it to the data of the page, with
//! lengths in the displayed units, and [`page()`] inserts them into the template. The figures on the page come from the
//! JSON of the verb, so that both agree.
//!
//! | module | does |
//! |---|---|
//! | [`document`](mod@document) | the data of the page |
//! | `scene` | builds the data from the result of a verb |
//! | `surface`, `colours` | triangles of the faces with curvature, and with the deviation of the points near them |
//! | `display` | these triangles for other front ends |
//! | `lines` | edges, seams, poles, isoparametric lines, control nets |
//! | `points`, `histogram`, `worst` | the points and their deviations |
//! | `trade` | deviation against control points |
//! | `tables`, `text` | formatted figures |
//! | `source` | size and SHA-256 of the input files |
//! | `page` | fills the template |

mod colours;
mod display;
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

pub use display::{DisplayMesh, display_mesh};
pub use document::Document;
pub use page::page;
pub use scene::{Kind, Measured, Subject, document};
pub use source::Source;

use glam::DVec3;

/// A number in the 32 bits that pages store.
#[expect(clippy::cast_possible_truncation, reason = "for the eye")]
fn small(x: f64) -> f32 {
    x as f32
}

/// Coordinates in the 32 bits that pages store.
fn place(p: DVec3) -> [f32; 3] {
    p.to_array().map(small)
}

/// A count; there are never more than 2^32 - 1.
fn number(k: usize) -> u32 {
    u32::try_from(k).unwrap_or(u32::MAX)
}
