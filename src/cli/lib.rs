//! The two programs: their options, commands, messages and progress, and the server of the viewer.
//!
//! Data or one JSON object goes to standard output; notes and progress go to standard error. `config` reads options
//! from a file. `commands` has those of `wavesplat`; `render` is all of `wavesplat-render`; `view` is the server of
//! `wavesplat view`, which uses it. `program` runs a program, and ends it with an exit code.
//!
//! Without the feature `programs`, other programs can use `input` and `values`: options that name and open frames.

#[cfg(feature = "programs")]
mod advice;
#[cfg(feature = "programs")]
mod choice;
#[cfg(feature = "programs")]
pub mod commands;
#[cfg(feature = "programs")]
mod common;
#[cfg(feature = "programs")]
mod config;
#[cfg(feature = "programs")]
mod generate;
mod input;
#[cfg(feature = "programs")]
mod json_progress;
mod messages;
#[cfg(feature = "programs")]
mod optional;
#[cfg(feature = "programs")]
mod program;
#[cfg(feature = "programs")]
mod remote;
#[cfg(feature = "programs")]
pub mod render;
#[cfg(feature = "programs")]
mod terminal;
mod times;
mod values;
#[cfg(feature = "view")]
pub mod view;

#[cfg(feature = "programs")]
pub use common::CommonArgs;
#[cfg(feature = "programs")]
pub use generate::{GenerateArgs, Generated};
pub use input::{InputArgs, SelectArgs, narrow, remembered};
pub use messages::{advice, error_text, note_text};
#[cfg(feature = "programs")]
use program::other_program;
#[cfg(feature = "programs")]
pub use program::{command, main};
#[cfg(feature = "programs")]
pub use remote::RemoteArgs;
#[cfg(feature = "programs")]
pub use terminal::{ProgressKind, TerminalProgress};
pub use times::TimesSpec;
pub use values::{Dims, Size, share};
pub use wavesplat_core::base::inputs::spare_inputs;
pub use wavesplat_core::base::values::{FrameList, FrameRange, Numbers, Pair, RegionSpec, Triple, Whole};
pub use wavesplat_core::colour::OpacityPoints;

use std::io::{self, Write};
use wavesplat_core::base::error::{Error, Result};

/// Writes text to standard output.
pub fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|e| Error::io("-", "writing", e))
}
