//! The manners that the programs share: common options, values of options, progress, exit codes.
//!
//! Standard output carries data or one JSON object; notes and progress go to standard error. `config` puts options of a file
//! before those of the command line, and `program` ends a program: with the exit code of an error, or at once when it is
//! interrupted.
//!
//! With the feature `args` alone, there are `input` and `values`: options that name and open frames, for other programs.

#[cfg(feature = "cli")]
mod advice;
#[cfg(feature = "cli")]
mod colours;
#[cfg(feature = "cli")]
mod common;
#[cfg(feature = "cli")]
mod config;
#[cfg(feature = "cli")]
mod generate;
mod input;
#[cfg(feature = "cli")]
mod lines;
mod messages;
#[cfg(feature = "cli")]
mod optional;
#[cfg(feature = "cli")]
mod program;
#[cfg(feature = "cli")]
mod terminal;
mod values;

#[cfg(feature = "cli")]
pub use colours::{open_colours, stretched, transfer_function};
#[cfg(feature = "cli")]
pub use common::{CommonArgs, report_text};
#[cfg(feature = "cli")]
pub use generate::{GenerateArgs, Generated};
pub use input::{InputArgs, SelectArgs, narrow, remembered, spare_inputs};
pub use messages::{of_error as error_text, of_note as note_text};
#[cfg(feature = "cli")]
pub use program::{command, main};
#[cfg(feature = "cli")]
pub use terminal::{ProgressKind, TerminalProgress};
pub use values::{Dims, FrameList, FrameRange, Numbers, OpacityPoints, Pair, RegionSpec, Size, Triple, Whole, share};

use crate::base::error::{Error, Result};
use std::io::{self, Write};

/// Writes text to standard output.
pub fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|e| Error::io("-", "writing", e))
}
