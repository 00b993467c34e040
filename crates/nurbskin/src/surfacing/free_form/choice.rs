//! Which of two surfaces of a sheet is the better one, and what is said of it.

use super::super::part::Shaped;
use super::FEW;
use nurbskin_geometry::unit::{Unit, grouped};

/// The largest ratio of control points, over the rectangle to along the outline, at which the rectangle is preferred where both
/// domains reach the goal. Found by trial, see docs/sheets.md.
const FEWER: f64 = 0.5;
/// The same for the errors, where neither domain reaches the goal.
const CLOSER: f64 = 0.8;

impl Shaped {
    /// The number of its control points, each counted once.
    pub(super) fn control_points(&self) -> usize {
        self.surface.distinct_counts().into_iter().product()
    }

    /// Whether no other domain needs to be tried.
    pub(super) fn is_plainly_good(&self) -> bool {
        self.not_met.is_none() && self.control_points() <= FEW && self.crossings == 0
    }

    /// This one, with the note that it was made calmer.
    pub(super) fn calmer_than(mut self, before: &Self, unit: Unit) -> Self {
        self.notes.detail(format!(
            "made calmer where it intersected itself: {}, before {}",
            self.in_words(unit),
            before.in_words(unit)
        ));
        self
    }

    /// This one, with the note that it was taken instead of another.
    pub(super) fn instead_of(mut self, other: &Self, unit: Unit) -> Self {
        self.notes.detail(format!(
            "the surface fills the rectangle around the sheet and is trimmed at its outline: {}; with sides that \
             follow the outline it would take {}",
            self.in_words(unit),
            other.in_words(unit)
        ));
        self
    }

    /// By the goal, then by the number of control points, or by the error where it is missed; only where that is clear.
    pub(super) fn is_better_than(&self, other: &Self) -> bool {
        let met = |s: &Self| s.not_met.is_none();
        if met(self) != met(other) {
            return met(self);
        }
        match met(self) {
            true => self.control_points() as f64 <= FEWER * other.control_points() as f64,
            false => self.error < CLOSER * other.error,
        }
    }

    /// Its size and its error.
    fn in_words(&self, unit: Unit) -> String {
        format!(
            "{} control points for {} at 95 % of the points",
            grouped(self.control_points()),
            unit.length(self.error)
        )
    }
}
