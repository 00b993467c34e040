//! The worst of many measurements.

use glam::DVec3;

/// A value and where it was found.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Worst {
    pub(super) value: f64,
    pub(super) place: Option<DVec3>,
    pub(super) face: Option<usize>,
    pub(super) edge: Option<usize>,
}

impl Worst {
    /// A value from nowhere.
    pub(super) fn of(value: f64) -> Self {
        Self {
            value,
            ..Self::default()
        }
    }

    /// A value at a place of a face.
    pub(super) fn at(value: f64, place: DVec3, face: usize) -> Self {
        Self {
            value,
            place: Some(place),
            face: Some(face),
            edge: None,
        }
    }

    pub(super) fn on_edge(self, edge: usize) -> Self {
        Self {
            edge: Some(edge),
            ..self
        }
    }

    /// The larger of both, the first if they are equal.
    pub(super) fn larger(self, other: Self) -> Self {
        if other.value > self.value {
            other
        } else {
            self
        }
    }

    /// The smaller of both, the first if they are equal.
    pub(super) fn smaller(self, other: Self) -> Self {
        if other.value < self.value {
            other
        } else {
            self
        }
    }

    /// One more of what is counted, found here; the first place is kept.
    pub(super) fn count(&mut self, place: Option<DVec3>, face: Option<usize>, edge: Option<usize>) {
        if self.value < 0.5 {
            (self.place, self.face, self.edge) = (place, face, edge);
        }
        self.value += 1.0;
    }
}
