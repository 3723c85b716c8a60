//! Options of every program: worker threads, notes, progress and reports.

use super::messages::{self, note};
use super::terminal::{ProgressKind, TerminalProgress};
use super::values::Size;
use super::{note_text, print};
use clap::Args;
use serde::Serialize;
use std::fmt::Arguments;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Note, Result};
use wavesplat_core::base::memory::for_reading;
use wavesplat_core::base::progress::Progress;
use wavesplat_formats::extension_of_frames;
use wavesplat_jobs::picture::Reporter;
use wavesplat_jobs::report::report_text;

/// Options that every program and subcommand takes.
#[derive(Debug, Clone, Args)]
pub struct CommonArgs {
    /// TOML file with more options by their long names, like tolerance = 0.001; a table named convert is for that command.
    /// The command line overrides the file [default: the file named by WAVESPLAT_CONFIG, for wavesplat-render by
    /// WAVESPLAT_RENDER_CONFIG]
    #[arg(long, value_name = "FILE", help_heading = "Common options")]
    pub config: Option<PathBuf>,
    /// Number of worker threads [default: one for each core]
    #[arg(long, value_name = "N", value_parser = threads, help_heading = "Common options")]
    pub threads: Option<NonZeroUsize>,
    /// Memory that the program may allocate
    #[arg(long, value_name = "SIZE", default_value = "512MiB", help_heading = "Common options")]
    pub memory: Size,
    /// Progress on standard error: a bar if it is a terminal, lines of JSON, or none
    #[arg(long, value_enum, value_name = "HOW", default_value = "auto", help_heading = "Common options")]
    pub progress: ProgressKind,
    /// Show no progress and no notes
    #[arg(short, long, help_heading = "Common options")]
    pub quiet: bool,
    /// Show more notes
    #[arg(short, long, conflicts_with = "quiet", help_heading = "Common options")]
    pub verbose: bool,
    /// Print a report as one JSON object (to standard error if data goes to standard output)
    #[arg(long, help_heading = "Common options")]
    pub json: bool,
}

impl CommonArgs {
    /// Starts the worker threads. Call once.
    pub fn start(&self) -> Result<()> {
        if self.quiet {
            messages::silence();
        }
        let threads = self.threads.map_or(0, NonZeroUsize::get);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build_global();
        pool.map_err(|e| Error::usage(format!("--threads {threads}: {e}")))
    }

    /// Bytes of the memory budget that a stream may take for the frames of one window.
    pub fn stream_memory(&self) -> usize {
        for_reading(self.memory.0)
    }

    /// Progress of a stage that counts `unit`s.
    pub fn progress(&self, stage: &'static str, unit: &'static str) -> TerminalProgress {
        let kind = if self.quiet { ProgressKind::None } else { self.progress };
        TerminalProgress::new(kind, stage, unit)
    }

    /// A note on standard error, unless quiet.
    pub fn note(&self, text: impl std::fmt::Display) {
        if !self.quiet {
            note(text);
        }
    }

    /// A note that only `--verbose` shows.
    pub fn detail(&self, text: impl std::fmt::Display) {
        if self.verbose {
            note(text);
        }
    }

    /// A detail: the bytes read of a coefficient file of `bytes` bytes. Bytes that are read again count again.
    pub fn detail_read(&self, read: u64, bytes: u64) {
        Reporter::detail_read(self, read, bytes);
    }

    /// With `--json`, prints a report to standard output, or to standard error if `data_on_stdout`.
    pub fn report(&self, report: &impl Serialize, data_on_stdout: bool) -> Result<()> {
        if self.json { Self::print_report(&report_text(report)?, data_on_stdout) } else { Ok(()) }
    }

    /// Prints the text of a report to standard output, or to standard error if `data_on_stdout`.
    pub(super) fn print_report(text: &str, data_on_stdout: bool) -> Result<()> {
        if data_on_stdout {
            note(text.trim_end());
            return Ok(());
        }
        print(text)
    }
}

impl Reporter for CommonArgs {
    fn note(&self, text: Arguments<'_>) {
        Self::note(self, messages::picture_text(&text.to_string()));
    }

    fn detail(&self, text: Arguments<'_>) {
        Self::detail(self, messages::picture_text(&text.to_string()));
    }

    fn note_source(&self, note: &Note) {
        Self::note(self, note_text(note));
    }

    fn progress(&self, stage: &'static str, unit: &'static str) -> Box<dyn Progress + '_> {
        Box::new(Self::progress(self, stage, unit))
    }
}

/// An error if a coefficient file would have the extension of a format of frames, which would mislead its readers.
pub(crate) fn coefficient_name(output: &Path) -> Result<()> {
    let Some(extension) = extension_of_frames(output) else { return Ok(()) };
    let what = format!("a coefficient file is named .wspl, not .{extension}; wavesplat extract writes other formats");
    Err(Error::usage(format!("{}: {what}", output.display())))
}

/// Parses a number of threads.
///
/// # Errors
/// The text is not a whole number above 0.
fn threads(text: &str) -> std::result::Result<NonZeroUsize, String> {
    text.parse().map_err(|_| "takes a whole number, at least 1; without it, each core has one thread".into())
}
