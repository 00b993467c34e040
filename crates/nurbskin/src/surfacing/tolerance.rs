//! The tolerance of a fit: asked for, or what the data can carry.

use super::SurfacingOptions;
use nurbskin_geometry::unit::Unit;

/// Share of the bounding-box diagonal that is the tolerance where the scan shows no noise.
const TOLERANCE_OF_DIAGONAL: f64 = 5e-4;
/// The tolerance chosen for a noisy scan, in standard deviations: 99.7 % of normal noise lies within.
const TOLERANCE_OF_SIGMA: f64 = 3.0;

/// The tolerance aimed at, and where it comes from.
#[derive(Clone, Debug)]
pub struct Tolerance {
    /// The largest distance, in the unit of the scan.
    pub value: f64,
    /// `option`, or how it was chosen.
    pub source: String,
    is_asked: bool,
    /// What the data can carry, whatever was asked for.
    carried: f64,
    /// Whether that is set by noise.
    noisy: bool,
}

impl Tolerance {
    /// The tolerance where one was asked for.
    pub fn asked(&self) -> Option<f64> {
        self.is_asked.then_some(self.value)
    }

    /// What the knots of a fit aim at: what the data can carry, or less where less was asked for of data without noise
    /// that counts.
    pub fn aim(&self) -> f64 {
        match self.noisy {
            true => self.carried,
            false => self.value.min(self.carried),
        }
    }

    /// The tolerance, or what the noise of a part leaves of it.
    pub fn told(&self, noise: f64) -> f64 {
        self.value.max(TOLERANCE_OF_SIGMA * noise)
    }

    /// The tolerance asked for, or one that the data can carry.
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
