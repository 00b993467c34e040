//! The exact surface of a body: level, normals, distances.

use super::foot::Search;
use super::forms::{Level, around, on_circle};
use super::{Body, bracket, knot, mesh, recipes};
use glam::DVec3;
use std::sync::OnceLock;

/// Where the bodies' own origin stands: where a scanner's table would be, as for shapes.
pub(super) const ORIGIN: DVec3 = DVec3::splat(300.0);
/// Most steps of [`Exact::project`]. Guard: 3 to 6 suffice within a part's radius of the surface.
const MAX_STEPS: usize = 60;
/// |f| at which a projection ends, mm. Guard: the rounding of coordinates of 100 mm, with a margin of 50.
const ROUNDING: f64 = 1e-12;

/// The surface of a [`Body`]: implicit function, normals, closest points.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// use nurbskin_scan::simulate::{Body, BodySurface};
/// let mug = BodySurface::new(Body::Mug);
/// // Above the middle of the cup's floor, which is 8 mm thick.
/// let point = DVec3::new(300.0, 300.0, 260.0);
/// assert!((mug.signed_distance(point) - 1.0).abs() < 1e-9);
/// ```
#[derive(Debug)]
pub struct BodySurface {
    exact: Exact,
    search: OnceLock<Search>,
}

/// The implicit function of a body about its own origin, and the planes where its surface ends.
#[derive(Clone, Copy, Debug)]
pub(super) struct Exact(pub(super) Body);

/// An open end: the plane `normal` · x = `offset`, with the surface below it, and the radius of the circle there.
pub(super) struct End {
    pub(super) normal: DVec3,
    pub(super) offset: f64,
    pub(super) radius: f64,
}

/// The open ends of the tee.
const TEE_ENDS: [End; 3] = [
    End {
        normal: DVec3::NEG_X,
        offset: recipes::TEE_END,
        radius: recipes::TEE_MAIN,
    },
    End {
        normal: DVec3::X,
        offset: recipes::TEE_END,
        radius: recipes::TEE_MAIN,
    },
    End {
        normal: DVec3::Z,
        offset: recipes::TEE_END,
        radius: recipes::TEE_BRANCH,
    },
];

impl Exact {
    pub(super) fn level(self, point: DVec3) -> Level {
        match self.0 {
            Body::DoubleTorus => recipes::double_torus(point),
            Body::Mug => recipes::mug(point),
            Body::Hammer => recipes::hammer(point),
            Body::Drill => recipes::drill(point),
            Body::Tee => recipes::tee(point),
            Body::Bracket => bracket::level(point),
            Body::Knot => around(point, knot::on_axis(point), knot::RADIUS),
        }
    }

    /// The planes where the surface ends.
    pub(super) fn ends(self) -> &'static [End] {
        if self.0 == Body::Tee { &TEE_ENDS } else { &[] }
    }

    /// A box that holds the surface.
    pub(super) fn bounds(self) -> [DVec3; 2] {
        let [low, high] = match self.0 {
            Body::DoubleTorus => [[-66.0, -35.0, -11.0], [66.0, 35.0, 11.0]],
            Body::Mug => [[-42.0, -42.0, -49.0], [73.0, 42.0, 49.0]],
            Body::Hammer => [[-63.0, -17.0, -142.0], [44.0, 17.0, 17.0]],
            Body::Drill => [[-84.0, -32.0, -132.0], [84.0, 32.0, 28.0]],
            Body::Tee => [[-70.0, -20.0, -20.0], [70.0, 20.0, 70.0]],
            Body::Bracket => [[-40.0, -25.0, -35.0], [40.0, 25.0, 35.0]],
            Body::Knot => [[-63.0, -63.0, -23.0], [63.0, 63.0, 23.0]],
        };
        [DVec3::from(low), DVec3::from(high)]
    }

    /// A point of the surface near `point`: steps of Newton's method along the gradient. The tee's surface goes on
    /// beyond its ends here.
    pub(super) fn project(self, point: DVec3) -> DVec3 {
        match self.0 {
            Body::Bracket => return bracket::closest(point).0,
            Body::Knot => return knot::closest(point),
            _ => {}
        }
        let mut at = point;
        let mut best = (f64::INFINITY, point);
        for _ in 0..MAX_STEPS {
            let level = self.level(at);
            if level.value.abs() < best.0 {
                best = (level.value.abs(), at);
            }
            let square = level.gradient.length_squared();
            if level.value.abs() <= ROUNDING || square <= 0.0 {
                break;
            }
            at -= level.gradient * (level.value / square);
        }
        best.1
    }

    /// The outward unit normal at a point of the surface.
    pub(super) fn normal(self, point: DVec3) -> DVec3 {
        self.level(point).gradient.normalize_or(DVec3::Z)
    }
}

impl End {
    /// How far a point lies beyond the end; negative before it.
    pub(super) fn beyond(&self, point: DVec3) -> f64 {
        point.dot(self.normal) - self.offset
    }

    /// The closest point of the end's circle.
    pub(super) fn closest(&self, point: DVec3) -> DVec3 {
        on_circle(point, self.normal * self.offset, self.normal, self.radius)
    }
}

impl BodySurface {
    /// The surface of a body.
    #[must_use]
    pub fn new(body: Body) -> Self {
        Self {
            exact: Exact(body),
            search: OnceLock::new(),
        }
    }

    /// The body.
    #[must_use]
    pub fn body(&self) -> Body {
        self.exact.0
    }

    /// The diagonal of the body's box, mm.
    #[must_use]
    pub fn diagonal(&self) -> f64 {
        let [low, high] = self.exact.bounds();
        low.distance(high)
    }

    /// The implicit function, mm: zero on the surface, negative inside, and nowhere steeper than 1. It is the signed
    /// distance except around blends. The tee's goes on beyond its open ends.
    #[must_use]
    pub fn level(&self, point: DVec3) -> f64 {
        self.exact.level(point - ORIGIN).value
    }

    /// The outward unit normal at the closest point of the surface; on a sharp edge that of either face.
    #[must_use]
    pub fn normal(&self, point: DVec3) -> DVec3 {
        let foot = self.foot(point - ORIGIN);
        if self.body() == Body::Bracket {
            // The face of the foot itself: the offset from it would be no normal beyond an edge.
            return bracket::closest(foot).1;
        }
        self.exact.normal(foot)
    }

    /// Distance from `point` to the surface, not negative. Exact for the bracket and the knot; for the others a search
    /// over all places that could be closer, each with Newton's method, to 1e-10 of the body. About 20 us near the
    /// surface; more where many places are equally far.
    #[must_use]
    pub fn distance(&self, point: DVec3) -> f64 {
        point.distance(self.closest_point(point))
    }

    /// The closest point of the surface; see [`distance`](Self::distance). One of them where there are several.
    #[must_use]
    pub fn closest_point(&self, point: DVec3) -> DVec3 {
        ORIGIN + self.foot(point - ORIGIN)
    }

    /// Distance with the sign of [`level`](Self::level): negative inside.
    #[must_use]
    pub fn signed_distance(&self, point: DVec3) -> f64 {
        self.distance(point).copysign(self.level(point))
    }

    fn foot(&self, point: DVec3) -> DVec3 {
        match self.body() {
            Body::Bracket => bracket::closest(point).0,
            Body::Knot => knot::closest(point),
            _ => self
                .search
                .get_or_init(|| Search::new(self.exact, &mesh::even(self.exact)))
                .closest(point),
        }
    }
}
