//! Triangles that pass through each other.

use glam::DVec3;

/// Shares of the way and of the triangle up to which a side only touches it. A guard against rounding.
const INSIDE: f64 = 1e-6;
/// Sine of the angle between a side and a plane up to which they are parallel. A guard against rounding.
const PARALLEL: f64 = 1e-12;

/// A place where a side of one of two triangles passes through the inside of the other; [`None`] where they only touch, or lie
/// in one plane. O(1).
///
/// Source: T. Moeller, B. Trumbore, *Fast, minimum storage ray/triangle intersection*, J. Graphics Tools 2, 1997.
///
/// ```
/// use glam::DVec3;
/// use nurbskin_geometry::spatial::triangles::crossing;
///
/// let flat = [DVec3::ZERO, DVec3::X, DVec3::Y];
/// let upright = [[0.2, 0.2, -1.0], [0.2, 0.2, 2.0], [9.0, 9.0, 2.0]].map(DVec3::from);
/// assert!(crossing(&flat, &upright).is_some_and(|place| place.z.abs() < 1e-12));
/// let beside = upright.map(|p| p + DVec3::X);
/// assert_eq!(crossing(&flat, &beside), None);
/// ```
#[must_use]
pub fn crossing(one: &[DVec3; 3], two: &[DVec3; 3]) -> Option<DVec3> {
    pierced(one, two).or_else(|| pierced(two, one))
}

/// Where a side of one triangle passes through the inside of another.
fn pierced(one: &[DVec3; 3], two: &[DVec3; 3]) -> Option<DVec3> {
    let [a, b, c] = *two;
    let (x, y) = (b - a, c - a);
    let normal = x.cross(y);
    for s in 0..3 {
        let (from, to) = (one[s], one[(s + 1) % 3]);
        let way = to - from;
        let height = normal.dot(way);
        // Nearly parallel sides are left to the others.
        if height.abs() <= PARALLEL * normal.length() * way.length() {
            continue;
        }
        let share = normal.dot(a - from) / height;
        if !(share > INSIDE && share < 1.0 - INSIDE) {
            continue;
        }
        let point = from + share * way;
        let square = normal.length_squared();
        let v = x.cross(point - a).dot(normal) / square;
        let u = (point - a).cross(y).dot(normal) / square;
        if u > INSIDE && v > INSIDE && u + v < 1.0 - INSIDE {
            return Some(point);
        }
    }
    None
}
