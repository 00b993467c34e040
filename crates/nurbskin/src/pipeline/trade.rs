//! Deviation against control points for one part.
//!
//! Combines the surfaces of the search with the chosen surface as measured, and derives the curve, its knee, and the
//! estimates for neighbouring tolerances ([`nurbskin_fit::fit::approximate::trade`]).

use super::Options;
use crate::deviation::measure::Deviation;
use crate::surfacing::{MOST_UNKNOWNS, Part, Surfaces};
use nurbskin_fit::fit::approximate::DEFAULT_BUDGET;
use nurbskin_fit::fit::approximate::trade::{
    Met, Neighbour, Range, TradePoint, curve, knee, neighbours,
};
use nurbskin_geometry::numeric::statistics::quantile_in_place;

/// Tolerance in standard deviations of the noise below which all tolerances lead to the same surface: slightly above
/// the three of the search.
const LEAST_SIGMAS: f64 = 3.1;

/// The curve of one part.
pub(super) struct Trade {
    pub(super) curve: Vec<TradePoint>,
    pub(super) knee: Option<usize>,
    pub(super) neighbours: Vec<Neighbour>,
}

impl Trade {
    /// The curve through the surfaces of the search and the chosen surface as measured.
    pub(super) fn new(
        part: &Part,
        measured: &Deviation,
        fitted: &Surfaces,
        options: &Options,
    ) -> Self {
        // A network has no search that could be shown.
        let none = Met::default();
        let mut distances: Vec<f64> = measured.points.iter().map(|p| p.upper).collect();
        let chosen = TradePoint {
            control_points: part.shape.control_points(),
            p95: measured.statistics.p95,
            max: measured.statistics.max,
            tolerance: quantile_in_place(&mut distances, fitted.share(&options.surfacing)),
        };
        let met = part.shape.single().map_or(&none, |single| &single.met);
        let curve = curve(&met.surfaces, chosen);
        let asked = fitted.tolerance.asked();
        let missed = asked.is_some() && part.not_met.is_some();
        let tolerance = asked.filter(|_| !missed).unwrap_or(chosen.tolerance);
        let floor = LEAST_SIGMAS * part.noise;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a part of a count"
        )]
        let followed = (MOST_UNKNOWNS * part.points.len() as f64) as usize;
        let range = Range {
            tolerance,
            // A tighter tolerance than a missed one is missed, too.
            least: if missed { floor.max(tolerance) } else { floor },
            most: options
                .surfacing
                .max_control_points
                .unwrap_or(DEFAULT_BUDGET)
                .min(followed),
        };
        Self {
            knee: knee(&curve),
            neighbours: neighbours(met, chosen, range),
            curve,
        }
    }
}
