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
//! | `joins` | angles between the normals of the faces at the edges |
//! | `points`, `histogram`, `worst` | the points and their deviations |
//! | `trade` | deviation against control points |
//! | `tables`, `text` | formatted figures |
//! | `fields` | title and notes, such as part and operator |
//! | `packed` | lists of numbers in a few bytes |
//! | `source` | size and SHA-256 of the input files |
//! | `page` | fills the template |

mod colours;
mod display;
pub mod document;
mod fields;
mod histogram;
mod joins;
mod lines;
mod packed;
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
pub use fields::{Heading, Note};
pub use page::page;
pub use scene::{Kind, Measured, Subject, document};
pub use source::Source;

use glam::DVec3;
use nurbskin_geometry::numeric::statistics::quantile_in_place;

/// Coordinates in the 32 bits that pages store.
#[expect(clippy::cast_possible_truncation, reason = "for the eye")]
fn place(p: DVec3) -> [f32; 3] {
    p.to_array().map(|x| x as f32)
}

/// Steps of coordinates, as a share of the diagonal. Guard: as fine as coordinates in 32 bits on the average, and far
/// below what any scanner measures.
const COORDINATE_STEP: f64 = 1.0 / (1 << 22) as f64;
/// Steps of deviations, as a share of a common one. Guard: five digits of each.
const DEVIATION_STEP: f64 = 1.0 / (1 << 17) as f64;
/// Steps of parameters, as a share of the largest. Guard: the page shows five digits.
const PARAMETER_STEP: f64 = 1.0 / (1 << 20) as f64;
/// Integers of a list are at most about this large, so that few values are limited. Guard: 2^31 is the limit.
const LARGEST: f64 = (1 << 30) as f64;

/// The step of coordinates for places like these, on a part of this size: larger for places far off.
fn step_of_places<'a>(places: impl IntoIterator<Item = &'a DVec3>, diagonal: f64) -> f64 {
    let finite = places.into_iter().filter(|p| p.is_finite());
    let far = finite.fold(0.0, |far: f64, p| far.max(p.abs().max_element()));
    positive((COORDINATE_STEP * diagonal).max(far / LARGEST))
}

/// The step for values of which 95 % are within a common one, which is divided into steps of the given share.
fn step_of_values(values: impl IntoIterator<Item = f64>, share: f64) -> f64 {
    let mut sizes: Vec<f64> = values.into_iter().map(f64::abs).collect();
    sizes.retain(|x| x.is_finite());
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let common = quantile_in_place(&mut sizes, 0.95);
    positive(if common > 0.0 { common } else { largest } * share)
}

/// The step for parameters like these.
fn step_of_parameters(values: impl IntoIterator<Item = f64>) -> f64 {
    let finite = values.into_iter().filter(|x| x.is_finite());
    positive(PARAMETER_STEP * finite.fold(0.0, |far: f64, x| far.max(x.abs())))
}

/// A usable step: 1 for lists of zeros, whose step does not matter.
fn positive(step: f64) -> f64 {
    if step > 0.0 && step.is_finite() {
        step
    } else {
        1.0
    }
}

/// A count; there are never more than 2^32 - 1.
fn number(k: usize) -> u32 {
    u32::try_from(k).unwrap_or(u32::MAX)
}
