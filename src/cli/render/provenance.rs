//! The settings stored in the pictures of a run.

use super::along::ModeName;
use super::args::{Cli, ErrorName, MethodName, QuantityName};
use super::colouring::Colouring;
use crate::base::grid::Grid;
use crate::base::time_labels::TimeLabels;
use crate::colour::{Norm, Scale};
use crate::file::CoefficientFile;
use crate::file::report::BoundReport;
use crate::render::sink::{Provenance, Shows};
use crate::render::{Limit, Mode, Pixel, RenderConfig, Surface};

impl Cli {
    /// The settings that pictures are rendered with.
    pub(crate) fn provenance(
        &self,
        grid: &Grid,
        config: &RenderConfig,
        (file, times): (Option<&CoefficientFile>, &TimeLabels),
        colouring: &Colouring,
    ) -> Provenance {
        let provenance = Provenance {
            software: concat!("wavesplat-render ", env!("CARGO_PKG_VERSION")).into(),
            size: self.size.0,
            tau: config.kernel.tau,
            sigma: config.kernel.sigma,
            splat_error: config.splat_error,
            tolerance: self.tolerance,
            error: self.tolerance.map(|_| match self.error {
                ErrorName::Certified => "certified",
                ErrorName::Expected => "expected",
            }),
            region: config.region.map(|region| region.to_string()),
            missing_value: self.missing_value,
            frames: config.frames.clone(),
            times: config.frames.iter().filter_map(|frame| times.times().get(*frame)).copied().collect(),
            dates: config.frames.iter().filter_map(|frame| times.date(*frame)).collect(),
            ..self.of_modes()
        };
        let provenance = of_transfer(provenance, grid, (config, file), colouring);
        let provenance = file.map_or(provenance.clone(), |file| self.of_file(provenance, file, config));
        match colouring.coloured().range {
            Some(_) => in_colours(provenance, colouring, &colouring.of_pictures),
            None => provenance,
        }
    }

    fn of_modes(&self) -> Provenance {
        let quantity = match self.quantity {
            QuantityName::Mean => "mean",
            QuantityName::Emission => "emission",
        };
        Provenance {
            method: match self.method {
                MethodName::Coefficients => "coefficients",
                MethodName::Direct => "direct",
            },
            mode: self.along.mode_name().name(),
            quantity: (self.along.mode_name() == ModeName::Projection).then_some(quantity),
            ..Provenance::default()
        }
    }

    /// Adds what is known about the coefficient file.
    fn of_file(&self, provenance: Provenance, file: &CoefficientFile, config: &RenderConfig) -> Provenance {
        let m = file.metadata();
        let reached = m.windows.iter().map(|w| w.reached).fold(0.0, f64::max);
        let certified = config.limited == Limit::Certified && !self.skip_damaged;
        Provenance {
            lod: Some(file.lod()).filter(|lod| *lod > 0),
            sample_error: certified.then(|| config.allowed.unwrap_or(0.0).max(reached)),
            file_id: Some(file.id().to_string()),
            file_promise: Some(BoundReport::from_metadata(m).promise),
            file_reached: Some(reached),
            ..provenance
        }
    }
}

/// Adds the colours of samples, applied before the transform or along the ray.
fn of_transfer(
    provenance: Provenance,
    grid: &Grid,
    (config, file): (&RenderConfig, Option<&CoefficientFile>),
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
    let [r, g, b] = colour.map(|c| (c * 255.0).round() as u8);
    format!("{value}:{r:02x}{g:02x}{b:02x}:{opacity}")
}

/// Adds the colours of pixels.
fn in_colours(provenance: Provenance, colouring: &Colouring, scale: &Scale) -> Provenance {
    let norm = match scale.norm() {
        Norm::Linear => "linear",
        Norm::Log => "log",
    };
    let [r, g, b] = scale.background();
    Provenance {
        colormap: (colouring.pixel == Pixel::Value).then(|| colouring.map.description()),
        range: Some(scale.range()),
        norm: Some(norm),
        background: Some(format!("{r:02x}{g:02x}{b:02x}")),
        clear: scale.clear().map(|clear| [clear.lo, clear.hi]),
        ..provenance
    }
}

/// The settings stored in pictures of errors.
pub(crate) fn error_provenance(provenance: &Provenance, colouring: &Colouring) -> Provenance {
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
        Some(_) => in_colours(provenance, colouring, &colouring.of_errors),
        None => provenance,
    }
}
