//! Colours by name, over the range that suits them.

use crate::picture::reporter::Reporter;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::values::Pair;
use wavesplat_core::colour::TransferFunction;
use wavesplat_core::source::{FrameSource, value_range};

/// Opens the colours that a field names.
pub fn open_colours(field: &'static str, name: &str) -> Result<TransferFunction> {
    TransferFunction::open(name).map_err(|error| match error {
        Error::Path { path, problem, .. } => Error::value(field, path.display(), problem),
        other => other,
    })
}

/// Colours over the given range, else over their own values, else over a range that suits `all` values.
pub(crate) fn stretched(
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

/// Opens the colours of samples by name, and stretches them over `range`. Without a range, colours without values are
/// stretched over the range of all frames, which are read for that.
///
/// # Errors
/// Also if all frames would have to be read, and come from standard input.
pub fn colours_of_source(
    name: &str,
    range: Option<Pair>,
    source: &mut dyn FrameSource,
    is_piped: bool,
    missing_value: Option<f64>,
    reporter: &dyn Reporter,
) -> Result<TransferFunction> {
    let all = || {
        if is_piped {
            let what = "standard input is read once: give `range` LO,HI, the values of the first and the last colour";
            return Err(Error::value("transfer_function", name, what));
        }
        let progress = reporter.progress("values", "frames");
        let (lo, hi) = value_range(source, missing_value, progress.as_ref())?.unwrap_or((0.0, 1.0));
        reporter.detail(format_args!("values from {lo:.4e} to {hi:.4e}; `range` sets the range of the colours"));
        Ok((lo, hi))
    };
    stretched(open_colours("transfer_function", name)?, range, all)
}
