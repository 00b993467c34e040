//! Test for points that fill a volume, which have no surface.
//!
//! ```text
//! thickness(point) = min over neighbourhoods of growing size of  λ₁ / λ₂,   variances λ₁ ≤ λ₂ ≤ λ₃
//! fills a volume:    median thickness > 0.3
//! ```
//!
//! Of a surface, however noisy, the ratio falls with the size of the neighbourhood; of a volume it does not.
//!
//! Source: principal component analysis of neighbourhoods (H. Hoppe et al., 1992); the test is ours.

use glam::DVec3;
use nurbskin_geometry::numeric::parallel::gather;
use nurbskin_geometry::numeric::statistics::median_in_place;
use nurbskin_geometry::spatial::neighbours::Neighbours;
use nurbskin_scan::clean::CleanScan;
use nurbskin_scan::mesh::subset::subset;
use nurbskin_scan::normals::plane_axes;

/// Noise, in spacings, up to which the points of a cloud are taken for a surface without a test.
/// Trial: not recorded. Scanners stay below 0.3; points anywhere in a volume have 0.7.
const MIN_NOISE_SPACINGS: f64 = 0.5;
/// Points, at most, on which the test is made. Count.
/// Guard: bounds the time; the ratio of variances does not depend on the density.
const MAX_TESTED_POINTS: usize = 20_000;
/// Points, about, whose neighbourhoods are tested. Count.
/// Guard: the standard error of a share of 100 is 5 %, and the two cases lie far apart.
const TESTED_NEIGHBOURHOODS: usize = 100;
/// Points of the smallest neighbourhood. Count.
/// Guard: with fewer the ratio of variances of a sheet scatters.
const FIRST_NEIGHBOURHOOD: usize = 24;
/// Ratio of the numbers of points of consecutive neighbourhoods. Dimensionless.
/// Derived: it doubles their radius on a surface.
const NEIGHBOURHOOD_GROWTH: usize = 4;
/// Number of points of the cloud per point of the largest neighbourhood. Dimensionless.
/// Trial: not recorded. An eighth of a curved surface is still wider than thick.
const LARGEST_NEIGHBOURHOOD_DIVISOR: usize = 8;
/// Ratio of the least to the middle variance of a neighbourhood above which it is no piece of a surface. Dimensionless.
/// Trial: on simulated cubes, sheets, bowls and spheres. Of points anywhere in a ball it is 0.8, and 0.3 at the border
/// of a volume; of a noisy sheet it falls with the size of the neighbourhood.
const MIN_VOLUME_THICKNESS: f64 = 0.3;

/// Whether the points of a cloud fill a volume: at all sizes, half of the neighbourhoods are about as thick as wide.
pub(super) fn fills_a_volume(scan: &CleanScan) -> bool {
    if !scan.triangles.is_empty() || scan.noise <= MIN_NOISE_SPACINGS * scan.spacing {
        return false;
    }
    let points: Vec<DVec3> = match scan.points.len() > MAX_TESTED_POINTS {
        true => gather(
            &scan.points,
            &subset(&scan.points, MAX_TESTED_POINTS, |_| true),
        ),
        false => scan.points.clone(),
    };
    let tree = Neighbours::new(&points);
    let largest = (points.len() / LARGEST_NEIGHBOURHOOD_DIVISOR).max(FIRST_NEIGHBOURHOOD);
    let step = points.len().div_ceil(TESTED_NEIGHBOURHOODS).max(1);
    let thickness = |&at: &DVec3| {
        let near: Vec<DVec3> = tree
            .nearest(at, largest)
            .into_iter()
            .map(|k| points[k as usize])
            .collect();
        let sizes = std::iter::successors(Some(FIRST_NEIGHBOURHOOD), |size| {
            Some(NEIGHBOURHOOD_GROWTH * size)
        });
        let sizes = sizes.take_while(|&size| size < near.len());
        let sizes = sizes.chain([near.len()]);
        let ratio = |size: usize| {
            let ([across, along, _], _) = plane_axes(near[..size].iter().copied());
            if along > 0.0 { across / along } else { 0.0 }
        };
        sizes.map(ratio).fold(f64::INFINITY, f64::min)
    };
    let mut all: Vec<f64> = points.iter().step_by(step).map(thickness).collect();
    let median = median_in_place(&mut all);
    median.is_finite() && median > MIN_VOLUME_THICKNESS
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_geometry::progress::Silent;
    use nurbskin_scan::{CleanOptions, Scan, clean};

    /// Numbers from 0 to 1 that look like chance.
    fn uniform(k: usize) -> f64 {
        let mut x = (k as u64).wrapping_add(0x9e37_79b9_7f4a_7c15);
        x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((x ^ (x >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn asked(count: usize, seed: usize, place: impl Fn([f64; 3]) -> DVec3) -> bool {
        let at = |k: usize| {
            let k = 3 * (k + 1_000_000 * seed);
            place([uniform(k), uniform(k + 1), uniform(k + 2)])
        };
        let scan = Scan {
            points: (0..count).map(at).collect(),
            ..Scan::default()
        };
        let cleaned = clean(&scan, &CleanOptions::default(), &Silent).unwrap();
        fills_a_volume(&cleaned)
    }

    #[test]
    fn volumes_are_told_from_noisy_surfaces() {
        for seed in 0..5 {
            for count in [300, 3000, 30_000] {
                let cube = asked(count, seed, DVec3::from);
                let sheet = asked(count, seed, |[u, v, w]| DVec3::new(u, v, 0.1 * w));
                let bowl = asked(count, seed, |[u, v, w]| {
                    let (x, y) = (2.0 * u - 1.0, 2.0 * v - 1.0);
                    DVec3::new(x, y, 0.5 * (x * x + y * y) + 0.1 * w)
                });
                let sphere = asked(count, seed, |[u, v, w]| {
                    let (z, a) = (2.0 * u - 1.0, std::f64::consts::TAU * v);
                    let r = (1.0 - z * z).sqrt();
                    DVec3::new(r * a.cos(), r * a.sin(), z) * (0.95 + 0.1 * w)
                });
                assert_eq!(
                    [cube, sheet, bowl, sphere],
                    [true, false, false, false],
                    "{count} points, seed {seed}"
                );
            }
        }
    }
}
