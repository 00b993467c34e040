//! The criterion of a good fit, and the spans to halve or knots to remove by it.
//!
//! ```text
//! exact:  score = max |d| / T
//! noise:  score = (|mean d| - 3.5 σ / √n)₊ / (0.2 T)             per sub-cell of n points
//! pooled: Σ n mean² > k σ² · (chi squared bound at 4 sigma)       per window of k sub-cells
//! gain:   Σ n mean² - k σ²                                        per strip
//! ```
//!
//! Spans with scores above 1 are halved. Maximum criteria on noisy points chase noise, hence the test of means.
//!
//! Source: E. B. Wilson and M. M. Hilferty, The distribution of chi-square, 1931, for the bound; the tests are ours.

use super::span_residuals::{Gathered, SpanResiduals};
use crate::fit::least_squares::samples::Residual;
use crate::fit::least_squares::spline_space::Fit;
use nurbskin_geometry::DVec3;
use nurbskin_geometry::nurbs::basis::basis_derivatives;

/// Fewest points of a sub-cell whose mean residual is judged. Count.
/// Trial: in prototypes; the mean of fewer is as wide as noise.
const MIN_CELL_POINTS: f64 = 5.0;
/// Standard errors of a mean residual up to which it is not significant.
/// Trial: in prototypes on simulated clouds; with this test the pot takes 136 control points, with the largest distance
/// 4968 at nine times the error. By chance one normal variable in 2150 exceeds it.
const SIGNIFICANCE_SIGMAS: f64 = 3.5;
/// Mean residual, in tolerances, that is allowed beyond noise.
/// Trial: in prototypes on simulated clouds, together with [`SIGNIFICANCE_SIGMAS`].
const BIAS_TOLERANCE_SHARE: f64 = 0.2;

/// Cells of the other direction that are judged together where single ones show no error. Count.
/// Trial: not recorded.
const WINDOW_SPANS: usize = 3;
/// Standard deviations, as of a normal variable, by which the squared means of such a window must exceed noise.
/// Derived: by chance one window in 30 000 does.
const POOLED_SIGNIFICANCE: f64 = 4.0;
/// Root mean square error, in tolerances, that a window may have.
/// Trial: with paired seeds of the simulated clouds; 0.15 was used before.
const POOLED_RMS_SHARE: f64 = 0.2;
/// Standard deviations by which the squared means of a strip must exceed noise for its cut to gain anything.
/// Trial: not recorded. A false gain wastes a row of control points.
const GAIN_SIGNIFICANCE: f64 = 2.0;
/// Share of the highest score of a round from which on a span is cut in the same round; others wait, since the cuts may
/// mend them. Dimensionless.
/// Trial: not recorded.
const CUT_SHARE_OF_BIAS: f64 = 0.35;
/// The same for exact points, whose highest score is that of a single point. Dimensionless.
/// Trial: not recorded.
const CUT_SHARE_OF_MAXIMUM: f64 = 0.6;
/// Distance, in tolerances, up to which an exact point adds nothing to the objective of refinement.
/// Trial: not recorded. At 1 points just within the tolerance would leave no room.
const SETTLED_DISTANCE: f64 = 0.7;
/// Length of a span, in units of the domain, up to which it is not halved.
/// Guard: keeps knots distinct and the equations regular.
const MIN_HALVED_SPAN: f64 = 1e-6;
/// Robust weight up to which a point does not count as a point of the surface. Dimensionless.
/// Trial: not recorded. With Tukey's biweight it is reached at 7.05 of the 8 sigma at which the weight is zero.
pub(super) const OUTLIER_WEIGHT: f64 = 0.05;
/// First spans of an open direction. Count.
/// Guard: a choice of a start; the rounds multiply it.
const OPEN_START_SPANS: usize = 2;
/// First spans of a closed direction, at least. Count.
/// Guard: a choice of a start, at which a circle has four spans.
const CLOSED_START_SPANS: usize = 4;

/// When a surface is good enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Criterion {
    /// Noise is part of the tolerance: the mean signed distance of every small cell must be below 0.2 tolerances or
    /// within 3.5 of its standard deviations.
    Bias,
    /// The points are exact: every distance must be below the tolerance.
    Maximum,
}

/// The spans of one direction that a criterion marks.
#[derive(Clone, Debug, Default)]
pub(super) struct Marks {
    /// Spans to cut with their score, in order of the spans.
    pub(super) spans: Vec<(usize, f64)>,
    /// The largest score, 1 = just good enough, including spans that cannot be cut.
    pub(super) worst: f64,
}

/// The measure of fit shared by marks, gains and removals.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measure {
    pub(super) criterion: Criterion,
    pub(super) tolerance: f64,
    pub(super) sigma: f64,
}

impl Measure {
    /// The spans in which the surface is not good enough, where they hold enough points to be cut.
    pub(super) fn marks(&self, levels: &[SpanResiduals]) -> Marks {
        let score = |cell: &Gathered| match self.criterion {
            Criterion::Maximum => cell.largest / self.tolerance,
            Criterion::Bias if cell.points < MIN_CELL_POINTS => 0.0,
            Criterion::Bias => {
                let n = cell.points;
                let excess = (cell.sum / n).abs() - SIGNIFICANCE_SIGMAS * self.sigma / n.sqrt();
                (excess / (BIAS_TOLERANCE_SHARE * self.tolerance)).max(0.0)
            }
        };
        let share = match self.criterion {
            Criterion::Bias => CUT_SHARE_OF_BIAS,
            Criterion::Maximum => CUT_SHARE_OF_MAXIMUM,
        };
        self.chosen(levels, share, |strips, a| {
            strips.strip(a).iter().map(score).fold(0.0, f64::max)
        })
    }

    /// The spans where the mean residuals of neighbouring sub-cells or lines together exceed noise, though no single
    /// one does; only for noisy points. A score of 1 is a root mean square error of [`POOLED_RMS_SHARE`] tolerances.
    pub(super) fn pooled_marks(&self, levels: &[SpanResiduals]) -> Marks {
        if self.criterion == Criterion::Maximum || self.sigma <= 0.0 {
            return Marks::default();
        }
        let variance = self.sigma * self.sigma;
        let window = |strips: &SpanResiduals, a: usize, from: usize| {
            let (mut k, mut points, mut squares) = (0.0_f64, 0.0, 0.0);
            let [_, across] = strips.parts();
            let to = (from + WINDOW_SPANS).min(across);
            let rows = strips.strip(a).chunks(across);
            for cell in rows.flat_map(|row| &row[from..to]) {
                if cell.points > 0.0 {
                    k += 1.0;
                    points += cell.points;
                    squares += cell.sum.powi(2) / cell.points;
                }
            }
            // Squared means in units of their variance add up to k.
            let excess = squares - k * variance;
            // Their bound by chance: the cube root of chi squared is nearly normal (Wilson and Hilferty).
            let ninth = 2.0 / (9.0 * k.max(1.0));
            let limit = k * ((1.0 - ninth + POOLED_SIGNIFICANCE * ninth.sqrt()).powi(3) - 1.0);
            if excess > limit * variance {
                (excess / points).sqrt() / (POOLED_RMS_SHARE * self.tolerance)
            } else {
                0.0
            }
        };
        self.chosen(levels, CUT_SHARE_OF_BIAS, |strips, a| {
            let windows = 0..(strips.parts()[1] + 1).saturating_sub(WINDOW_SPANS).max(1);
            windows.map(|b| window(strips, a, b)).fold(0.0, f64::max)
        })
    }

    /// The spans with a score above 1 and above `share` of the largest that can be cut.
    fn chosen(
        &self,
        levels: &[SpanResiduals],
        share: f64,
        score: impl Fn(&SpanResiduals, usize) -> f64,
    ) -> Marks {
        let Some(coarse) = levels.first() else {
            return Marks::default();
        };
        let of_level = |strips: &SpanResiduals| -> Vec<f64> {
            let of_span = |a: usize| match strips.across_all() && !coarse.is_well_supported(a) {
                true => 0.0,
                false => score(strips, a),
            };
            (0..strips.spans()).map(of_span).collect()
        };
        let scores: Vec<Vec<f64>> = levels.iter().map(of_level).collect();
        let largest = |scores: &Vec<f64>| scores.iter().copied().fold(0.0, f64::max);
        let worst = scores.iter().map(largest).fold(0.0, f64::max);
        // Details count only where the larger cells are good enough: they would scatter the first cuts.
        let scores = scores
            .iter()
            .find(|s| largest(s) > 1.0)
            .unwrap_or(&scores[0]);
        let spans = (0..coarse.spans())
            .filter(|&a| scores[a] > 1.0 && coarse.can_be_cut(a, self.criterion))
            .map(|a| (a, scores[a]))
            .collect::<Vec<_>>();
        let highest = spans.iter().fold(0.0, |m: f64, s| m.max(s.1));
        Marks {
            spans: spans
                .into_iter()
                .filter(|s| s.1 > share * highest)
                .collect(),
            worst,
        }
    }

    /// Estimated gain of halving each span: the sum over its sub-cells of the squared mean residuals beyond noise, in
    /// squares of the unit. Means above `cap` count as `cap`. Spans that cannot be cut, or whose gain is not
    /// significant, have 0.
    pub(super) fn energies(&self, strips: &SpanResiduals, cap: f64) -> Vec<f64> {
        let of_span = |a: usize| {
            let (excess, chance) = self.excess(strips, a, cap);
            let clear = excess > GAIN_SIGNIFICANCE * chance && strips.can_be_cut(a, self.criterion);
            if clear { excess } else { 0.0 }
        };
        (0..strips.spans()).map(of_span).collect()
    }

    /// The squared mean residuals of span a beyond noise, and the standard deviation of that sum by chance.
    fn excess(&self, strips: &SpanResiduals, a: usize, cap: f64) -> (f64, f64) {
        let variance = match self.criterion {
            Criterion::Bias => self.sigma * self.sigma,
            Criterion::Maximum => 0.0,
        };
        let (mut k, mut squares) = (0.0_f64, 0.0);
        for cell in strips.strip(a) {
            let n = cell.points;
            if n > 0.0 {
                let mean = (cell.sum / n).abs().min(cap);
                k += 1.0;
                squares += n * mean * mean;
            }
        }
        (squares - k * variance, (2.0 * k).sqrt() * variance)
    }

    /// The objective of refinement.
    pub(super) fn objective(&self, residuals: &[Residual], weights: &[f64]) -> f64 {
        let terms = residuals.iter().zip(weights);
        match self.criterion {
            Criterion::Bias => terms.map(|(r, w)| w * r.signed * r.signed).sum(),
            Criterion::Maximum => terms
                .filter(|&(_, &w)| w > OUTLIER_WEIGHT)
                .map(|(r, _)| {
                    (r.distance - SETTLED_DISTANCE * self.tolerance)
                        .max(0.0)
                        .powi(2)
                })
                .sum(),
        }
    }
}

/// The breakpoints after halving the marked spans, highest scores first, with at most `allowed` new knots; `None` if no
/// knot may be added.
pub(super) fn cut(breaks: &[f64], marks: &Marks, allowed: usize) -> Option<Vec<f64>> {
    let mut chosen = marks.spans.clone();
    chosen.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    chosen.truncate(allowed);
    let spans: Vec<usize> = chosen.into_iter().map(|s| s.0).collect();
    let out = cut_spans(breaks, &spans);
    (out.len() > breaks.len()).then_some(out)
}

/// The breakpoints after halving these spans, except those too narrow.
pub(super) fn cut_spans(breaks: &[f64], spans: &[usize]) -> Vec<f64> {
    let mut out = breaks.to_vec();
    for &a in spans {
        if breaks[a + 1] - breaks[a] > MIN_HALVED_SPAN {
            out.push(0.5 * (breaks[a] + breaks[a + 1]));
        }
    }
    out.sort_by(f64::total_cmp);
    out
}

/// Breakpoints for `spans` spans with the density of the given ones.
pub(super) fn respaced(breaks: &[f64], spans: usize) -> Vec<f64> {
    let old = breaks.len() - 1;
    (0..=spans)
        .map(|i| {
            let (a, rest) = (i * old / spans, i * old % spans);
            let next = breaks[(a + 1).min(old)];
            breaks[a] + rest as f64 / spans as f64 * (next - breaks[a])
        })
        .collect()
}

/// The derivative of order p along direction `d`, constant on each span, on each line of control points across.
fn highest_derivatives(fit: &Fit, d: usize) -> Vec<Vec<DVec3>> {
    let knots = &fit.space.knots[d];
    let breaks = &fit.space.breaks[d];
    let p = knots.degree();
    let (stride, along) = (fit.space.stride(), knots.control_point_count());
    let lines = fit.net.len() / along;
    let at = |i: usize, line: usize| match d {
        0 => fit.net[line * stride + i],
        _ => fit.net[i * stride + line],
    };
    let mut ders = vec![0.0; (p + 1) * (p + 1)];
    (0..breaks.len() - 1)
        .map(|s| {
            let middle = 0.5 * (breaks[s] + breaks[s + 1]);
            basis_derivatives(knots, s + p, middle, p, &mut ders);
            let highest = &ders[p * (p + 1)..];
            let of_line = |line: usize| {
                let terms = highest.iter().enumerate();
                terms.fold(DVec3::ZERO, |sum, (k, &b)| sum + b * at(s + k, line))
            };
            (0..lines).map(of_line).collect()
        })
        .collect()
}

/// Use of each interior breakpoint of direction `d`: the largest jump of the highest derivative there, times the knot
/// distance to the power of the degree. In the order of the breakpoints, from the second one (in a closed direction the
/// first one, at the seam, is never removed).
pub(super) fn knot_use(fit: &Fit, d: usize) -> Vec<f64> {
    let breaks = &fit.space.breaks[d];
    let p = fit.space.knots[d].degree();
    let of = highest_derivatives(fit, d);
    (1..breaks.len() - 1)
        .map(|r| {
            let h = 0.5 * (breaks[r + 1] - breaks[r - 1]);
            let jump = of[r - 1]
                .iter()
                .zip(&of[r])
                .map(|(a, b)| (*b - *a).length())
                .fold(0.0, f64::max);
            (0..p).fold(jump, |x, _| x * h)
        })
        .collect()
}

/// Fewest breakpoints of a direction; a closed one of degree p needs p + 2 to have distinct control points.
pub(super) fn fewest_breaks(degree: usize, closed: bool) -> usize {
    if closed { degree + 2 } else { 2 }
}

/// The first breakpoints of a direction.
pub(super) fn first_breaks(degree: usize, closed: bool) -> Vec<f64> {
    let spans = if closed {
        (degree + 1).max(CLOSED_START_SPANS)
    } else {
        OPEN_START_SPANS
    };
    (0..=spans).map(|i| i as f64 / spans as f64).collect()
}
