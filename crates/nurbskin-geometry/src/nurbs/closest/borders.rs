//! Which ends of the domain are borders of the surface, and normals where there is more than one.

use crate::nurbs::surface::SurfaceDerivatives;
use crate::nurbs::{KnotVector, NurbsSurface};
use glam::{DVec2, DVec3};

/// The four ends of the domain: u low, u high, v low, v high.
#[derive(Clone, Copy, Debug)]
pub(super) struct Borders {
    free: [bool; 4],
    /// Whether u (v) low and high are the same curve in space.
    closed: [bool; 2],
    /// Whether the surface may have creases: knots where it is only continuous, or a seam that is not periodic.
    pub(super) sharp: bool,
    /// Whether the tangents turn at such a knot inside, so that the surface has an edge there.
    pub(super) creased: bool,
}

impl Borders {
    /// An end is a pole if its curve stays within 1e-9 of the size of the surface, a seam if it follows the opposite end
    /// as closely: far above the rounding of files, far below any tolerance.
    pub(super) fn new(surface: &NurbsSurface) -> Self {
        let [low, high] = surface.bounding_box();
        let same = 1e-9 * (high - low).length();
        let [(a, b), (c, d)] = surface.domain();
        let [periodic_u, periodic_v] = surface.periodic();
        // Points at the middles and ends of the spans tell curves of the surface apart.
        let places = |knots: &KnotVector| {
            let breaks = knots.breakpoints();
            let mut at: Vec<f64> = breaks.windows(2).map(|w| 0.5 * (w[0] + w[1])).collect();
            at.extend(breaks);
            at
        };
        let (at_u, at_v) = (places(surface.knots_u()), places(surface.knots_v()));
        let along_v =
            |u: f64| -> Vec<DVec3> { at_v.iter().map(|&v| surface.point(u, v)).collect() };
        let along_u =
            |v: f64| -> Vec<DVec3> { at_u.iter().map(|&u| surface.point(u, v)).collect() };
        let ends = [along_v(a), along_v(b), along_u(c), along_u(d)];
        let equal = |p: &[DVec3], q: &[DVec3]| p.iter().zip(q).all(|(a, b)| a.distance(*b) <= same);
        let pole = |p: &[DVec3]| p.iter().all(|a| a.distance(p[0]) <= same);
        let closed = [
            periodic_u || equal(&ends[0], &ends[1]),
            periodic_v || equal(&ends[2], &ends[3]),
        ];
        let free = [0, 1, 2, 3].map(|k| !closed[k / 2] && !pole(&ends[k]));
        let (full_u, full_v) = (full(surface.knots_u()), full(surface.knots_v()));
        let turns = |at: DVec2, along: DVec2, derivative: fn(&SurfaceDerivatives) -> DVec3| {
            let [before, after] = [-1.0, 1.0].map(|side| {
                let at = at + side * 1e-9 * along;
                derivative(&surface.derivatives(at.x, at.y)).normalize_or_zero()
            });
            before.distance(after) > 1e-6
        };
        let (width, height) = (DVec2::new(b - a, 0.0), DVec2::new(0.0, d - c));
        let creased = full_u.iter().any(|&u| {
            at_v.iter()
                .any(|&v| turns(DVec2::new(u, v), width, |s| s.du))
        }) || full_v.iter().any(|&v| {
            at_u.iter()
                .any(|&u| turns(DVec2::new(u, v), height, |s| s.dv))
        });
        let sharp = !full_u.is_empty()
            || !full_v.is_empty()
            || (closed[0] && !(periodic_u && surface.degree()[0] > 1))
            || (closed[1] && !(periodic_v && surface.degree()[1] > 1));
        Self {
            free,
            closed,
            sharp,
            creased,
        }
    }

    /// Whether (u, v) lies on a free end.
    pub(super) fn is_free(&self, surface: &NurbsSurface, u: f64, v: f64) -> bool {
        let [(a, b), (c, d)] = surface.domain();
        let at = [u <= a, u >= b, v <= c, v >= d];
        at.iter().zip(self.free).any(|(&at, free)| at && free)
    }

    /// The mean of the unit normals a little (1e-5 of the domain) to the four sides.
    pub(super) fn pseudo_normal(&self, surface: &NurbsSurface, uv: DVec2) -> DVec3 {
        let [u, v] = surface.domain();
        let beside = |x: f64, (a, b): (f64, f64), closed: bool, side: f64| {
            let moved = x + side * 1e-5 * (b - a);
            if closed && moved < a {
                moved + (b - a)
            } else if closed && moved > b {
                moved - (b - a)
            } else {
                moved.clamp(a, b)
            }
        };
        let mut sum = DVec3::ZERO;
        for (i, j) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
            let at = surface.derivatives(
                beside(uv.x, u, self.closed[0], i),
                beside(uv.y, v, self.closed[1], j),
            );
            sum += at.du.cross(at.dv).normalize_or_zero();
        }
        sum.normalize_or_zero()
    }
}

/// Inner knots where a direction is only continuous.
fn full(knots: &KnotVector) -> Vec<f64> {
    let breaks = knots.breakpoints();
    let inner = breaks.get(1..breaks.len() - 1).unwrap_or_default();
    let is_full = |u: &f64| knots.multiplicity(*u) >= knots.degree();
    inner.iter().copied().filter(is_full).collect()
}
