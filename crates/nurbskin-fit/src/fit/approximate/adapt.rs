//! Knots where the error is: which spans to cut, in which direction, and which knots to take out again.

use super::span_residuals::{Gathered, SpanResiduals};
use crate::fit::least_squares::samples::Residual;
use crate::fit::least_squares::spline_space::Fit;
use nurbskin_geometry::DVec3;
use nurbskin_geometry::nurbs::basis::basis_derivatives;

/// Fewest points of a sub-cell whose mean says anything.
const FEWEST: f64 = 5.0;
/// Standard deviations of a mean that are not yet significant.
const SIGNIFICANT: f64 = 3.5;
/// Part of the tolerance that a mean error may take.
const BIAS_SHARE: f64 = 0.2;

/// Spans of the other direction that are judged together where single cells say nothing.
const WINDOW: usize = 3;
/// Standard deviations, as of a normal variable, by which the squared means of such a window must exceed noise: by chance
/// one window in 30 000 does.
const POOLED: f64 = 4.0;
/// Root mean square error that a window may have, in tolerances.
const POOLED_SHARE: f64 = 0.2;
/// The same for what a cut could gain.
const CLEAR_EXCESS: f64 = 2.0;
/// Part of the highest score of a round from which on a span is cut in the same round; the others wait, since the cuts may mend
/// them.
const CUT_SHARE_OF_BIAS: f64 = 0.35;
/// The same for exact points, whose highest score is that of a single point.
const CUT_SHARE_OF_MAXIMUM: f64 = 0.6;
/// Distance, in tolerances, below which an exact point does not count for what refinement brings down.
const SETTLED: f64 = 0.7;
/// Narrower spans are not halved.
const NARROWEST: f64 = 1e-6;
/// Points with less weight do not count as points of the surface.
pub(super) const OUTLIER_WEIGHT: f64 = 0.05;

/// When a surface is good enough.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Criterion {
    /// Noise is part of the tolerance: the mean signed distance of every small cell must be below 0.2 tolerances or
    /// within 3.5 of its standard deviations.
    Bias,
    /// The points are exact: every distance must be below the tolerance.
    Maximum,
}

/// What a criterion says about one direction.
#[derive(Clone, Debug, Default)]
pub(super) struct Marks {
    /// Spans to cut with their score, in order of the spans.
    pub(super) spans: Vec<(usize, f64)>,
    /// The largest score, 1 = just good enough; of spans that cannot be cut as well.
    pub(super) worst: f64,
}

/// The measure of fit that marks, gains and removals share.
#[derive(Clone, Copy, Debug)]
pub(super) struct Measure {
    pub(super) criterion: Criterion,
    pub(super) tolerance: f64,
    pub(super) sigma: f64,
}

impl Measure {
    /// The spans of direction `d` in which the surface is not good enough, where they hold enough points to be cut.
    pub(super) fn marks(&self, levels: &[SpanResiduals]) -> Marks {
        let score = |cell: &Gathered| match self.criterion {
            Criterion::Maximum => cell.largest / self.tolerance,
            Criterion::Bias if cell.points < FEWEST => 0.0,
            Criterion::Bias => {
                let n = cell.points;
                let excess = (cell.sum / n).abs() - SIGNIFICANT * self.sigma / n.sqrt();
                (excess / (BIAS_SHARE * self.tolerance)).max(0.0)
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

    /// The spans of direction `d` where the mean residuals of neighbouring sub-cells or lines, taken together, are larger than noise
    /// explains, though no single one is; only where noise is part of the tolerance. A score of 1 is a root mean square
    /// error of [`POOLED_SHARE`] tolerances.
    pub(super) fn pooled_marks(&self, levels: &[SpanResiduals]) -> Marks {
        if self.criterion == Criterion::Maximum || self.sigma <= 0.0 {
            return Marks::default();
        }
        let variance = self.sigma * self.sigma;
        let window = |strips: &SpanResiduals, a: usize, from: usize| {
            let (mut k, mut points, mut squares) = (0.0_f64, 0.0, 0.0);
            let [_, across] = strips.parts();
            let to = (from + WINDOW).min(across);
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
            // How far they go by chance, by Wilson and Hilferty's cube root of chi squared: with few of them farther than
            // so many of its standard deviations.
            let ninth = 2.0 / (9.0 * k.max(1.0));
            let limit = k * ((1.0 - ninth + POOLED * ninth.sqrt()).powi(3) - 1.0);
            if excess > limit * variance {
                (excess / points).sqrt() / (POOLED_SHARE * self.tolerance)
            } else {
                0.0
            }
        };
        self.chosen(levels, CUT_SHARE_OF_BIAS, |strips, a| {
            let windows = 0..(strips.parts()[1] + 1).saturating_sub(WINDOW).max(1);
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
        // Details only count where the larger cells are content: they would scatter the first cuts.
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

    /// What could be gained by cutting each span: the sum over its sub-cells of the squared mean residuals that noise does
    /// not explain, in squares of the unit; means above `cap` count as that. Spans that cannot be cut, or where that may
    /// be chance, gain nothing.
    pub(super) fn energies(&self, strips: &SpanResiduals, cap: f64) -> Vec<f64> {
        let of_span = |a: usize| {
            let (excess, chance) = self.excess(strips, a, cap);
            let clear = excess > CLEAR_EXCESS * chance && strips.can_be_cut(a, self.criterion);
            if clear { excess } else { 0.0 }
        };
        (0..strips.spans()).map(of_span).collect()
    }

    /// The squared mean residuals of span a that noise does not explain, and the standard deviation of that by chance.
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

    /// What refinement brings down.
    pub(super) fn objective(&self, residuals: &[Residual], weights: &[f64]) -> f64 {
        let terms = residuals.iter().zip(weights);
        match self.criterion {
            Criterion::Bias => terms.map(|(r, w)| w * r.signed * r.signed).sum(),
            Criterion::Maximum => terms
                .filter(|&(_, &w)| w > OUTLIER_WEIGHT)
                .map(|(r, _)| (r.distance - SETTLED * self.tolerance).max(0.0).powi(2))
                .sum(),
        }
    }
}

/// The breakpoints with the marked spans halved, best scores first as far as `allowed` new knots go; `None` if no knot
/// may be added.
pub(super) fn cut(breaks: &[f64], marks: &Marks, allowed: usize) -> Option<Vec<f64>> {
    let mut chosen = marks.spans.clone();
    chosen.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    chosen.truncate(allowed);
    let spans: Vec<usize> = chosen.into_iter().map(|s| s.0).collect();
    let out = cut_spans(breaks, &spans);
    (out.len() > breaks.len()).then_some(out)
}

/// The breakpoints with these spans halved, as far as the numbers have digits for it.
pub(super) fn cut_spans(breaks: &[f64], spans: &[usize]) -> Vec<f64> {
    let mut out = breaks.to_vec();
    for &a in spans {
        if breaks[a + 1] - breaks[a] > NARROWEST {
            out.push(0.5 * (breaks[a] + breaks[a + 1]));
        }
    }
    out.sort_by(f64::total_cmp);
    out
}

/// The breakpoints of so many spans that lie as dense as these.
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

/// For each interior breakpoint of direction `d` how much the surface uses it: the largest jump of the highest
/// derivative there, times the knot distance to the power of the degree. In the order of the breakpoints, from the second
/// one (in a closed direction the first one, at the seam, is never taken out).
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

/// Fewest breakpoints that a closed direction of degree p keeps, so that its control points are distinct.
pub(super) fn fewest_breaks(degree: usize, closed: bool) -> usize {
    if closed { degree + 2 } else { 2 }
}

/// The first breakpoints of a direction.
pub(super) fn first_breaks(degree: usize, closed: bool) -> Vec<f64> {
    let spans = if closed { (degree + 1).max(4) } else { 2 };
    (0..=spans).map(|i| i as f64 / spans as f64).collect()
}
