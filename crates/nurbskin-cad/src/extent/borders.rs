//! Where faces end: edges, or, where these are off their surfaces, p-curves on the surfaces.

use super::Part;
use crate::model::Model;
use glam::DVec3;
use nurbskin_geometry::nurbs::{NurbsCurve, NurbsSurface};

/// Samples per span of a p-curve.
const SAMPLES: usize = 16;

/// The borders of faces.
pub(super) struct Borders<'a> {
    /// Edges that lie on all their faces.
    pub(super) edges: Vec<&'a NurbsCurve>,
    /// The others on each of their faces.
    pub(super) loose: Vec<OnSurface<'a>>,
}

/// A p-curve on its surface.
pub(super) struct OnSurface<'a> {
    surface: &'a NurbsSurface,
    pcurve: &'a NurbsCurve,
    /// Parameters and points; none before they are needed.
    samples: Vec<(f64, DVec3)>,
}

impl<'a> Borders<'a> {
    pub(super) fn new(
        model: &'a Model,
        parts: &[Part<'a>],
        edges: &[usize],
        tolerance: f64,
    ) -> Self {
        let mut uses: Vec<Vec<OnSurface>> = Vec::new();
        uses.resize_with(model.edges().len(), Vec::new);
        for part in parts {
            for used in part.face.loops.iter().flat_map(|each| &each.uses) {
                uses[used.edge].push(OnSurface {
                    surface: &part.face.surface,
                    pcurve: &used.pcurve,
                    samples: Vec::new(),
                });
            }
        }
        let mut borders = Self {
            edges: Vec::new(),
            loose: Vec::new(),
        };
        for &edge in edges {
            let (Some(found), Some(uses)) = (model.edges().get(edge), uses.get_mut(edge)) else {
                continue;
            };
            for used in uses.iter_mut() {
                let at = |&t: &f64| (t, used.point(t));
                used.samples = used.parameters().iter().map(at).collect();
            }
            match &found.curve {
                Some(curve) if uses.iter().all(|used| used.gap(curve) <= tolerance) => {
                    borders.edges.push(curve);
                }
                _ => borders.loose.append(uses),
            }
        }
        borders
    }
}

impl OnSurface<'_> {
    fn point(&self, t: f64) -> DVec3 {
        let place = self.pcurve.point(t);
        self.surface.point(place.x, place.y)
    }

    fn parameters(&self) -> Vec<f64> {
        let breaks = self.pcurve.knots().breakpoints();
        let at =
            |range: &[f64], k: usize| range[0] + (range[1] - range[0]) * k as f64 / SAMPLES as f64;
        let inner = breaks.windows(2);
        let mut parameters: Vec<f64> = inner
            .flat_map(|range| (0..SAMPLES).map(move |k| at(range, k)))
            .collect();
        parameters.extend(breaks.last());
        parameters
    }

    /// The largest distance from the edge, on samples.
    fn gap(&self, curve: &NurbsCurve) -> f64 {
        let gap = |&(t, point): &(f64, DVec3)| curve.point(t).distance(point);
        self.samples.iter().map(gap).fold(0.0, f64::max)
    }

    /// The largest value of a linear function: the best of the samples, improved between its neighbours by golden
    /// sections.
    pub(super) fn largest(&self, value: impl Fn(DVec3) -> f64) -> f64 {
        let values: Vec<f64> = self.samples.iter().map(|sample| value(sample.1)).collect();
        let mut best = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        for k in 0..values.len() {
            let [before, after] = [k.saturating_sub(1), (k + 1).min(values.len() - 1)];
            // Only tops that are about as high as the highest.
            let rise = (values[k] - values[before]).max(values[k] - values[after]);
            if values[k] < values[before].max(values[after]) || values[k] + rise < best {
                continue;
            }
            let golden = (5.0_f64.sqrt() - 1.0) / 2.0;
            let (mut a, mut b) = (self.samples[before].0, self.samples[after].0);
            for _ in 0..48 {
                let (x, y) = (b - golden * (b - a), a + golden * (b - a));
                let (at_x, at_y) = (value(self.point(x)), value(self.point(y)));
                best = best.max(at_x).max(at_y);
                if at_x > at_y {
                    b = y;
                } else {
                    a = x;
                }
            }
        }
        best
    }
}
