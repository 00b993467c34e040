//! Knots where the error is: which spans to cut, in which direction, and which knots to take out again.

use super::samples::{Residual, Samples, map_blocks};
use super::space::{Fit, Space};
use crate::DVec3;
use crate::nurbs::basis::basis_derivatives;

/// Sub-cells along a span: an error that changes sign within a span does not average out.
const PARTS: usize = 3;
/// Points of the smallest sub-cells; large spans are looked at in such detail as well.
const DETAIL: f64 = 25.0;
/// Points of the smallest lines of cells that are judged as one, along the whole surface; and most of them in a span.
const LINE: f64 = 45.0;
const LINES: f64 = 64.0;
/// Fewest points of a sub-cell whose mean says anything.
const FEWEST: f64 = 5.0;
/// Standard deviations of a mean that are not yet significant.
const SIGNIFICANT: f64 = 3.5;
/// Part of the tolerance that a mean error may take.
const BIAS_SHARE: f64 = 0.2;

/// Parts per span across that stand for one part across all spans.
const WHOLE: usize = 0;

/// Spans of the other direction that are judged together where single cells say nothing.
const WINDOW: usize = 3;
/// Standard deviations, as of a normal variable, by which the squared means of such a window must exceed noise: by chance
/// one window in 30 000 does.
const POOLED: f64 = 4.0;
/// Root mean square error that a window may have, in tolerances.
const POOLED_SHARE: f64 = 0.2;
/// The same for what a cut could gain.
const CLEAR_EXCESS: f64 = 2.0;
/// Points that a strip must hold per control point that its cut adds.
const PER_CONTROL_POINT: f64 = 4.0;
/// Narrower spans are not halved.
const NARROWEST: f64 = 1e-6;
/// Blocks in which residuals are gathered; fixed, so that sums do not depend on the number of threads.
const BLOCKS: usize = 4;
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

/// Residuals gathered over the spans of one direction, each cut into parts, times the (parts of) spans of the other.
#[derive(Debug)]
pub(super) struct Strips {
    own: usize,
    /// Sub-cells along a span, and across: those of all spans of the other direction.
    parts: [usize; 2],
    /// Per sub-cell `(a * parts[0] + part) * parts[1] + b`: points, sum of signed residuals, largest distance.
    count: Vec<f64>,
    sum: Vec<f64>,
    largest: Vec<f64>,
    /// Whether a sub-cell goes across all spans of the other direction.
    across_all: bool,
}

impl Strips {
    /// The strips of direction `d`, in three parts per span and one per span across; where those hold many points, in
    /// detail as well; and, where points have noise, in lines across all spans.
    pub(super) fn levels(
        space: &Space,
        samples: &Samples,
        residuals: &[Residual],
        weights: &[f64],
        d: usize,
        criterion: Criterion,
    ) -> Vec<Self> {
        let spans = space.spans();
        let mut out = vec![Self::new(space, samples, residuals, weights, d, [PARTS, 1])];
        let wanted = samples.len() as f64 / (spans[0] * spans[1]) as f64 / DETAIL;
        if wanted > 2.0 * PARTS as f64 {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "2..=64"
            )]
            let fine = wanted.sqrt().clamp(2.0, 64.0).round() as usize;
            let parts = [fine.max(PARTS), fine];
            out.push(Self::new(space, samples, residuals, weights, d, parts));
        }
        // What is off by the same all along an edge, or around, shows in narrow lines though in no cell.
        let lines = samples.len() as f64 / spans[d] as f64 / LINE;
        if criterion == Criterion::Bias && lines > PARTS as f64 {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "3..=64"
            )]
            let parts = [lines.min(LINES).round() as usize, WHOLE];
            out.push(Self::new(space, samples, residuals, weights, d, parts));
        }
        out
    }

    /// The strips of direction `d`, in three parts per span and one per span across.
    pub(super) fn coarse(
        space: &Space,
        samples: &Samples,
        residuals: &[Residual],
        weights: &[f64],
        d: usize,
    ) -> Self {
        Self::new(space, samples, residuals, weights, d, [PARTS, 1])
    }

    /// Outliers do not count.
    fn new(
        space: &Space,
        samples: &Samples,
        residuals: &[Residual],
        weights: &[f64],
        d: usize,
        per_span: [usize; 2],
    ) -> Self {
        let spans = space.spans();
        let (own, other) = (spans[d], spans[1 - d]);
        let parts = [per_span[0], (per_span[1] * other).max(1)];
        let size = own * parts[0] * parts[1];
        let mut this = Self {
            own,
            parts,
            count: vec![0.0; size],
            sum: vec![0.0; size],
            largest: vec![0.0; size],
            across_all: per_span[1] == WHOLE,
        };
        let part = |direction: usize, t: f64, parts: usize| {
            let breaks = &space.breaks[direction];
            let a = space.span(direction, t);
            let within = (t - breaks[a]) / (breaks[a + 1] - breaks[a]);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "a fraction of a span"
            )]
            let part = ((within * parts as f64) as usize).min(parts - 1);
            a * parts + part
        };
        // In blocks of samples on all cores, added up in order.
        let blocks = map_blocks(BLOCKS, |block| {
            let (mut count, mut sum, mut largest) =
                (vec![0.0; size], vec![0.0; size], vec![0.0_f64; size]);
            let n = residuals.len();
            for k in block * n / BLOCKS..(block + 1) * n / BLOCKS {
                if weights[k] <= OUTLIER_WEIGHT {
                    continue;
                }
                let r = &residuals[k];
                // Noise moves parameters, but hardly feet: narrow lines would take from rows of points those with noise of
                // one sign.
                let t = match per_span[1] {
                    WHOLE => r.foot.to_array(),
                    _ => samples.parameters[k].to_array(),
                };
                let along = part(d, t[d], per_span[0]);
                let across = match per_span[1] {
                    WHOLE => 0,
                    parts => part(1 - d, t[1 - d], parts),
                };
                let cell = along * parts[1] + across;
                count[cell] += 1.0;
                sum[cell] += r.signed;
                largest[cell] = largest[cell].max(r.distance);
            }
            [count, sum, largest]
        });
        for [count, sum, largest] in blocks {
            this.count.iter_mut().zip(count).for_each(|(x, y)| *x += y);
            this.sum.iter_mut().zip(sum).for_each(|(x, y)| *x += y);
            let both = this.largest.iter_mut().zip(largest);
            both.for_each(|(x, y)| *x = x.max(y));
        }
        this
    }
    /// The absolute mean residuals of the sub-cells.
    pub(super) fn means(&self) -> impl Iterator<Item = f64> {
        let cells = self.count.iter().zip(&self.sum);
        cells.filter(|c| *c.0 > 0.0).map(|(n, s)| (s / n).abs())
    }
    /// The sub-cells of span a.
    fn cells(&self, a: usize) -> std::ops::Range<usize> {
        let strip = self.parts[0] * self.parts[1];
        a * strip..(a + 1) * strip
    }
    /// Whether both halves of span a hold several points per control point: ragged rims do not.
    fn is_well_supported(&self, a: usize) -> bool {
        let (used, halves) = self.support(a);
        halves.iter().all(|&n| n > PER_CONTROL_POINT * (used + 3.0))
    }
    /// How many sub-cells across span a have points, and how many points its halves hold; of strips in three parts.
    fn support(&self, a: usize) -> (f64, [f64; 2]) {
        let strip = &self.count[self.cells(a)];
        let [along, across] = self.parts;
        let used = (0..across)
            .filter(|b| (0..along).any(|h| strip[h * across + b] > 0.0))
            .count() as f64;
        let part = |h: usize| strip[h * across..(h + 1) * across].iter().sum::<f64>();
        let middle = 0.5 * part(1);
        (used, [part(0) + middle, middle + part(2)])
    }
    /// Whether span a holds enough points for one more row of control points.
    fn can_be_cut(&self, a: usize, criterion: Criterion) -> bool {
        let (used, halves) = self.support(a);
        let points = halves[0] + halves[1];
        match criterion {
            // Neither half may be left to fairness.
            Criterion::Bias => {
                points > PER_CONTROL_POINT * (used + 3.0) && halves.iter().all(|&n| n > used + 3.0)
            }
            Criterion::Maximum => points >= used && halves.iter().all(|&n| n > 0.0),
        }
    }
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
    pub(super) fn marks(&self, levels: &[Strips]) -> Marks {
        let score = |strips: &Strips, cell: usize| match self.criterion {
            Criterion::Maximum => strips.largest[cell] / self.tolerance,
            Criterion::Bias if strips.count[cell] < FEWEST => 0.0,
            Criterion::Bias => {
                let n = strips.count[cell];
                let excess = (strips.sum[cell] / n).abs() - SIGNIFICANT * self.sigma / n.sqrt();
                (excess / (BIAS_SHARE * self.tolerance)).max(0.0)
            }
        };
        let share = match self.criterion {
            Criterion::Bias => 0.35,
            Criterion::Maximum => 0.6,
        };
        self.chosen(levels, share, |strips, a| {
            strips
                .cells(a)
                .map(|c| score(strips, c))
                .fold(0.0, f64::max)
        })
    }

    /// The spans of direction `d` where the mean residuals of neighbouring sub-cells or lines, taken together, are larger than noise
    /// explains, though no single one is; only where noise is part of the tolerance. A score of 1 is a root mean square
    /// error of [`POOLED_SHARE`] tolerances.
    pub(super) fn pooled_marks(&self, levels: &[Strips]) -> Marks {
        if self.criterion == Criterion::Maximum || self.sigma <= 0.0 {
            return Marks::default();
        }
        let variance = self.sigma * self.sigma;
        let window = |strips: &Strips, a: usize, from: usize| {
            let (mut k, mut points, mut squares) = (0.0_f64, 0.0, 0.0);
            let to = (from + WINDOW).min(strips.parts[1]);
            for cell in strips.cells(a) {
                let n = strips.count[cell];
                if (from..to).contains(&(cell % strips.parts[1])) && n > 0.0 {
                    k += 1.0;
                    points += n;
                    squares += strips.sum[cell].powi(2) / n;
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
        self.chosen(levels, 0.35, |strips, a| {
            let windows = 0..(strips.parts[1] + 1).saturating_sub(WINDOW).max(1);
            windows.map(|b| window(strips, a, b)).fold(0.0, f64::max)
        })
    }

    /// The spans with a score above 1 and above `share` of the largest that can be cut.
    fn chosen(
        &self,
        levels: &[Strips],
        share: f64,
        score: impl Fn(&Strips, usize) -> f64,
    ) -> Marks {
        let Some(coarse) = levels.first() else {
            return Marks::default();
        };
        let of_level = |strips: &Strips| -> Vec<f64> {
            let of_span = |a: usize| match strips.across_all && !coarse.is_well_supported(a) {
                true => 0.0,
                false => score(strips, a),
            };
            (0..strips.own).map(of_span).collect()
        };
        let scores: Vec<Vec<f64>> = levels.iter().map(of_level).collect();
        let largest = |scores: &Vec<f64>| scores.iter().copied().fold(0.0, f64::max);
        let worst = scores.iter().map(largest).fold(0.0, f64::max);
        // Details only count where the larger cells are content: they would scatter the first cuts.
        let scores = scores
            .iter()
            .find(|s| largest(s) > 1.0)
            .unwrap_or(&scores[0]);
        let spans = (0..coarse.own)
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
    pub(super) fn energies(&self, strips: &Strips, cap: f64) -> Vec<f64> {
        let of_span = |a: usize| {
            let (excess, chance) = self.excess(strips, a, cap);
            let clear = excess > CLEAR_EXCESS * chance && strips.can_be_cut(a, self.criterion);
            if clear { excess } else { 0.0 }
        };
        (0..strips.own).map(of_span).collect()
    }

    /// The squared mean residuals of span a that noise does not explain, and the standard deviation of that by chance.
    fn excess(&self, strips: &Strips, a: usize, cap: f64) -> (f64, f64) {
        let variance = match self.criterion {
            Criterion::Bias => self.sigma * self.sigma,
            Criterion::Maximum => 0.0,
        };
        let (mut k, mut squares) = (0.0_f64, 0.0);
        for cell in strips.cells(a) {
            let n = strips.count[cell];
            if n > 0.0 {
                let mean = (strips.sum[cell] / n).abs().min(cap);
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
