//! Threads of a process that cannot use rayon's own, such as a forked one: threads do not follow a fork.

use super::error::{Error, Result};

/// Threads that do parallel work.
#[derive(Debug)]
pub struct Workers(rayon::ThreadPool);

impl Workers {
    /// As many as rayon has by default.
    ///
    /// # Errors
    /// The system gives no threads.
    pub fn new() -> Result<Self> {
        let pool = rayon::ThreadPoolBuilder::new().build();
        pool.map(Self).map_err(|e| Error::io("threads", "starting", std::io::Error::other(e)))
    }

    /// The result of work, whose parallel parts these threads do. Threads that the work starts by itself must have none.
    pub fn run<T: Send>(&self, work: impl FnOnce() -> T + Send) -> T {
        self.0.install(work)
    }
}
