//! Parameters and averaged knots for interpolation.
//!
//! ```text
//! t_k = t_{k-1} + |Q_k - Q_{k-1}|^e / Σ |Q_j - Q_{j-1}|^e,   e = 0 uniform, 1/2 centripetal, 1 chord length
//! u_{j+p} = (t_j + … + t_{j+p-1}) / p
//! ```
//!
//! A grid takes the mean over its lines. Sums are made in fixed parts, so that they do not depend on the number of
//! threads.
//!
//! Source: Pal & Ballav 2007, eqs. (7)-(9); A9.1, *The NURBS Book*; E. T. Y. Lee, 1989, for the centripetal rule.

use glam::DVec3;
use nurbskin_geometry::{Error, KnotVector, PointGrid, Result};
use rayon::prelude::*;
use serde::Serialize;
use std::ops::Range;

/// The rule that computes parameters from points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Parameterization {
    /// Equal steps (Pal & Ballav 2007, eq. (7)): right where the points themselves are equal steps of a smooth motion.
    Uniform,
    /// Steps proportional to the distances (eq. (8)): the one with full order of convergence on uneven data.
    #[default]
    ChordLength,
    /// Steps proportional to the square roots of the distances (E. T. Y. Lee, *Computer-Aided Design* 21, 1989).
    Centripetal,
}

impl Parameterization {
    /// The name on the command line and in JSON: `uniform`, `chord` or `centripetal`.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Parameterization::Uniform => "uniform",
            Parameterization::ChordLength => "chord",
            Parameterization::Centripetal => "centripetal",
        }
    }
}

/// Parameters of the columns (lines of constant u) of a grid: each row gives its own, the average is returned. Rows of
/// zero length (poles) are left out. `count_u` values, increasing.
///
/// Open: from 0 to 1. Closed: from 0, all below 1; the chord from the last column back to the first counts and ends
/// at 1.
///
/// Source: Pal & Ballav 2007, eqs. (7), (8) and (10).
///
/// # Errors
/// [`Error::Invalid`] if the direction has fewer than 2 columns (3 where closed), every row has zero length, or, for
/// other than uniform parameters, two neighbouring columns coincide.
pub fn parameters_u(grid: &PointGrid, closed: bool, kind: Parameterization) -> Result<Vec<f64>> {
    let count = grid.count_u();
    check_count(count, closed, "columns")?;
    if kind == Parameterization::Uniform {
        return Ok(uniform(count, closed));
    }
    let sum = match kind {
        Parameterization::Centripetal => row_steps::<true>,
        _ => row_steps::<false>,
    };
    let parts = grid.count_v().div_ceil(ROWS_PER_PART);
    let (steps, used) = sum_parts(grid, parts, count - usize::from(!closed), |part, steps| {
        sum(
            grid,
            part * ROWS_PER_PART..((part + 1) * ROWS_PER_PART).min(grid.count_v()),
            closed,
            steps,
        )
    });
    accumulate(&steps, used, closed, "columns")
}

/// Parameters of the rows (lines of constant v) of a grid, as [`parameters_u`] with u and v exchanged.
///
/// # Errors
/// As [`parameters_u`], for rows.
pub fn parameters_v(grid: &PointGrid, closed: bool, kind: Parameterization) -> Result<Vec<f64>> {
    let count = grid.count_v();
    check_count(count, closed, "rows")?;
    if kind == Parameterization::Uniform {
        return Ok(uniform(count, closed));
    }
    let sum = match kind {
        Parameterization::Centripetal => column_steps::<true>,
        _ => column_steps::<false>,
    };
    let parts = grid.count_u().div_ceil(COLUMNS_PER_PART);
    let (steps, used) = sum_parts(grid, parts, count - usize::from(!closed), |part, steps| {
        sum(
            grid,
            part * COLUMNS_PER_PART..((part + 1) * COLUMNS_PER_PART).min(grid.count_u()),
            closed,
            steps,
        )
    });
    accumulate(&steps, used, closed, "rows")
}

/// Parameters of one line of points, as [`parameters_u`] of a single row.
///
/// # Errors
/// As [`parameters_u`], for points.
pub fn line_parameters(points: &[DVec3], closed: bool, kind: Parameterization) -> Result<Vec<f64>> {
    check_count(points.len(), closed, "points")?;
    if kind == Parameterization::Uniform {
        return Ok(uniform(points.len(), closed));
    }
    let grid = PointGrid::new(points.len(), 1, points.to_vec())?;
    parameters_u(&grid, closed, kind).map_err(|e| match e {
        Error::Invalid(text) => Error::Invalid(text.replace("columns", "points")),
        other => other,
    })
}

/// Clamped knots for open interpolation at these parameters: the mean of p consecutive parameters at each interior
/// knot, which makes the collocation matrix totally positive and regular.
///
/// Source: Pal & Ballav 2007, eq. (9); A9.1, *The NURBS Book*, 2nd ed., p. 369.
///
/// # Errors
/// [`Error::Invalid`] if there are fewer than p + 1 parameters, they do not increase, or the degree is out of range.
pub fn averaged_knots(parameters: &[f64], degree: usize) -> Result<KnotVector> {
    let count = parameters.len();
    check_increasing(parameters)?;
    if degree == 0 || count <= degree {
        return Err(Error::invalid(format!(
            "degree {degree} needs at least 1 and fewer than the {count} lines to interpolate"
        )));
    }
    let mut knots = Vec::with_capacity(count + degree + 1);
    knots.resize(degree + 1, parameters[0]);
    knots.extend(
        parameters[1..count - 1]
            .windows(degree)
            .map(|w| w.iter().sum::<f64>() / degree as f64),
    );
    knots.resize(count + degree + 1, parameters[count - 1]);
    KnotVector::new(degree, knots)
}

/// Periodic knots for closed interpolation at n parameters within one period of length 1: at the parameters for odd
/// degree, midway between neighbours for even degree (where knots at the parameters would be singular). The domain
/// starts at the first knot: the first parameter for odd degree, half a step before it for even degree.
///
/// # Errors
/// [`Error::Invalid`] if there are no more parameters than the degree, they do not increase within one period, or the
/// degree is out of range.
pub fn periodic_knots(parameters: &[f64], degree: usize) -> Result<KnotVector> {
    let count = parameters.len();
    check_increasing(parameters)?;
    if count <= degree || count < 2 {
        return Err(Error::invalid(format!(
            "degree {degree} needs more than the {count} lines to interpolate"
        )));
    }
    let (first, last) = (parameters[0], parameters[count - 1]);
    if last - first >= 1.0 {
        return Err(Error::invalid(
            "the parameters of a closed direction must lie within one period of length 1",
        ));
    }
    let mut breaks = Vec::with_capacity(count + 1);
    if degree % 2 == 1 {
        breaks.extend_from_slice(parameters);
    } else {
        breaks.push(0.5 * (last - 1.0 + first));
        breaks.extend(parameters.windows(2).map(|w| 0.5 * (w[0] + w[1])));
    }
    breaks.push(breaks[0] + 1.0);
    KnotVector::periodic(degree, &breaks)
}

/// Finite and strictly increasing.
pub(crate) fn check_increasing(parameters: &[f64]) -> Result<()> {
    if let Some(k) = parameters.iter().position(|t| !t.is_finite()) {
        return Err(Error::invalid(format!("parameter {k} is not finite")));
    }
    match parameters.windows(2).position(|w| w[0] >= w[1]) {
        Some(k) => Err(Error::invalid(format!(
            "parameter {} is not above the one before it",
            k + 1
        ))),
        None => Ok(()),
    }
}

fn check_count(count: usize, closed: bool, lines: &str) -> Result<()> {
    let least = if closed { 3 } else { 2 };
    if count < least {
        let kind = if closed { "a closed" } else { "an open" };
        return Err(Error::invalid(format!(
            "{kind} direction needs at least {least} {lines}, not {count}"
        )));
    }
    Ok(())
}

fn uniform(count: usize, closed: bool) -> Vec<f64> {
    let steps = if closed { count } else { count - 1 };
    (0..count).map(|k| k as f64 / steps as f64).collect()
}

/// Rows whose steps are summed together. Count.
/// Guard: fixed, so that sums do not depend on the number of threads.
const ROWS_PER_PART: usize = 32;
/// Columns whose steps are summed together. Count.
/// Guard: fixed, for the same reason; 32 columns of distances of a few thousand rows stay in the cache.
const COLUMNS_PER_PART: usize = 32;
/// Points from which on the sums are made in parallel. Count.
/// Guard: fewer are not worth waking other threads.
const PARALLEL_POINTS: usize = 1 << 15;
/// Rounding of the distance of two equal points, in units of the last place of the largest coordinate.
/// Guard: covers the three coordinates of both points.
const ROUNDING_ULPS: f64 = 4.0;

/// Sums what `part` writes to its second argument over all parts, in their order, and the numbers it returns.
fn sum_parts(
    grid: &PointGrid,
    parts: usize,
    len: usize,
    part: impl Fn(usize, &mut [f64]) -> usize + Sync,
) -> (Vec<f64>, usize) {
    let mut sum = vec![0.0; len];
    let mut used = 0;
    let mut add = |steps: &[f64], count: usize| {
        used += count;
        for (sum, step) in sum.iter_mut().zip(steps) {
            *sum += step;
        }
    };
    if grid.points().len() >= PARALLEL_POINTS {
        let all: Vec<(Vec<f64>, usize)> = (0..parts)
            .into_par_iter()
            .map(|k| {
                let mut steps = vec![0.0; len];
                let count = part(k, &mut steps);
                (steps, count)
            })
            .collect();
        for (steps, count) in &all {
            add(steps, *count);
        }
        return (sum, used);
    }
    let mut steps = vec![0.0; len];
    for k in 0..parts {
        steps.fill(0.0);
        let count = part(k, &mut steps);
        add(&steps, count);
    }
    (sum, used)
}

/// Adds the steps of each of these rows, relative to the row's length; returns how many rows have a length.
fn row_steps<const ROOT: bool>(
    grid: &PointGrid,
    rows: Range<usize>,
    closed: bool,
    steps: &mut [f64],
) -> usize {
    let mut lengths = vec![0.0; steps.len()];
    let mut used = 0;
    for j in rows {
        let row = grid.row(j);
        for (length, pair) in lengths.iter_mut().zip(row.windows(2)) {
            *length = measure::<ROOT>(pair[0], pair[1]);
        }
        let (first, last) = (row[0], row[row.len() - 1]);
        if closed {
            lengths[row.len() - 1] = measure::<ROOT>(last, first);
        }
        let total = total(&lengths);
        if total > rounding::<ROOT>(first, lengths.len()) {
            used += 1;
            let factor = total.recip();
            for (step, length) in steps.iter_mut().zip(&lengths) {
                *step += factor * length;
            }
        }
    }
    used
}

/// Adds the steps of each of these columns, relative to the column's length; returns how many have a length.
fn column_steps<const ROOT: bool>(
    grid: &PointGrid,
    columns: Range<usize>,
    closed: bool,
    steps: &mut [f64],
) -> usize {
    let width = columns.len();
    let mut lengths = vec![0.0; steps.len() * width];
    let mut totals = [0.0; COLUMNS_PER_PART];
    let totals = &mut totals[..width];
    let last = grid.count_v() - 1;
    for (j, lengths) in lengths.chunks_exact_mut(width).enumerate() {
        let here = &grid.row(j)[columns.clone()];
        let next = &grid.row(if j == last { 0 } else { j + 1 })[columns.clone()];
        for (((length, total), &a), &b) in lengths.iter_mut().zip(&mut *totals).zip(here).zip(next)
        {
            *length = measure::<ROOT>(a, b);
            *total += *length;
        }
    }
    debug_assert!(closed == (steps.len() == last + 1));
    let mut used = 0;
    // Totals become factors; zero leaves a column out.
    for (total, &first) in totals.iter_mut().zip(&grid.row(0)[columns]) {
        if *total > rounding::<ROOT>(first, steps.len()) {
            used += 1;
            *total = total.recip();
        } else {
            *total = 0.0;
        }
    }
    for (step, lengths) in steps.iter_mut().zip(lengths.chunks_exact(width)) {
        *step += lengths
            .iter()
            .zip(&*totals)
            .map(|(l, f)| l * f)
            .sum::<f64>();
    }
    used
}

/// The distance of two points, or its square root.
#[inline]
fn measure<const ROOT: bool>(a: DVec3, b: DVec3) -> f64 {
    let d = a.distance(b);
    if ROOT { d.sqrt() } else { d }
}

/// The sum, in four interleaved parts so that additions are independent.
fn total(lengths: &[f64]) -> f64 {
    let (fours, rest) = lengths.as_chunks::<4>();
    let mut sum = [0.0; 4];
    for four in fours {
        for (sum, x) in sum.iter_mut().zip(four) {
            *sum += x;
        }
    }
    rest.iter()
        .fold((sum[0] + sum[1]) + (sum[2] + sum[3]), |s, x| s + x)
}

/// Length that `count` steps between equal points near `point` may have by the rounding of their coordinates.
fn rounding<const ROOT: bool>(point: DVec3, count: usize) -> f64 {
    let step = ROUNDING_ULPS * f64::EPSILON * point.abs().max_element();
    count as f64 * if ROOT { step.sqrt() } else { step }
}

/// Parameters from the summed relative steps of `used` lines.
fn accumulate(steps: &[f64], used: usize, closed: bool, lines: &str) -> Result<Vec<f64>> {
    if used == 0 {
        return Err(Error::invalid(format!(
            "all {lines} of the grid coincide: there is no length to measure parameters by"
        )));
    }
    let mut parameters = Vec::with_capacity(steps.len() + 1);
    let mut sum = 0.0;
    parameters.push(0.0);
    for &step in steps {
        sum += step;
        parameters.push(sum);
    }
    if !sum.is_finite() {
        return Err(Error::invalid(
            "the distances between the points are too large to compute with",
        ));
    }
    for t in &mut parameters {
        *t /= sum;
    }
    if let Some(k) = parameters.windows(2).position(|w| w[0] >= w[1]) {
        let next = (k + 1) % (parameters.len() - usize::from(closed));
        return Err(Error::invalid(format!(
            "{lines} {k} and {next} coincide: remove one of them"
        )));
    }
    if closed {
        parameters.pop();
    }
    Ok(parameters)
}
