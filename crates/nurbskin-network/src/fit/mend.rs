//! Folds and self-intersections of a finished network.
//!
//! ```text
//! inspect ─▶ parts that cross ─▶ points there let go, faces smoother ─▶ a few steps ─▶ inspect …
//! ```
//!
//! A scan may touch or pass through itself: eyelids, lips, fins at the rim of a merged scan that are thinner than the tolerance.
//! No sound surface follows such points. Without them the thin plate spans the place.
//!
//! Source: ours.

use super::network::Network;
use super::state::Fit;
use super::strategy::resumed;
use super::{FacePart, FitOptions, Inspect, Target, finished};
use nurbskin_geometry::Result;

/// Most times that points are let go. Count.
/// Guard: each time reaches a span farther.
const MOST_MENDS: usize = 5;
/// Steps after that. Count.
/// Trial: not varied; as at the end of a fit over all points.
const STEPS: usize = 3;
/// Factor of the weight of a point that is let go. Dimensionless.
/// Trial: not varied; one point in thirty still holds the surface near the scan.
const LET_GO: f64 = 0.03;
/// Factor of the fairness of its face. Dimensionless.
/// Trial: on bunny, whose 60 to 470 crossings go the first time; not varied.
const STIFFER: f64 = 4.0;

/// Mends what `inspect` finds, as far as it goes; returns what is left.
pub(super) fn mended(
    fit: &mut Fit,
    target: &Target,
    inspect: &mut Inspect,
    options: &FitOptions,
) -> Result<Vec<FacePart>> {
    let mut defects = inspect(&finished(fit, Vec::new())?)?;
    let mut best = None;
    for reach in 0..MOST_MENDS {
        if defects.is_empty() {
            return Ok(defects);
        }
        let before = (fit.network.clone(), fit.samples.clone(), defects.clone());
        let is_better = |b: &(Network, _, Vec<FacePart>)| defects.len() < b.2.len();
        if best.as_ref().is_none_or(is_better) {
            best = Some(before);
        }
        fit.let_go(&defects, reach, [LET_GO, STIFFER]);
        resumed(fit, target, options, STEPS)?;
        defects = inspect(&finished(fit, Vec::new())?)?;
    }
    if let Some((network, samples, fewest)) = best.filter(|b| b.2.len() < defects.len()) {
        (fit.network, fit.samples) = (network, samples);
        defects = fewest;
    }
    Ok(defects)
}
