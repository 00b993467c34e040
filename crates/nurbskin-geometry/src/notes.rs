//! Warnings and details that a stage reports beside its result.

/// What a run says beside its figures, for people.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Notes {
    /// What changes the answer: a unit that was assumed, points that were ignored, parts left out, holes closed, options
    /// without effect.
    pub warnings: Vec<String>,
    /// The chronicle: what was repaired, why this topology, how the chart came out.
    pub details: Vec<String>,
}

impl Notes {
    /// Adds what changes the answer.
    pub fn warn(&mut self, what: impl Into<String>) {
        self.warnings.push(what.into());
    }

    /// Adds a line of the chronicle.
    pub fn detail(&mut self, what: impl Into<String>) {
        self.details.push(what.into());
    }

    /// Adds all of `other` at the end.
    pub fn append(&mut self, other: Notes) {
        self.warnings.extend(other.warnings);
        self.details.extend(other.details);
    }

    /// The same, each line made into another.
    pub fn map(self, made: impl Fn(String) -> String) -> Self {
        Self {
            warnings: self.warnings.into_iter().map(&made).collect(),
            details: self.details.into_iter().map(&made).collect(),
        }
    }
}
