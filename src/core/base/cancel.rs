//! Progress and cancellation of work for a caller that waits for the result.

use super::progress::Progress;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

/// Counts the steps of work, and cancels it.
#[derive(Debug, Default)]
pub struct CancelToken {
    steps: AtomicU64,
    done: AtomicU64,
    is_cancelled: AtomicBool,
}

impl CancelToken {
    /// Ends the work soon, with an error.
    pub fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
    }

    /// The steps that are done, and all steps; 0 if their number is not known.
    pub fn counts(&self) -> (u64, u64) {
        (self.done.load(Ordering::Relaxed), self.steps.load(Ordering::Relaxed))
    }

    /// The share of the work that is done, 0 to 1; 0 if the number of steps is not known.
    pub fn share(&self) -> f64 {
        let (done, steps) = self.counts();
        if steps > 0 { (done as f64 / steps as f64).min(1.0) } else { 0.0 }
    }
}

impl Progress for CancelToken {
    fn start(&self, steps: Option<u64>) {
        self.done.store(0, Ordering::Relaxed);
        self.steps.store(steps.unwrap_or(0), Ordering::Relaxed);
    }

    fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Ordering::Relaxed);
    }

    fn finish(&self) {}

    fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_says_how_far_it_is_and_ends_when_it_is_cancelled() {
        let work = CancelToken::default();
        assert_eq!(work.share(), 0.0);
        work.start(Some(4));
        work.advance(1);
        assert!(work.share() == 0.25 && work.check().is_ok());
        work.start(None);
        work.advance(3);
        work.cancel();
        assert!(work.share() == 0.0 && work.check().is_err());
    }
}
