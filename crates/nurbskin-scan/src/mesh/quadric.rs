//! Quadrics over tangent planes, fitted to the points around a place.
//!
//! Source: F. Cazals, M. Pouget, *Estimating differential quantities using polynomial fitting of osculating jets*, Computer
//! Aided Geometric Design 22(2), 2005 (DOI 10.1016/j.cagd.2004.09.004); P. W. Holland, R. E. Welsch, *Robust regression using
//! iteratively reweighted least-squares*, 1977, with Tukey's biweight.

use glam::DVec2;
use nurbskin_geometry::numeric::statistics::{SIGMA_PER_MAD, median_in_place};

/// Rounds of iteratively reweighted least squares; the first has no residuals yet. Trial: not recorded.
const IRLS_ROUNDS: usize = 3;
/// Fewest points of a fit. Guard: a quadric has six coefficients, and three more points give residuals.
const MIN_FIT_SAMPLES: usize = 9;
/// Standard deviation of the residuals, in radii, above which the points are no quadric, as at sharp edges and corners.
/// Trial: not recorded.
const MAX_FIT_SIGMA: f64 = 0.25;
/// Residual, in standard deviations, at which Tukey's biweight reaches zero. Source: Holland and Welsch 1977; it keeps
/// 95 % efficiency for normal noise.
const TUKEY_CUTOFF: f64 = 4.685;
/// Least standard deviation of the residuals in the weights, in radii. Guard: keeps the weights finite for exact data.
const MIN_FIT_SIGMA: f64 = 1e-6;
/// Least pivot of the Cholesky factorisation, relative to the sum of the weights, below which the normal equations are
/// singular. Guard: the coordinates are in radii, so that regular pivots are near one.
const MIN_PIVOT: f64 = 1e-6;

/// A quadric over a tangent plane: coefficients of 1, x, y, x², xy, y². Lengths are in units of the radius of the fit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quadric(pub(super) [f64; 6]);

impl Quadric {
    /// The height at a place.
    pub(super) fn height(&self, at: DVec2) -> f64 {
        -residual(&[at.x, at.y, 0.0, 0.0], &self.0)
    }

    /// The gradient of the height.
    pub(super) fn slope(&self, at: DVec2) -> DVec2 {
        let [_, b, c, d, e, f] = self.0;
        DVec2::new(b + 2.0 * d * at.x + e * at.y, c + e * at.x + 2.0 * f * at.y)
    }
}

/// The samples of a fit.
#[derive(Debug, Default)]
pub(super) struct QuadricFit {
    /// x, y, height and weight, lengths in radii.
    pub(super) samples: Vec<[f64; 4]>,
    residuals: Vec<f64>,
}

impl QuadricFit {
    /// The quadric by iteratively reweighted least squares; `None` if the samples are no such surface. O(n).
    pub(super) fn solve(&mut self) -> Option<Quadric> {
        let mut coefficients = [0.0; 6];
        let mut scale = f64::INFINITY;
        for _ in 0..IRLS_ROUNDS {
            if self.samples.len() < MIN_FIT_SAMPLES {
                return None;
            }
            let (mut a, mut right) = ([[0.0; 6]; 6], [0.0; 6]);
            for sample in &self.samples {
                let basis = basis(sample);
                let off = residual(sample, &coefficients) / scale;
                let weight = sample[3] * (1.0 - off * off).max(0.0).powi(2);
                for i in 0..6 {
                    right[i] += weight * basis[i] * sample[2];
                    for j in 0..=i {
                        a[i][j] += weight * basis[i] * basis[j];
                    }
                }
            }
            coefficients = solved(a, right)?;
            self.residuals.clear();
            let residuals = self
                .samples
                .iter()
                .map(|s| residual(s, &coefficients).abs());
            self.residuals.extend(residuals);
            let sigma = SIGMA_PER_MAD * median_in_place(&mut self.residuals);
            if sigma > MAX_FIT_SIGMA {
                return None;
            }
            scale = TUKEY_CUTOFF * sigma.max(MIN_FIT_SIGMA);
        }
        Some(Quadric(coefficients))
    }
}

fn basis(&[x, y, ..]: &[f64; 4]) -> [f64; 6] {
    [1.0, x, y, x * x, x * y, y * y]
}

fn residual(&[x, y, height, _]: &[f64; 4], &[a, b, c, d, e, f]: &[f64; 6]) -> f64 {
    height - (a + x * (b + x * d + y * e) + y * (c + y * f))
}

/// Solves a positive definite system, given by its lower triangle, by Cholesky factorisation; `None` if it is nearly
/// singular.
fn solved(mut a: [[f64; 6]; 6], mut x: [f64; 6]) -> Option<[f64; 6]> {
    let least = MIN_PIVOT * a[0][0];
    for i in 0..6 {
        for j in 0..=i {
            let mut sum = a[i][j];
            for (x, y) in a[i].iter().zip(&a[j]).take(j) {
                sum -= x * y;
            }
            if i == j {
                if sum.is_nan() || sum <= least {
                    return None;
                }
                a[i][i] = sum.sqrt();
            } else {
                a[i][j] = sum / a[j][j];
            }
        }
    }
    for i in 0..6 {
        for k in 0..i {
            x[i] -= a[i][k] * x[k];
        }
        x[i] /= a[i][i];
    }
    for i in (0..6).rev() {
        for k in i + 1..6 {
            x[i] -= a[k][i] * x[k];
        }
        x[i] /= a[i][i];
    }
    Some(x)
}
