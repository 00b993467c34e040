//! Points that a fit lets go of, since no sound network follows them.

use super::{Fit, MOST_STIFF};
use crate::fit::FacePart;
use crate::fit::network::Network;
use crate::layout::OnFace;

/// Least part of its weight that a point on a border keeps. Dimensionless.
/// Trial: 0, 0.003, 0.03 and 0.3 on a vase and views of a figure. With 0 the rim of the vase flares to 0.04 of its diagonal off the scan,
/// with the others the network is 0.02 off at most, in a hole; with 0.03 and 0.3 two of the views need up to three more layouts.
pub(in crate::fit) const LEAST_ON_BORDER: f64 = 0.003;

impl Fit<'_> {
    /// Lets go of the points on some parts of faces and `reach` spans around them within these, by a factor of their weights, and
    /// makes the faces smoother, by another. Points on the borders there are let go, too, down to [`LEAST_ON_BORDER`].
    pub(in crate::fit) fn let_go(
        &mut self,
        parts: &[FacePart],
        reach: usize,
        [weight, fairness]: [f64; 2],
    ) {
        let mut by_face: Vec<Vec<[[f64; 2]; 2]>> = vec![Vec::new(); self.network.faces.len()];
        for part in parts {
            let Some(face) = self.network.faces.get(part.face as usize) else {
                continue;
            };
            let sides = [0, 1].map(|d| {
                let breaks = Network::breaks(&face.inner[d]);
                let last = breaks.len() - 1;
                // A place on a knot belongs to both spans.
                let is_place = part.low[d] >= part.high[d];
                let low =
                    breaks.partition_point(|&b| b < part.low[d] || !is_place && b <= part.low[d]);
                let high =
                    breaks.partition_point(|&b| b < part.high[d] || is_place && b <= part.high[d]);
                [
                    breaks[low.saturating_sub(1 + reach)],
                    breaks[(high + reach).min(last)],
                ]
            });
            by_face[part.face as usize].push(sides);
        }
        for (phi, _) in self
            .fairness
            .iter_mut()
            .zip(&by_face)
            .filter(|f| !f.1.is_empty())
        {
            *phi = (*phi * fairness).min(MOST_STIFF);
        }
        let is_in = |foot: &OnFace| {
            let inside = |[u, v]: &[[f64; 2]; 2]| {
                (u[0]..=u[1]).contains(&foot.u) && (v[0]..=v[1]).contains(&foot.v)
            };
            by_face[foot.face as usize].iter().any(inside)
        };
        let samples = &mut self.samples;
        let weights = self.weights.iter_mut().zip(&mut samples.weights);
        for (foot, (own, pulling)) in samples.feet.iter().zip(weights) {
            if is_in(foot) {
                *own *= weight;
            }
            // On other faces points pull on as hard as they do.
            if !by_face[foot.face as usize].is_empty() {
                *pulling = *own;
            }
        }
        for (foot, own) in self.lines.on_borders(&self.network) {
            if is_in(&foot) {
                *own = (*own * weight).max(LEAST_ON_BORDER);
            }
        }
    }

    /// Sets the distance of the points whose weight is less than `at_first` to 0, until feet are found anew, and that of the points on
    /// borders that were let go. Returns the share of all points that were beyond the tolerance among the first.
    pub(in crate::fit) fn excuse(&mut self, at_first: &[f64], tolerance: f64) -> f64 {
        let before = self.beyond(tolerance);
        let lines = &mut self.lines;
        for (own, distance) in lines.weights.iter().zip(&mut lines.distances) {
            if *own < 1.0 {
                *distance = 0.0;
            }
        }
        let weights = self.weights.iter().zip(at_first);
        for ((own, first), distance) in weights.zip(&mut self.samples.distances) {
            if own < first {
                *distance = 0.0;
            }
        }
        before - self.beyond(tolerance)
    }
}
