//! The angle between normals at samples, for edges of any form.

use super::Sample;
use crate::model::Model;
use nurbskin_geometry::math;

/// Samples per Bezier piece of the curve, and at least [`LEAST`] on an edge. As in the checks along edges.
const EACH: usize = 8;
const LEAST: usize = 24;

/// Samples along an edge with its two uses: face, loop and use. `flip` turns the second normal over.
pub(super) fn along(model: &Model, k: usize, uses: [[usize; 3]; 2], flip: bool) -> Vec<Sample> {
    let Some(curve) = &model.edges()[k].curve else {
        return Vec::new();
    };
    let (a, b) = curve.domain();
    let mut samples = Vec::new();
    let breaks = curve.knots().breakpoints();
    let each = LEAST.div_ceil(breaks.len().max(2) - 1).max(EACH);
    for range in breaks.windows(2) {
        for part in 0..each {
            let step = (range[1] - range[0]) / each as f64;
            let t = range[0] + step * (part as f64 + 0.5);
            let normals = uses.map(|[face, l, m]| {
                let face = &model.faces()[face];
                let place = face.loops[l].uses[m].pcurve.point(t);
                let normal = face.surface.normal(place.x, place.y)?;
                Some(if face.reversed { -normal } else { normal })
            });
            let [Some(n), Some(m)] = normals else {
                continue;
            };
            let m = if flip { -m } else { m };
            samples.push(Sample {
                at: (t - a) / (b - a),
                angle: math::angle_between(n, m).to_degrees(),
                length: curve.derivatives(t)[1].length() * step,
            });
        }
    }
    samples
}
