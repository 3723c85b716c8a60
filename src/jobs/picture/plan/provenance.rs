//! The settings stored in the pictures of a run.

use super::colouring::Colouring;
use super::modes::mode_name;
use crate::picture::request::PictureRequest;
use crate::picture::values::{HexColour, ModeName};
use wavesplat_core::base::choice::Choice;
use wavesplat_core::base::grid::Grid;
use wavesplat_core::base::time_labels::TimeLabels;
use wavesplat_core::colour::Scale;
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::file::report::BoundReport;
use wavesplat_engine::render::sink::{Provenance, Shows};
use wavesplat_engine::render::{Limit, Mode, Pixel, RenderConfig, Surface};

/// The settings that pictures are rendered with.
pub(in crate::picture) fn provenance(
    request: &PictureRequest,
    grid: &Grid,
    config: &RenderConfig,
    file: Option<&CoefficientFile>,
    times: &TimeLabels,
    colouring: &Colouring,
) -> Provenance {
    let mode = mode_name(request);
    let provenance = Provenance {
        software: concat!("wavesplat-render ", env!("CARGO_PKG_VERSION")).into(),
        method: request.method.name(),
        mode: mode.name(),
        quantity: (mode == ModeName::Projection).then_some(request.quantity.name()),
        size: request.size.0,
        tau: config.kernel.tau,
        sigma: sigma(config, grid),
        splat_error: config.splat_error,
        tolerance: request.tolerance,
        error: request.tolerance.map(|_| request.error.name()),
        region: config.region.map(|region| region.to_string()),
        missing_value: request.missing_value,
        annotate: request.annotate.map(|parts| parts.to_string()),
        title: request.title.clone().filter(|title| !title.is_empty()),
        bar_title: request.bar_title.clone().filter(|title| !title.is_empty()),
        frames: config.frames.clone(),
        times: config.frames.iter().filter_map(|frame| times.times().get(*frame)).copied().collect(),
        dates: config.frames.iter().filter_map(|frame| times.date(*frame)).collect(),
        ..Provenance::default()
    };
    let provenance = with_sample_colours(provenance, grid, config, file, colouring);
    let provenance = match file {
        Some(file) => with_file(provenance, request, file, config),
        None => provenance,
    };
    match colouring.coloured().range {
        Some(_) => in_colours(provenance, colouring, &colouring.picture_scale),
        None => provenance,
    }
}

/// The kernel's standard deviation in world units; `None` if it differs from axis to axis.
fn sigma(config: &RenderConfig, grid: &Grid) -> Option<f64> {
    let [x, y, z] = grid.spacing;
    let differs = config.kernel.follows_axes && config.mode != Mode::Projection && (x != y || y != z);
    (!differs).then_some(config.kernel.sigma)
}

/// Adds what is known about the coefficient file.
fn with_file(
    provenance: Provenance,
    request: &PictureRequest,
    file: &CoefficientFile,
    config: &RenderConfig,
) -> Provenance {
    let m = file.metadata();
    let reached = m.windows.iter().map(|w| w.reached).fold(0.0, f64::max);
    let certified = config.error == Limit::Certified && !request.skip_damaged;
    Provenance {
        lod: Some(file.lod()).filter(|lod| *lod > 0),
        sample_error: certified.then(|| config.allowed.unwrap_or(0.0).max(reached)),
        file_id: Some(file.id().to_string()),
        file_promise: Some(BoundReport::from_metadata(m).promise),
        file_reached: Some(reached),
        ..provenance
    }
}

/// Adds the colours of samples, applied before the transform or along the ray.
fn with_sample_colours(
    provenance: Provenance,
    grid: &Grid,
    config: &RenderConfig,
    file: Option<&CoefficientFile>,
    colouring: &Colouring,
) -> Provenance {
    let painter = file.and_then(CoefficientFile::colour_transform).map(|painter| painter.colours.words());
    let words = || painter.unwrap_or_else(|| colouring.map.words());
    let provenance = Provenance { transfer_function: (colouring.pixel != Pixel::Value).then(words), ..provenance };
    match &config.mode {
        Mode::Composite { transfer, unit, light, .. } => Provenance {
            opacity: Some(transfer.opacity_words()),
            opacity_unit: Some(unit.unwrap_or_else(|| grid.largest_spacing())),
            light: light.map(|light| [light.azimuth, light.elevation]),
            ..provenance
        },
        Mode::Iso { surfaces, light, .. } => Provenance {
            iso: Some(surfaces.iter().map(words_of).collect::<Vec<_>>().join(",")),
            light: Some([light.azimuth, light.elevation]),
            ..provenance
        },
        Mode::Projection | Mode::Mip { .. } | Mode::Planes { .. } => provenance,
    }
}

/// A surface in the form of --iso.
fn words_of(Surface { value, colour, opacity }: &Surface) -> String {
    let colour = HexColour(colour.map(|c| (c * 255.0).round() as u8));
    format!("{value}:{colour}:{opacity}")
}

/// Adds the colours of pixels.
fn in_colours(provenance: Provenance, colouring: &Colouring, scale: &Scale) -> Provenance {
    Provenance {
        colormap: (colouring.pixel == Pixel::Value).then(|| colouring.map.description()),
        range: Some(scale.range()),
        norm: Some(scale.norm().name()),
        background: Some(HexColour(scale.background()).to_string()),
        clear: scale.clear().map(|clear| [clear.lo, clear.hi]),
        beyond: colouring.beyond,
        ..provenance
    }
}

/// The settings stored in pictures of errors.
pub(in crate::picture) fn error_provenance(provenance: &Provenance, colouring: &Colouring) -> Provenance {
    let provenance = Provenance {
        shows: Shows::CertifiedError,
        colormap: None,
        range: None,
        norm: None,
        background: None,
        clear: None,
        ..provenance.clone()
    };
    match colouring.coloured().error_range {
        Some(_) => Provenance { beyond: None, ..in_colours(provenance, colouring, &colouring.error_scale) },
        None => provenance,
    }
}
