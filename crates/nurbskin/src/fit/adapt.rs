//! Knots where the error is: which spans to cut, in which direction, and which knots to take out again.

use super::samples::{Residual, Samples};
use super::space::{Fit, Space};
use crate::DVec3;
use crate::nurbs::basis::basis_derivatives;

/// Sub-cells per span: an error that changes sign within a span does not average out.
const PARTS: usize = 3;
/// Fewest points of a sub-cell whose mean says anything.
const FEWEST: f64 = 5.0;
/// Standard deviations of a mean that are not yet significant.
const SIGNIFICANT: f64 = 3.5;
/// Part of the tolerance that a mean error may take.
const BIAS_SHARE: f64 = 0.2;

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
    pub(super) fn marks(
        &self,
        space: &Space,
        samples: &Samples,
        residuals: &[Residual],
        weights: &[f64],
        d: usize,
    ) -> Marks {
        let spans = space.spans();
        let (own, other) = (spans[d], spans[1 - d]);
        let breaks = &space.breaks[d];
        let mut count = vec![0.0_f64; own * PARTS * other];
        let mut sum = vec![0.0_f64; count.len()];
        let mut largest = vec![0.0_f64; count.len()];
        for (k, r) in residuals.iter().enumerate() {
            if weights[k] <= 0.05 {
                continue;
            }
            let t = samples.parameters[k].to_array();
            let a = space.span(d, t[d]);
            let b = space.span(1 - d, t[1 - d]);
            let within = (t[d] - breaks[a]) / (breaks[a + 1] - breaks[a]);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a fraction of a span"
            )]
            let part = ((within * PARTS as f64) as usize).min(PARTS - 1);
            let cell = (a * PARTS + part) * other + b;
            count[cell] += 1.0;
            sum[cell] += r.signed;
            largest[cell] = largest[cell].max(r.distance);
        }
        let score = |cell: usize| match self.criterion {
            Criterion::Maximum => largest[cell] / self.tolerance,
            Criterion::Bias if count[cell] < FEWEST => 0.0,
            Criterion::Bias => {
                let n = count[cell];
                let excess = (sum[cell] / n).abs() - SIGNIFICANT * self.sigma / n.sqrt();
                (excess / (BIAS_SHARE * self.tolerance)).max(0.0)
            }
        };
        let scores: Vec<f64> = (0..own)
            .map(|a| {
                let cells = a * PARTS * other..(a + 1) * PARTS * other;
                cells.map(score).fold(0.0, f64::max)
            })
            .collect();
        let worst = scores.iter().copied().fold(0.0, f64::max);
        let enough = |a: usize| {
            let strip = &count[a * PARTS * other..(a + 1) * PARTS * other];
            let points: f64 = strip.iter().sum();
            let used = (0..other)
                .filter(|b| (0..PARTS).any(|h| strip[h * other + b] > 0.0))
                .count() as f64;
            match self.criterion {
                Criterion::Bias => points > 4.0 * (used + 3.0),
                Criterion::Maximum => {
                    let part = |h: usize| strip[h * other..(h + 1) * other].iter().sum::<f64>();
                    points >= used && part(0) + part(1) > 0.0 && part(1) + part(2) > 0.0
                }
            }
        };
        let share = match self.criterion {
            Criterion::Bias => 0.35,
            Criterion::Maximum => 0.6,
        };
        let spans = (0..own)
            .filter(|&a| scores[a] > 1.0 && enough(a))
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

    /// What refinement brings down.
    pub(super) fn objective(&self, residuals: &[Residual], weights: &[f64]) -> f64 {
        let terms = residuals.iter().zip(weights);
        match self.criterion {
            Criterion::Bias => terms.map(|(r, w)| w * r.signed * r.signed).sum(),
            Criterion::Maximum => terms
                .filter(|&(_, &w)| w > 0.05)
                .map(|(r, _)| (r.distance - 0.7 * self.tolerance).max(0.0).powi(2))
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
    let mut out = breaks.to_vec();
    for (a, _) in chosen {
        let middle = 0.5 * (breaks[a] + breaks[a + 1]);
        // Spans are halved until the numbers run out of digits.
        if breaks[a + 1] - breaks[a] > 1e-6 {
            out.push(middle);
        }
    }
    out.sort_by(f64::total_cmp);
    (out.len() > breaks.len()).then_some(out)
}

/// For each interior breakpoint of direction `d` how much the surface uses it: the largest jump of the highest
/// derivative there, times the knot distance to the power of the degree. In the order of the breakpoints, from the second
/// one (in a closed direction the first one, at the seam, is never taken out).
pub(super) fn knot_use(fit: &Fit, d: usize) -> Vec<f64> {
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
    let highest: Vec<Vec<f64>> = (0..breaks.len() - 1)
        .map(|s| {
            basis_derivatives(
                knots,
                s + p,
                0.5 * (breaks[s] + breaks[s + 1]),
                p,
                &mut ders,
            );
            ders[p * (p + 1)..].to_vec()
        })
        .collect();
    let derivative = |s: usize, line: usize| {
        let terms = highest[s].iter().enumerate();
        terms.fold(DVec3::ZERO, |sum, (k, &b)| sum + b * at(s + k, line))
    };
    (1..breaks.len() - 1)
        .map(|r| {
            let h = 0.5 * (breaks[r + 1] - breaks[r - 1]);
            let jump = (0..lines)
                .map(|line| (derivative(r, line) - derivative(r - 1, line)).length())
                .fold(0.0, f64::max);
            (0..p).fold(jump, |x, _| x * h)
        })
        .collect()
}

/// The breakpoints without the interior one number `r`.
pub(super) fn without(breaks: &[f64], r: usize) -> Vec<f64> {
    let mut out = breaks.to_vec();
    out.remove(r);
    out
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
