//! Progress on standard error: a bar for people, lines for programs, or nothing.

use super::json_progress::JsonProgress;
use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use wavesplat_core::base::progress::Progress;

/// How progress is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum ProgressKind {
    /// A bar, if standard error is a terminal
    Auto,
    /// JSON objects, one per line, up to two a second and one at the end
    Json,
    /// Nothing
    None,
}

/// Progress of one stage of a program.
#[derive(Debug)]
pub enum TerminalProgress {
    /// A bar on standard error, if it is a terminal.
    Bar(Bar),
    /// Lines of JSON on standard error.
    Json(JsonProgress),
}

impl TerminalProgress {
    /// Progress of a stage that counts `unit`s.
    pub fn new(kind: ProgressKind, stage: &'static str, unit: &'static str) -> Self {
        let target = match kind {
            ProgressKind::Json => return Self::Json(JsonProgress::new(stage, unit)),
            ProgressKind::Auto => ProgressDrawTarget::stderr(),
            ProgressKind::None => ProgressDrawTarget::hidden(),
        };
        Self::Bar(Bar { bar: ProgressBar::with_draw_target(None, target), stage, unit })
    }
}

impl Progress for TerminalProgress {
    fn start(&self, steps: Option<u64>) {
        match self {
            Self::Bar(bar) => bar.start(steps),
            Self::Json(json) => json.start(steps),
        }
    }

    fn resume(&self, steps: u64) {
        match self {
            Self::Bar(bar) => bar.resume(steps),
            Self::Json(json) => json.resume(steps),
        }
    }

    fn advance(&self, steps: u64) {
        match self {
            Self::Bar(bar) => bar.bar.inc(steps),
            Self::Json(json) => json.advance(steps),
        }
    }

    fn finish(&self) {
        match self {
            Self::Bar(bar) => bar.bar.finish_and_clear(),
            Self::Json(json) => json.write_last(),
        }
    }
}

/// A bar with speed and remaining time.
#[derive(Debug)]
pub struct Bar {
    bar: ProgressBar,
    stage: &'static str,
    unit: &'static str,
}

impl Bar {
    fn start(&self, steps: Option<u64>) {
        let known = "STAGE {wide_bar} {human_pos}/{human_len} UNIT, {per_sec}, {eta} left";
        let template = if steps.is_some() { known } else { "STAGE {spinner} {human_pos} UNIT, {per_sec}, {elapsed}" };
        let template = template.replace("STAGE", self.stage).replace("UNIT", self.unit);
        if let Ok(style) = ProgressStyle::with_template(&template) {
            self.bar.set_style(style);
        }
        if let Some(steps) = steps {
            self.bar.set_length(steps);
        }
    }

    fn resume(&self, steps: u64) {
        self.bar.set_position(steps);
        self.bar.reset_eta();
    }
}
