//! How the samples along a ray make a pixel, and which settings each mode accepts.

use super::named_colours::open_colours;
use super::named_colours::stretched;
use crate::picture::request::PictureRequest;
use crate::picture::values::ModeName;
use wavesplat_core::base::choice::Choice;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Grid;
use wavesplat_core::base::values::Numbers;
use wavesplat_core::colour::{Opacities, TransferFunction};
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::render::{Light, Mode};

/// The mode: as given, or the one that other fields imply.
pub(in crate::picture) fn mode_name(request: &PictureRequest) -> ModeName {
    match (request.mode, &request.iso) {
        (None, _) if !request.slice.is_empty() => ModeName::Slice,
        (None, Some(_)) => ModeName::Iso,
        (mode, _) => mode.unwrap_or(ModeName::Projection),
    }
}

/// The unit of the progress of pictures.
pub(in crate::picture) fn unit(mode: &Mode) -> &'static str {
    match mode {
        Mode::Projection | Mode::Planes { .. } => "pictures",
        Mode::Composite { .. } | Mode::Iso { .. } | Mode::Mip { .. } => "slices",
    }
}

/// An error if a field does not apply to the mode. `is_direct` is whether frames are splatted.
pub(in crate::picture) fn check(request: &PictureRequest, is_direct: bool) -> Result<()> {
    let mode = mode_name(request);
    let needs = |given: bool, field: &'static str, takes: fn(ModeName) -> bool| {
        (given && !takes(mode)).then(|| (field, format!("needs `mode` {}", names(takes))))
    };
    let colours = || {
        (request.colormap.is_some() && mode.colours_samples())
            .then(|| ("colormap", format!("`mode` {} takes its colours from `transfer_function`", mode.name())))
    };
    let refused = needs(request.opacity.is_some(), "opacity", ModeName::has_opacities)
        .or_else(|| needs(request.opacity_unit.is_some(), "opacity_unit", ModeName::has_opacities))
        .or_else(|| needs(request.iso.is_some(), "iso", ModeName::is_of_surfaces))
        .or_else(|| needs(request.shade, "shade", ModeName::has_opacities))
        .or_else(|| needs(request.light.is_some(), "light", ModeName::colours_samples))
        .or_else(|| needs(request.slices.is_some(), "slices", ModeName::has_slices))
        .or_else(colours)
        .or_else(|| request.transfer_function.as_ref().and_then(|_| refuse_colours(mode, is_direct)));
    if let Some((field, what)) = refused {
        return Err(Error::setting(field, what));
    }
    let positive = request.opacity_unit.is_none_or(|unit| unit.is_finite() && unit > 0.0);
    if positive { Ok(()) } else { Err(Error::setting("opacity_unit", "takes a length above 0")) }
}

/// An error if slices are missing, or the mode takes none.
pub(in crate::picture) fn check_slices(request: &PictureRequest) -> Result<()> {
    match (request.slice.is_empty(), request.mode) {
        (true, Some(ModeName::Slice)) => Err(Error::value("mode", "slice", "needs `slice`, like `slice` z=0.5")),
        (true, _) | (false, None | Some(ModeName::Slice | ModeName::Composite)) => Ok(()),
        (false, Some(mode)) => {
            Err(Error::setting("slice", format!("needs `mode` slice or composite, not {}", mode.name())))
        }
    }
}

/// The names of all modes with a property, for messages.
fn names(has: impl Fn(ModeName) -> bool) -> String {
    let modes = ModeName::CHOICES.iter().filter(|(_, mode, _)| has(*mode));
    modes.map(|(name, ..)| *name).collect::<Vec<_>>().join(" or ")
}

/// Why `transfer_function` does not apply to the mode, if it does not.
fn refuse_colours(mode: ModeName, is_direct: bool) -> Option<(&'static str, String)> {
    let why = match mode {
        ModeName::Composite | ModeName::Iso => return None,
        ModeName::Projection if is_direct => return None, // frames are turned into colours before they are splatted
        ModeName::Projection => {
            "with a coefficient file, it colours samples along the ray (`mode` composite); `colormap` colours \
             projections, and wavesplat convert `transfer_function` makes files of colours"
        }
        ModeName::Mip => "`mode` mip takes `colormap`",
        ModeName::Slice => "`slice` takes `colormap`",
    };
    Some(("transfer_function", why.into()))
}

/// The name of the colours of a composite, or of coloured frames.
pub(in crate::picture) fn sample_colours(request: &PictureRequest) -> Option<&str> {
    let usual = mode_name(request).colours_samples().then_some("viridis");
    request.transfer_function.as_deref().or(usual)
}

/// Whether the range of a composite's colours is automatic: neither given nor stored with the colours.
pub(in crate::picture) fn has_automatic_range(request: &PictureRequest) -> Result<bool> {
    let colours_samples = mode_name(request).colours_samples();
    let Some(name) = sample_colours(request).filter(|_| colours_samples && request.range.is_none()) else {
        return Ok(false);
    };
    Ok(!TransferFunction::open(name)?.is_of_values())
}

/// Whether the opacities of a composite are to be suggested: neither given nor stored with the colours.
pub(in crate::picture) fn suggests_opacities(request: &PictureRequest, colours: &TransferFunction) -> bool {
    let suggests = match &request.opacity {
        Some(Opacities::Auto) => true,
        Some(Opacities::Points(_)) => false,
        None => colours.name().is_some(),
    };
    suggests && mode_name(request).has_opacities()
}

/// Colours whose range has all values at which opacities are given, unless the range is given or stored with the colours.
pub(in crate::picture) fn with_given_values(
    request: &PictureRequest,
    colours: TransferFunction,
) -> Result<TransferFunction> {
    let Some(Opacities::Points(points)) = &request.opacity else { return Ok(colours) };
    let around = |(lo, hi): (f64, f64), value: f64| (lo.min(value), hi.max(value));
    let range = points.values().fold(colours.range(), around);
    if range == colours.range() || !has_automatic_range(request)? { Ok(colours) } else { colours.over(range) }
}

/// The length over which opacities apply.
pub(in crate::picture) fn opacity_unit(request: &PictureRequest, grid: &Grid) -> f64 {
    request.opacity_unit.unwrap_or_else(|| grid.largest_spacing())
}

/// The colours of a composite of a file, over the given range, their own range, or that of all samples.
pub(in crate::picture) fn colours_of_file(
    request: &PictureRequest,
    file: &CoefficientFile,
) -> Result<Option<TransferFunction>> {
    let colours_samples = mode_name(request).colours_samples();
    let Some(name) = sample_colours(request).filter(|_| colours_samples) else { return Ok(None) };
    let colours = open_colours("transfer_function", name)?;
    let colours = stretched(colours, request.range, || Ok(file.source_range()))?;
    with_given_values(request, colours).map(Some)
}

/// The mode with these colours, which a composite needs.
pub(in crate::picture) fn mode(request: &PictureRequest, colours: Option<&TransferFunction>) -> Result<Mode> {
    let slices = request.slices;
    Ok(match mode_name(request) {
        ModeName::Projection => Mode::Projection,
        ModeName::Composite => {
            let transfer = needed(colours)?;
            let transfer = match &request.opacity {
                Some(Opacities::Points(points)) => {
                    points.at_shares(transfer.range()).and_then(|points| transfer.with_opacity(&points))
                }
                Some(Opacities::Auto) | None => Ok(transfer.clone()),
            };
            let transfer = transfer.map_err(|what| Error::setting("opacity", what))?;
            let light = (request.shade || request.light.is_some()).then(|| lamp(request));
            Mode::Composite { transfer, unit: request.opacity_unit, slices, light, planes: Vec::new() }
        }
        ModeName::Mip => Mode::Mip { slices },
        ModeName::Iso => {
            let list = request.iso.clone().unwrap_or_default();
            let surfaces = list.surfaces(needed(colours)?, request.transfer_function.is_some());
            Mode::Iso { surfaces, light: lamp(request), slices }
        }
        ModeName::Slice => Mode::Planes { planes: Vec::new(), panels: Vec::new() },
    })
}

fn lamp(request: &PictureRequest) -> Light {
    let usual = Light::default();
    request.light.map_or(usual, |Numbers([azimuth, elevation])| Light { azimuth, elevation, ..usual })
}

/// The colours of samples.
fn needed(colours: Option<&TransferFunction>) -> Result<&TransferFunction> {
    colours.ok_or_else(|| Error::setting("mode", "needs `transfer_function`"))
}
