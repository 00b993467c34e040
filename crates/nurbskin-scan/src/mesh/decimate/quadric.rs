//! Squared distances to many planes and places at once.

use glam::{DMat3, DVec3};

/// What a distance to the middle of a triangle counts against one to its plane. Planes alone leave flat regions to chance, or to
/// slivers; with 0.1 a collapse on a flat mesh costs as much as one that leaves the surface by a tenth of an edge, so that
/// triangles come out even unless that would round off an edge of the part.
const EVEN: f64 = 0.1;
/// What a distance to the border counts against one to the surface: both are to be followed alike, but a border has half
/// the triangles around it.
const BORDER: f64 = 2.0;

/// x A x - 2 b x + c: a weighted sum of squared distances of x.
///
/// Sources: M. Garland, P. S. Heckbert, *Surface simplification using quadric error metrics*, SIGGRAPH 1997; the distances
/// to places besides: P. Trettner, L. Kobbelt, *Fast and robust QEF minimization using probabilistic quadrics*, Computer
/// Graphics Forum 39(2), 2020.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Quadric {
    /// xx, yy, zz, xy, yz, zx of the symmetric matrix.
    a: [f64; 6],
    b: DVec3,
    c: f64,
}

impl Quadric {
    /// Distances to the plane through `place` with the unit normal, and to the place itself.
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

    /// A corner's third of a triangle.
    pub(super) fn of_triangle([a, b, c]: [DVec3; 3]) -> Self {
        let twice = (b - a).cross(c - a);
        let area = 0.5 * twice.length();
        Self::new(
            area / 3.0,
            twice.normalize_or_zero(),
            (a + b + c) / 3.0,
            EVEN,
        )
    }

    /// An end's half of a side on the border: distances to the plane upright on the triangle there.
    pub(super) fn of_border([a, b, c]: [DVec3; 3]) -> Self {
        let along = b - a;
        let out = along.cross((b - a).cross(c - a)).normalize_or_zero();
        let weight = 0.5 * along.length_squared();
        Self::new(BORDER * weight, out, 0.5 * (a + b), EVEN)
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

    /// The sum at a place; not negative.
    pub(super) fn at(&self, x: DVec3) -> f64 {
        let ax = self.matrix() * x;
        (x.dot(ax) - 2.0 * self.b.dot(x) + self.c).max(0.0)
    }

    /// Where it is least, if that is one place.
    pub(super) fn least(&self) -> Option<DVec3> {
        let m = self.matrix();
        let determinant = m.determinant();
        // The trace of a matrix that has all eigenvalues alike, cubed, is 27 times the determinant; the distances to places
        // keep the least eigenvalue above EVEN^2 of the largest.
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
