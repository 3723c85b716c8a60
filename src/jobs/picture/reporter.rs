//! Where notes and progress go.

use std::fmt::Arguments;
use wavesplat_core::base::error::Note;
use wavesplat_core::base::progress::Progress;

/// Shows notes and progress: a terminal, or a program that waits for pictures.
pub trait Reporter {
    /// Shows something that users should know.
    fn note(&self, text: Arguments<'_>);
    /// Shows something that users may want to know.
    fn detail(&self, text: Arguments<'_>);
    /// Shows how an archive is read.
    fn note_source(&self, note: &Note);
    /// Progress of a stage that counts `unit`s.
    fn progress(&self, stage: &'static str, unit: &'static str) -> Box<dyn Progress + '_>;

    /// A detail: the bytes read of a coefficient file of `bytes` bytes. Bytes that are read again count again.
    fn detail_read(&self, read: u64, bytes: u64) {
        let again = if read > bytes { ", as some were read more than once" } else { "" };
        self.detail(format_args!("{read} bytes were read of a file of {bytes}{again}"));
    }
}

/// The progress of a caller within a program that shows no notes. Small pictures that find ranges only end early if
/// the caller cancels.
pub struct Caller<'a>(pub &'a dyn Progress);

/// Stages whose progress the caller sees.
const SHOWN: [&str; 3] = ["render", "parts", "sum"];

impl Reporter for Caller<'_> {
    fn note(&self, _text: Arguments<'_>) {}
    fn detail(&self, _text: Arguments<'_>) {}
    fn note_source(&self, _note: &Note) {}

    fn progress(&self, stage: &'static str, _unit: &'static str) -> Box<dyn Progress + '_> {
        Box::new(Stage { caller: self.0, is_shown: SHOWN.contains(&stage) })
    }
}

struct Stage<'a> {
    caller: &'a dyn Progress,
    is_shown: bool,
}

impl Progress for Stage<'_> {
    fn start(&self, steps: Option<u64>) {
        if self.is_shown {
            self.caller.start(steps);
        }
    }

    fn advance(&self, steps: u64) {
        if self.is_shown {
            self.caller.advance(steps);
        }
    }

    fn finish(&self) {
        if self.is_shown {
            self.caller.finish();
        }
    }

    fn is_cancelled(&self) -> bool {
        self.caller.is_cancelled()
    }
}
