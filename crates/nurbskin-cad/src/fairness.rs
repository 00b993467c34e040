//! How fair a surface is.
//!
//! A fair surface bends as evenly as its shape allows (H. P. Moreton, C. H. Sequin, *Functional optimization for fair
//! surface design*, SIGGRAPH 1992: minimum variation surfaces). What varies is measured here by the mean curvature H,
//! the integral of |grad H| dA over a face. That has no unit and does not change with the size: it is 0 for planes, cylinders
//! and spheres, and large for ribs and wiggles. Of the square, a single sharp spot would be nearly all.

use super::model::Face;
use super::region::Region;
use crate::pcurve::planar::rule;
use glam::DVec2;
use nurbskin_geometry::nurbs::NurbsSurface;
use rayon::prelude::*;

/// Places along u and v on each span, through whose values of H polynomials are laid. With six the result for a torus of four
/// quarters, the longest spans that occur, is off by 0.07 %; with four by 1 %.
const NODES: usize = 6;

/// The variation of the mean curvature over a face, the integral of `|grad H|`; a number without unit, at least 0.
///
/// Each knot span is looked at in 36 places. O(spans).
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_cad::{Model, curvature_variation};
/// use nurbskin_geometry::nurbs::conic;
/// let mut model = Model::new("ring");
/// let face = model.add_whole_surface(&conic::torus(DVec3::ZERO, DVec3::Z, 30.0, 10.0)?, 1e-9)?;
/// let variation = curvature_variation(&model.faces()[face]);
/// assert!((variation / (6.0 * std::f64::consts::PI * 2.0_f64.ln()) - 1.0).abs() < 1e-3, "{variation}");
/// # Ok::<(), nurbskin_geometry::Error>(())
/// ```
#[must_use]
pub fn curvature_variation(face: &Face) -> f64 {
    let surface = &face.surface;
    let region = Region::new(face).ok().filter(|_| face.trimmed);
    let nodes = Nodes::new();
    let knots = [surface.knots_u(), surface.knots_v()];
    let spans = knots.map(|knots| {
        let breaks = knots.breakpoints();
        let pairs = breaks.windows(2).map(|w| [w[0], w[1]]);
        pairs.collect::<Vec<_>>()
    });
    let [along, across] = spans;
    let keeps = |p: DVec2| region.as_ref().is_none_or(|region| region.contains(p));
    let row = |v: &[f64; 2]| -> f64 {
        let spans = along
            .iter()
            .map(|u| nodes.on_span(surface, [*u, *v], &keeps));
        spans.sum()
    };
    let rows: Vec<f64> = across.par_iter().map(row).collect();
    rows.iter().sum()
}

/// Gauss' rule on the unit interval, and the derivatives of polynomials through values at its places.
struct Nodes {
    /// Places and weights.
    rule: Vec<[f64; 2]>,
    /// `slopes[i][k]`: the part of value k in the derivative at place i.
    slopes: [[f64; NODES]; NODES],
}

impl Nodes {
    fn new() -> Self {
        let rule: Vec<[f64; 2]> = rule(NODES).iter().map(|&(x, w)| [x, w]).collect();
        let at = |k: usize| rule[k][0];
        // Barycentric weights (J.-P. Berrut, L. N. Trefethen, Barycentric Lagrange interpolation, SIAM Review 46, 2004).
        let weight = |k: usize| -> f64 {
            let others = (0..NODES).filter(|&j| j != k);
            others.map(|j| 1.0 / (at(k) - at(j))).product()
        };
        let mut slopes = [[0.0; NODES]; NODES];
        for (i, slopes) in slopes.iter_mut().enumerate() {
            for k in (0..NODES).filter(|&k| k != i) {
                slopes[k] = weight(k) / weight(i) / (at(i) - at(k));
                slopes[i] -= slopes[k];
            }
        }
        Self { rule, slopes }
    }

    /// The integral of `|grad H|` over the kept places of a span; 0 where the surface has no normal.
    fn on_span(
        &self,
        surface: &NurbsSurface,
        [u, v]: [[f64; 2]; 2],
        keeps: &impl Fn(DVec2) -> bool,
    ) -> f64 {
        let size = [u[1] - u[0], v[1] - v[0]];
        let place = |i: usize, j: usize| {
            DVec2::new(
                u[0] + size[0] * self.rule[i][0],
                v[0] + size[1] * self.rule[j][0],
            )
        };
        let mut mean = [[0.0; NODES]; NODES];
        let mut first = [[[0.0; 3]; NODES]; NODES];
        for j in 0..NODES {
            for i in 0..NODES {
                let p = place(i, j);
                let Some(found) = surface.curvature(p.x, p.y) else {
                    return 0.0;
                };
                mean[j][i] = found.mean;
                first[j][i] = found.first;
            }
        }
        let mut sum = 0.0;
        for j in 0..NODES {
            for i in (0..NODES).filter(|&i| keeps(place(i, j))) {
                let along: f64 = (0..NODES).map(|k| self.slopes[i][k] * mean[j][k]).sum();
                let across: f64 = (0..NODES).map(|k| self.slopes[j][k] * mean[k][i]).sum();
                let (hu, hv) = (along / size[0], across / size[1]);
                let [e, f, g] = first[j][i];
                let square = e * g - f * f;
                // The inverse of the first fundamental form.
                let gradient = (g * hu * hu - 2.0 * f * hu * hv + e * hv * hv) / square;
                let area = square.sqrt() * size[0] * size[1] * self.rule[i][1] * self.rule[j][1];
                sum += gradient.max(0.0).sqrt() * area;
            }
        }
        sum
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test may stop")]
mod tests {
    use super::*;
    use crate::Model;
    use nurbskin_geometry::nurbs::conic;
    use nurbskin_geometry::{DVec3, NurbsSurface};

    fn variation(surface: &NurbsSurface) -> f64 {
        let mut model = Model::new("");
        let face = model.add_whole_surface(surface, 1e-9).unwrap();
        curvature_variation(&model.faces()[face])
    }

    #[test]
    fn even_shapes_do_not_vary() {
        let sphere = conic::sphere(DVec3::ZERO, 2.0).unwrap();
        let cylinder = conic::cylinder(DVec3::ZERO, 5.0 * DVec3::Z, 1.0).unwrap();
        assert!(variation(&sphere) < 1e-9);
        assert!(variation(&cylinder) < 1e-9);
    }

    #[test]
    fn a_torus_varies_as_its_formula_tells() {
        // H = (R + 2 r cos t) / (2 r (R + r cos t)), so that |grad H| = R |sin t| / (2 r (R + r cos t)^2), and the integral
        // is 2 pi R / r log((R + r) / (R - r)).
        let (large, small) = (30.0_f64, 10.0_f64);
        let exact =
            std::f64::consts::TAU * large / small * ((large + small) / (large - small)).ln();
        let torus = conic::torus(DVec3::ZERO, DVec3::Z, large, small).unwrap();
        let found = variation(&torus);
        assert!((found / exact - 1.0).abs() < 1e-3, "{found} {exact}");
        // Nor does it depend on the size.
        let larger = torus.map_points(|p| 7.0 * p).unwrap();
        assert!((variation(&larger) / found - 1.0).abs() < 1e-9);
    }
}
