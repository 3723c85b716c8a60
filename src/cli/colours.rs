//! Transfer functions as options name them.

use super::{CommonArgs, Pair};
use crate::colour::TransferFunction;
use crate::error::{Error, Result};
use crate::output::STANDARD;
use crate::scan::value_range;
use crate::source::FrameSource;
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
    let colours = TransferFunction::open(name)?;
    if let Some(range) = range {
        let [lo, hi] = range.0;
        return colours.over((lo, hi));
    }
    if colours.is_of_values() {
        return Ok(colours);
    }
    if inputs == [Path::new(STANDARD)] {
        let what = "standard input is read once: give --range LO,HI, the values of the first and the last colour";
        return Err(Error::usage(format!("--transfer-function {name}: {what}")));
    }
    let (lo, hi) = value_range(source, missing_value, &common.progress("frames"))?.unwrap_or((0.0, 1.0));
    let (lo, hi) = colours.suitable((lo, hi));
    common.detail(format_args!("colours from {lo:.4e} to {hi:.4e}; --range sets them"));
    colours.over((lo, hi))
}
