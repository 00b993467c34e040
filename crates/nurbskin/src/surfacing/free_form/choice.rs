//! Choice between surfaces of a sheet: over rectangles around it, and over the region that its borders enclose.
//!
//! ```text
//! both reach the goal:  rectangle if N_rectangle ≤ 0.5 N_outline
//! neither does:         rectangle if p95_rectangle < 0.8 p95_outline
//! ```
//!
//! The rectangle has to be clearly better, since its surface is trimmed all around. Ours.

use super::super::part::Shaped;
use super::EDITABLE_SIZE;
use nurbskin_geometry::unit::{Unit, grouped};

/// Largest ratio of control points, over the rectangle to along the outline, at which the rectangle is preferred where
/// both domains reach the goal. Dimensionless.
/// Trial: on the sheets of docs/sheets.md.
const MAX_SIZE_RATIO: f64 = 0.5;
/// The same ratio of the errors where neither domain reaches the goal. Dimensionless.
/// Trial: on the sheets of docs/sheets.md.
const MAX_ERROR_RATIO: f64 = 0.8;

impl Shaped {
    /// The number of its control points, each counted once.
    pub(super) fn control_points(&self) -> usize {
        self.surface.distinct_counts().into_iter().product()
    }

    /// Whether no other domain needs to be tried.
    pub(super) fn is_plainly_good(&self) -> bool {
        self.not_met.is_none() && self.control_points() <= EDITABLE_SIZE && self.crossings == 0
    }

    /// This surface, with a note that it was made calmer.
    pub(super) fn calmer_than(mut self, before: &Self, unit: Unit) -> Self {
        self.notes.detail(format!(
            "made calmer where it intersected itself: {}, before {}",
            self.in_words(unit),
            before.in_words(unit)
        ));
        self
    }

    /// This surface, with a note that it replaces another.
    pub(super) fn instead_of(mut self, other: &Self, unit: Unit) -> Self {
        self.notes.detail(format!(
            "the surface fills the rectangle around the sheet and is trimmed at its outline: {}; with sides that \
             follow the outline it would take {}",
            self.in_words(unit),
            other.in_words(unit)
        ));
        self
    }

    /// Compares by the goal, then by the number of control points, or by the error where the goal is missed; true only
    /// for a clear difference.
    pub(super) fn is_better_than(&self, other: &Self) -> bool {
        let met = |s: &Self| s.not_met.is_none();
        if met(self) != met(other) {
            return met(self);
        }
        match met(self) {
            true => self.control_points() as f64 <= MAX_SIZE_RATIO * other.control_points() as f64,
            false => self.error < MAX_ERROR_RATIO * other.error,
        }
    }

    /// Compares with a surface over another rectangle around the same sheet: by the goal, then by what needs no mending,
    /// then by the number of control points, or by the error where the goal is missed.
    pub(super) fn precedes(&self, other: &Self) -> bool {
        let merit = |s: &Self| {
            let cost = match s.not_met {
                None => s.control_points() as f64,
                Some(_) => s.error,
            };
            (s.not_met.is_some(), s.crossings > 0, cost)
        };
        merit(self) < merit(other)
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
