//! Which of several domains a mesh is laid out on: the most likely, unless a surface over another one needs far fewer control
//! points.

use super::{LaidOut, is_poor_chart, without_pockets};
use crate::chart::shape::{MeshShape, readings_of, shape_of};
use crate::chart::{Chart, Topology};
use crate::fit::approximate::{ApproximateOptions, Guides, approximate_guided};
use glam::{DVec2, DVec3};
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::point_grid::bounding_box;
use nurbskin_geometry::progress::Progress;
use nurbskin_geometry::unit::{Unit, percent};
use nurbskin_geometry::{Error, Result};
use nurbskin_scan::mesh::Manifold;

/// Spans of the coarse fit of each reading: as many as follow the shape of a part without its details.
const SPANS: f64 = 200.0;
/// Most triangles whose middles it is fitted to: some 20 for each of its control points.
const PLACES: usize = 6000;
/// Errors below this part of the diagonal are no reason to prefer a reading: any surface is refined to it in the end.
const EQUAL: f64 = 1e-4;
/// Part of the control points with which a less likely reading is preferred: a coarse error tells them to a factor of two or so.
const CHEAPER: f64 = 1.0 / 3.0;
/// Part of the area above which what is filled in is made up: a few per cent. A reading that adds more gives way to one that adds
/// less than half and costs less.
const MADE_UP: f64 = 0.03;
/// Order with which the error of a bicubic surface falls with the size of its cells, so that as many control points as the
/// square root of the error says lower it to a given one.
const ORDER: f64 = 4.0;

/// What speaks for a reading.
#[derive(Clone, Copy, Debug)]
struct Weighed {
    /// Area of what was filled in, in parts of the scan's.
    added: f64,
    /// Part of the triangles that are folded over, and the mean stretch.
    folded: f64,
    stretch: f64,
    /// Distance of 95 % of the mesh from a coarse fit.
    error: f64,
    /// Whether the layout would be refused, or stretches so much that another one is better.
    poor: bool,
    /// Control points that a surface needs, as far as the error and the area that was added tell, in units of their own.
    cost: f64,
}

/// Lays a mesh out over the domain that it has; where there are several that it may have, over the most likely one that
/// neither folds nor stretches badly, or over one that costs less than a third of it. Says which were weighed.
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
        // A sheet with a large hole can look like a tube.
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
                    percent(MADE_UP),
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
    /// Whether this reading, of shape `shapes[0]`, replaces one that comes before it.
    fn is_better_than(&self, first: &Self, shapes: [&MeshShape; 2]) -> bool {
        match (self.poor, first.poor) {
            (false, true) => true,
            (true, false) => false,
            (false, false) => {
                let made_up = first.added > MADE_UP && self.added < 0.5 * first.added;
                made_up && self.cost < first.cost || self.cost < CHEAPER * first.cost
            }
            // A sheet may still be laid out on its plane.
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

/// With what its shape is, before what was said of its layout.
fn noted(mut laid: LaidOut, shape: &MeshShape, manifold: &Manifold, unit: Unit) -> LaidOut {
    laid.notes
        .details
        .insert(0, super::described(shape, manifold, unit));
    laid
}

/// What speaks for a layout. O(n).
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
        cost: (1.0 + added) * (error / diagonal).max(EQUAL).powf(2.0 / ORDER),
    })
}

/// Distance of 95 % of the scanned triangles from a surface of few control points.
fn coarse_error(laid: &LaidOut, diagonal: f64, progress: &dyn Progress) -> Result<f64> {
    let chart = &laid.chart;
    let step = laid.scanned.div_ceil(PLACES).max(1);
    let (mut points, mut parameters): (Vec<DVec3>, Vec<DVec2>) = (Vec::new(), Vec::new());
    for t in (0..laid.scanned).step_by(step) {
        let [a, b, c] = laid.mesh.corners(t);
        points.push((a + b + c) / 3.0);
        let [p, q, r] = chart.corners[t];
        parameters.push(chart.topology.within((p + q + r) / 3.0));
    }
    // Cells about as long as wide.
    let [long, wide] = chart.size.map(|s| s.max(f64::MIN_POSITIVE));
    let along = (SPANS * long / wide).sqrt().clamp(SPANS.powf(0.25), SPANS);
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "a small count"
    )]
    let spans = [along, SPANS / along].map(|n| n.round().max(4.0) as usize);
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
        ..ApproximateOptions::new(1e-3 * diagonal)
    };
    let made = approximate_guided(&points, &chart, &Guides::default(), &options, progress)?;
    let mut distances: Vec<f64> = made.residuals.iter().map(|r| r.abs()).collect();
    Ok(quantile_in_place(&mut distances, 0.95))
}

#[cfg(test)]
mod tests;
