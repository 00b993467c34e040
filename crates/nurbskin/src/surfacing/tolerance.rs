//! The tolerance of a fit: requested, or chosen from the data.
//!
//! ```text
//! T = requested, or max(3 σ, 5e-4 diagonal)
//! aim of the knots = max(3 σ, 5e-4 diagonal), or the requested T if smaller and the scan is not noisy
//! ```
//!
//! Ours; 3 sigma holds 99.7 % of normal errors.

use super::SurfacingOptions;
use nurbskin_geometry::unit::Unit;

/// Tolerance of a scan without noise that counts, as a share of the diagonal of its bounding box.
/// Guard: a choice of a default; the user can set any other.
const TOLERANCE_OF_DIAGONAL: f64 = 5e-4;
/// Tolerance of a noisy scan, in standard deviations of the noise.
/// Derived: 99.7 % of normal errors lie within 3 sigma.
const TOLERANCE_OF_SIGMA: f64 = 3.0;

/// The tolerance, and its source.
#[derive(Clone, Debug)]
pub struct Tolerance {
    /// The largest distance, in the unit of the scan.
    pub value: f64,
    /// `option`, or how it was chosen.
    pub source: String,
    is_asked: bool,
    /// The tolerance that the data support, whatever was requested.
    carried: f64,
    /// Whether noise determines it.
    noisy: bool,
}

impl Tolerance {
    /// The tolerance, if it was requested.
    pub fn asked(&self) -> Option<f64> {
        self.is_asked.then_some(self.value)
    }

    /// The aim of the knots of a fit: the tolerance that the data support, or the requested one if that is smaller and
    /// noise does not determine the first.
    pub fn aim(&self) -> f64 {
        match self.noisy {
            true => self.carried,
            false => self.value.min(self.carried),
        }
    }

    /// The tolerance, or what the noise of a part allows if that is more.
    pub fn told(&self, noise: f64) -> f64 {
        self.value.max(TOLERANCE_OF_SIGMA * noise)
    }

    /// The requested tolerance, or one that the data support.
    pub fn choose(options: &SurfacingOptions, unit: Unit, noise: f64, diagonal: f64) -> Self {
        let by_noise = TOLERANCE_OF_SIGMA * noise;
        let by_size = TOLERANCE_OF_DIAGONAL * diagonal;
        let noisy = by_noise > by_size;
        let carried = by_noise.max(by_size);
        if let Some(length) = options.tolerance {
            return Self {
                value: length.resolve(unit, diagonal),
                source: "option".into(),
                is_asked: true,
                carried,
                noisy,
            };
        }
        let source = match noisy {
            true => "three times the measured noise",
            false => "0.05 % of the scan's diagonal; the measured noise is smaller",
        };
        Self {
            value: carried,
            source: source.into(),
            is_asked: false,
            carried,
            noisy,
        }
    }
}
