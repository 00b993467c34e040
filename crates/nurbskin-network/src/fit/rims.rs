//! Borders of a mesh as curves that a surface can end at.
//!
//! The border of a scan that was cut by its pixels or triangles is a zigzag. A curve through it may make the faces beside it
//! fold; such a curve follows the low-pass filtered border instead.
//!
//! Source: G. Taubin, *A signal processing approach to fair surface design*, SIGGRAPH 1995: steps of opposite sign, so that
//! loops do not shrink.

use glam::DVec3;
use nurbskin_scan::mesh::Manifold;

/// Factors of the two steps of a pass.
/// Source: Taubin 1995, a pass band up to 0.1 and no shrinking.
const STEPS: [f64; 2] = [0.5, -0.53];
/// Passes. Count.
/// Trial: on a bottle cut along its triangles; more leave more points beyond the border.
const PASSES: usize = 3;
/// The places of the vertices of a mesh, those on borders smoothed.
pub(crate) fn smoothed(mesh: &Manifold) -> Vec<DVec3> {
    let mut points = mesh.points.clone();
    for border in &mesh.loops {
        let own: Vec<DVec3> = border.iter().map(|&k| mesh.points[k as usize]).collect();
        let count = own.len();
        if count < 4 {
            continue;
        }
        let mut at = own.clone();
        for _ in 0..PASSES {
            for step in STEPS {
                let before = at.clone();
                for (k, place) in at.iter_mut().enumerate() {
                    let middle = before[(k + count - 1) % count].midpoint(before[(k + 1) % count]);
                    *place = before[k] + step * (middle - before[k]);
                }
            }
        }
        for (&k, place) in border.iter().zip(at) {
            points[k as usize] = place;
        }
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flat disk of a hub and a rim of these radii.
    fn disk(radius: impl Fn(u32) -> f64) -> Manifold {
        let count = 60_u32;
        let rim = (0..count).map(|k| radius(k) * DVec3::new((f64::from(k) * 0.104_719_755).cos(), (f64::from(k) * 0.104_719_755).sin(), 0.0));
        let points: Vec<DVec3> = rim.chain([DVec3::ZERO]).collect();
        let source = (0..=count).map(Some).collect();
        let triangles = (0..count).map(|k| [k, (k + 1) % count, count]).collect();
        Manifold { points, source, triangles, loops: vec![(0..count).collect()] }
    }

    #[test]
    fn a_clean_border_stays() {
        let mesh = disk(|_| 10.0);
        for (a, b) in smoothed(&mesh).iter().zip(&mesh.points) {
            assert!(a.distance(*b) < 1e-2, "{}", a.distance(*b));
        }
    }

    #[test]
    fn a_zigzag_goes_and_the_circle_stays() {
        let mesh = disk(|k| if k % 2 == 0 { 10.3 } else { 9.7 });
        for point in &smoothed(&mesh)[..60] {
            assert!((point.length() - 10.0).abs() < 0.1, "{}", point.length());
        }
    }
}
