//! Progress of long work. The library reports it, programs show it, and both can end the work early.

use super::error::{Error, Result};

/// Receives the progress of one run.
pub trait Progress: Sync {
    /// The work starts, and has this many steps or an unknown number.
    fn start(&self, steps: Option<u64>);
    /// An earlier run did this many steps. They do not count for the speed.
    fn resume(&self, steps: u64) {
        self.advance(steps);
    }
    /// This many more steps are done.
    fn advance(&self, steps: u64);
    /// All steps are done.
    fn finish(&self);
    /// Whether the result is no longer wanted. Then the work ends soon, with [`Error::Cancelled`].
    fn is_cancelled(&self) -> bool {
        false
    }
    /// Lets the work go on if its result is wanted.
    ///
    /// # Errors
    /// [`Error::Cancelled`].
    fn check(&self) -> Result<()> {
        if self.is_cancelled() { Err(Error::Cancelled) } else { Ok(()) }
    }
}

/// Shows nothing.
#[derive(Debug, Clone, Copy)]
pub struct Silent;

impl Progress for Silent {
    fn start(&self, _steps: Option<u64>) {}
    fn advance(&self, _steps: u64) {}
    fn finish(&self) {}
}
