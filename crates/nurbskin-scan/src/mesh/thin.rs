//! Fewer points, evenly spread, and on the surface that all of them describe.

use glam::DVec3;
use nurbskin_geometry::Result;
use nurbskin_geometry::numeric::bucket_sort::sort_by_key;
use nurbskin_geometry::numeric::parallel::each;
use nurbskin_geometry::numeric::statistics::{SIGMA_PER_MAD, median_in_place};
use nurbskin_geometry::progress::Progress;
use rayon::prelude::*;
use std::collections::HashMap;
use std::hash::{BuildHasherDefault, Hasher};
use std::ops::Range;

/// Area per kept point in squares of the radius, as measured on a plane.
const AREA_PER_POINT: f64 = 1.53;
/// Offsets from the surface up to this part of the radius are one sheet, ...
const SHEET: f64 = 0.4;
/// ... or up to so many standard deviations of the noise: those of two points differ by more once in 200 times.
const NOISE: f64 = 4.0;
/// The fit of [`smooth`] reaches this many radii.
const REACH: f64 = 1.5;
/// More points than this are not used for one fit.
const ENOUGH: usize = 120;
/// Kept points that one thread smooths in a row.
const CHUNK: usize = 256;

/// The radius with which [`thin`] keeps about `count` of `points` points that stand for squares of side `spacing`; never
/// less than the spacing.
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

/// A Poisson-disk subset: indices, ascending, of points of which no two are closer than `radius`, while each other point
/// is closer than that to a kept one.
///
/// With `normals` (one per point, either side) this holds for each sheet by itself: two points whose chord leaves both
/// tangent planes to the same side by more than 0.4 of the radius, and by more than four standard deviations of the
/// `noise`, do not exclude each other, so that both walls of a thin pot keep their points.
///
/// The same points for any order of them; of repeated ones one is kept. Points that are not finite are never kept, and
/// none are for a radius that is not positive. O(n log n), 0.25 us per point; 80 bytes per point.
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
            // The latest ones are the likeliest.
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

/// How far apart points of one sheet may be across it.
fn sheet(radius: f64, noise: f64) -> f64 {
    (SHEET * radius).max(NOISE * noise)
}

/// How far a chord leaves the surface that touches both its ends: half the sum of the heights above both planes.
fn offset(d: DVec3, n: DVec3, m: DVec3) -> f64 {
    let m = if n.dot(m) < 0.0 { -m } else { m };
    0.5 * (n + m).dot(d).abs()
}

/// Kept points on the surface that all points nearby describe.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Smoothed {
    /// The kept points, moved along their normals.
    pub points: Vec<DVec3>,
    /// Unit normals of the surface there, on the side of the given ones.
    pub normals: Vec<DVec3>,
}

/// Moves each kept point along its normal onto a quadric fitted to the points of its sheet within 1.5 `radius`, so that
/// noise does not roughen a mesh between them; Tukey's weights let outliers and edges be. A point stays where it is if
/// there are too few points around it, or if they are no quadric: at sharp edges, in corners. Points of its sheet are told
/// as by [`thin`], with the same `noise`.
///
/// `normals` has one unit normal per point. The same bytes for any order of the points but for that of `kept`.
/// About 20 us per kept point and core.
///
/// Source: F. Cazals, M. Pouget, *Estimating differential quantities using polynomial fitting of osculating jets*,
/// Computer Aided Geometric Design 22(2), 2005 (DOI 10.1016/j.cagd.2004.09.004).
///
/// # Errors
/// [`nurbskin_geometry::Error::Invalid`] if there is not one normal per point or a kept index is none; [`nurbskin_geometry::Error::Cancelled`].
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
    let cells = Cells::new(points, REACH * radius);
    let sheet = sheet(radius, noise);
    progress.check()?;
    // Normals in the order of the cells, for the cache.
    let in_cells = each(cells.items.len(), |k| normals[cells.items[k].1 as usize]);
    let of_chunk = |chunk: &[u32]| -> Result<Vec<(DVec3, DVec3)>> {
        progress.check()?;
        let mut fit = Fit::default();
        let moved = chunk
            .iter()
            .map(|&k| k as usize)
            .map(|k| fit.moved((points[k], normals[k]), &in_cells, &cells, radius, sheet));
        Ok(moved.collect())
    };
    let parts: Vec<_> = kept
        .par_chunks(CHUNK)
        .map(of_chunk)
        .collect::<Result<_>>()?;
    let (points, normals) = parts.into_iter().flatten().unzip();
    Ok(Smoothed { points, normals })
}

/// A quadric over a tangent plane, in units of the radius.
#[derive(Debug, Default)]
struct Fit {
    /// x, y, height and weight by distance.
    samples: Vec<[f64; 4]>,
    residuals: Vec<f64>,
}

impl Fit {
    /// A point and its normal, by the points in cells around it, whose `normals` are in the order of the cells.
    fn moved(
        &mut self,
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
        self.samples.clear();
        for cell in cells
            .of(origin)
            .into_iter()
            .flat_map(|cell| cells.around(cell))
        {
            let range = cells.range(cell);
            for (&(point, _), &other) in cells.items[range.clone()].iter().zip(&normals[range]) {
                let d = point - origin;
                let far = d.length_squared() / (REACH * radius).powi(2);
                if far < 1.0 && offset(d, normal, other) <= sheet {
                    let at = |axis: DVec3| d.dot(axis) / radius;
                    let weight = (1.0 - far).powi(2);
                    self.samples
                        .push([at(across), at(along), at(normal), weight]);
                }
            }
        }
        let step = self.samples.len().div_ceil(ENOUGH).max(1);
        let mut count = 0;
        self.samples.retain(|_| (count % step == 0, count += 1).0);
        let Some(c) = self.quadric() else {
            return unchanged;
        };
        if c[0].abs() * radius > sheet {
            return unchanged;
        }
        let turned = (normal - across * c[1] - along * c[2]).normalize_or(normal);
        (origin + normal * (c[0] * radius), turned)
    }

    /// Coefficients of 1, x, y, x^2, xy, y^2; none if the samples are no such surface.
    fn quadric(&mut self) -> Option<[f64; 6]> {
        let mut coefficients = [0.0; 6];
        let mut scale = f64::INFINITY;
        for _ in 0..3 {
            if self.samples.len() < 9 {
                return None;
            }
            let (mut a, mut right) = ([[0.0; 6]; 6], [0.0; 6]);
            for sample in &self.samples {
                let basis = basis(sample);
                let off = residual(sample, &coefficients) / scale;
                let weight = sample[3] * (1.0 - off * off).max(0.0).powi(2);
                for i in 0..6 {
                    right[i] += weight * basis[i] * sample[2];
                    for j in 0..=i {
                        a[i][j] += weight * basis[i] * basis[j];
                    }
                }
            }
            coefficients = solved(a, right)?;
            self.residuals.clear();
            let residuals = self
                .samples
                .iter()
                .map(|s| residual(s, &coefficients).abs());
            self.residuals.extend(residuals);
            // Tukey's biweight keeps 95 % efficiency at 4.685 sigma.
            let sigma = SIGMA_PER_MAD * median_in_place(&mut self.residuals);
            if sigma > 0.25 {
                return None;
            }
            scale = 4.685 * sigma.max(1e-6);
        }
        Some(coefficients)
    }
}

fn basis(&[x, y, ..]: &[f64; 4]) -> [f64; 6] {
    [1.0, x, y, x * x, x * y, y * y]
}

fn residual(&[x, y, height, _]: &[f64; 4], &[a, b, c, d, e, f]: &[f64; 6]) -> f64 {
    height - (a + x * (b + x * d + y * e) + y * (c + y * f))
}

/// Solves a positive definite system given by its lower half, by Cholesky's factors; none if it is nearly singular.
fn solved(mut a: [[f64; 6]; 6], mut x: [f64; 6]) -> Option<[f64; 6]> {
    let least = 1e-6 * a[0][0];
    for i in 0..6 {
        for j in 0..=i {
            let mut sum = a[i][j];
            for (x, y) in a[i].iter().zip(&a[j]).take(j) {
                sum -= x * y;
            }
            if i == j {
                if sum.is_nan() || sum <= least {
                    return None;
                }
                a[i][i] = sum.sqrt();
            } else {
                a[i][j] = sum / a[j][j];
            }
        }
    }
    for i in 0..6 {
        for k in 0..i {
            x[i] -= a[i][k] * x[k];
        }
        x[i] /= a[i][i];
    }
    for i in (0..6).rev() {
        for k in i + 1..6 {
            x[i] -= a[k][i] * x[k];
        }
        x[i] /= a[i][i];
    }
    Some(x)
}

/// Bits per coordinate of a cell.
const BITS: u32 = 21;

/// Points in cubes of at least a certain size, sorted within each by coordinates.
#[derive(Debug)]
struct Cells {
    low: DVec3,
    size: f64,
    /// Which cube each cell is, ascending.
    keys: Vec<u64>,
    by_key: HashMap<u64, u32, BuildHasherDefault<Mixer>>,
    starts: Vec<usize>,
    /// Points, cell by cell, with their numbers.
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
        // Larger cubes only take longer.
        let least = (high - low).max_element() / f64::from((1_u32 << BITS) - 3);
        let mut this = Self {
            low,
            size: size.max(least),
            keys: Vec::new(),
            by_key: HashMap::default(),
            starts: Vec::new(),
            items: Vec::new(),
        };
        // 1. Points by cube, those that are not finite left out.
        let numbered = (0..u32::MAX).zip(points);
        let numbers = numbered.filter(|(_, p)| p.is_finite()).map(|(k, _)| k);
        let numbers: Vec<u32> = numbers.collect();
        let keyed = each(numbers.len(), |k| {
            (this.key(points[numbers[k] as usize]), numbers[k])
        });
        let keyed = sort_by_key(keyed, |key| key.0, Ord::cmp);
        this.items = each(keyed.len(), |k| (points[keyed[k].1 as usize], keyed[k].1));
        // 2. Each cube in the order of coordinates.
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
        slices.into_par_iter().with_min_len(64).for_each(sort);
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
        // One more, so that the neighbours below are none of another row.
        let [x, y, z] = cell.to_array().map(|x| x as u64 + 1);
        x | y << BITS | z << (2 * BITS)
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
            let step = (k % 3) | ((k / 3 % 3) << BITS) | ((k / 9) << (2 * BITS));
            let one = 1 | (1 << BITS) | (1 << (2 * BITS));
            let other = key.wrapping_add(step).wrapping_sub(one);
            self.by_key.get(&other).map(|&cell| cell as usize)
        })
    }

    /// Where the points of a cell are among the items.
    fn range(&self, cell: usize) -> Range<usize> {
        self.starts[cell]..self.starts[cell + 1]
    }
}

/// Mixes the bits of one number; the keys of cells are no threat.
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
