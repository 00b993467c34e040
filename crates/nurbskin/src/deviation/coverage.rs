//! The distance of the surface to the scan, which reveals bulges and areas without data.
//!
//! Samples the faces in cells of equal parameter steps, about half a spacing wide, and finds the nearest scan point or
//! triangle of each sample. The opposite direction, from the scan to the surface, is in [`measure`](super::measure).

use glam::{DVec2, DVec3};
use nurbskin_cad::Region;
use nurbskin_geometry::NurbsSurface;
use nurbskin_geometry::spatial::nearest::Nearest;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Limits of the total number of cells.
const CELLS: [f64; 2] = [4096.0, 100_000.0];
/// Least number of cells per face.
const LEAST: f64 = 64.0;
/// Distance in spacings beyond which a sample has no data.
pub const UNSUPPORTED_SPACINGS: f64 = 3.0;

/// Distances of the surface to the scan; lengths in the unit of the points. `surface_to_scan` of the JSON contract.
///
/// `max`, `mean` and `p95` cover the whole area, including the area without data, so that bulges show. Against points
/// without triangles even a perfect surface has a distance of about half a spacing; against triangles it has not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Coverage {
    /// Largest distance of a sample of the surface.
    pub max: f64,
    /// Mean distance over the area.
    pub mean: f64,
    /// 95th percentile of the distance over the area.
    pub p95: f64,
    /// Share (0..=1) of the area that is farther than three spacings from the scan.
    pub unsupported_area: f64,
}

/// The distance of the surface to the points of a scan, or to its triangles if there are any. Samples the surface at
/// the centres of cells about half a `spacing` wide (with a total of 4096 to 100 000 cells), weighted by area.
///
/// All zero if there are no points. O((points + cells) log points).
///
/// ```
/// use nurbskin::{ControlNet, DVec3, KnotVector, NurbsSurface};
/// use nurbskin::deviation::coverage::coverage;
/// let net = ControlNet::from_fn(2, 2, |i, j| DVec3::new(10.0 * i as f64, 10.0 * j as f64, 0.0))?;
/// let knots = KnotVector::uniform(1, 2)?;
/// let plane = NurbsSurface::new(knots.clone(), knots, net, None)?;
/// // The scan covers the left half only.
/// let scan: Vec<DVec3> = (0..=50 * 101).map(|k| DVec3::new((k % 51) as f64 / 10.0, (k / 51) as f64 / 10.0, 0.0)).collect();
/// let found = coverage(&plane, &scan, None, 0.1);
/// assert!((found.unsupported_area - 0.47).abs() < 0.01 && (found.max - 5.0).abs() < 0.1);
/// # Ok::<(), nurbskin::Error>(())
/// ```
#[must_use]
pub fn coverage(
    surface: &NurbsSurface,
    points: &[DVec3],
    triangles: Option<&[[u32; 3]]>,
    spacing: f64,
) -> Coverage {
    coverage_of_all(&[Covered {
        faces: vec![CoveredFace {
            surface,
            region: None,
        }],
        points,
        triangles,
        spacing,
    }])
}

/// A surface, or the trimmed part of it.
#[derive(Clone, Copy, Debug)]
pub struct CoveredFace<'a> {
    /// The surface.
    pub surface: &'a NurbsSurface,
    /// The trimmed part, if the surface is trimmed.
    pub region: Option<&'a Region>,
}

/// Faces and their part of the scan.
#[derive(Clone, Debug)]
pub struct Covered<'a> {
    /// The faces.
    pub faces: Vec<CoveredFace<'a>>,
    /// The points.
    pub points: &'a [DVec3],
    /// Triangles between the points, if any.
    pub triangles: Option<&'a [[u32; 3]]>,
    /// Typical distance of neighbouring points.
    pub spacing: f64,
}

/// [`coverage`] of several surfaces together, each against its own points.
#[must_use]
pub fn coverage_of_all(all: &[Covered]) -> Coverage {
    let samples = all.iter().flat_map(|covered| {
        let nearest = Nearest::new(covered.points, covered.triangles);
        samples(covered, &nearest)
    });
    summary(samples.collect())
}

/// The same with given search trees of the scans.
pub(crate) fn coverage_near(all: &[(Covered, &Nearest)]) -> Coverage {
    let samples = all
        .iter()
        .flat_map(|(covered, nearest)| samples(covered, nearest));
    summary(samples.collect())
}

/// A sample of a surface.
#[derive(Clone, Copy, Debug, Default)]
struct Sample {
    distance: f64,
    area: f64,
    /// Whether the sample has data.
    supported: bool,
}

fn samples(covered: &Covered, nearest: &Nearest) -> Vec<Sample> {
    let faces = covered.faces.iter();
    // The faces share the number of cells of a single face.
    let share = 1.0 / covered.faces.len().max(1) as f64;
    faces
        .flat_map(|face| samples_of(face, share, nearest, covered.spacing))
        .collect()
}

/// The centres of the cells of a face, in the order of the cells.
fn samples_of(face: &CoveredFace, share: f64, nearest: &Nearest, spacing: f64) -> Vec<Sample> {
    let surface = face.surface;
    let [count_u, count_v] = cells(surface, spacing, share);
    let [(a, b), (c, d)] = surface.domain();
    let (du, dv) = ((b - a) / count_u as f64, (d - c) / count_v as f64);
    let row = |j: usize| -> Vec<Sample> {
        let mut near = None;
        (0..count_u)
            .map(|i| {
                let place = DVec2::new(a + (i as f64 + 0.5) * du, c + (j as f64 + 0.5) * dv);
                if face.region.is_some_and(|region| !region.contains(place)) {
                    return Sample::default();
                }
                let at = surface.derivatives(place.x, place.y);
                near = nearest.closest(at.point, near);
                let distance = near.map_or(f64::INFINITY, |place| place.distance);
                Sample {
                    distance,
                    area: at.du.cross(at.dv).length() * du * dv,
                    supported: distance <= UNSUPPORTED_SPACINGS * spacing,
                }
            })
            .collect()
    };
    let rows: Vec<Vec<Sample>> = (0..count_v).into_par_iter().map(row).collect();
    rows.into_iter().flatten().collect()
}

fn summary(mut samples: Vec<Sample>) -> Coverage {
    samples.retain(|s| s.distance.is_finite() && s.area > 0.0);
    samples.sort_unstable_by(|a, b| {
        let by_distance = a.distance.total_cmp(&b.distance);
        by_distance.then(a.area.total_cmp(&b.area))
    });
    let total: f64 = samples.iter().map(|s| s.area).sum();
    let Some(max) = samples.last().map(|s| s.distance) else {
        return Coverage::default();
    };
    let mut below = 0.0;
    let p95 = samples
        .iter()
        .find(|s| {
            below += s.area;
            below >= 0.95 * total
        })
        .map_or(max, |s| s.distance);
    let bare = samples.iter().filter(|s| !s.supported);
    let unsupported = bare.fold(0.0, |sum, s| sum + s.area);
    Coverage {
        max,
        mean: samples.iter().map(|s| s.distance * s.area).sum::<f64>() / total,
        p95,
        // The empty sum is -0.0, which would be displayed with its sign.
        unsupported_area: unsupported / total + 0.0,
    }
}

/// Numbers of cells along u and v: cells about half a spacing wide, within the limits, in proportion to the lengths of
/// the surface; `share` scales the limits.
fn cells(surface: &NurbsSurface, spacing: f64, share: f64) -> [usize; 2] {
    let length = surface.iso_lengths();
    let floor = 1e-6 * (length[0] + length[1]) + f64::MIN_POSITIVE;
    let length = length.map(|l| l.max(floor));
    let step = (0.5 * spacing).max(f64::MIN_POSITIVE);
    let wanted = (length[0] / step * (length[1] / step))
        .clamp((share * CELLS[0]).max(LEAST), (share * CELLS[1]).max(LEAST));
    let ratio = (length[0] / length[1]).sqrt();
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "within 8 and 20 000"
    )]
    let count = |x: f64| x.round().clamp(8.0, 20_000.0) as usize;
    [count(wanted.sqrt() * ratio), count(wanted.sqrt() / ratio)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use nurbskin_geometry::{ControlNet, KnotVector};

    fn plane(height: f64) -> NurbsSurface {
        let net = ControlNet::from_fn(4, 4, |i, j| DVec3::new(i as f64, j as f64, height)).unwrap();
        let knots = KnotVector::uniform(3, 4).unwrap();
        NurbsSurface::new(knots.clone(), knots, net, None).unwrap()
    }

    #[test]
    fn a_translated_copy_is_as_far_as_the_translation() {
        let points: Vec<DVec3> = (0..16)
            .map(|k| DVec3::new(f64::from(k % 4), f64::from(k / 4), 0.0))
            .collect();
        let mut triangles = Vec::new();
        for j in 0..3 {
            for i in 0..3 {
                let k = 4 * j + i;
                triangles.extend([[k, k + 1, k + 5], [k, k + 5, k + 4]]);
            }
        }
        let found = coverage(&plane(0.25), &points, Some(&triangles), 0.05);
        for distance in [found.max, found.mean, found.p95] {
            assert!((distance - 0.25).abs() < 1e-12);
        }
        assert!((found.unsupported_area - 1.0).abs() < 1e-12);
    }

    #[test]
    fn full_support_is_zero_without_a_sign() {
        let points: Vec<DVec3> = (0..16)
            .map(|k| DVec3::new(f64::from(k % 4), f64::from(k / 4), 0.0))
            .collect();
        let found = coverage(&plane(0.0), &points, None, 1.0);
        assert_eq!(found.unsupported_area.to_bits(), 0.0_f64.to_bits());
    }

    #[test]
    fn no_points_and_extreme_spacings_end() {
        assert_eq!(coverage(&plane(0.0), &[], None, 1.0), Coverage::default());
        for spacing in [0.0, 1e-300, 1e300] {
            let found = coverage(&plane(0.0), &[DVec3::ZERO], None, spacing);
            assert!(found.max > 4.0 && found.max < 4.25);
        }
    }
}
