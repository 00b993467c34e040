//! The noise of a scan, measured.
//!
//! Through each of many small neighbourhoods goes a polynomial; what it leaves over, corrected for the freedom it
//! had, is the noise - or shape that the polynomial could not follow. The two are told apart by raising the degree:
//! shape shrinks quickly, noise stays. Medians over the neighbourhoods make single features and outliers harmless.

pub(crate) mod lines;

use crate::clean::elements::{Element, Elements, LINEAR, ON_LINE};
use crate::normals::{plane_axes, principal_axes};
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::{each, gather};
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::spatial::morton::spatial_order;
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};

pub use crate::clean::noise::lines::{noise_of_grid, noise_of_lines};

/// Neighbourhoods examined at most; their overlap makes more of little use.
pub(super) const SAMPLES: usize = 3000;
/// Degrees, and as many nearest points each.
type Degrees = [(usize, usize); 3];
/// Degree of the polynomial and size of the neighbourhood, from coarse to fine. About 2.4 points per coefficient.
const STEPS: Degrees = [(2, 14), (3, 24), (4, 36)];
/// The same on a line, where there are fewer coefficients.
const LINE_STEPS: Degrees = [(2, 12), (3, 14), (4, 16)];
/// Where neighbours lie on one line, as on dense scan lines far apart, every 4th or 16th of as many times more.
const THINNING: [usize; 3] = [1, 4, 16];
/// Where the variance across a line is at most this part of that along it its points are far enough apart.
const THIN: f64 = 0.02;
/// The quantile of the local variances that is compared with its expectation. Features and outliers only ever add
/// to a local variance, so that a quantile below the median is less disturbed.
pub(super) const QUANTILE: f64 = 0.25;
/// Standard normal quantile of [`QUANTILE`].
const QUANTILE_NORMAL: f64 = -0.674_489_750_196_081_7;
/// Residuals beyond this many sigma are left out in a second pass; of normal noise that is 7 in a million.
const OUTLYING: f64 = 4.5;
/// Standard deviation, along the surface normal, of the noise of points in any order. Zero where there are fewer
/// than 40 points, which cannot tell. `normals`, where given, keep the opposite wall of a thin part out of a
/// neighbourhood. At most a few thousand neighbourhoods are examined: O(n log n) for finding them.
///
/// On noise-free data the answer is not exactly zero but small against what the sampling leaves unresolved.
#[must_use]
pub fn noise_of_cloud(points: &[DVec3], normals: Option<&[DVec3]>) -> f64 {
    let order = spatial_order(points, |p| p.is_finite());
    let normals = normals.map(|normals| gather(normals, &order));
    let tree = Neighbours::of_sorted(gather(points, &order));
    let stride = tree.len().div_ceil(SAMPLES).max(1);
    let centres: Vec<usize> = (0..tree.len()).step_by(stride).collect();
    let facing = |centre: usize, k: usize| {
        let normals = normals.as_ref();
        normals.is_none_or(|n| n[k].dot(n[centre]) >= 0.0)
    };
    noise_around(&tree, &centres, tree.len(), &facing, &|_| None)
}

/// As [`noise_of_cloud`], of points whose elements are at hand and that are alive.
pub(super) fn noise_of_elements(
    tree: &Neighbours,
    elements: &Elements,
    spacing: f64,
    alive: &(dyn Fn(usize) -> bool + Sync),
) -> f64 {
    let of = &elements.of;
    let living: Vec<usize> = (0..tree.len()).filter(|&k| alive(k)).collect();
    let mut centres = centres(tree.sorted_points(), elements, spacing, &living);
    // Where most points are known to lie on lines the others are on lines that noise hides.
    let lined = |k: &usize| of[*k].gap > 0.0 && of[*k].gap.is_finite();
    if 2 * centres.iter().filter(|k| lined(k)).count() > centres.len() {
        centres.retain(lined);
    }
    let facing = |centre: usize, k: usize| alive(k) && of[k].normal.dot(of[centre].normal) >= 0.0;
    let line = |k: usize| {
        let Element { normal, gap, .. } = of[k];
        lined(&k).then_some(OnLine { normal, gap })
    };
    noise_around(tree, &centres, living.len(), &facing, &line)
}

/// The points whose neighbourhoods are examined: a sample that a motion of all points does not change. It takes those
/// whose distance from the middle, in small units and mixed with the distance of their neighbours, ends in the right
/// digits; where too few or too many do, as on regular shapes, every so many.
fn centres(points: &[DVec3], elements: &Elements, spacing: f64, living: &[usize]) -> Vec<usize> {
    let stride = living.len().div_ceil(SAMPLES).max(1);
    if stride == 1 {
        return living.to_vec();
    }
    let middle = living.iter().map(|&k| points[k]).sum::<DVec3>() / living.len() as f64;
    let digits = |k: usize| {
        let length = points[k].distance(middle) + 31.0 * elements.of[k].reach;
        (97.0 * length / spacing).fract()
    };
    let chosen = each(living.len(), |l| digits(living[l]) * (stride as f64) < 1.0);
    let sample: Vec<usize> = living
        .iter()
        .zip(chosen)
        .filter(|(_, chosen)| *chosen)
        .map(|(&k, _)| k)
        .collect();
    if sample.len() * 3 > SAMPLES && sample.len() < 2 * SAMPLES {
        sample
    } else {
        living.iter().copied().step_by(stride).collect()
    }
}

/// The noise in the neighbourhoods of these places of a tree in spatial order, of `count` points.
fn noise_around(
    tree: &Neighbours,
    centres: &[usize],
    count: usize,
    facing: &(dyn Fn(usize, usize) -> bool + Sync),
    line: &(dyn Fn(usize) -> Option<OnLine> + Sync),
) -> f64 {
    if count < STEPS[STEPS.len() - 1].1 + 4 {
        return 0.0;
    }
    settle(&cloud_variances(tree, centres, facing, line))
        .max(0.0)
        .sqrt()
}

/// The noise in three variances found with rising degree, of which each is the noise plus a remainder of shape:
/// * where the last step more than halves the variance it is mostly shape; the sequence is taken for geometric and
///   its limit computed (Aitken's delta-squared process);
/// * otherwise the last, whose neighbourhoods are the largest and least selected by the noise itself, unless coarse
///   sampling makes just these the worst.
///
/// Negative for no variances.
pub(super) fn settle(variances: &[f64]) -> f64 {
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
fn cloud_variances(
    tree: &Neighbours,
    centres: &[usize],
    facing: &(dyn Fn(usize, usize) -> bool + Sync),
    line: &(dyn Fn(usize) -> Option<OnLine> + Sync),
) -> Vec<f64> {
    let around = |k: usize| {
        let centre = centres[k];
        let facing = |j| facing(centre, j);
        match line(centre) {
            Some(line) => (LINE_STEPS, along_line(tree, centre, &line, facing)),
            None => (STEPS, neighbourhood(tree, centre, facing)),
        }
    };
    let examine = |(steps, around): &(Degrees, Vec<DVec3>), limit: f64| {
        steps.map(|(degree, size)| patch(&around[..size.min(around.len())], degree, limit))
    };
    let around: Vec<(Degrees, Vec<DVec3>)> = each(centres.len(), around);
    let mut found: Vec<[Patch; STEPS.len()]> =
        each(around.len(), |k| examine(&around[k], f64::INFINITY));
    let variances = |found: &[[Patch; STEPS.len()]]| -> Vec<f64> {
        (0..STEPS.len())
            .map(|k| {
                let known = found.iter().map(|f| f[k].variance).filter(|v| *v >= 0.0);
                let mut known: Vec<f64> = known.collect();
                if known.is_empty() {
                    0.0
                } else {
                    quantile_in_place(&mut known, QUANTILE)
                }
            })
            .collect()
    };
    let limit = OUTLYING * variances(&found)[STEPS.len() - 1].sqrt();
    let again: Vec<usize> = (0..found.len())
        .filter(|&k| found[k].iter().any(|patch| patch.worst > limit))
        .collect();
    let better = each(again.len(), |a| examine(&around[again[a]], limit));
    for (k, patches) in again.into_iter().zip(better) {
        found[k] = patches;
    }
    variances(&found)
}

/// What is known of a point whose neighbours lie on one line with it: the normal of the surface, from points beside the
/// line, and how far off these are.
struct OnLine {
    normal: DVec3,
    gap: f64,
}

/// A point and its nearest neighbours that face its way in the frame of their plane, nearest first: x and y along it,
/// z across. Neighbours on one line would leave nothing across it to tell noise from: farther ones are taken.
fn neighbourhood(tree: &Neighbours, centre: usize, facing: impl Fn(usize) -> bool) -> Vec<DVec3> {
    let mut around: Vec<DVec3> = Vec::new();
    for every in THINNING {
        around = around_point(tree, centre, STEPS[STEPS.len() - 1].1, every, &facing);
        let (values, _) = plane_axes(around.iter().take(STEPS[0].1).copied());
        if values[1] >= LINEAR * values[2] {
            break;
        }
    }
    let (_, axes) = principal_axes(around.iter().copied());
    let [z, y, x] = axes.map(|(_, axis)| axis);
    let seen = |d: &DVec3| DVec3::new(d.dot(x), d.dot(y), d.dot(z));
    around.iter().map(seen).collect()
}

/// The same of a point on a line: only neighbours on that line, x along it, y zero. Those that are as near as the noise is
/// wide would mostly be off as the point itself is: they are taken from where the line looks thinnest.
fn along_line(
    tree: &Neighbours,
    centre: usize,
    line: &OnLine,
    facing: impl Fn(usize) -> bool,
) -> Vec<DVec3> {
    let count = LINE_STEPS[LINE_STEPS.len() - 1].1;
    let mut best = (f64::INFINITY, Vec::new());
    for every in THINNING {
        let around = around_point(tree, centre, count, every, &facing);
        let (values, axes) = plane_axes(around.iter().take(ON_LINE).copied());
        let thickness = values[1] / values[2];
        if around.len() < count || thickness.is_nan() || thickness >= best.0 {
            continue;
        }
        let x = axes[2]
            .reject_from_normalized(line.normal)
            .normalize_or_zero();
        let y = line.normal.cross(x);
        let on_it = around.iter().filter(|d| d.dot(y).abs() < 0.5 * line.gap);
        let seen = |d: &DVec3| DVec3::new(d.dot(x), 0.0, d.dot(line.normal));
        best = (thickness, on_it.map(seen).collect());
        if thickness < THIN {
            break;
        }
    }
    best.1
}

/// Every so many of the nearest points that face the way of a point, itself the first, as seen from it.
fn around_point(
    tree: &Neighbours,
    centre: usize,
    count: usize,
    every: usize,
    facing: impl Fn(usize) -> bool,
) -> Vec<DVec3> {
    let points = tree.sorted_points();
    let mut near = Nearest::default();
    let most = every * count;
    tree.search(points[centre], most, &mut near, |k| facing(k as usize));
    let some = near.indices().step_by(every);
    some.map(|k| points[k as usize] - points[centre]).collect()
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

pub(super) fn small(power: usize) -> i32 {
    i32::try_from(power).unwrap_or(0)
}

/// [`QUANTILE`] of chi-squared over its degrees of freedom (Wilson & Hilferty 1931).
pub(super) fn expected_quantile(free: f64) -> f64 {
    let h = 2.0 / (9.0 * free);
    (1.0 - h + QUANTILE_NORMAL * h.sqrt()).powi(3)
}

/// Values with the least-squares fit of some columns taken out, by Gram-Schmidt twice over.
pub(super) struct Residuals {
    values: Vec<f64>,
    /// Orthonormal columns, one after the other.
    pub(super) columns: Vec<f64>,
}

impl Residuals {
    pub(super) fn new(values: Vec<f64>, most: usize) -> Self {
        let columns = Vec::with_capacity(values.len() * most);
        Self { values, columns }
    }
    pub(super) fn rank(&self) -> usize {
        self.columns.len() / self.values.len().max(1)
    }
    /// Takes one more column out, unless it depends on those before.
    pub(super) fn remove(&mut self, column: impl Iterator<Item = f64>) {
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
        // Less than a fiftieth of a column that is of its own is the jitter of a grid line, not a direction; and what
        // remains across a line is rounding, which may hold just the values.
        let rest = dot(column, column).sqrt();
        if rest <= 0.02 * size || size <= 1e-6 * (rows as f64).sqrt() {
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

#[cfg(test)]
mod tests;
