//! The noise of a scan, measured.
//!
//! Through each of many small neighbourhoods goes a polynomial; what it leaves over, corrected for the freedom it
//! had, is the noise - or shape that the polynomial could not follow. The two are told apart by raising the degree:
//! shape shrinks quickly, noise stays. Medians over the neighbourhoods make single features and outliers harmless.

use super::neighbours::Neighbours;
use super::normals::principal_axes;
use crate::PointGrid;
use glam::DVec3;

/// Neighbourhoods examined at most; their overlap makes more of little use.
const SAMPLES: usize = 3000;
/// Degree of the polynomial and size of the neighbourhood, from coarse to fine. About 2.4 points per coefficient.
const STEPS: [(usize, usize); 3] = [(2, 14), (3, 24), (4, 36)];
/// The quantile of the local variances that is compared with its expectation. Features and outliers only ever add
/// to a local variance, so that a quantile below the median is less disturbed.
const QUANTILE: f64 = 0.25;
/// Standard normal quantile of [`QUANTILE`].
const QUANTILE_NORMAL: f64 = -0.674_489_750_196_081_7;
/// Residuals beyond this many sigma are left out in a second pass; of normal noise that is 7 in a million.
const OUTLYING: f64 = 4.5;
/// Points per window of a line, and degrees of the polynomials along it.
const WINDOW: usize = 9;
const LINE_DEGREES: [usize; 3] = [3, 4, 5];

/// Standard deviation, along the surface normal, of the noise of points in any order. Zero where there are fewer
/// than 40 points, which cannot tell. `normals`, where given, keep the opposite wall of a thin part out of a
/// neighbourhood. At most a few thousand neighbourhoods are examined: O(n log n) for finding them.
///
/// On noise-free data the answer is not exactly zero but small against what the sampling leaves unresolved.
#[must_use]
pub fn noise_of_cloud(points: &[DVec3], normals: Option<&[DVec3]>) -> f64 {
    noise_with_tree(points, &Neighbours::new(points), normals)
}

/// As [`noise_of_cloud`], with a tree over the same points at hand.
#[must_use]
pub(super) fn noise_with_tree(
    points: &[DVec3],
    tree: &Neighbours,
    normals: Option<&[DVec3]>,
) -> f64 {
    settle(&cloud_variances(points, tree, normals))
        .max(0.0)
        .sqrt()
}

/// Standard deviation of the noise of ordered points, along their normals, from windows of nine consecutive points
/// on lines of constant v and of constant u; `closed` says which of u and v run around. The smaller of the two
/// counts: noise shows in both directions, coarse sampling mostly in one. Zero where neither direction has nine
/// points. O(n).
#[must_use]
pub fn noise_of_grid(grid: &PointGrid, closed: [bool; 2]) -> f64 {
    let normals = grid_normals(grid, closed);
    let [m, n] = grid.counts();
    let along = |count: usize, lines: usize, around: bool, at: &dyn Fn(usize, usize) -> usize| {
        let lines = (0..lines).map(|l| (0..count).map(|k| at(k, l)).collect::<Vec<_>>());
        line_variances(grid.points(), &normals, &lines.collect::<Vec<_>>(), around)
    };
    let in_u = along(m, n, closed[0], &|k, l| l * m + k);
    let in_v = along(n, m, closed[1], &|k, l| k * m + l);
    smallest([settle(&in_u), settle(&in_v)])
}

/// As [`noise_of_grid`] for lines of any length: each line is a list of indices into `points`. `None` where no line
/// has nine points.
#[must_use]
pub fn noise_of_lines(points: &[DVec3], normals: &[DVec3], lines: &[Vec<usize>]) -> Option<f64> {
    let variance = settle(&line_variances(points, normals, lines, false));
    (variance >= 0.0).then(|| variance.sqrt())
}

/// The square root of the smaller variance; what is not known (negative) does not count.
fn smallest(variances: [f64; 2]) -> f64 {
    let known = variances.into_iter().filter(|&v| v >= 0.0);
    let least = known.fold(f64::INFINITY, f64::min);
    if least.is_finite() { least.sqrt() } else { 0.0 }
}

/// The noise in three variances found with rising degree, of which each is the noise plus a remainder of shape:
/// * where the last step more than halves the variance it is mostly shape; the sequence is taken for geometric and
///   its limit computed (Aitken's delta-squared process);
/// * otherwise the last, whose neighbourhoods are the largest and least selected by the noise itself, unless coarse
///   sampling makes just these the worst.
///
/// Negative for no variances.
fn settle(variances: &[f64]) -> f64 {
    let &[a, b, c] = variances else {
        return -1.0;
    };
    let before = a.min(b);
    if c > 0.5 * before {
        return if c <= 1.15 * before { c } else { before };
    }
    let (first, second) = ((a - before).max(0.0), before - c);
    // Where the first step showed nothing the rest is taken for shape altogether: the limit is below zero.
    let shrink = (second / first.max(second)).min(0.9);
    (c - second * shrink / (1.0 - shrink)).max(0.0)
}

/// Residual variance of local polynomials over both tangent directions, per [`STEPS`] entry.
fn cloud_variances(points: &[DVec3], tree: &Neighbours, normals: Option<&[DVec3]>) -> Vec<f64> {
    let most = STEPS[STEPS.len() - 1].1;
    if points.len() < most + 4 {
        return Vec::new();
    }
    let stride = points.len().div_ceil(SAMPLES);
    let centres: Vec<usize> = (0..points.len()).step_by(stride).collect();
    let around = |&centre: &usize| neighbourhood(points, tree, normals, centre, most);
    let examine = |around: &Vec<DVec3>, limit: f64| {
        STEPS.map(|(degree, size)| patch(&around[..size.min(around.len())], degree, limit))
    };
    let around: Vec<Vec<DVec3>> = map(&centres, around);
    let mut found: Vec<[Patch; STEPS.len()]> = map(&around, |a| examine(a, f64::INFINITY));
    let variances = |found: &[[Patch; STEPS.len()]]| -> Vec<f64> {
        (0..STEPS.len())
            .map(|k| {
                let known = found.iter().map(|f| f[k].variance).filter(|v| *v >= 0.0);
                let mut known: Vec<f64> = known.collect();
                if known.is_empty() {
                    0.0
                } else {
                    crate::numeric::statistics::quantile_in_place(&mut known, QUANTILE)
                }
            })
            .collect()
    };
    let limit = OUTLYING * variances(&found)[STEPS.len() - 1].sqrt();
    let again: Vec<usize> = (0..found.len())
        .filter(|&k| found[k].iter().any(|patch| patch.worst > limit))
        .collect();
    let better = map(&again, |&k| examine(&around[k], limit));
    for (k, patches) in again.into_iter().zip(better) {
        found[k] = patches;
    }
    variances(&found)
}

/// f of each item, in order.
fn map<A: Sync, B: Send>(items: &[A], f: impl Fn(&A) -> B + Sync + Send) -> Vec<B> {
    #[cfg(feature = "parallel")]
    {
        use rayon::prelude::*;
        items.par_iter().map(f).collect()
    }
    #[cfg(not(feature = "parallel"))]
    items.iter().map(f).collect()
}

/// A point and its nearest neighbours in the frame of their plane, nearest first: x and y along it, z across.
fn neighbourhood(
    points: &[DVec3],
    tree: &Neighbours,
    normals: Option<&[DVec3]>,
    centre: usize,
    count: usize,
) -> Vec<DVec3> {
    let near = tree.nearest(points[centre], count);
    let around: Vec<DVec3> = near
        .iter()
        .map(|&k| k as usize)
        .filter(|&k| normals.is_none_or(|n| n[k].dot(n[centre]) >= 0.0))
        .map(|k| points[k])
        .collect();
    let (_, axes) = principal_axes(around.iter().copied());
    let [z, y, x] = axes.map(|(_, axis)| axis);
    let origin = points[centre];
    around
        .iter()
        .map(|&p| p - origin)
        .map(|d| DVec3::new(d.dot(x), d.dot(y), d.dot(z)))
        .collect()
}

/// What a polynomial leaves of a neighbourhood.
struct Patch {
    /// Residual variance, divided by its expected [`QUANTILE`]; negative if the polynomial has no freedom left.
    variance: f64,
    /// Largest absolute residual.
    worst: f64,
}

/// Fits the polynomial of total degree `degree`; points further than `limit` from it are left out once.
fn patch(around: &[DVec3], degree: usize, limit: f64) -> Patch {
    let fit = |around: &[DVec3]| {
        let size = around
            .iter()
            .fold(0.0_f64, |s, p| s.max(p.truncate().length()));
        if size <= 0.0 {
            return (Vec::new(), 0);
        }
        let mut space = Residuals::new(around.iter().map(|p| p.z).collect(), 15);
        for total in 0..=degree {
            for power in 0..=total {
                let (in_x, in_y) = (small(total - power), small(power));
                let monomial = |p: &DVec3| (p.x / size).powi(in_x) * (p.y / size).powi(in_y);
                space.remove(around.iter().map(monomial));
            }
        }
        let free = around.len() - space.rank();
        (space.values, free)
    };
    let (mut residuals, mut free) = fit(around);
    if residuals.iter().any(|r| r.abs() > limit) {
        let kept: Vec<DVec3> = around
            .iter()
            .zip(&residuals)
            .filter(|(_, r)| r.abs() <= limit)
            .map(|(&p, _)| p)
            .collect();
        (residuals, free) = fit(&kept);
    }
    let worst = residuals.iter().fold(0.0_f64, |w, r| w.max(r.abs()));
    let sum: f64 = residuals.iter().map(|r| r * r).sum();
    let variance = if free < 3 {
        -1.0
    } else {
        sum / (free as f64 * expected_quantile(free as f64))
    };
    Patch { variance, worst }
}

fn small(power: usize) -> i32 {
    i32::try_from(power).unwrap_or(0)
}

/// [`QUANTILE`] of chi-squared over its degrees of freedom (Wilson & Hilferty 1931).
fn expected_quantile(free: f64) -> f64 {
    let h = 2.0 / (9.0 * free);
    (1.0 - h + QUANTILE_NORMAL * h.sqrt()).powi(3)
}

/// Values with the least-squares fit of some columns taken out, by Gram-Schmidt twice over.
struct Residuals {
    values: Vec<f64>,
    /// Orthonormal columns, one after the other.
    columns: Vec<f64>,
}

impl Residuals {
    fn new(values: Vec<f64>, most: usize) -> Self {
        let columns = Vec::with_capacity(values.len() * most);
        Self { values, columns }
    }
    fn rank(&self) -> usize {
        self.columns.len() / self.values.len().max(1)
    }
    /// Takes one more column out, unless it depends on those before.
    fn remove(&mut self, column: impl Iterator<Item = f64>) {
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
        let (rows, rank) = (self.values.len(), self.rank());
        if rank >= rows {
            return;
        }
        self.columns.extend(column.take(rows));
        let (others, column) = self.columns.split_at_mut(rows * rank);
        let size = dot(column, column).sqrt();
        for _ in 0..2 {
            for other in others.chunks_exact(rows) {
                let part = dot(column, other);
                for (c, o) in column.iter_mut().zip(other) {
                    *c -= part * o;
                }
            }
        }
        // Less than a thousandth of a column that is of its own is a grid line's jitter, not a direction.
        let rest = dot(column, column).sqrt();
        if rest <= 1e-3 * size {
            self.columns.truncate(rows * rank);
            return;
        }
        for c in column.iter_mut() {
            *c /= rest;
        }
        let part = dot(&self.values, column);
        for (v, c) in self.values.iter_mut().zip(column.iter()) {
            *v -= part * c;
        }
    }
}

/// Residual variance of polynomials over the chord length of windows of lines, per degree; empty if no line is long
/// enough.
fn line_variances(
    points: &[DVec3],
    normals: &[DVec3],
    lines: &[Vec<usize>],
    around: bool,
) -> Vec<f64> {
    let mut windows: Vec<(usize, usize)> = Vec::new();
    for (l, line) in lines.iter().enumerate() {
        if line.len() < WINDOW {
            continue;
        }
        let starts = if around {
            line.len()
        } else {
            line.len() + 1 - WINDOW
        };
        windows.extend((0..starts).map(|start| (l, start)));
    }
    let stride = windows.len().div_ceil(SAMPLES).max(1);
    let mut found = vec![Vec::new(); LINE_DEGREES.len()];
    for &(l, start) in windows.iter().step_by(stride) {
        let line = &lines[l];
        let window: [usize; WINDOW] = std::array::from_fn(|k| line[(start + k) % line.len()]);
        let at = window.map(|k| points[k]);
        let normal = window.map(|k| normals[k]);
        for (variances, degree) in found.iter_mut().zip(LINE_DEGREES) {
            let variance = window_variance(&at, &normal, degree);
            if variance >= 0.0 {
                variances.push(variance);
            }
        }
    }
    found
        .into_iter()
        .filter(|variances| !variances.is_empty())
        .map(|mut v| crate::numeric::statistics::quantile_in_place(&mut v, QUANTILE))
        .collect()
}

/// Residual variance, along the normals, of the polynomial of this degree over the chord length through a window.
/// With the residual operator M the residual of point i along its normal is `sum_j M_ij e_j (n_i . n_j)`, which gives
/// the expectation that the sum of squares is divided by.
fn window_variance(points: &[DVec3; WINDOW], normals: &[DVec3; WINDOW], degree: usize) -> f64 {
    let mut length = [0.0; WINDOW];
    for k in 1..WINDOW {
        length[k] = length[k - 1] + points[k].distance(points[k - 1]);
    }
    let total = length[WINDOW - 1];
    if total <= 0.0 {
        return -1.0;
    }
    let mut space = Residuals::new(vec![0.0; WINDOW], WINDOW);
    for power in 0..=degree {
        let column = length.map(|s| (2.0 * s / total - 1.0).powi(small(power)));
        space.remove(column.into_iter());
    }
    let operator = |i: usize, j: usize| {
        let inside: f64 = space
            .columns
            .chunks_exact(WINDOW)
            .map(|c| c[i] * c[j])
            .sum();
        f64::from(u8::from(i == j)) - inside
    };
    let (mut sum, mut expected) = (0.0, 0.0);
    for i in 0..WINDOW {
        let mut residual = DVec3::ZERO;
        for j in 0..WINDOW {
            let m = operator(i, j);
            residual += m * (points[j] - points[0]);
            expected += (m * normals[i].dot(normals[j])).powi(2);
        }
        sum += residual.dot(normals[i]).powi(2);
    }
    let free = (WINDOW - space.rank()) as f64;
    if expected <= 1e-6 || free < 1.0 {
        return -1.0;
    }
    sum / (expected * expected_quantile(free))
}

/// Unit normals of ordered points by central differences, one-sided at open ends; zero where a pole has none.
fn grid_normals(grid: &PointGrid, closed: [bool; 2]) -> Vec<DVec3> {
    let [m, n] = grid.counts();
    let step = |k: usize, count: usize, around: bool| {
        if around {
            ((k + count - 1) % count, (k + 1) % count)
        } else {
            (k.saturating_sub(1), (k + 1).min(count - 1))
        }
    };
    (0..m * n)
        .map(|k| {
            let (i, j) = (k % m, k / m);
            let (a, b) = step(i, m, closed[0]);
            let (c, d) = step(j, n, closed[1]);
            let along_u = grid.point(b, j) - grid.point(a, j);
            let along_v = grid.point(i, d) - grid.point(i, c);
            along_u.cross(along_v).normalize_or_zero()
        })
        .collect()
}

#[cfg(test)]
#[path = "noise_tests.rs"]
mod tests;
