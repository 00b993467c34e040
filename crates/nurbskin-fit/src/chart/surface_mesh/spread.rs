//! Even spacing: a monotone map of u or v after which iso-lines are evenly spaced on average.
//!
//! The speed at u is the root mean square of `|S_u|` over the line, from the areas of triangles in 512 bins. The map is
//! its normalised integral, piecewise quadratic and with a continuous derivative:
//!
//! ```text
//! m(u) = ∫_0^u speed / ∫_0^1 speed
//! ```
//!
//! Source: reparametrisation by arc length, averaged over lines; ours.

use super::layout::Piece;

/// Bins along a direction. Guard: more than the lines of any chart need; a bin still holds many triangles.
const SPEED_BINS: usize = 512;
/// Rounds of binomial smoothing of the speeds. Trial: not recorded. Fewer let single triangles bend the lines.
const SPEED_SMOOTHINGS: usize = 3;
/// Largest factor between a speed and the mean. Guard: keeps the map monotone and finite.
const MAX_SPEED_RATIO: f64 = 1e4;
/// Extent of a triangle, in whole domains, above which it is left out. Guard: only a failed layout has such.
const MAX_TRIANGLE_EXTENT: f64 = 2.0;

/// A monotone map of 0..=1 onto itself with a continuous derivative.
#[derive(Clone, Debug)]
pub(super) struct Monotone {
    closed: bool,
    /// Derivative at the middles of the bins.
    slopes: Vec<f64>,
    /// Value at the middle of each bin.
    values: Vec<f64>,
}

impl Monotone {
    fn new(mut slopes: Vec<f64>, closed: bool) -> Self {
        let n = slopes.len();
        let h = 1.0 / n as f64;
        // Trapezoids between the middles of bins; the slope is constant at the ends unless they meet.
        let (first, last) = (slopes[0], slopes[n - 1]);
        let at_zero = if closed { 0.5 * (first + last) } else { first };
        let at_one = if closed { at_zero } else { last };
        let mut values = vec![0.25 * h * (at_zero + first)];
        for k in 1..n {
            values.push(values[k - 1] + 0.5 * h * (slopes[k - 1] + slopes[k]));
        }
        let whole = values[n - 1] + 0.25 * h * (last + at_one);
        for x in slopes.iter_mut().chain(&mut values) {
            *x /= whole;
        }
        Self {
            closed,
            slopes,
            values,
        }
    }

    /// The value at any x. Outside of 0..=1, closed maps add whole turns and open ones continue straight.
    pub(super) fn at(&self, x: f64) -> f64 {
        let n = self.slopes.len();
        let turns = if self.closed { x.floor() } else { 0.0 };
        let inside = (x - turns).clamp(0.0, 1.0);
        let beyond = x - turns - inside;
        let x = inside;
        let at = x * n as f64 - 0.5;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the bins"
        )]
        let k = at.max(0.0) as usize;
        let k = k.min(n - 1);
        let t = at - k as f64;
        let other = if self.closed {
            if t < 0.0 {
                self.slopes[n - 1]
            } else {
                self.slopes[(k + 1) % n]
            }
        } else if t < 0.0 || k + 1 == n {
            self.slopes[k]
        } else {
            self.slopes[k + 1]
        };
        let bend = 0.5 * t * t.abs() * (other - self.slopes[k]) * if t < 0.0 { -1.0 } else { 1.0 };
        let sum = self.values[k] + (self.slopes[k] * t + bend) / n as f64;
        let end = if beyond < 0.0 {
            self.slopes[0]
        } else {
            self.slopes[n - 1]
        };
        turns + sum.clamp(0.0, 1.0) + end * beyond
    }
}

/// The map after which lines across `axis` (0 = u, 1 = v) are evenly spaced, by the root mean square length of the
/// surface along `axis` over each line. O(n).
pub(super) fn evenly(pieces: &[Piece], axis: usize, closed: bool) -> Monotone {
    let mut sums = vec![[0.0; 2]; SPEED_BINS];
    for &Piece { at, du, dv, twice } in pieces.iter().filter(|piece| piece.twice > 0.0) {
        let square = [du, dv][axis].length_squared() / (twice * twice);
        if square.is_finite() {
            deposit(
                &mut sums,
                at.map(|p| p[axis]),
                [square * twice, twice],
                closed,
            );
        }
    }
    let speed = |[sum, area]: &[f64; 2]| (*area > 0.0).then(|| (sum / area).sqrt());
    let mut speeds: Vec<Option<f64>> = sums.iter().map(speed).collect();
    let known = speeds.iter().flatten().count();
    let mean = speeds.iter().flatten().sum::<f64>() / known.max(1) as f64;
    if known == 0 || mean <= 0.0 {
        return Monotone::new(vec![1.0; SPEED_BINS], closed);
    }
    // An empty bin takes the speed of the one before; the first ones take that of the first bin with data.
    let first = speeds.iter().flatten().next().copied().unwrap_or(mean);
    let mut last = first;
    for speed in &mut speeds {
        last = speed.unwrap_or(last);
        *speed = Some(last);
    }
    let mut slopes: Vec<f64> = speeds
        .iter()
        .flatten()
        .map(|s| s.clamp(mean / MAX_SPEED_RATIO, mean * MAX_SPEED_RATIO))
        .collect();
    for _ in 0..SPEED_SMOOTHINGS {
        let n = slopes.len();
        let wrapped = |k: usize, back: bool| match (k, back, closed) {
            (0, true, true) => n - 1,
            (0, true, false) => 0,
            (k, true, _) => k - 1,
            (k, false, true) => (k + 1) % n,
            (k, false, false) => (k + 1).min(n - 1),
        };
        slopes = (0..n)
            .map(|k| {
                0.25 * (slopes[wrapped(k, true)] + 2.0 * slopes[k] + slopes[wrapped(k, false)])
            })
            .collect();
    }
    Monotone::new(slopes, closed)
}

/// Distributes `amounts` over the bins that a triangle with these coordinates overlaps, by its area in each.
fn deposit(sums: &mut [[f64; 2]], mut x: [f64; 3], amounts: [f64; 2], closed: bool) {
    x.sort_unstable_by(f64::total_cmp);
    let n = sums.len() as f64;
    let [low, middle, high] = x.map(|x| x * n);
    if !(low.is_finite() && high.is_finite()) || high - low > MAX_TRIANGLE_EXTENT * n {
        return;
    }
    // Share of the triangle below a coordinate.
    let below = |c: f64| {
        if c <= low {
            0.0
        } else if c >= high {
            1.0
        } else if c < middle {
            (c - low) * (c - low) / ((middle - low) * (high - low))
        } else {
            1.0 - (high - c) * (high - c) / ((high - middle).max(f64::MIN_POSITIVE) * (high - low))
        }
    };
    let mut bin = low.floor();
    let mut before = 0.0;
    loop {
        let upto = below(bin + 1.0);
        let place = if closed {
            bin.rem_euclid(n)
        } else {
            bin.clamp(0.0, n - 1.0)
        };
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "within the bins"
        )]
        let sum = &mut sums[(place as usize).min(sums.len() - 1)];
        sum[0] += (upto - before) * amounts[0];
        sum[1] += (upto - before) * amounts[1];
        before = upto;
        bin += 1.0;
        if bin >= high || upto >= 1.0 {
            break;
        }
    }
}
