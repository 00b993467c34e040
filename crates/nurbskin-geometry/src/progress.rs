//! What a long computation tells its caller, and how the caller stops it.

use crate::{Error, Result};

/// Receives the stages of a computation. All methods may be called from any thread.
pub trait Progress: Sync {
    /// A stage begins; `steps` is its length where it is known.
    fn stage(&self, name: &'static str, steps: Option<u64>);
    /// `steps` more of the current stage are done.
    fn advance(&self, steps: u64);
    /// How far a stage of unknown length has come, in words that go on after its name.
    fn tell(&self, _so_far: &str) {}
    /// Something the user should know; it is also in the outcome.
    fn warn(&self, message: &str);
    /// True as soon as the computation should stop; it then returns [`Error::Cancelled`].
    fn cancelled(&self) -> bool {
        false
    }
    /// [`Error::Cancelled`] if the caller asked to stop.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    fn check(&self) -> Result<()> {
        if self.cancelled() {
            Err(Error::Cancelled)
        } else {
            Ok(())
        }
    }
}

/// A [`Progress`] that tells nobody.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn stage(&self, _: &'static str, _: Option<u64>) {}
    fn advance(&self, _: u64) {}
    fn warn(&self, _: &str) {}
}

/// A [`Progress`] that has asked to stop: every long computation returns [`Error::Cancelled`] at its first check.
#[derive(Clone, Copy, Debug, Default)]
pub struct Stopped;

impl Progress for Stopped {
    fn stage(&self, _: &'static str, _: Option<u64>) {}
    fn advance(&self, _: u64) {}
    fn warn(&self, _: &str) {}
    fn cancelled(&self) -> bool {
        true
    }
}
