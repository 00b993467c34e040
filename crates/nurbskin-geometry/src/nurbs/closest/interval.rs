//! Intervals and boxes of vectors, for bounds of derivatives.

use glam::DVec3;

/// All numbers between two.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Interval {
    pub(super) low: f64,
    pub(super) high: f64,
}

impl Interval {
    pub(super) fn add(self, other: Self) -> Self {
        Self {
            low: self.low + other.low,
            high: self.high + other.high,
        }
    }
    pub(super) fn scale(self, f: f64) -> Self {
        let (a, b) = (self.low * f, self.high * f);
        Self {
            low: a.min(b),
            high: a.max(b),
        }
    }
    pub(super) fn times(self, other: Self) -> Self {
        let (a, b) = (self.scale(other.low), self.scale(other.high));
        Self {
            low: a.low.min(b.low),
            high: a.high.max(b.high),
        }
    }
    /// Largest absolute value.
    pub(super) fn magnitude(self) -> f64 {
        self.low.abs().max(self.high.abs())
    }
    /// Smallest square.
    fn smallest_square(self) -> f64 {
        let least = self.low.max(-self.high).max(0.0);
        least * least
    }
}

/// A box of vectors.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Vector(pub(super) [Interval; 3]);

impl Vector {
    pub(super) fn new(low: DVec3, high: DVec3) -> Self {
        Self([0, 1, 2].map(|k| Interval {
            low: low[k],
            high: high[k],
        }))
    }
    pub(super) fn add(&self, other: &Self) -> Self {
        Self([0, 1, 2].map(|k| self.0[k].add(other.0[k])))
    }
    pub(super) fn sub(&self, other: &Self) -> Self {
        self.add(&other.scale(-1.0))
    }
    pub(super) fn scale(&self, f: f64) -> Self {
        Self(self.0.map(|i| i.scale(f)))
    }
    pub(super) fn times(&self, f: Interval) -> Self {
        Self(self.0.map(|i| i.times(f)))
    }
    pub(super) fn dot(&self, other: &Self) -> Interval {
        (0..3).fold(Interval::default(), |sum, k| {
            sum.add(self.0[k].times(other.0[k]))
        })
    }
    /// Lower bound of the squared length.
    pub(super) fn smallest_square(&self) -> f64 {
        self.0.iter().map(|i| i.smallest_square()).sum()
    }
    /// Upper bound of the length.
    pub(super) fn norm(&self) -> f64 {
        self.0
            .iter()
            .map(|i| i.magnitude().powi(2))
            .sum::<f64>()
            .sqrt()
    }
}

/// Corners of the box around points.
pub(super) fn hull(points: impl Iterator<Item = DVec3>) -> [DVec3; 2] {
    points.fold([DVec3::INFINITY, DVec3::NEG_INFINITY], |[low, high], p| {
        [low.min(p), high.max(p)]
    })
}
