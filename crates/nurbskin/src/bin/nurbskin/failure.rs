//! Errors as the command reports them: a kind, a message, an exit status.

use crate::{ERROR, USAGE};
use nurbskin::Error;
use serde_json::{Value, json};
use std::fmt;

/// `Result` with a [`Failure`].
pub(crate) type Result<T> = std::result::Result<T, Failure>;

/// Why a verb gave up.
#[derive(Debug)]
pub(crate) struct Failure {
    kind: &'static str,
    message: String,
}

impl Failure {
    /// A wrong use of the command: exit status 2.
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self {
            kind: "usage",
            message: message.into(),
        }
    }

    /// Something that cannot be written, standard output above all.
    pub(crate) fn write(message: impl Into<String>) -> Self {
        Self {
            kind: "write",
            message: message.into(),
        }
    }

    /// Something that the operating system refuses.
    pub(crate) fn system(message: impl Into<String>) -> Self {
        Self {
            kind: "unsupported",
            message: message.into(),
        }
    }

    /// A refusal before any work: what the words on the command line contradict is wrong usage, what is missing on the
    /// disk is not.
    pub(crate) fn refused(error: Error) -> Self {
        match error {
            Error::Invalid(message) => Self::usage(message),
            other => other.into(),
        }
    }

    /// The status that the process ends with.
    pub(crate) fn status(&self) -> u8 {
        if self.kind == "usage" { USAGE } else { ERROR }
    }

    /// `{ "kind", "message" }`.
    pub(crate) fn json(&self) -> Value {
        json!({ "kind": self.kind, "message": self.message })
    }

    /// Whether the user stopped it.
    pub(crate) fn is_cancelled(&self) -> bool {
        self.kind == "cancelled"
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        let kind = match &error {
            Error::Read { .. } => "read",
            Error::Write { .. } => "write",
            Error::Invalid(_) => "invalid",
            Error::NoSolution(_) => "no_solution",
            Error::Cancelled => "cancelled",
            // Kinds that a later library adds are wishes it cannot fulfil, until they are named here.
            _ => "unsupported",
        };
        Self {
            kind,
            message: error.to_string(),
        }
    }
}

impl From<serde_json::Error> for Failure {
    fn from(error: serde_json::Error) -> Self {
        Self::write(format!("cannot write JSON: {error}"))
    }
}
