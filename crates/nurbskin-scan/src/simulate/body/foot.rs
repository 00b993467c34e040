//! Closest points of an implicit surface.
//!
//! The foot x of a point p minimises |x - p|² / 2 subject to f(x) = 0. With g = grad f, r = p - x and λ = r · g / |g|²,
//! Newton's step in the tangent plane solves (I + λ H) t = r there, where H is the Hessian of f; then x + t goes back to
//! the surface along g. A search starts from every triangle of a mesh of the surface that could hold a closer point.
//!
//! Source: J. Nocedal, S. J. Wright, *Numerical Optimization*, 2nd ed. 2006, section 18.1 (reduced Newton steps).

use super::mesh::Mesh;
use super::surface::Exact;
use glam::{DVec2, DVec3};
use nurbskin_geometry::spatial::hierarchy::{Node, build, limit, visit_near};

/// Most steps of Newton's method. Guard: 3 to 5 suffice near the surface.
const MAX_STEPS: usize = 50;
/// Step of the differences that make the Hessian, mm. Derived: rounding 1e-14 / step and truncation step² are about
/// 1e-9 each for radii of some mm; the foot itself does not depend on it.
const DIFFERENCE: f64 = 1e-5;
/// Room around a triangle's box for the surface, in deviations of its middle. Guard: the middle deviates most where the
/// curvature is even.
const ROOM: f64 = 3.0;

/// The triangles of a mesh of the surface, for the search.
#[derive(Debug)]
pub(super) struct Search {
    exact: Exact,
    /// A point of the surface for each triangle.
    starts: Vec<DVec3>,
    nodes: Vec<Node>,
    /// The rounding of coordinates to single precision.
    slack: f64,
}

impl Search {
    pub(super) fn new(exact: Exact, mesh: &Mesh) -> Self {
        let mut starts = Vec::with_capacity(mesh.triangles.len());
        let mut boxes = Vec::with_capacity(mesh.triangles.len());
        for triangle in &mesh.triangles {
            let [a, b, c] = triangle.map(|k| mesh.points[k as usize]);
            let middle = (a + b + c) / 3.0;
            let start = exact.project(middle);
            let room = ROOM * middle.distance(start) + 1e-3 * a.distance(b);
            boxes.push([a.min(b).min(c) - room, a.max(b).max(c) + room]);
            starts.push(start);
        }
        let [low, high] = exact.bounds();
        Self {
            exact,
            starts,
            nodes: build(&boxes),
            slack: f64::from(f32::EPSILON) * 4.0 * low.abs().max(high).max_element(),
        }
    }

    /// The closest point of the surface.
    pub(super) fn closest(&self, point: DVec3) -> DVec3 {
        let ends = self.exact.ends();
        let mut best = (f64::INFINITY, point);
        let keep = |best: &mut (f64, DVec3), foot: DVec3| {
            let square = foot.distance_squared(point);
            if square < best.0 {
                *best = (square, foot);
            }
        };
        // 1. Open ends: their circles are part of the surface.
        for end in ends {
            keep(&mut best, end.closest(point));
        }
        // 2. The surface itself, from near to far.
        let slack = self.slack + f64::from(f32::EPSILON) * 4.0 * point.abs().max_element();
        let start = limit(best.0, slack);
        visit_near(&self.nodes, point.as_vec3().to_array(), start, |triangle| {
            let foot = self.refine(point, self.starts[triangle]);
            if ends.iter().all(|end| end.beyond(foot) <= 0.0) {
                keep(&mut best, foot);
            }
            limit(best.0, slack)
        });
        best.1
    }

    /// Newton's method from a point of the surface, never uphill.
    fn refine(&self, point: DVec3, start: DVec3) -> DVec3 {
        let mut at = start;
        for _ in 0..MAX_STEPS {
            let step = self.step(point, at);
            let now = at.distance_squared(point);
            let mut factor = 1.0;
            let mut moved = false;
            while factor * step.length() > 1e-14 * now.sqrt().max(1.0) {
                let next = self.exact.project(at + factor * step);
                if next.distance_squared(point) < now {
                    (at, moved) = (next, true);
                    break;
                }
                factor *= 0.5;
            }
            if !moved {
                break;
            }
        }
        at
    }

    /// Newton's step in the tangent plane at `at`; where the reduced Hessian is not positive definite, that of the
    /// plane.
    fn step(&self, point: DVec3, at: DVec3) -> DVec3 {
        let gradient = self.exact.level(at).gradient;
        let normal = gradient.normalize_or(DVec3::Z);
        let (s, t) = normal.any_orthonormal_pair();
        let offset = point - at;
        let r = DVec2::new(offset.dot(s), offset.dot(t));
        let lambda = offset.dot(gradient) / gradient.length_squared().max(1e-12);
        let change = |along: DVec3| {
            let [plus, minus] =
                [1.0, -1.0].map(|sign| self.exact.level(at + sign * DIFFERENCE * along).gradient);
            (plus - minus) / (2.0 * DIFFERENCE)
        };
        let (hs, ht) = (change(s), change(t));
        let a = 1.0 + lambda * hs.dot(s);
        let b = 0.5 * lambda * (hs.dot(t) + ht.dot(s));
        let c = 1.0 + lambda * ht.dot(t);
        let determinant = a * c - b * b;
        if a > 0.0 && determinant > 1e-9 * a * c {
            let x = (c * r.x - b * r.y) / determinant;
            let y = (a * r.y - b * r.x) / determinant;
            x * s + y * t
        } else {
            r.x * s + r.y * t
        }
    }
}
