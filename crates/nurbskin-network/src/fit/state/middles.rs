//! Further points on triangles, which hold the surface where points are few.

use glam::DVec3;

/// The middles of the parts of a triangle whose sides are divided into `parts`, those that point its way.
pub(super) fn of_parts(corners: &[DVec3; 3], parts: f64) -> Vec<DVec3> {
    let [a, b, c] = *corners;
    let mut all = Vec::new();
    let mut i = 0.0;
    while i < parts {
        let mut j = 0.0;
        while i + j < parts {
            let [x, y] = [i, j].map(|k: f64| (k + 1.0 / 3.0) / parts);
            all.push(a + x * (b - a) + y * (c - a));
            j += 1.0;
        }
        i += 1.0;
    }
    all
}
