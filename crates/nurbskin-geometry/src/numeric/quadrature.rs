//! Gauss quadrature.
//!
//! Source: Gauss-Legendre rules (NIST DLMF 3.5).

use crate::math;

/// Most Newton steps to a root of a Legendre polynomial. Count.
/// Guard: the iteration converges quadratically and ends far earlier.
const MAX_NEWTON_STEPS: usize = 100;
/// Newton step below which the root is found.
/// Guard: about the rounding of a root.
const NEWTON_STEP: f64 = 1e-15;

/// Nodes and weights of the Gauss-Legendre rule with n >= 1 points on \[-1, 1\], exact to degree 2n - 1.
///
/// Source: roots of the Legendre polynomial by Newton's method from Tricomi's start, NIST DLMF 18.16.
#[must_use]
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = math::cos(std::f64::consts::PI * (i as f64 + 0.75) / (n as f64 + 0.5));
            let mut slope = 1.0;
            for _ in 0..MAX_NEWTON_STEPS {
                let (mut p0, mut p1) = (1.0, x);
                for k in 2..=n {
                    let k = k as f64;
                    (p0, p1) = (p1, ((2.0 * k - 1.0) * x * p1 - (k - 1.0) * p0) / k);
                }
                slope = n as f64 * (x * p1 - p0) / (x * x - 1.0);
                let step = p1 / slope;
                x -= step;
                if step.abs() < NEWTON_STEP {
                    break;
                }
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_are_exact_for_polynomials() {
        for count in 1..30 {
            let rule = gauss_legendre(count);
            for degree in [0, 1, 2 * count - 2, 2 * count - 1] {
                let degree = i32::try_from(degree).unwrap();
                let sum: f64 = rule.iter().map(|&(x, w)| w * x.powi(degree)).sum();
                let exact = if degree % 2 == 1 {
                    0.0
                } else {
                    2.0 / f64::from(degree + 1)
                };
                assert!((sum - exact).abs() < 1e-14, "{count} {degree} {sum}");
            }
        }
    }
}
