//! Robust statistics: quantiles, median absolute deviation.

use crate::math;

/// Ratio of the standard deviation to the median absolute deviation of a normal distribution, 1 / Phi^-1(3/4).
pub const SIGMA_PER_MAD: f64 = 1.482_602_218_505_602;

/// The `fraction` quantile (0..=1) of `values`, which are reordered; linear between the two nearest ranks. NaN for no
/// values. O(n).
#[must_use]
pub fn quantile_in_place(values: &mut [f64], fraction: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else {
        return f64::NAN;
    };
    let rank = fraction.clamp(0.0, 1.0) * last as f64;
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "0 <= rank <= last"
    )]
    let below = (rank.floor() as usize).min(last);
    let (_, &mut low, above) = values.select_nth_unstable_by(below, f64::total_cmp);
    let high = above.iter().copied().min_by(f64::total_cmp).unwrap_or(low);
    low + (high - low) * (rank - below as f64)
}

/// The median of `values`, which are reordered; NaN for none. O(n).
#[must_use]
pub fn median_in_place(values: &mut [f64]) -> f64 {
    quantile_in_place(values, 0.5)
}

/// Standard deviation estimated from the median absolute deviation from `centre`: half of the values may be wild
/// without harm. NaN for no values. O(n).
#[must_use]
pub fn robust_sigma(values: &[f64], centre: f64) -> f64 {
    let mut absolute: Vec<f64> = values.iter().map(|x| (x - centre).abs()).collect();
    SIGMA_PER_MAD * median_in_place(&mut absolute)
}

/// The standard deviations that a normal variable exceeds with probability `p` (0..=0.5), to 5e-4; infinite for 0.
///
/// Source: Abramowitz and Stegun, *Handbook of Mathematical Functions*, 26.2.23.
#[must_use]
pub fn normal_exceeded(p: f64) -> f64 {
    if p <= 0.0 {
        return f64::INFINITY;
    }
    let t = (-2.0 * math::ln(p.min(0.5))).sqrt();
    let above = 2.515_517 + t * (0.802_853 + t * 0.010_328);
    let below = 1.0 + t * (1.432_788 + t * (0.189_269 + t * 0.001_308));
    (t - above / below).max(0.0)
}

/// The probability that a normal variable exceeds `x` (>= 0) standard deviations: at most 2 % too much from 1 on, 0.5 %
/// from 2 on, 13 % at 0; never too little.
///
/// Source: M. R. Sampford, Some inequalities on Mill's ratio and related functions, 1953.
#[must_use]
pub fn normal_tail(x: f64) -> f64 {
    let density = math::exp(-0.5 * x * x) / std::f64::consts::TAU.sqrt();
    density * 4.0 / (3.0 * x + (x * x + 8.0).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[expect(clippy::float_cmp, reason = "small integers are exact")]
    fn quantiles() {
        let mut values = [5.0, 1.0, 4.0, 2.0, 3.0];
        assert_eq!(median_in_place(&mut values), 3.0);
        assert_eq!(quantile_in_place(&mut values, 0.0), 1.0);
        assert_eq!(quantile_in_place(&mut values, 1.0), 5.0);
        assert_eq!(quantile_in_place(&mut values, 0.375), 2.5);
        assert!(median_in_place(&mut []).is_nan());
    }

    #[test]
    fn normal_tails() {
        for (p, z) in [
            (0.5, 0.0),
            (0.025, 1.959_964),
            (1e-3, 3.090_232),
            (1e-6, 4.753_424),
        ] {
            assert!((normal_exceeded(p) - z).abs() < 5e-4, "{p}");
        }
        assert!(normal_exceeded(0.0).is_infinite());
    }

    #[test]
    fn tails_of_the_normal_distribution() {
        // Values of tables.
        for (x, tail, most) in [
            (0.0, 0.5, 0.13),
            (1.0, 0.158_655_25, 0.02),
            (2.0, 0.022_750_13, 0.005),
            (3.0, 1.349_898e-3, 0.002),
            (4.0, 3.167_124e-5, 0.001),
        ] {
            let over = normal_tail(x) / tail - 1.0;
            assert!((0.0..=most).contains(&over), "{x}: {over}");
            assert!((normal_exceeded(tail) - x).abs() < 1e-3);
        }
        assert!(normal_tail(f64::INFINITY).abs() < f64::MIN_POSITIVE);
    }
}
