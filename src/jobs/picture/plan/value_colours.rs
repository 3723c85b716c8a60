//! The colours of values: map, range, norm, and which values show the background.

use super::named_colours::open_colours;
use super::ranges::{KnownSamples, Ranges};
use crate::picture::reporter::Reporter;
use crate::picture::request::PictureRequest;
use crate::picture::values::ClearSpec;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::colour::{Clear, Norm, TransferFunction};

/// Whether clear values are looked for in small pictures.
pub(in crate::picture) fn finds_clear(request: &PictureRequest) -> bool {
    request.clear == ClearSpec::Auto && request.norm == Norm::Linear
}

/// The values that show the background.
pub(in crate::picture) fn clear_values(
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
                "values near {value}, as in {percent} % of the pixels, show the background; `clear` none colours them"
            ));
            Some(clear)
        }
    }
}

/// An error if colours of values are asked for, and samples are colours.
pub(in crate::picture) fn refuse_for_colours(request: &PictureRequest) -> Result<()> {
    if request.colormap.is_some() {
        let what = "the colours are fixed, since the samples were turned into them";
        return Err(Error::setting("colormap", what));
    }
    match request.norm {
        Norm::Linear => Ok(()),
        Norm::Log => Err(Error::setting("norm", "is for values with a `colormap`; these samples are colours")),
    }
}

/// The colours of values, over the range if one was given. Those of bodies are greys unless others are given.
pub(in crate::picture) fn value_colours(request: &PictureRequest, known: KnownSamples) -> Result<TransferFunction> {
    let usual = if known.are_of_body { "grey" } else { "viridis" };
    let map = open_colours("colormap", request.colormap.as_deref().unwrap_or(usual))?;
    request.range.map_or(Ok(map.clone()), |range| map.over(range.0.into()))
}

/// The values of the first and the last colour, and the norm between them.
pub(in crate::picture) fn value_spread(
    request: &PictureRequest,
    known: KnownSamples,
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
        return Ok((ranges.automatic(norm, map, known)?, norm));
    }
    let ((lo, hi), (least, most)) = (map.range(), ranges.values);
    if request.range.is_none() && (most < lo || hi < least) {
        let name = request.colormap.as_deref().unwrap_or_default();
        reporter.note(format_args!(
            "{name} has colours of {lo:.4e} to {hi:.4e}, and values are {least:.4e} to {most:.4e}: `range` stretches them"
        ));
    }
    Ok(((lo, hi), norm))
}
