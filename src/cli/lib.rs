//! The two programs: their options, commands, messages and progress, and the server of the viewer.
//!
//! Data or one JSON object goes to standard output; notes and progress go to standard error. `config` reads options
//! from a file. `commands` has those of `wavesplat`; `render` is all of `wavesplat-render`; `view` is the server of
//! `wavesplat view`, which uses it. `program` runs a program, and ends it with an exit code.
//!
//! Other programs can use `input` and `values`: options that name and open frames.

mod advice;
mod choice;
pub mod commands;
mod common;
mod config;
mod generate;
mod input;
mod json_progress;
mod messages;
mod program;
mod programs;
mod remote;
pub mod render;
mod terminal;
mod times;
mod values;
#[cfg(feature = "view")]
pub mod view;

pub use common::CommonArgs;
use common::coefficient_name;
pub use generate::{GenerateArgs, Generated, command};
pub use input::{InputArgs, SelectArgs, narrow, remembered};
pub use messages::{advice, error_text, note_text};
pub use program::main;
pub use remote::RemoteArgs;
pub use terminal::{ProgressKind, TerminalProgress};
pub use times::TimesSpec;
pub use values::{Dims, Size};
use wavesplat_core::base::inputs::spare_inputs;
use wavesplat_core::base::position::RegionSpec;
use wavesplat_core::base::values::{FrameList, FrameRange, Numbers, Pair, Triple};

use std::io::{self, Write};
use wavesplat_core::base::error::{Error, Result};

/// Writes text to standard output.
pub fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|e| Error::io("-", "writing", e))
}
