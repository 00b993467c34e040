//! The closest point of an ellipsoid.

use glam::DVec3;

/// The point of the ellipsoid (x/a)^2 + (y/b)^2 + (z/c)^2 = 1 closest to `point`; the semi-axes must differ. At its foot
/// x the vector p - x is t times half the gradient, so `x_i = a_i^2 p_i / (t + a_i^2)`, and t is the one root of a
/// decreasing function, found by bisection to the last bit (D. Eberly, *Distance from a Point to an Ellipse, an
/// Ellipsoid, or a Hyperellipsoid*, Geometric Tools, 2013).
pub(super) fn closest_on_ellipsoid(axes: DVec3, point: DVec3) -> DVec3 {
    let sign = DVec3::from_array(point.to_array().map(f64::signum));
    let (a, p) = (axes.to_array(), point.abs().to_array());
    // 1. The shortest axis bounds the root from below.
    let short = (1..3).fold(0, |s, i| if a[i] < a[s] { i } else { s });
    let excess = |t: f64| -> f64 {
        (0..3)
            .map(|i| {
                if p[i] > 0.0 {
                    (a[i] * p[i] / (t + a[i] * a[i])).powi(2)
                } else {
                    0.0
                }
            })
            .sum::<f64>()
            - 1.0
    };
    let floor = -a[short] * a[short];
    let mut foot = [0.0; 3];
    if p[short] > 0.0 || excess_without(&a, &p, short, floor) > 0.0 {
        // 2. excess(low) >= 0 >= excess(high).
        let mut low = floor + a[short] * p[short];
        let mut high = floor + (0..3).map(|i| (a[i] * p[i]).powi(2)).sum::<f64>().sqrt();
        high = high.max(low);
        // The root is wanted relative to its distance from the floor: 200 halvings are ample for any double.
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if middle <= low || middle >= high {
                break;
            }
            if excess(middle) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        let t = 0.5 * (low + high);
        for i in 0..3 {
            foot[i] = a[i] * a[i] * p[i] / (t + a[i] * a[i]);
        }
    } else {
        // 3. Inside, on the disc of points with two feet: either will do.
        let mut rest = 1.0;
        for i in 0..3 {
            if i != short {
                foot[i] = a[i] * a[i] * p[i] / (floor + a[i] * a[i]);
                rest -= (foot[i] / a[i]).powi(2);
            }
        }
        foot[short] = a[short] * f64::max(rest, 0.0).sqrt();
    }
    // 4. Bisection leaves the foot off the surface by rounding only; one radial step removes it.
    let foot = DVec3::from_array(foot);
    let level = (foot / axes).length();
    sign * if level > 0.0 { foot / level } else { foot }
}

fn excess_without(a: &[f64; 3], p: &[f64; 3], skip: usize, t: f64) -> f64 {
    (0..3)
        .filter(|&i| i != skip)
        .map(|i| (a[i] * p[i] / (t + a[i] * a[i])).powi(2))
        .sum::<f64>()
        - 1.0
}
