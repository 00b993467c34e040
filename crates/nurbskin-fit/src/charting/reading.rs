//! The choice between several readings of a mesh.
//!
//! Each reading is laid out, its holes filled, and fitted with a coarse surface of about 200 spans. The error E of a
//! bicubic surface falls with the number N of its control points as N⁻², so that the control points for equal errors
//! are estimated as
//!
//! ```text
//! cost = (1 + added area) max(E / diagonal, 1e-4)^(1/2)
//! ```
//!
//! The first reading stays unless a later one costs less than a third, or unless it folds, stretches or makes up area.
//!
//! Source: the order of approximation is that of cubic splines; the criterion is ours.

use super::is_poor_chart;
use super::over_mesh::{LaidOut, described, without_pockets};
use crate::chart::shape::{MeshShape, readings_of, shape_of};
use crate::chart::{Chart, Topology};
use crate::fit::approximate::{ApproximateOptions, Guides, approximate_guided};
use glam::{DVec2, DVec3};
use nurbskin_geometry::math;
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::{Unit, percent};
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::mesh::Manifold;

/// Spans, in both directions multiplied, of the coarse fit of each reading. Trial: not recorded; they follow the shape
/// of a part without its details.
const COARSE_SPANS: f64 = 200.0;
/// Most triangles whose middles are fitted. Derived: some 20 for each control point of the coarse fit.
const COARSE_PLACES: usize = 6000;
/// Error, as a share of the diagonal, below which errors of readings are equal. Trial: not recorded; any surface is
/// refined to it in the end.
const ERROR_FLOOR: f64 = 1e-4;
/// Cost of a less likely reading, in that of the more likely one, below which it is preferred. Trial: 1/2 in an earlier
/// version; a coarse error tells the control points to a factor of about two.
const COST_RATIO: f64 = 1.0 / 3.0;
/// Filled area, as a share of the scan's, above which it is made up, and the reading gives way to one that adds little
/// and costs less. Trial: a vase was laid out as a sheet with an opening filled, which added 5 % of its area.
const MAX_ADDED_AREA: f64 = 0.03;
/// Order h^4 of the error of a bicubic surface with spans of length h. Source: approximation order of cubic splines (de
/// Boor, A Practical Guide to Splines). The number of control points then grows as the square root of the inverse
/// error.
const ERROR_ORDER: f64 = 4.0;
/// Added area of such a reading, in that of the one it replaces. Trial: not recorded.
const ADDED_AREA_RATIO: f64 = 0.5;
/// Fewest spans of the coarse fit along a direction. Guard: a periodic cubic needs four.
const MIN_COARSE_SPANS: f64 = 4.0;
/// Quantile of the distances that is the error of a coarse fit. Trial: not recorded; it leaves out creases and stray
/// triangles.
const ERROR_QUANTILE: f64 = 0.95;
/// Tolerance of the coarse fit, as a share of the diagonal. Guard: it only scales the fairness term; the fit is not
/// refined.
const COARSE_TOLERANCE: f64 = 1e-3;

/// Measures of a reading.
#[derive(Clone, Copy, Debug)]
struct Weighed {
    /// Filled area, as a share of the scan's.
    added: f64,
    /// Share of folded triangles, and the root mean square stretch.
    folded: f64,
    stretch: f64,
    /// Distance of 95 % of the places from a coarse fit.
    error: f64,
    /// Whether the layout would be refused, or stretches so much that another one is tried.
    poor: bool,
    /// Estimate of the control points that a surface needs, from the error and the added area, in arbitrary units.
    cost: f64,
}

/// Lays a mesh out over its domain. If there are several readings, the first that neither folds nor stretches badly is
/// taken, unless a later one costs less than a third of it. The notes list the readings.
pub(super) fn best(
    manifold: &Manifold,
    topology: Option<Topology>,
    unit: Unit,
    progress: &dyn Progress,
) -> Result<LaidOut> {
    let mut readings = readings_of(manifold, topology)?;
    let first = readings.remove(0);
    let laid = without_pockets(manifold.clone(), &first, progress);
    if matches!(laid, Err(Error::Cancelled)) {
        return laid;
    }
    let poor = laid
        .as_ref()
        .map_or(true, |l| is_poor_chart(l.chart.quality));
    if topology.is_none() && readings.is_empty() && first.topology == Topology::Tube && poor {
        // A sheet with a large hole can be read as a tube.
        readings.extend(shape_of(manifold, Some(Topology::Disk)));
    }
    if readings.is_empty() {
        return laid.map(|laid| noted(laid, &first, manifold, unit));
    }
    let mut others = vec![(first, laid)];
    for shape in readings {
        progress.check()?;
        let laid = without_pockets(manifold.clone(), &shape, progress);
        others.push((shape, laid));
    }
    let mut weighed = Vec::new();
    let mut refusal = None;
    for (shape, laid) in others {
        match laid {
            Ok(laid) => {
                let found = weigh(manifold, &laid, progress)?;
                weighed.push((shape, laid, found));
            }
            Err(Error::Cancelled) => return Err(Error::Cancelled),
            Err(why) => refusal = refusal.or(Some(why)),
        }
    }
    let said: Vec<String> = weighed
        .iter()
        .map(|(shape, _, found)| format!("{} ({})", shape.reason, found.said(unit)))
        .collect();
    // In their order, unless a later one is much better.
    let best = weighed.into_iter().reduce(|best, other| {
        if other.2.is_better_than(&best.2, [&other.0, &best.0]) {
            other
        } else {
            best
        }
    });
    match (best, refusal) {
        (Some((shape, laid, _)), _) => {
            let mut laid = noted(laid, &shape, manifold, unit);
            if said.len() > 1 {
                laid.notes.detail(format!(
                    "{} readings were weighed: the first was kept unless a surface over a later one needs less than a third \
                     of the control points, by the error of a coarse fit and the area added, or fewer where the first makes \
                     up more than {} of the area, or only that one does not fold: {}",
                    said.len(),
                    percent(MAX_ADDED_AREA),
                    said.join("; ")
                ));
            }
            Ok(laid)
        }
        (None, Some(why)) => Err(why),
        (None, None) => Err(Error::NoSolution("the mesh has no layout".into())),
    }
}

impl Weighed {
    /// Whether this reading, of shape `shapes[0]`, replaces an earlier one.
    fn is_better_than(&self, first: &Self, shapes: [&MeshShape; 2]) -> bool {
        match (self.poor, first.poor) {
            (false, true) => true,
            (true, false) => false,
            (false, false) => {
                let made_up =
                    first.added > MAX_ADDED_AREA && self.added < ADDED_AREA_RATIO * first.added;
                made_up && self.cost < first.cost || self.cost < COST_RATIO * first.cost
            }
            // A sheet may still be charted by projection.
            (true, true) => match shapes.map(|shape| shape.topology == Topology::Disk) {
                [true, false] => true,
                [false, true] => false,
                _ => self.stretch < first.stretch,
            },
        }
    }

    fn said(&self, unit: Unit) -> String {
        format!(
            "adds {} of the area, stretch {:.2}, {} folded, coarse error {}",
            percent(self.added),
            self.stretch,
            percent(self.folded),
            unit.length(self.error)
        )
    }
}

/// Adds the description of the shape in front of the notes on the layout.
fn noted(mut laid: LaidOut, shape: &MeshShape, manifold: &Manifold, unit: Unit) -> LaidOut {
    laid.notes
        .details
        .insert(0, described(shape, manifold, unit));
    laid
}

/// Measures a layout. O(n).
fn weigh(manifold: &Manifold, laid: &LaidOut, progress: &dyn Progress) -> Result<Weighed> {
    let quality = laid.chart.quality;
    let [low, high] = bounding_box(&manifold.points);
    let diagonal = low.distance(high);
    let area = manifold.area().max(f64::MIN_POSITIVE);
    let added = (laid.mesh.area() - laid.source.area()).max(0.0) / area;
    let error = match coarse_error(laid, diagonal, progress) {
        Err(Error::NoSolution(_) | Error::Invalid(_)) => f64::INFINITY,
        other => other?,
    };
    Ok(Weighed {
        added,
        folded: quality.folded,
        stretch: quality.stretch,
        error,
        poor: is_poor_chart(quality),
        cost: (1.0 + added) * math::powf((error / diagonal).max(ERROR_FLOOR), 2.0 / ERROR_ORDER),
    })
}

/// Distance of 95 % of the scanned triangles from a surface of few control points.
fn coarse_error(laid: &LaidOut, diagonal: f64, progress: &dyn Progress) -> Result<f64> {
    let chart = &laid.chart;
    let step = laid.scanned.div_ceil(COARSE_PLACES).max(1);
    let (mut points, mut parameters): (Vec<DVec3>, Vec<DVec2>) = (Vec::new(), Vec::new());
    for t in (0..laid.scanned).step_by(step) {
        let [a, b, c] = laid.mesh.corners(t);
        points.push((a + b + c) / 3.0);
        let [p, q, r] = chart.corners[t];
        parameters.push(chart.topology.within((p + q + r) / 3.0));
    }
    // Spans about as long as wide.
    let [long, wide] = chart.size.map(|s| s.max(f64::MIN_POSITIVE));
    let along = (COARSE_SPANS * long / wide)
        .sqrt()
        .clamp(math::powf(COARSE_SPANS, 0.25), COARSE_SPANS);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a small count"
    )]
    let spans = [along, COARSE_SPANS / along].map(|n| n.round().max(MIN_COARSE_SPANS) as usize);
    let chart = Chart {
        parameters,
        topology: chart.topology,
        size: chart.size,
        reason: String::new(),
    };
    let options = ApproximateOptions {
        refine: false,
        spans: Some(spans),
        noise: Some(0.0),
        correct: false,
        ..ApproximateOptions::new(COARSE_TOLERANCE * diagonal)
    };
    let made = approximate_guided(&points, &chart, &Guides::default(), &options, progress)?;
    let mut distances: Vec<f64> = made.residuals.iter().map(|r| r.abs()).collect();
    Ok(quantile_in_place(&mut distances, ERROR_QUANTILE))
}

#[cfg(test)]
mod tests;
