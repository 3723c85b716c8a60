//! Transfer functions from options.

use super::{CommonArgs, Pair};
use crate::base::error::{Error, Result};
use crate::base::output::STANDARD;
use crate::colour::TransferFunction;
use crate::source::{FrameSource, value_range};
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
    let all = || {
        if inputs == [Path::new(STANDARD)] {
            let what = "standard input is read once: give --range LO,HI, the values of the first and the last colour";
            return Err(Error::usage(format!("--transfer-function {name}: {what}")));
        }
        let (lo, hi) = value_range(source, missing_value, &common.progress("values", "frames"))?.unwrap_or((0.0, 1.0));
        common.detail(format_args!("values from {lo:.4e} to {hi:.4e}; --range sets the range of the colours"));
        Ok((lo, hi))
    };
    stretched(open_colours("--transfer-function", name)?, range, all)
}

/// Opens the colours that an option names.
pub fn open_colours(option: &str, name: &str) -> Result<TransferFunction> {
    TransferFunction::open(name).map_err(|error| match error {
        Error::Path { path, problem, .. } => Error::usage(format!("{option} {}: {problem}", path.display())),
        other => other,
    })
}

/// Colours over the given range, else over their own values, else over a range that suits `all` values.
pub fn stretched(
    colours: TransferFunction,
    range: Option<Pair>,
    all: impl FnOnce() -> Result<(f64, f64)>,
) -> Result<TransferFunction> {
    match range {
        Some(range) => colours.over(range.0.into()),
        None if colours.is_of_values() => Ok(colours),
        None => colours.over(colours.suitable(all()?)),
    }
}
