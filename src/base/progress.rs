//! How long work tells how far it is. The library reports; programs draw.

/// Receives the progress of one run.
pub trait Progress: Sync {
    /// The work has this many steps, or an unknown number.
    fn start(&self, steps: Option<u64>);
    /// So many of them were done before, by an earlier run: they say nothing of the speed.
    fn resume(&self, steps: u64) {
        self.advance(steps);
    }
    /// So many more steps are done.
    fn advance(&self, steps: u64);
    /// All is done.
    fn finish(&self);
}

/// Reports to nobody.
#[derive(Debug, Clone, Copy)]
pub struct Silent;

impl Progress for Silent {
    fn start(&self, _steps: Option<u64>) {}
    fn advance(&self, _steps: u64) {}
    fn finish(&self) {}
}
