//! Poisson-disk thinning of a cloud, and smoothing of the points that remain.
//!
//! Thinning visits the points cell by cell and keeps each that has no kept point of its sheet within the radius r. Two
//! points lie on one sheet if the offset ½ |(n + m) · d| of their chord d, the mean of its heights above both tangent
//! planes (zero on a circular arc), is at most max(0.4 r, 4 σ). Smoothing fits a quadric z = q(x, y) to the points of
//! the sheet within 1.5 r, by iteratively reweighted least squares with Tukey's biweight, and moves the point along
//! its normal onto it.
//!
//! Sources: F. Cazals, M. Pouget, *Estimating differential quantities using polynomial fitting of osculating jets*,
//! Computer Aided Geometric Design 22(2), 2005 (DOI 10.1016/j.cagd.2004.09.004); P. W. Holland, R. E. Welsch, *Robust
//! regression using iteratively reweighted least-squares*, 1977. The test for one sheet is ours.

use super::quadric::{Quadric, QuadricFit};
use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::bucket_sort::sort_by_key;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::progress::Progress;
use rayon::prelude::*;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::ops::Range;

/// Area per kept point, in squares of the radius. Trial: measured on a plane. An earlier value, 1.15, kept too few
/// points for a given count.
const AREA_PER_POINT: f64 = 1.53;
/// Offset between two points across their surface, in radii, up to which they lie on one sheet. Trial: not recorded.
/// Larger offsets thin both walls of a thin part as one; smaller ones keep too many points at edges.
const SHEET_OFFSET: f64 = 0.4;
/// The same offset in standard deviations of the noise, where that is larger. Derived: the difference of two heights
/// has the deviation √2 sigma, and exceeds 4 sigma once in 200 times.
const SHEET_DEVIATIONS: f64 = 4.0;
/// Radius of the neighbourhood to which [`smooth`] fits a quadric, in radii of thinning. Trial: not recorded. Smaller
/// neighbourhoods average less noise; larger ones see more than a quadric.
const SMOOTHING_RADII: f64 = 1.5;
/// Most points of one fit; more are thinned by a stride. Trial: 300 before, and reduced to 120 when the tests of
/// thinning were written. Fewer average less noise, more cost time.
const MAX_FIT_SAMPLES: usize = 120;
/// Fewest cells that one task sorts. Guard: large against the overhead of a task.
const CELLS_PER_TASK: usize = 64;
/// Kept points that one task smooths. Guard: some 5 ms of work, large against the overhead of a task and short between
/// tests for cancellation.
const SMOOTHING_CHUNK: usize = 256;

/// The radius with which [`thin`] keeps about `count` of `points` points, each of which represents a square of side
/// `spacing`; never less than the spacing.
///
/// ```
/// let radius = nurbskin_scan::mesh::thin::radius_for(10_000, 1_000_000, 0.1);
/// assert!(radius > 0.7 && radius < 0.9);
/// ```
#[must_use]
pub fn radius_for(count: usize, points: usize, spacing: f64) -> f64 {
    let per_point = points as f64 / count.max(1) as f64;
    spacing * (per_point / AREA_PER_POINT).sqrt().max(1.0)
}

/// A Poisson-disk subset: the ascending indices of points of which no two are closer than `radius`, while every other
/// point is closer than that to a kept one.
///
/// With `normals` (one per point, of either side) this holds for each sheet separately: two points do not exclude each
/// other if their chord leaves both tangent planes to the same side by more than 0.4 of the radius and by more than
/// four standard deviations of the `noise`. Both walls of a thin pot then keep their points.
///
/// The result does not depend on the order of the points; of repeated points one is kept. Points that are not finite
/// are never kept, and none are for a radius that is not positive. O(n log n), 0.25 us per point; 80 bytes per point.
///
/// ```
/// use nurbskin_geometry::DVec3;
/// let line: Vec<DVec3> = (0..10).map(|k| DVec3::X * f64::from(k)).collect();
/// assert_eq!(nurbskin_scan::mesh::thin::thin(&line, None, 2.5, 0.0), [0, 3, 6, 9]);
/// ```
#[must_use]
pub fn thin(points: &[DVec3], normals: Option<&[DVec3]>, radius: f64, noise: f64) -> Vec<u32> {
    if !(radius > 0.0 && radius.is_finite()) {
        return Vec::new();
    }
    let sheet = sheet(radius, noise);
    let cells = Cells::new(points, radius);
    // Normals in the order of the cells, for the cache.
    let normals = normals.filter(|n| n.len() == points.len());
    let normal = |k: u32| normals.map_or(DVec3::ZERO, |n| n[k as usize]);
    let normals = each(cells.items.len(), |k| normal(cells.items[k].1));
    let mut kept: Vec<Vec<(DVec3, DVec3)>> = vec![Vec::new(); cells.keys.len()];
    let mut indices = Vec::new();
    let mut near = Vec::new();
    for cell in 0..cells.keys.len() {
        near.clear();
        for other in cells.around(cell) {
            near.extend_from_slice(&kept[other]);
        }
        let before = near.len();
        let range = cells.range(cell);
        for (&(p, k), &n) in cells.items[range.clone()].iter().zip(&normals[range]) {
            let covers = |&(q, m): &(DVec3, DVec3)| {
                let d = q - p;
                d.length_squared() < radius * radius && offset(d, n, m) <= sheet
            };
            // The latest ones are the most likely to cover the point.
            if !near.iter().rev().any(covers) {
                near.push((p, n));
                indices.push(k);
            }
        }
        kept[cell] = near.split_off(before);
    }
    indices.sort_unstable();
    indices
}

/// Largest offset between points of one sheet across it.
fn sheet(radius: f64, noise: f64) -> f64 {
    (SHEET_OFFSET * radius).max(SHEET_DEVIATIONS * noise)
}

/// Offset of a chord from the surface that touches both its ends: half the sum of its heights above both tangent
/// planes.
fn offset(d: DVec3, n: DVec3, m: DVec3) -> f64 {
    let m = if n.dot(m) < 0.0 { -m } else { m };
    0.5 * (n + m).dot(d).abs()
}

/// Kept points, moved onto the surface through all points nearby.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Smoothed {
    /// The kept points, moved along their normals.
    pub points: Vec<DVec3>,
    /// Unit normals of the surface there, on the side of the given ones.
    pub normals: Vec<DVec3>,
}

/// Moves each kept point along its normal onto a quadric fitted to the points of its sheet within 1.5 `radius`, so that
/// noise does not roughen a mesh between the kept points; Tukey's weights reject outliers and edges. A point remains
/// unchanged if there are too few points around it, or if they are no quadric, as at sharp edges and corners. The
/// sheets are those of [`thin`] with the same `noise`.
///
/// `normals` has one unit normal per point. The result does not depend on the order of the points, and follows that of
/// `kept`. About 20 us per kept point and core.
///
/// Source: F. Cazals, M. Pouget, *Estimating differential quantities using polynomial fitting of osculating jets*,
/// Computer Aided Geometric Design 22(2), 2005 (DOI 10.1016/j.cagd.2004.09.004).
///
/// [`nurbskin_geometry::Error::Invalid`] if there is not one normal per point or a kept index does not exist;
/// [`nurbskin_geometry::Error::Cancelled`].
pub fn smooth(
    points: &[DVec3],
    normals: &[DVec3],
    kept: &[u32],
    radius: f64,
    noise: f64,
    progress: &dyn Progress,
) -> Result<Smoothed> {
    if normals.len() != points.len() || kept.iter().any(|&k| k as usize >= points.len()) {
        return Err(nurbskin_geometry::Error::Invalid(format!(
            "{} points need as many normals, not {}, and kept indices below that",
            points.len(),
            normals.len()
        )));
    }
    let cells = Cells::new(points, SMOOTHING_RADII * radius);
    let sheet = sheet(radius, noise);
    progress.check()?;
    // Normals in the order of the cells, for the cache.
    let in_cells = each(cells.items.len(), |k| normals[cells.items[k].1 as usize]);
    let of_chunk = |chunk: &[u32]| -> Result<Vec<(DVec3, DVec3)>> {
        progress.check()?;
        let mut fit = QuadricFit::default();
        let moved = chunk.iter().map(|&k| k as usize).map(|k| {
            moved(
                &mut fit,
                (points[k], normals[k]),
                &in_cells,
                &cells,
                radius,
                sheet,
            )
        });
        Ok(moved.collect())
    };
    let parts: Vec<_> = kept
        .par_chunks(SMOOTHING_CHUNK)
        .map(of_chunk)
        .collect::<Result<_>>()?;
    let (points, normals) = parts.into_iter().flatten().unzip();
    Ok(Smoothed { points, normals })
}

/// The moved point and its normal, from the points in the cells around it, whose `normals` are in the order of the
/// cells.
fn moved(
    fit: &mut QuadricFit,
    (origin, normal): (DVec3, DVec3),
    normals: &[DVec3],
    cells: &Cells,
    radius: f64,
    sheet: f64,
) -> (DVec3, DVec3) {
    let unchanged = (origin, normal);
    let Some(normal) = normal.try_normalize() else {
        return unchanged;
    };
    let (across, along) = normal.any_orthonormal_pair();
    fit.samples.clear();
    for cell in cells
        .of(origin)
        .into_iter()
        .flat_map(|cell| cells.around(cell))
    {
        let range = cells.range(cell);
        for (&(point, _), &other) in cells.items[range.clone()].iter().zip(&normals[range]) {
            let d = point - origin;
            let far = d.length_squared() / (SMOOTHING_RADII * radius).powi(2);
            if far < 1.0 && offset(d, normal, other) <= sheet {
                let at = |axis: DVec3| d.dot(axis) / radius;
                let weight = (1.0 - far).powi(2);
                fit.samples
                    .push([at(across), at(along), at(normal), weight]);
            }
        }
    }
    let step = fit.samples.len().div_ceil(MAX_FIT_SAMPLES).max(1);
    let mut count = 0;
    fit.samples.retain(|_| (count % step == 0, count += 1).0);
    let Some(Quadric(c)) = fit.solve() else {
        return unchanged;
    };
    if c[0].abs() * radius > sheet {
        return unchanged;
    }
    let turned = (normal - across * c[1] - along * c[2]).normalize_or(normal);
    (origin + normal * (c[0] * radius), turned)
}

/// Bits per coordinate in the key of a cell. Derived: three coordinates fit into 64 bits.
const CELL_KEY_BITS: u32 = 21;

/// Points in cubes of at least a certain size, sorted within each by coordinates.
#[derive(Debug)]
struct Cells {
    low: DVec3,
    size: f64,
    /// Key of the cube of each cell, ascending.
    keys: Vec<u64>,
    by_key: HashMap<u64, u32, BuildHasherDefault<Mixer>>,
    starts: Vec<usize>,
    /// Points, cell by cell, with their indices.
    items: Vec<(DVec3, u32)>,
}

impl Cells {
    fn new(points: &[DVec3], size: f64) -> Self {
        let finite = |p: &&DVec3| p.is_finite();
        let (low, high) = points
            .iter()
            .filter(finite)
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), &p| {
                (low.min(p), high.max(p))
            });
        // Larger cubes only cost time.
        let least = (high - low).max_element() / f64::from((1_u32 << CELL_KEY_BITS) - 3);
        let mut this = Self {
            low,
            size: size.max(least),
            keys: Vec::new(),
            by_key: HashMap::default(),
            starts: Vec::new(),
            items: Vec::new(),
        };
        // 1. Finite points, sorted by cube.
        let numbered = (0..u32::MAX).zip(points);
        let numbers = numbered.filter(|(_, p)| p.is_finite()).map(|(k, _)| k);
        let numbers: Vec<u32> = numbers.collect();
        let keyed = each(numbers.len(), |k| {
            (this.key(points[numbers[k] as usize]), numbers[k])
        });
        let keyed = sort_by_key(keyed, |key| key.0, Ord::cmp);
        this.items = each(keyed.len(), |k| (points[keyed[k].1 as usize], keyed[k].1));
        // 2. The points of each cube, sorted by coordinates.
        let mut slices = Vec::new();
        let mut rest = &mut this.items[..];
        for cell in keyed.chunk_by(|a, b| a.0 == b.0) {
            this.starts.push(keyed.len() - rest.len());
            this.keys.push(cell[0].0);
            let (one, others) = rest.split_at_mut(cell.len());
            slices.push(one);
            rest = others;
        }
        this.starts.push(keyed.len());
        let sort = |cell: &mut [(DVec3, u32)]| {
            cell.sort_unstable_by(|(p, a), (q, b)| {
                p.x.total_cmp(&q.x)
                    .then(p.y.total_cmp(&q.y))
                    .then(p.z.total_cmp(&q.z))
                    .then(a.cmp(b))
            });
        };
        slices
            .into_par_iter()
            .with_min_len(CELLS_PER_TASK)
            .for_each(sort);
        this.by_key = this.keys.iter().copied().zip(0..).collect();
        this
    }

    fn key(&self, p: DVec3) -> u64 {
        let cell = (p - self.low) / self.size;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "from 0 to 2^21 by the size"
        )]
        // One more, so that the neighbours below do not wrap into another row.
        let [x, y, z] = cell.to_array().map(|x| x as u64 + 1);
        x | y << CELL_KEY_BITS | z << (2 * CELL_KEY_BITS)
    }

    /// The cell that holds a point.
    fn of(&self, p: DVec3) -> Option<usize> {
        let cell = p.is_finite().then(|| self.by_key.get(&self.key(p)))?;
        cell.map(|&cell| cell as usize)
    }

    /// A cell and those of its 26 neighbours that hold points, in fixed order.
    fn around(&self, cell: usize) -> impl Iterator<Item = usize> {
        let key = self.keys[cell];
        (0..27_u64).filter_map(move |k| {
            let step = (k % 3) | ((k / 3 % 3) << CELL_KEY_BITS) | ((k / 9) << (2 * CELL_KEY_BITS));
            let one = 1 | (1 << CELL_KEY_BITS) | (1 << (2 * CELL_KEY_BITS));
            let other = key.wrapping_add(step).wrapping_sub(one);
            self.by_key.get(&other).map(|&cell| cell as usize)
        })
    }

    /// The range of a cell's points among the items.
    fn range(&self, cell: usize) -> Range<usize> {
        self.starts[cell]..self.starts[cell + 1]
    }
}

/// Mixes the bits of one number; cell keys need no protection against collisions made on purpose.
#[derive(Debug, Default)]
struct Mixer(u64);

impl Hasher for Mixer {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.write_u64(u64::from(byte));
        }
    }
    fn write_u64(&mut self, number: u64) {
        let mixed = (self.0 ^ number).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        self.0 = mixed ^ (mixed >> 32);
    }
}

#[cfg(test)]
mod tests;
