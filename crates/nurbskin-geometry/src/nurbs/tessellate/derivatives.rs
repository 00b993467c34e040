//! Bounds of the derivatives of a surface over any rectangle of its domain.

use super::bounds::Bounds;
use crate::Result;
use crate::nurbs::NurbsSurface;
use crate::nurbs::bezier;
use crate::nurbs::bezier::BezierPatch;

/// Upper bounds of the lengths of `S_u`, `S_v`, `S_uu`, `S_uv` and `S_vv`, per parameter.
pub(crate) type Lengths = [f64; 5];

/// Bounds on every span of a surface.
#[derive(Debug)]
pub struct DerivativeBounds {
    breaks: [Vec<f64>; 2],
    /// By span, u fastest.
    spans: Vec<Lengths>,
}

impl DerivativeBounds {
    /// O(spans).
    pub fn new(surface: &NurbsSurface) -> Result<Self> {
        let breaks = [
            surface.knots_u().breakpoints(),
            surface.knots_v().breakpoints(),
        ];
        let count = breaks[0].len() - 1;
        let mut spans = Vec::new();
        bezier::visit(surface, |_, patch| {
            let (i, j) = (spans.len() % count, spans.len() / count);
            let [h, k] = [
                breaks[0][i + 1] - breaks[0][i],
                breaks[1][j + 1] - breaks[1][j],
            ];
            let [u, v] = slopes(patch);
            let second = Bounds::new(patch, surface.is_rational());
            spans.push([
                u / h,
                v / k,
                second.uu / (h * h),
                second.uv / (h * k),
                second.vv / (k * k),
            ]);
        })?;
        Ok(Self { breaks, spans })
    }

    /// Bounds over the rectangle between two corners.
    pub fn over(&self, low: [f64; 2], high: [f64; 2]) -> Lengths {
        let range = |k: usize| {
            let breaks = &self.breaks[k];
            let last = breaks.len() - 2;
            let first = breaks.partition_point(|&b| b < low[k]).saturating_sub(1);
            let end = breaks.partition_point(|&b| b <= high[k]).saturating_sub(1);
            first.min(last)..=end.min(last)
        };
        let count = self.breaks[0].len() - 1;
        let mut most = [0.0_f64; 5];
        for j in range(1) {
            for i in range(0) {
                for (most, bound) in most.iter_mut().zip(self.spans[j * count + i]) {
                    *most = most.max(bound);
                }
            }
        }
        most
    }
}

/// Bounds of the first derivatives of a piece over the unit square: degree times the largest step between control points,
/// and for a rational piece times the square of the ratio of its weights (M. Floater, *Derivatives of rational Bezier
/// curves*, CAGD 9, 1992).
fn slopes(patch: &BezierPatch) -> [f64; 2] {
    let [p, q] = patch.degree;
    let at = |i: usize, j: usize| {
        let h = patch.points[j * (p + 1) + i];
        h.truncate() / h.w
    };
    let weights = patch.points.iter().map(|h| h.w);
    let (low, high) = weights.fold((f64::INFINITY, 0.0_f64), |(l, h), w| (l.min(w), h.max(w)));
    let ratio = (high / low).powi(2);
    let along_u = (0..=q).flat_map(|j| (0..p).map(move |i| (i, j)));
    let along_v = (0..q).flat_map(|j| (0..=p).map(move |i| (i, j)));
    let u = along_u
        .map(|(i, j)| at(i, j).distance(at(i + 1, j)))
        .fold(0.0, f64::max);
    let v = along_v
        .map(|(i, j)| at(i, j).distance(at(i, j + 1)))
        .fold(0.0, f64::max);
    [p as f64 * ratio * u, q as f64 * ratio * v]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nurbs::conic;
    use crate::{ControlNet, DVec3, KnotVector};

    #[test]
    fn no_derivative_is_longer() {
        let net = ControlNet::from_fn(7, 6, |i, j| {
            let (x, y) = (i as f64, j as f64);
            DVec3::new(x, y, (2.0 * x).sin() * y.cos())
        });
        let knots = |n| KnotVector::uniform(3, n).unwrap();
        let sheet = NurbsSurface::new(knots(7), knots(6), net.unwrap(), None).unwrap();
        let ball = conic::sphere(DVec3::new(1.0, 2.0, 3.0), 2.0).unwrap();
        for surface in [sheet, ball] {
            let bounds = DerivativeBounds::new(&surface).unwrap();
            for k in 0..400 {
                let (u, v) = (f64::from(k % 20) / 20.0, f64::from(k / 20) / 20.0);
                let (low, high) = ([u, v], [u + 0.05, v + 0.05]);
                let d = surface.derivatives(u + 0.02, v + 0.03);
                let found = [d.du, d.dv, d.duu, d.duv, d.dvv].map(DVec3::length);
                for (found, bound) in found.into_iter().zip(bounds.over(low, high)) {
                    assert!(found <= bound * (1.0 + 1e-12), "{found} {bound}");
                }
            }
        }
    }
}
