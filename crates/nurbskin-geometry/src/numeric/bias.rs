//! Whether signed deviations are noise, or biased somewhere.

use super::statistics::{SIGMA_PER_MAD, median_in_place, normal_exceeded, normal_tail};
use crate::math;
use std::collections::BTreeMap;

/// Tolerance, in standard deviations of the noise, from which on every point must be within it. Derived: one normal
/// error in 16,000 exceeds 4 sigma.
pub const ALL_WITHIN: f64 = 4.0;
/// Tolerance in standard deviations of the noise below which there is no verdict on the deviation. Derived: 95 % of normal noise is within.
pub const LEAST_TOLD: f64 = 2.0;
/// Default share of the points that must be within a tolerance. Derived: the contract of `--within`.
pub const USUAL_WITHIN: f64 = 0.995;
/// Points that a cell needs for its mean to count, and that cells are made to hold on average.
const CELL_POINTS: [usize; 2] = [5, 25];
/// Standard deviations from the median of its cell as which a point counts at most in the mean.
const REACH: f64 = 2.5;
/// Standard deviations of a mean that are never significant, however few cells are tested.
const LEAST_SIGNIFICANT: f64 = 3.5;
/// Part of the tolerance by which a mean may be off whatever the number of points.
const SLACK: f64 = 0.2;
/// Noise below this part of the tolerance takes no point beyond it.
const NOISE_SHARE: f64 = 0.1;
/// Chance of a perfect surface to fail in any cell.
const FALSE_ALARM: f64 = 0.01;
/// Expected events from which on the probability comes from the normal distribution.
const NORMAL_FROM: f64 = 500.0;
/// Most cells along one direction.
const MOST_CELLS: usize = 48;

/// A signed deviation at its place.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// Number of the surface.
    pub face: u32,
    /// First parameter of its place on it.
    pub u: f64,
    /// Second parameter of its place on it.
    pub v: f64,
    /// Signed distance from it, in the unit of the points.
    pub signed: f64,
}

/// What a cell may show before it counts as biased.
#[derive(Clone, Copy, Debug)]
pub struct Allowed {
    /// The tolerance.
    pub(crate) tolerance: f64,
    /// Standard deviation of the noise; may be zero.
    pub(crate) noise: f64,
    /// Mean deviation that is allowed whatever the number of points, the tolerance at most.
    pub offset: f64,
    /// Share of the points that may lie beyond the tolerance on one side, everywhere.
    pub(crate) beyond: f64,
    /// Whether a verdict is asked for: see [`in_verdicts`](Self::in_verdicts).
    pub(crate) verdict: bool,
}

impl Allowed {
    /// What a fit looks for: a fifth of the tolerance, and points that lie beyond it together.
    pub fn in_fits(tolerance: f64, noise: f64) -> Self {
        Self {
            tolerance,
            noise,
            offset: SLACK * tolerance,
            beyond: 0.0,
            verdict: false,
        }
    }

    /// What a verdict holds against the regions of `count` points of which the share `within` must keep the tolerance: the
    /// mean may be off by as much as still leaves that share within it. Its standard error comes from the scatter of the
    /// region's own points where that is wider than the noise, and a region holds half as many points as the average at
    /// least: one rough spot is no bias. Too many points beyond the tolerance count only where the plain mean is off by
    /// too much, too, and noise takes a part of the tolerance: without noise no number of them is left to chance.
    pub fn in_verdicts(tolerance: f64, noise: f64, within: f64, count: usize) -> Self {
        // All of n points are within where less than half a point is not.
        let beyond = (1.0 - within).max(0.5 / count.max(1) as f64);
        let room = normal_exceeded(beyond) * noise;
        Self {
            tolerance,
            noise,
            offset: (tolerance - room).max(SLACK * tolerance),
            beyond: 0.5 * (1.0 - within),
            verdict: true,
        }
    }

    /// Points that a region needs.
    fn fewest(&self) -> usize {
        match self.verdict {
            true => CELL_POINTS[1] / 2,
            false => CELL_POINTS[0],
        }
    }

    /// Whether points beyond the tolerance together count by themselves.
    fn counts_together(&self) -> bool {
        !self.verdict || self.noise >= NOISE_SHARE * self.tolerance
    }

    /// Probability that noise about a mean of `off` leaves a point beyond the tolerance.
    fn tail(&self, off: f64) -> f64 {
        if self.noise > 0.0 {
            normal_tail((self.tolerance - off) / self.noise)
        } else {
            0.0
        }
    }
}

/// What the cells of a grid over (u, v) say.
#[derive(Debug, Default)]
pub struct Bias {
    /// Cells with enough points.
    pub tested: usize,
    /// Those with a significant mean.
    pub biased: usize,
    /// The one of them whose mean is the largest by magnitude.
    pub worst: Option<Region>,
}

/// A biased cell.
#[derive(Debug)]
pub struct Region {
    /// Its mean deviation.
    pub mean: f64,
    /// Its points.
    pub points: Vec<usize>,
}

/// Tests the signed deviations of every cell: whether their mean is beyond what is allowed and what noise leaves of it, or
/// more points lie beyond the tolerance on one side than the share of outliers explains, or noise about a mean that is off
/// by as much as is allowed. Without noise the median stands for the mean. O(n log n).
pub fn bias(points: &[Placed], allowed: Allowed) -> Bias {
    let Allowed {
        tolerance, noise, ..
    } = allowed;
    let outside = points.iter().filter(|p| p.signed.abs() > tolerance).count();
    let cells = cells(points);
    let tested = || cells.iter().filter(|cell| cell.len() >= allowed.fewest());
    let mut out = Bias {
        tested: tested().count(),
        ..Bias::default()
    };
    let alarm = FALSE_ALARM / (2.0 * out.tested.max(1) as f64);
    let significant = normal_exceeded(alarm).max(LEAST_SIGNIFICANT);
    // Outliers lie on either side.
    let share = (0.5 * outside as f64 / points.len().max(1) as f64).max(allowed.beyond);
    for cell in tested() {
        let n = cell.len() as f64;
        let signed: Vec<f64> = cell.iter().map(|&k| points[k].signed).collect();
        let (median, mean) = clipped_mean(&signed, REACH * noise);
        let beyond = |side: f64| signed.iter().filter(|&d| side * d > tolerance).count();
        let (above, below) = (beyond(1.0), beyond(-1.0));
        let side = if above >= below { 1.0 } else { -1.0 };
        let off = (side * median).clamp(0.0, allowed.offset);
        let expected = n * share.max(allowed.tail(off));
        let limit = |scatter: f64| allowed.offset + significant * scatter / n.sqrt();
        let plain = signed.iter().sum::<f64>() / n;
        let together = allowed.counts_together()
            && poisson_tail(expected, above.abs_diff(below)) < alarm
            && (!allowed.verdict || plain.abs() > limit(noise));
        let scatter = match allowed.verdict {
            true => noise.max(scatter(&signed, median)),
            false => noise,
        };
        if together || mean.abs() > limit(scatter) {
            out.biased += 1;
            // Where some lie off together it is they who speak.
            let mean = if together { plain } else { mean };
            let worst = out.worst.as_ref().map_or(0.0, |worst| worst.mean.abs());
            if mean.abs() > worst {
                out.worst = Some(Region {
                    mean,
                    points: cell.clone(),
                });
            }
        }
    }
    out
}

/// The points by cells of grids over (u, v), one for each face, that hold a few dozen on average.
fn cells(points: &[Placed]) -> Vec<Vec<usize>> {
    if points.windows(2).all(|pair| pair[0].face == pair[1].face) {
        return cells_of_face(points, &(0..points.len()).collect::<Vec<_>>());
    }
    let mut of_face: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (k, point) in points.iter().enumerate() {
        of_face.entry(point.face).or_default().push(k);
    }
    let faces = of_face.values();
    faces
        .flat_map(|those| cells_of_face(points, those))
        .collect()
}

fn cells_of_face(points: &[Placed], those: &[usize]) -> Vec<Vec<usize>> {
    let mut side = 1;
    while side < MOST_CELLS && (side + 1) * (side + 1) * CELL_POINTS[1] <= those.len() {
        side += 1;
    }
    let range = |value: fn(&Placed) -> f64| {
        let none = (f64::INFINITY, f64::NEG_INFINITY);
        those.iter().fold(none, |(a, b), &k| {
            let x = value(&points[k]);
            (a.min(x), b.max(x))
        })
    };
    let (u, v) = (range(|p| p.u), range(|p| p.v));
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "clamped to 0..side"
    )]
    let place = |x: f64, (a, b): (f64, f64)| {
        let at = if b > a { (x - a) / (b - a) } else { 0.0 };
        ((at * side as f64).max(0.0) as usize).min(side - 1)
    };
    let mut cells = vec![Vec::new(); side * side];
    for &k in those {
        let p = &points[k];
        cells[place(p.v, v) * side + place(p.u, u)].push(k);
    }
    cells
}

/// The median of values, and their mean where each counts as at most `reach` away from it. Of normal ones with a standard deviation of
/// 0.4 reaches its own is that of the plain mean to 1 %.
///
/// Source: P. J. Huber, Robust estimation of a location parameter, 1964; one step from the median.
fn clipped_mean(values: &[f64], reach: f64) -> (f64, f64) {
    let median = median_in_place(&mut values.to_vec());
    let off: f64 = values
        .iter()
        .map(|x| (x - median).clamp(-reach, reach))
        .sum();
    (median, median + off / values.len().max(1) as f64)
}

/// The standard deviation of values about their median, from the median of their distances.
fn scatter(values: &[f64], median: f64) -> f64 {
    let mut off: Vec<f64> = values.iter().map(|x| (x - median).abs()).collect();
    SIGMA_PER_MAD * median_in_place(&mut off)
}

/// Probability of `count` or more events where `expected` happen on average.
pub fn poisson_tail(expected: f64, count: usize) -> f64 {
    if expected > NORMAL_FROM {
        // E. B. Wilson, M. M. Hilferty, The distribution of chi-square, 1931: cube roots are nearly normal.
        let k = count.max(1) as f64;
        let off = 1.0 - 1.0 / (9.0 * k) - math::cbrt(expected / k);
        return normal_tail((3.0 * k.sqrt() * off).max(0.0));
    }
    let mut term = math::exp(-expected);
    let mut below = 0.0;
    for k in 0..count {
        below += term;
        term *= expected / (k + 1) as f64;
    }
    if below < 0.999 {
        return 1.0 - below;
    }
    // What is left is summed by itself: the difference has lost its digits.
    let mut tail = 0.0;
    for k in count..count + 50 {
        tail += term;
        term *= expected / (k + 1) as f64;
    }
    tail
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A grid of 900 places with these signed deviations.
    fn grid(signed: impl Fn(usize, usize) -> f64) -> Vec<Placed> {
        let at = |k: usize| Placed {
            face: 0,
            u: (k % 30) as f64,
            v: (k / 30) as f64,
            signed: signed(k % 30, k / 30),
        };
        (0..900).map(at).collect()
    }

    #[test]
    fn a_region_is_biased_by_its_mean_and_by_points_beyond() {
        // +-1 by turns: a standard deviation of 1, and no mean.
        let sign = |i: usize, j: usize| if (i + j).is_multiple_of(2) { 1.0 } else { -1.0 };
        let inside = |i: usize, j: usize| i < 5 && j < 5;
        let none = bias(&grid(sign), Allowed::in_fits(3.0, 1.0));
        assert_eq!((none.tested, none.biased), (36, 0));
        // The limit is 0.6 + 3.6 / 5: the first region is off by more, or by less.
        let moved = |by: f64| grid(move |i, j| sign(i, j) + if inside(i, j) { by } else { 0.0 });
        assert_eq!(bias(&moved(1.2), Allowed::in_fits(3.0, 1.0)).biased, 0);
        assert_eq!(bias(&moved(1.5), Allowed::in_fits(3.0, 1.0)).biased, 1);
        // Four of 25 points beyond the tolerance on one side, and nowhere else.
        let beyond = grid(|i, j| if i < 2 && j < 2 { 3.5 } else { sign(i, j) });
        assert_eq!(bias(&beyond, Allowed::in_fits(3.0, 1.0)).biased, 1);
    }

    #[test]
    fn noise_about_a_mean_that_may_be_off_is_no_bias() {
        // 40 regions of 5,000 normal deviations each, the first of them off.
        let off = |by: f64, more: usize| {
            let at = |k: usize| {
                let z = normal_exceeded(((k % 2500) as f64 + 0.5) / 5000.0);
                let z = if (k / 2500).is_multiple_of(2) { z } else { -z };
                let first = if k < 5000 { by } else { 0.0 };
                let off = if k < more { 4.0 } else { z + first };
                (k / 5000, off)
            };
            let placed = |(place, signed): (usize, f64)| Placed {
                face: 0,
                u: (place % 8) as f64,
                v: (place / 8) as f64,
                signed,
            };
            bias(
                &(0..200_000).map(at).map(placed).collect::<Vec<_>>(),
                Allowed::in_fits(3.0, 1.0),
            )
        };
        assert_eq!(off(0.0, 0).biased, 0);
        assert_eq!(off(0.3, 0).biased, 0);
        assert_eq!(off(0.6, 0).biased, 0);
        assert_eq!(off(0.8, 0).biased, 1);
        // Points off together at a place where the mean is right are as before.
        assert_eq!(off(0.0, 60).biased, 1);
    }

    #[test]
    fn without_noise_the_median_decides() {
        let quiet = Allowed {
            tolerance: 1.0,
            noise: 0.0,
            offset: 1.0,
            beyond: 0.0025,
            verdict: true,
        };
        let corner =
            |by: f64, width: usize| grid(move |i, j| if i < width && j < 5 { by } else { 0.0 });
        // All of a region's 25 points.
        assert_eq!(bias(&corner(0.99, 5), quiet).biased, 0);
        let found = bias(&corner(1.01, 5), quiet);
        let worst = found.worst.unwrap();
        assert_eq!(
            (found.tested, found.biased, worst.points.len()),
            (36, 1, 25)
        );
        assert!((worst.mean - 1.01).abs() < 1e-12);
        // Ten of 25, whatever they are: the median is right, and without noise no number of points is a matter of chance.
        assert_eq!(bias(&corner(-2.6, 2), quiet).biased, 0);
        // With noise that takes a part of the tolerance so many are too many for chance.
        let noisy = Allowed {
            noise: 0.2,
            ..quiet
        };
        assert_eq!(bias(&corner(-4.0, 2), noisy).biased, 1);
        // A region whose own points scatter as widely as they are off is a rough spot.
        let rough = grid(|i, j| match i < 5 && j < 5 {
            true => ((5 * i + j) * 7 % 13) as f64 / 4.0,
            false => 0.0,
        });
        assert_eq!(bias(&rough, quiet).biased, 0);
        // Three points in a region of their own show nothing.
        let few: Vec<Placed> = grid(|_, _| 0.0)
            .into_iter()
            .filter(|p| p.u >= 5.0 || p.v >= 5.0)
            .chain((0..3).map(|k| Placed {
                face: 0,
                u: f64::from(k),
                v: 0.0,
                signed: 5.0,
            }))
            .collect();
        assert_eq!(bias(&few, quiet).biased, 0);
    }

    #[test]
    fn poisson_tails() {
        assert!((poisson_tail(0.1, 1) - 0.095_162_58).abs() < 1e-8);
        assert!((poisson_tail(0.1, 4) / 3.846_833e-6 - 1.0).abs() < 1e-6);
        assert!((poisson_tail(2.0, 3) - 0.323_323_58).abs() < 1e-8);
        assert!((poisson_tail(0.0, 0) - 1.0).abs() < 1e-15);
        // Both ways, where they meet.
        assert!(
            (poisson_tail(499.9, 600) / poisson_tail(500.1, 600))
                .ln()
                .abs()
                < 1.0
        );
    }
}
