//! Parameter values and averaged knots for interpolation (Pal & Ballav 2007, eqs. (7)-(9)).

use crate::{Error, KnotVector, PointGrid, Result};
use glam::DVec3;
use serde::Serialize;

/// How parameters follow from points.
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
    let negligible = rounding(grid.points(), count);
    let mut steps = vec![0.0; if closed { count } else { count - 1 }];
    let mut used = 0usize;
    let mut lengths = steps.clone();
    for j in 0..grid.count_v() {
        let row = grid.row(j);
        let total = distances(row, closed, kind, &mut lengths);
        if total > negligible {
            used += 1;
            let factor = total.recip();
            for (step, &length) in steps.iter_mut().zip(&lengths) {
                *step += factor * length;
            }
        }
    }
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
    let negligible = rounding(grid.points(), count);
    let mut steps = vec![0.0; if closed { count } else { count - 1 }];
    let mut used = 0usize;
    let mut lengths = steps.clone();
    let mut column = Vec::with_capacity(count);
    for i in 0..grid.count_u() {
        column.clear();
        column.extend(grid.column(i));
        let total = distances(&column, closed, kind, &mut lengths);
        if total > negligible {
            used += 1;
            let factor = total.recip();
            for (step, &length) in steps.iter_mut().zip(&lengths) {
                *step += factor * length;
            }
        }
    }
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
    let mut lengths = vec![0.0; points.len() - usize::from(!closed)];
    let total = distances(points, closed, kind, &mut lengths);
    let used = usize::from(total > rounding(points, points.len()));
    for length in &mut lengths {
        *length /= total;
    }
    accumulate(&lengths, used, closed, "points")
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

/// Length that a line of `count` equal points may seem to have by the rounding of its coordinates.
fn rounding(points: &[DVec3], count: usize) -> f64 {
    let largest = points
        .iter()
        .fold(0.0_f64, |m, p| m.max(p.abs().max_element()));
    4.0 * f64::EPSILON * largest * count as f64
}

/// Distances between neighbours (or their square roots), and their sum.
fn distances(points: &[DVec3], closed: bool, kind: Parameterization, out: &mut [f64]) -> f64 {
    let measure = |a: DVec3, b: DVec3| {
        let d = a.distance(b);
        if kind == Parameterization::Centripetal {
            d.sqrt()
        } else {
            d
        }
    };
    let mut total = 0.0;
    for (k, length) in out.iter_mut().enumerate() {
        let next = if k + 1 == points.len() { 0 } else { k + 1 };
        *length = measure(points[k], points[next]);
        total += *length;
    }
    debug_assert!(closed == (out.len() == points.len()));
    total
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
