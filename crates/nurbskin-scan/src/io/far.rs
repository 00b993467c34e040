//! Coordinates that are large against the extent of the scan.

use crate::Scan;
use glam::DVec3;
use nurbskin_geometry::math;
use nurbskin_geometry::point_grid::bounding_box;

/// Coordinates of an axis that are more than so many extents of the scan away from zero are moved: beyond that, second
/// moments about the file's origin lose six and more of their sixteen digits.
pub(super) const FAR: f64 = 1e3;

/// The box of the finite points.
fn extent(points: &[DVec3]) -> [DVec3; 2] {
    if points.iter().all(|p| p.is_finite()) {
        return bounding_box(points);
    }
    let finite = points.iter().copied().filter(|p| p.is_finite());
    bounding_box(&finite.collect::<Vec<_>>())
}

/// Keeps this origin, to which the points are relative, apart, and says so; nothing for zero.
pub(super) fn keep(scan: &mut Scan, origin: DVec3) {
    if origin == DVec3::ZERO {
        return;
    }
    scan.origin = origin;
    let [x, y, z] = origin.to_array();
    scan.warnings.push(format!(
        "the part is far from the origin for its size: to keep all digits, it is computed relative to ({x}, {y}, {z})"
    ));
}

fn translate(scan: &mut Scan, by: DVec3) {
    for point in &mut scan.points {
        *point += by;
    }
    for viewpoint in &mut scan.viewpoints {
        viewpoint.place += by;
    }
}

/// Gives the points, which are relative to `origin`, their place: the origin stays apart on axes where it is far, and
/// is added to the points on the others.
pub(super) fn place(scan: &mut Scan, origin: DVec3) {
    if !origin.is_finite() || origin == DVec3::ZERO {
        translate(scan, origin);
        return;
    }
    let [low, high] = extent(&scan.points);
    let size = (high - low).length();
    let apart = |origin: f64| size > 0.0 && origin.abs() > FAR * size;
    let kept = DVec3::from_array(origin.to_array().map(|c| if apart(c) { c } else { 0.0 }));
    let rest = origin - kept;
    if rest != DVec3::ZERO {
        translate(scan, rest);
    }
    keep(scan, kept);
}

/// Moves the origin of an axis whose coordinates are far, unless the reader has done so.
///
/// The new origin is a coarse binary number within 1.5 extents of every point of the axis, less than a factor of two
/// away from every coordinate, so that every difference is exact (Sterbenz's lemma) and adding the origin gives the
/// file's numbers back.
pub(super) fn shift(scan: &mut Scan) {
    if scan.origin != DVec3::ZERO {
        return;
    }
    let [low, high] = extent(&scan.points);
    let extent = (high - low).length();
    if !(extent.is_normal() && extent > 0.0) {
        return;
    }
    #[expect(clippy::cast_possible_truncation, reason = "an exponent is small")]
    let step = 2.0_f64.powi(math::log2(extent).ceil() as i32);
    let axis = |low: f64, high: f64| {
        let centre = 0.5 * low + 0.5 * high;
        if centre.abs() > FAR * extent {
            (centre / step).round() * step
        } else {
            0.0
        }
    };
    let origin = DVec3::new(
        axis(low.x, high.x),
        axis(low.y, high.y),
        axis(low.z, high.z),
    );
    if origin != DVec3::ZERO && origin.is_finite() {
        translate(scan, -origin);
        keep(scan, origin);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifting_is_exact() {
        let points: Vec<DVec3> = (0..200)
            .map(|k| {
                let k = f64::from(k);
                DVec3::new(
                    665_187.522_077 + 0.07 * k,
                    -5.648e6 + (0.3 * k).sin(),
                    0.1 * k,
                )
            })
            .collect();
        let mut scan = Scan {
            points: points.clone(),
            ..Scan::default()
        };
        shift(&mut scan);
        assert!(scan.origin.x > 6e5 && scan.origin.y < -5e6);
        assert!(scan.origin.z.to_bits() == 0);
        for (moved, given) in scan.points.iter().zip(&points) {
            assert_eq!(*moved + scan.origin, *given);
            assert!(moved.length() < 100.0);
        }
    }

    #[test]
    fn near_the_origin_and_degenerate_scans_stay() {
        for points in [
            vec![],
            vec![DVec3::splat(1e9)],
            vec![DVec3::NAN, DVec3::splat(1e12)],
            vec![DVec3::ZERO, DVec3::splat(5.0)],
            vec![DVec3::splat(f64::MAX), DVec3::splat(-f64::MAX)],
        ] {
            let mut scan = Scan {
                points,
                ..Scan::default()
            };
            shift(&mut scan);
            assert_eq!(scan.origin, DVec3::ZERO);
        }
    }

    #[test]
    fn far_origins_stay_apart_and_near_ones_are_added() {
        let near = vec![DVec3::ZERO, DVec3::new(2.0, 3.0, 0.5)];
        let mut scan = Scan {
            points: near.clone(),
            ..Scan::default()
        };
        place(&mut scan, DVec3::new(4.0e6, 10.0, 0.0));
        assert_eq!(scan.origin, DVec3::new(4.0e6, 0.0, 0.0));
        assert_eq!(scan.points[1], DVec3::new(2.0, 13.0, 0.5));
        assert_eq!(scan.warnings.len(), 1);
    }
}
