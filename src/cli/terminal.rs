//! Progress on a terminal.

use crate::progress::Progress;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// A bar on standard error; nothing unless that is a terminal.
#[derive(Debug)]
pub struct TerminalProgress {
    bar: ProgressBar,
    unit: &'static str,
}

impl TerminalProgress {
    /// A bar that counts `unit`s, or no bar at all.
    pub fn new(quiet: bool, unit: &'static str) -> Self {
        let target = if quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        Self { bar: ProgressBar::with_draw_target(None, target), unit }
    }
}

impl Progress for TerminalProgress {
    fn start(&self, steps: Option<u64>) {
        let known = "{wide_bar} {pos}/{len} UNIT, {eta} left";
        let template = if steps.is_some() { known } else { "{spinner} {pos} UNIT, {elapsed}" };
        if let Ok(style) = ProgressStyle::with_template(&template.replace("UNIT", self.unit)) {
            self.bar.set_style(style);
        }
        if let Some(steps) = steps {
            self.bar.set_length(steps);
        }
    }

    fn advance(&self, steps: u64) {
        self.bar.inc(steps);
    }

    fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
