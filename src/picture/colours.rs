//! The colours of values and of samples.

use super::ranges::Ranges;
use super::reporter::Reporter;
use super::request::PictureRequest;
use super::values::ClearSpec;
use crate::base::error::{Error, Result};
use crate::base::values::Pair;
use crate::colour::{Clear, Norm, TransferFunction};
use crate::render::sink::PictureFormat;
use crate::source::{FrameSource, value_range};

/// Whether clear values are looked for in small pictures.
pub(super) fn finds_clear(request: &PictureRequest) -> bool {
    request.clear == ClearSpec::Auto && request.norm == Norm::Linear
}

/// The values that show the background.
pub(super) fn clear_values(
    request: &PictureRequest,
    ranges: &Ranges,
    range @ (lo, hi): (f64, f64),
    reporter: &dyn Reporter,
) -> Option<Clear> {
    match request.clear {
        ClearSpec::Nothing => None,
        ClearSpec::Values(pair) => Some(Clear::new(pair.0.into(), range)),
        // A logarithm is for values near empty space.
        ClearSpec::Auto if request.norm == Norm::Log => None,
        ClearSpec::Auto => {
            let (clear, empty) = ranges.clear(range)?;
            let is_zero = empty.value.abs() < 1e-3 * (hi - lo);
            let (value, percent) = (if is_zero { 0.0 } else { empty.value as f32 }, (100.0 * empty.share).round());
            reporter.note(format_args!(
                "values near {value}, as in {percent} % of the pixels, show the background; --clear none colours them"
            ));
            Some(clear)
        }
    }
}

/// An error if a format cannot hold colours or annotations.
pub(super) fn check_format(request: &PictureRequest, format: PictureFormat, is_annotated: bool) -> Result<()> {
    let in_colours = request.colormap.is_some();
    if format == PictureFormat::Exr && in_colours {
        return Err(Error::usage("--colormap: an .exr holds numbers, not colours; take png with --depth 16"));
    }
    let why = match format {
        PictureFormat::Gray16 => "gray16 has no colours to draw in; take png, or another format",
        PictureFormat::Exr => "an .exr holds numbers to compute with; take png, or another format",
        PictureFormat::Npy if !in_colours => "an .npy holds values to compute with; give --colormap for colours",
        _ => return Ok(()),
    };
    if is_annotated { Err(Error::usage(format!("--annotate: {why}"))) } else { Ok(()) }
}

/// An error if colours of values are asked for, and samples are colours.
pub(super) fn refuse_for_colours(request: &PictureRequest) -> Result<()> {
    if request.colormap.is_some() {
        let what = "the colours are fixed, since the samples were turned into them";
        return Err(Error::usage(format!("--colormap: {what}")));
    }
    match request.norm {
        Norm::Linear => Ok(()),
        Norm::Log => Err(Error::usage("--norm: is for values with a --colormap; these samples are colours")),
    }
}

/// The colours of values, over the range if one was given.
pub(super) fn value_colours(request: &PictureRequest) -> Result<TransferFunction> {
    let map = open_colours("--colormap", request.colormap.as_deref().unwrap_or("viridis"))?;
    request.range.map_or(Ok(map.clone()), |range| map.over(range.0.into()))
}

/// The values of the first and the last colour, and the norm between them.
pub(super) fn value_spread(
    request: &PictureRequest,
    map: &TransferFunction,
    ranges: &Ranges,
    in_colours: bool,
    reporter: &dyn Reporter,
) -> Result<((f64, f64), Norm)> {
    if !in_colours {
        return Ok((ranges.values, Norm::Linear));
    }
    let norm = request.norm;
    if !map.is_of_values() {
        return Ok((ranges.automatic(norm, map)?, norm));
    }
    let ((lo, hi), (least, most)) = (map.range(), ranges.values);
    if request.range.is_none() && (most < lo || hi < least) {
        let name = request.colormap.as_deref().unwrap_or_default();
        reporter.note(format_args!(
            "{name} has colours of {lo:.4e} to {hi:.4e}, and values are {least:.4e} to {most:.4e}: --range stretches them"
        ));
    }
    Ok(((lo, hi), norm))
}

/// Opens the colours that an option names.
pub fn open_colours(option: &str, name: &str) -> Result<TransferFunction> {
    TransferFunction::open(name).map_err(|error| match error {
        Error::Path { path, problem, .. } => Error::usage(format!("{option} {}: {problem}", path.display())),
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
            let what = "standard input is read once: give --range LO,HI, the values of the first and the last colour";
            return Err(Error::usage(format!("--transfer-function {name}: {what}")));
        }
        let progress = reporter.progress("values", "frames");
        let (lo, hi) = value_range(source, missing_value, progress.as_ref())?.unwrap_or((0.0, 1.0));
        reporter.detail(format_args!("values from {lo:.4e} to {hi:.4e}; --range sets the range of the colours"));
        Ok((lo, hi))
    };
    stretched(open_colours("--transfer-function", name)?, range, all)
}
