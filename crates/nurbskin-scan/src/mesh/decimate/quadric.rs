//! Quadrics: weighted sums of squared distances to planes and points.
//!
//! Q(x) = Σ w ((n · (x - p))² + ε² |x - p|²) = xᵀA x - 2 bᵀx + c, with ε = 0.1. The second term makes A regular: its
//! smallest eigenvalue is at least ε² / (1 + ε²) of the largest, so that the minimiser A⁻¹ b is one point.
//!
//! Sources: M. Garland, P. S. Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997; P.
//! Trettner, L. Kobbelt, *Fast and robust QEF minimization using probabilistic quadrics*, Computer Graphics Forum
//! 39(2), 2020.

use glam::{DMat3, DVec3};

/// Weight of the distance to the centroid of a triangle relative to that to its plane. Planes alone leave flat regions
/// to chance, or to slivers. Trial: not recorded. With 0.1, a collapse on a flat mesh costs as much as one that leaves
/// the surface by a tenth of an edge: triangles come out even unless that would round off an edge of the part.
const CENTROID_WEIGHT: f64 = 0.1;
/// Weight of the squared distance to the border relative to that to the surface. Derived: both are to be followed
/// alike, and a border vertex has half the triangles around it.
const BORDER_WEIGHT: f64 = 2.0;

/// x A x - 2 b x + c: a weighted sum of squared distances of x.
///
/// Sources: M. Garland, P. S. Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997; for the
/// distances to points: P. Trettner, L. Kobbelt, *Fast and robust QEF minimization using probabilistic quadrics*,
/// Computer Graphics Forum 39(2), 2020.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quadric {
    /// xx, yy, zz, xy, yz, zx of the symmetric matrix.
    a: [f64; 6],
    b: DVec3,
    c: f64,
}

impl Quadric {
    /// Squared distance to the plane through `place` with the unit normal, and to the place itself.
    fn new(weight: f64, normal: DVec3, place: DVec3, even: f64) -> Self {
        let offset = normal.dot(place);
        let even = even * even;
        let n = normal;
        Self {
            a: [
                n.x * n.x + even,
                n.y * n.y + even,
                n.z * n.z + even,
                n.x * n.y,
                n.y * n.z,
                n.z * n.x,
            ]
            .map(|x| weight * x),
            b: weight * (offset * normal + even * place),
            c: weight * (offset * offset + even * place.length_squared()),
        }
    }

    /// The quadric of a triangle, a third of its area for each corner.
    pub(super) fn of_triangle([a, b, c]: [DVec3; 3]) -> Self {
        let twice = (b - a).cross(c - a);
        let area = 0.5 * twice.length();
        Self::new(
            area / 3.0,
            twice.normalize_or_zero(),
            (a + b + c) / 3.0,
            CENTROID_WEIGHT,
        )
    }

    /// The quadric of a border side, half of it for each end: squared distance to the plane through the side,
    /// perpendicular to the triangle.
    pub(super) fn of_border([a, b, c]: [DVec3; 3]) -> Self {
        let along = b - a;
        let out = along.cross((b - a).cross(c - a)).normalize_or_zero();
        let weight = 0.5 * along.length_squared();
        Self::new(BORDER_WEIGHT * weight, out, 0.5 * (a + b), CENTROID_WEIGHT)
    }

    pub(super) fn plus(&self, other: &Self) -> Self {
        let mut a = self.a;
        for (x, y) in a.iter_mut().zip(other.a) {
            *x += y;
        }
        Self {
            a,
            b: self.b + other.b,
            c: self.c + other.c,
        }
    }

    /// The value at a place; not negative.
    pub(super) fn at(&self, x: DVec3) -> f64 {
        let ax = self.matrix() * x;
        (x.dot(ax) - 2.0 * self.b.dot(x) + self.c).max(0.0)
    }

    /// The minimiser, if it is unique.
    pub(super) fn least(&self) -> Option<DVec3> {
        let m = self.matrix();
        let determinant = m.determinant();
        // For equal eigenvalues, the cube of the trace is 27 times the determinant; the distances to centroids keep the
        // smallest eigenvalue above ε² of the largest.
        let trace = self.a[0] + self.a[1] + self.a[2];
        let regular = determinant > f64::EPSILON * trace * trace * trace;
        let x = regular.then(|| m.inverse() * self.b)?;
        x.is_finite().then_some(x)
    }

    fn matrix(&self) -> DMat3 {
        let [xx, yy, zz, xy, yz, zx] = self.a;
        DMat3::from_cols_array(&[xx, xy, zx, xy, yy, yz, zx, yz, zz])
    }
}
