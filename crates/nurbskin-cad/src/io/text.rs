//! What the readers and writers of both CAD formats do alike: the spelling of numbers, weights, the origin, the size of
//! what is written.

use nurbskin_geometry::math;
use nurbskin_geometry::{DVec3, Error, Result};
use std::fmt::Write;

/// Size of a file that was written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Lines; in IGES they are cards.
    pub lines: usize,
    /// Bytes, line ends included.
    pub bytes: usize,
}

/// Appends `x` with the fewest digits that read back to the same f64: always with a decimal point, which IGES and STEP
/// want, and for the very large and the very small with this letter before the exponent.
pub(super) fn push_real(text: &mut String, x: f64, letter: &str) {
    let start = text.len();
    let size = x.abs();
    // Writing to a String cannot fail.
    if size == 0.0 || (1e-4..1e15).contains(&size) {
        let _ = write!(text, "{x}");
        if !text[start..].contains('.') {
            text.push('.');
        }
        return;
    }
    let _ = write!(text, "{x:e}");
    if let Some(e) = text[start..].find('e') {
        let at = start + e;
        text.replace_range(at..=at, letter);
        if !text[start..at].contains('.') {
            text.insert(at, '.');
        }
    }
}

/// The weights, or `None` where they are all the same positive number, which is polynomial.
pub(super) fn true_weights(weights: Vec<f64>) -> Option<Vec<f64>> {
    let same = weights
        .iter()
        .all(|w| *w > 0.0 && Some(w) == weights.first());
    (!same).then_some(weights)
}

/// `point + origin`, correctly rounded; without an origin the very same bits (-0 stays -0).
pub(super) fn shifted(point: DVec3, origin: DVec3) -> DVec3 {
    if origin == DVec3::ZERO {
        point
    } else {
        point + origin
    }
}

/// A gap may be larger between samples by this.
const BETWEEN_SAMPLES: f64 = 1.2;

/// The number of one significant digit at or above `x`.
fn rounded_up(x: f64) -> f64 {
    if !(x > 0.0 && x.is_finite()) {
        return 0.0;
    }
    let power = math::log10(x).floor();
    let digit = (x / math::powf(10f64, power)).ceil();
    format!("{digit}e{power}")
        .parse()
        .map_or(x, |up: f64| up.max(x))
}

/// The box around everything that is written, the origin added.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    low: DVec3,
    high: DVec3,
}

impl Bounds {
    /// The box around these points, moved by `origin`; `None` around nothing.
    ///
    /// # Errors
    /// [`Error::Invalid`] if one is not finite then.
    pub(super) fn of<'a>(
        points: impl Iterator<Item = &'a DVec3>,
        origin: DVec3,
    ) -> Result<Option<Self>> {
        let [mut low, mut high] = [DVec3::INFINITY, DVec3::NEG_INFINITY];
        for &point in points {
            let point = shifted(point, origin);
            if !point.is_finite() {
                return Err(Error::invalid(format!(
                    "the point {point} is not finite: it cannot be written"
                )));
            }
            low = low.min(point);
            high = high.max(point);
        }
        Ok((low.x <= high.x).then_some(Self { low, high }))
    }

    /// The largest coordinate, without its sign.
    pub(super) fn largest(&self) -> f64 {
        self.low.abs().max(self.high.abs()).max_element()
    }

    /// The smallest distance that a receiver should care for: as given, or the power of ten at or below 1e-7 of the
    /// diagonal, but not below `least` nor `gap`, the largest between edges and surfaces that samples show.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the one given is not a positive length.
    pub(super) fn resolution(&self, given: Option<f64>, least: f64, gap: f64) -> Result<f64> {
        match given {
            Some(given) if given > 0.0 && given.is_finite() => Ok(given),
            Some(given) => Err(Error::invalid(format!(
                "the resolution must be a positive length, not {given}"
            ))),
            None => {
                let diagonal = (self.high - self.low).length();
                let size = if diagonal > 0.0 && diagonal.is_finite() {
                    diagonal
                } else {
                    1.0
                };
                let power = math::log10(1e-7 * size).floor().clamp(-300.0, 300.0);
                let round: f64 = format!("1e{power}").parse().unwrap_or(1e-7 * size);
                Ok(round.max(least).max(rounded_up(BETWEEN_SAMPLES * gap)))
            }
        }
    }

    /// Four units in the last place of the largest coordinate: no two places can be told apart better.
    pub(super) fn rounding(&self) -> f64 {
        4.0 * f64::EPSILON * self.largest()
    }
}
