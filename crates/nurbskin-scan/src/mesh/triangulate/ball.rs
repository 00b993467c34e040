//! The smallest empty ball through the corners of a triangle.
//!
//! The centres of all balls through three points lie on the line c + t n, with c the circumcentre and n the normal.
//! Each other point d leaves the half-line `2 t (d · n) ≤ |d|² - 2 d · c + w - w_d`, with the weights w of the sites.
//! A triangle belongs to the three-dimensional Delaunay triangulation if and only if the intersection of these
//! half-lines is not empty.
//!
//! Source: the empty-ball property (B. Delaunay 1934).

use super::sites::Sites;
use nurbskin_geometry::math;

/// The radius of the smallest ball through three points that contains no other point nearby; `None` if every ball
/// through them contains one: the triangle then does not belong to the three-dimensional Delaunay triangulation.
/// Triangles of that do not cross each other. The weights of the sites decide between points on one sphere.
pub(super) fn empty_ball(sites: &Sites, triangle: [u32; 3]) -> Option<f64> {
    let [a, b, c] = triangle.map(|k| k as usize);
    let (origin, weight) = (sites.points[a], sites.weights[a]);
    let (u, v) = (sites.points[b] - origin, sites.points[c] - origin);
    let normal = u.cross(v);
    let area = normal.length();
    // The centre in the plane: 2 u . x = e, 2 v . x = f.
    let e = u.length_squared() + weight - sites.weights[b];
    let f = v.length_squared() + weight - sites.weights[c];
    let centre = (v.cross(normal) * e + normal.cross(u) * f) / (2.0 * area * area);
    if !centre.is_finite() {
        return None;
    }
    let normal = normal / area;
    // The centres of all balls through the three lie on a line; each other point excludes a half of it.
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    for k in triangle {
        for &j in sites.table.of(k as usize) {
            if triangle.contains(&j) {
                continue;
            }
            let d = sites.points[j as usize] - origin;
            let room =
                d.length_squared() - 2.0 * d.dot(centre) + weight - sites.weights[j as usize];
            let height = 2.0 * d.dot(normal);
            if height > 0.0 {
                high = high.min(room / height);
            } else if height < 0.0 {
                low = low.max(room / height);
            } else if room < 0.0 {
                return None;
            }
            if low > high {
                return None;
            }
        }
    }
    let shift = 0_f64.max(low).min(high);
    Some(math::hypot(centre.length(), shift))
}
