//! Deviation against control points, from the JSON of a fit.
//!
//! Extracts the curve of the largest surface with its knee and neighbours, for the plot of the page.

use super::document::Trade;
use nurbskin_fit::fit::approximate::trade::{Neighbour, TradePoint, said};
use nurbskin_geometry::unit::Unit;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// The curve of the surface, or of the largest one; `None` for a single point.
pub(super) fn trade(outcome: &Value, unit: Unit) -> Option<Trade> {
    let surface = outcome.get("surface")?;
    let points: Vec<TradePoint> = of(surface, "trade")?;
    let counts: Vec<usize> = of(surface, "control_points")?;
    let neighbours: Vec<Neighbour> = of(surface, "neighbours").unwrap_or_default();
    // The plot uses their logarithms.
    let drawn = points.iter().filter(|p| p.p95 > 0.0 && p.max > 0.0);
    (drawn.count() > 1).then(|| Trade {
        chosen: counts.into_iter().product(),
        knee: of(surface, "knee"),
        neighbours: said(&neighbours, unit),
        points,
    })
}

fn of<T: DeserializeOwned>(value: &Value, key: &str) -> Option<T> {
    serde_json::from_value(value.get(key)?.clone()).ok()
}
