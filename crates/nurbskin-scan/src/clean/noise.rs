//! Standard deviation of the noise of a scan along its normals.
//!
//! Idea: a polynomial z(x, y) of total degree 2, 3 and 4 is fitted to 14, 24 and 36 points in the frame of their
//! plane. With the residuals e, f degrees of freedom and q(f) the lower quartile of χ²/f, each neighbourhood gives the
//! variance Σ e² / (f q(f)). The lower quartile over some 3000 neighbourhoods resists features and outliers, which
//! only increase a local variance. Shape shrinks quickly with the degree, noise does not: `settle` compares the three
//! variances, and extrapolates their limit where the last step is mostly shape.
//!
//! Sources: E. B. Wilson, M. M. Hilferty, *The distribution of chi-square*, 1931, for q(f); Aitken's delta-squared
//! process for the limit; F. Cazals, M. Pouget 2005 (DOI 10.1016/j.cagd.2004.09.004) for local polynomials. Their
//! combination is ours.

pub(crate) mod lines;

use crate::clean::elements::{Element, Elements, LINE_NEIGHBOURS, LINE_VARIANCE_RATIO};
use crate::normals::{plane_axes, principal_axes};
use glam::DVec3;
use nurbskin_geometry::numeric::parallel::{each, gather};
use nurbskin_geometry::numeric::statistics::quantile_in_place;
use nurbskin_geometry::spatial::morton::spatial_order;
use nurbskin_geometry::spatial::neighbours::{Nearest, Neighbours};

pub use crate::clean::noise::lines::{noise_of_grid, noise_of_lines};

/// Most neighbourhoods (or windows) in which the noise is measured. Guard: bounds the time; neighbourhoods of larger
/// samples overlap and add little.
pub(super) const NOISE_SAMPLES: usize = 3000;
/// Degrees of the polynomials, and numbers of nearest points.
type Degrees = [(usize, usize); 3];
/// Degree of the polynomial and number of points of its neighbourhood, from coarse to fine. Trial: not recorded. Each
/// has about 2.4 points per coefficient (6, 10 and 15); with fewer the variance scatters, with more the neighbourhood
/// sees more of the shape.
const CLOUD_STEPS: Degrees = [(2, 14), (3, 24), (4, 36)];
/// The same for points on a line, where a polynomial has 3, 4 and 5 coefficients. Trial: not recorded.
const LINE_STEPS: Degrees = [(2, 12), (3, 14), (4, 16)];
/// Strides through the nearest points where these lie on one line, as on dense scan lines: every point, every 4th of 4
/// times and every 16th of 16 times as many. Trial: not recorded.
const LINE_THINNING: [usize; 3] = [1, 4, 16];
/// Ratio of the variances across and along a line up to which the spacing of its points is wide against the noise.
/// Trial: not recorded. At a larger ratio the nearest points are mostly off in the same way as the centre.
const THIN_LINE_RATIO: f64 = 0.02;
/// Quantile of the local variances that is compared with its expectation. Trial: not recorded. Features and outliers
/// only ever increase a local variance, so a quantile below the median is less disturbed; lower quantiles scatter more.
pub(super) const VARIANCE_QUANTILE: f64 = 0.25;
/// Standard normal quantile of [`VARIANCE_QUANTILE`]. Derived: Φ⁻¹(0.25).
const VARIANCE_QUANTILE_NORMAL: f64 = -0.674_489_750_196_081_7;
/// Absolute residual, in standard deviations of the noise, above which a point is left out of the second fit. Derived:
/// 2 Φ(-4.5) = 7e-6, so that normal noise keeps practically all its points.
const RESIDUAL_CUTOFF: f64 = 4.5;
/// Points beyond the largest neighbourhood (36) that a cloud must have for its noise to be measured; otherwise the
/// noise is 0, which means unknown. Trial: not recorded.
const NOISE_SURPLUS: usize = 4;
/// Factor of the distance from the centroid in the pseudo-random choice of neighbourhoods. Guard: any factor does that
/// brings digits beyond the spacing to the front.
const LENGTH_MIX: f64 = 97.0;
/// Factor of the mean neighbour distance in the same choice, which separates points at equal distances from the
/// centroid. Guard: any factor does that is no simple fraction of [`LENGTH_MIX`].
const REACH_MIX: f64 = 31.0;
/// Ratio of the last variance to the smaller of the two before up to which the last step is mostly shape, and the limit
/// is extrapolated. Trial: not recorded. A larger ratio extrapolates noise, which scatters; a smaller one reports shape
/// as noise.
const SETTLED_RATIO: f64 = 0.5;
/// Ratio above which the last variance is worse than those before, as coarse sampling makes it, and is not used. Trial:
/// not recorded.
const COARSE_RATIO: f64 = 1.15;
/// Upper limit of the ratio of successive differences in the extrapolation. Guard: keeps the sum of the geometric
/// series finite; at 0.9 it is 9 times the last difference.
const MAX_SHRINK: f64 = 0.9;
/// Fewest degrees of freedom of a neighbourhood whose variance counts. Trial: not recorded. A variance of one or two
/// degrees of freedom scatters too much.
const MIN_FREEDOM: usize = 3;
/// Length of a column after orthogonalisation, relative to the column, up to which it counts as dependent. Trial: not
/// recorded. Less than a fiftieth is the jitter of a grid line, not a direction of its own.
const MIN_INDEPENDENT_SHARE: f64 = 0.02;
/// Root mean square of a column, in units of the neighbourhood's size, up to which it is zero. Guard: what remains of a
/// coordinate across a line is rounding, which may reproduce the values exactly.
const MIN_COLUMN_SIZE: f64 = 1e-6;
/// Largest distance of a point from a line, in the distance to the next line, for it to belong to the line. Derived:
/// half-way between both lines.
const LINE_HALF_WIDTH: f64 = 0.5;

/// Standard deviation, along the surface normal, of the noise of points in any order. Zero for fewer than 40 points,
/// which means unknown. `normals`, where given, keep the opposite wall of a thin part out of a neighbourhood. At most a
/// few thousand neighbourhoods are examined: O(n log n) for finding them.
///
/// On noise-free data the result is not exactly zero, but small against the shape that the sampling leaves unresolved.
#[must_use]
pub fn noise_of_cloud(points: &[DVec3], normals: Option<&[DVec3]>) -> f64 {
    let order = spatial_order(points, |p| p.is_finite());
    let normals = normals.map(|normals| gather(normals, &order));
    let tree = Neighbours::of_sorted(gather(points, &order));
    let stride = tree.len().div_ceil(NOISE_SAMPLES).max(1);
    let centres: Vec<usize> = (0..tree.len()).step_by(stride).collect();
    let facing = |centre: usize, k: usize| {
        let normals = normals.as_ref();
        normals.is_none_or(|n| n[k].dot(n[centre]) >= 0.0)
    };
    noise_around(&tree, &centres, tree.len(), &facing, &|_| None)
}

/// As [`noise_of_cloud`], for points with known elements, without rejected ones.
pub(super) fn noise_of_elements(
    tree: &Neighbours,
    elements: &Elements,
    spacing: f64,
    alive: &(dyn Fn(usize) -> bool + Sync),
) -> f64 {
    let of = &elements.of;
    let living: Vec<usize> = (0..tree.len()).filter(|&k| alive(k)).collect();
    let mut centres = centres(tree.sorted_points(), elements, spacing, &living);
    // Where most points lie on lines, the others lie on lines that noise hides.
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

/// The centres of the neighbourhoods that are examined: a pseudo-random sample that does not change with a motion of
/// all points. It consists of the points for which the fraction of a scaled sum, of the distance from the centroid and
/// the mean neighbour distance, is below a limit. Where the sum is not random, as on regular shapes, the sample has the
/// wrong size, and a regular stride is used instead.
fn centres(points: &[DVec3], elements: &Elements, spacing: f64, living: &[usize]) -> Vec<usize> {
    let stride = living.len().div_ceil(NOISE_SAMPLES).max(1);
    if stride == 1 {
        return living.to_vec();
    }
    let middle = living.iter().map(|&k| points[k]).sum::<DVec3>() / living.len() as f64;
    let digits = |k: usize| {
        let length = points[k].distance(middle) + REACH_MIX * elements.of[k].reach;
        (LENGTH_MIX * length / spacing).fract()
    };
    let chosen = each(living.len(), |l| digits(living[l]) * (stride as f64) < 1.0);
    let sample: Vec<usize> = living
        .iter()
        .zip(chosen)
        .filter(|(_, chosen)| *chosen)
        .map(|(&k, _)| k)
        .collect();
    if sample.len() * 3 > NOISE_SAMPLES && sample.len() < 2 * NOISE_SAMPLES {
        sample
    } else {
        living.iter().copied().step_by(stride).collect()
    }
}

/// The noise in the neighbourhoods of these centres, for a tree of `count` points in spatial order.
fn noise_around(
    tree: &Neighbours,
    centres: &[usize],
    count: usize,
    facing: &(dyn Fn(usize, usize) -> bool + Sync),
    line: &(dyn Fn(usize) -> Option<OnLine> + Sync),
) -> f64 {
    if count < CLOUD_STEPS[CLOUD_STEPS.len() - 1].1 + NOISE_SURPLUS {
        return 0.0;
    }
    settle(&cloud_variances(tree, centres, facing, line))
        .max(0.0)
        .sqrt()
}

/// The variance of the noise from three variances of increasing degree, each of which is the noise plus a remainder of
/// shape:
/// * if the last step more than halves the variance, it is mostly shape: the sequence is taken as geometric, and its
///   limit computed (Aitken's delta-squared process);
/// * otherwise the last one, whose neighbourhoods are the largest and least selected by the noise itself, unless coarse
///   sampling makes it the worst.
///
/// Negative for no variances.
pub(super) fn settle(variances: &[f64]) -> f64 {
    let &[a, b, c] = variances else {
        return -1.0;
    };
    let before = a.min(b);
    if c > SETTLED_RATIO * before {
        return if c <= COARSE_RATIO * before {
            c
        } else {
            before
        };
    }
    let (first, second) = ((a - before).max(0.0), before - c);
    // If the first step shows no decrease, the rest is taken as shape altogether: the limit is below zero.
    let shrink = (second / first.max(second)).min(MAX_SHRINK);
    (c - second * shrink / (1.0 - shrink)).max(0.0)
}

/// Residual variance of local polynomials over both tangent directions, per [`CLOUD_STEPS`] entry.
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
            None => (CLOUD_STEPS, neighbourhood(tree, centre, facing)),
        }
    };
    let examine = |(steps, around): &(Degrees, Vec<DVec3>), limit: f64| {
        steps.map(|(degree, size)| patch(&around[..size.min(around.len())], degree, limit))
    };
    let around: Vec<(Degrees, Vec<DVec3>)> = each(centres.len(), around);
    let mut found: Vec<[Patch; CLOUD_STEPS.len()]> =
        each(around.len(), |k| examine(&around[k], f64::INFINITY));
    let variances = |found: &[[Patch; CLOUD_STEPS.len()]]| -> Vec<f64> {
        (0..CLOUD_STEPS.len())
            .map(|k| {
                let known = found.iter().map(|f| f[k].variance).filter(|v| *v >= 0.0);
                let mut known: Vec<f64> = known.collect();
                if known.is_empty() {
                    0.0
                } else {
                    quantile_in_place(&mut known, VARIANCE_QUANTILE)
                }
            })
            .collect()
    };
    let limit = RESIDUAL_CUTOFF * variances(&found)[CLOUD_STEPS.len() - 1].sqrt();
    let again: Vec<usize> = (0..found.len())
        .filter(|&k| found[k].iter().any(|patch| patch.worst > limit))
        .collect();
    let better = each(again.len(), |a| examine(&around[again[a]], limit));
    for (k, patches) in again.into_iter().zip(better) {
        found[k] = patches;
    }
    variances(&found)
}

/// A point whose neighbours lie on one line with it: the normal of the surface, from points beside the line, and the
/// distance to the next line.
struct OnLine {
    normal: DVec3,
    gap: f64,
}

/// A point and its nearest neighbours of the same side in the frame of their plane, nearest first: x and y along the
/// plane, z across it. Neighbours on one line leave nothing across it from which noise could be estimated: farther ones
/// are then taken.
fn neighbourhood(tree: &Neighbours, centre: usize, facing: impl Fn(usize) -> bool) -> Vec<DVec3> {
    let mut around: Vec<DVec3> = Vec::new();
    for every in LINE_THINNING {
        around = around_point(
            tree,
            centre,
            CLOUD_STEPS[CLOUD_STEPS.len() - 1].1,
            every,
            &facing,
        );
        let (values, _) = plane_axes(around.iter().take(CLOUD_STEPS[0].1).copied());
        if values[1] >= LINE_VARIANCE_RATIO * values[2] {
            break;
        }
    }
    let (_, axes) = principal_axes(around.iter().copied());
    let [z, y, x] = axes.map(|(_, axis)| axis);
    let seen = |d: &DVec3| DVec3::new(d.dot(x), d.dot(y), d.dot(z));
    around.iter().map(seen).collect()
}

/// The same for a point on a line: only neighbours on that line, x along it, y zero. Neighbours at distances below the
/// width of the noise are mostly off in the same way as the point itself. The stride is chosen for which the line is
/// thinnest.
fn along_line(
    tree: &Neighbours,
    centre: usize,
    line: &OnLine,
    facing: impl Fn(usize) -> bool,
) -> Vec<DVec3> {
    let count = LINE_STEPS[LINE_STEPS.len() - 1].1;
    let mut best = (f64::INFINITY, Vec::new());
    for every in LINE_THINNING {
        let around = around_point(tree, centre, count, every, &facing);
        let (values, axes) = plane_axes(around.iter().take(LINE_NEIGHBOURS).copied());
        let thickness = values[1] / values[2];
        if around.len() < count || thickness.is_nan() || thickness >= best.0 {
            continue;
        }
        let x = axes[2]
            .reject_from_normalized(line.normal)
            .normalize_or_zero();
        let y = line.normal.cross(x);
        let on_it = around
            .iter()
            .filter(|d| d.dot(y).abs() < LINE_HALF_WIDTH * line.gap);
        let seen = |d: &DVec3| DVec3::new(d.dot(x), 0.0, d.dot(line.normal));
        best = (thickness, on_it.map(seen).collect());
        if thickness < THIN_LINE_RATIO {
            break;
        }
    }
    best.1
}

/// Offsets of every `every`-th of the nearest points on the same side as a point, including itself.
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

/// Residuals of a polynomial in a neighbourhood.
struct Patch {
    /// Residual variance, divided by its expected [`VARIANCE_QUANTILE`]; negative if the polynomial has no degree of
    /// freedom left.
    variance: f64,
    /// Largest absolute residual.
    worst: f64,
}

/// Fits the polynomial of total degree `degree`; points with residuals above `limit` are left out of a second fit.
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
    let variance = if free < MIN_FREEDOM {
        -1.0
    } else {
        sum / (free as f64 * expected_quantile(free as f64))
    };
    Patch { variance, worst }
}

pub(super) fn small(power: usize) -> i32 {
    i32::try_from(power).unwrap_or(0)
}

/// [`VARIANCE_QUANTILE`] of chi-squared over its degrees of freedom (Wilson & Hilferty 1931).
pub(super) fn expected_quantile(free: f64) -> f64 {
    let h = 2.0 / (9.0 * free);
    (1.0 - h + VARIANCE_QUANTILE_NORMAL * h.sqrt()).powi(3)
}

/// Residuals of values after the least-squares fit of some columns, by Gram-Schmidt orthogonalisation, applied twice
/// for stability.
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
    /// Removes the component along one more column, unless it depends on those before.
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
        // Less than a fiftieth of the column is independent: the jitter of a grid line, not a direction. And what
        // remains across a line is rounding, which may reproduce the values exactly.
        let rest = dot(column, column).sqrt();
        if rest <= MIN_INDEPENDENT_SHARE * size || size <= MIN_COLUMN_SIZE * (rows as f64).sqrt() {
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
