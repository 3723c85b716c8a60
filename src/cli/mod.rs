//! The parts that the programs share: common options, values of options, progress and exit codes.
//!
//! Data or one JSON object goes to standard output; notes and progress go to standard error. `config` reads options
//! from a file. `render` is all of `wavesplat-render`, and `view` the server of `wavesplat view`, which uses it. `program` runs a program, and ends it with an exit code.
//!
//! With the feature `args` alone, other programs can use `input` and `values`: options that name and open frames.

#[cfg(feature = "cli")]
mod advice;
#[cfg(feature = "cli")]
mod choice;
#[cfg(feature = "cli")]
pub mod commands;
#[cfg(feature = "cli")]
mod common;
#[cfg(feature = "cli")]
mod config;
#[cfg(feature = "cli")]
mod generate;
mod input;
#[cfg(feature = "cli")]
mod json_progress;
mod messages;
#[cfg(feature = "cli")]
mod optional;
#[cfg(feature = "cli")]
mod program;
#[cfg(feature = "cli")]
mod remote;
#[cfg(feature = "cli")]
pub mod render;
#[cfg(feature = "cli")]
mod terminal;
mod times;
mod values;
#[cfg(feature = "view")]
pub mod view;

pub use crate::base::inputs::spare_inputs;
pub use crate::base::values::{FrameList, FrameRange, Numbers, Pair, RegionSpec, Triple, Whole};
pub use crate::colour::OpacityPoints;
#[cfg(feature = "cli")]
pub use common::CommonArgs;
#[cfg(feature = "cli")]
pub use generate::{GenerateArgs, Generated};
pub use input::{InputArgs, SelectArgs, narrow, remembered};
pub use messages::{advice, error_text, note_text};
#[cfg(feature = "cli")]
use program::other_program;
#[cfg(feature = "cli")]
pub use program::{command, main};
#[cfg(feature = "cli")]
pub use remote::RemoteArgs;
#[cfg(feature = "cli")]
pub use terminal::{ProgressKind, TerminalProgress};
pub use times::TimesSpec;
pub use values::{Dims, Size, share};

use crate::base::error::{Error, Result};
use std::io::{self, Write};

/// Writes text to standard output.
pub fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|e| Error::io("-", "writing", e))
}
