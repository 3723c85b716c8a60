//! Transfer functions from options.

use super::CommonArgs;
use crate::base::error::Result;
use crate::base::output::STANDARD;
use crate::base::values::Pair;
use crate::colour::TransferFunction;
use crate::picture::colours_of_source;
use crate::source::FrameSource;
use std::path::{Path, PathBuf};

/// Opens a transfer function by name and stretches it over `range`. Without a range, a map without values is stretched
/// over the range of all frames; `source`, opened from `inputs`, is read for that.
///
/// # Errors
/// Also if all frames would have to be read, and the input is standard input.
pub fn transfer_function(
    name: &str,
    range: Option<Pair>,
    (inputs, source): (&[PathBuf], &mut dyn FrameSource),
    missing_value: Option<f64>,
    common: &CommonArgs,
) -> Result<TransferFunction> {
    let is_piped = inputs == [Path::new(STANDARD)];
    colours_of_source(name, range, source, is_piped, missing_value, common)
}
