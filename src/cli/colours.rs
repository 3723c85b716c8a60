//! Transfer functions as options name them.

use super::{CommonArgs, Pair};
use crate::base::error::{Error, Result};
use crate::base::output::STANDARD;
use crate::colour::TransferFunction;
use crate::source::{FrameSource, value_range};
use std::path::{Path, PathBuf};

/// The transfer function of a name, stretched over `range` if one is given. A map that is of no values of its own is stretched
/// over those of all frames otherwise: they are read for that.
///
/// # Errors
/// Also where that is needed and `inputs`, of which `source` is, are standard input.
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
        common.detail(format_args!("values from {lo:.4e} to {hi:.4e}; --range sets those of the colours"));
        Ok((lo, hi))
    };
    stretched(open_colours("--transfer-function", name)?, range, all)
}

/// The colours of a name that an option has.
pub fn open_colours(option: &str, name: &str) -> Result<TransferFunction> {
    TransferFunction::open(name).map_err(|error| match error {
        Error::Path { path, problem, .. } => Error::usage(format!("{option} {}: {problem}", path.display())),
        other => other,
    })
}

/// Colours over the range that was asked for, their own, or what suits those of all values.
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
