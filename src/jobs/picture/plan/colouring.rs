//! The colours of the pictures of a run.

use super::modes;
use super::pixels::is_of_means;
use super::planes::{planes_of, with_planes};
use super::ranges::{self, KnownSamples, Needed, Ranges};
use super::targets::Targets;
use super::value_colours::{clear_values, finds_clear, refuse_for_colours, value_colours, value_spread};
use crate::picture::distributions::Distributions;
use crate::picture::reporter::Reporter;
use crate::picture::request::PictureRequest;
use crate::picture::values::{BeyondSpec, ModeName, Theme};
use serde::Serialize;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Grid;
use wavesplat_core::colour::{Clear, Distribution, Norm, Rgb, Scale, TransferFunction};
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::render::sink::PictureFormat;
use wavesplat_engine::render::{Mode, Pixel, Quantity, RenderConfig, Scene};

/// The colours of pictures and of pictures of their errors.
pub(in crate::picture) struct Colouring {
    /// The meaning of a pixel's numbers.
    pub(in crate::picture) pixel: Pixel,
    pub(in crate::picture) map: TransferFunction,
    pub(in crate::picture) picture_scale: Scale,
    pub(in crate::picture) error_scale: Scale,
    /// The value beyond the volume, if means are weighed with it.
    pub(in crate::picture) beyond: Option<f64>,
    /// Whether pictures are in colours.
    in_colours: bool,
    /// Whether pictures of errors are.
    errors_in_colours: bool,
}

/// The values of the first and the last colour, for pictures that are in colours.
#[derive(Serialize)]
pub(in crate::picture) struct ColouredPictures {
    pub(in crate::picture) range: Option<(f64, f64)>,
    pub(in crate::picture) error_range: Option<(f64, f64)>,
}

impl Colouring {
    pub(in crate::picture) fn coloured(&self) -> ColouredPictures {
        ColouredPictures {
            range: self.in_colours.then(|| self.picture_scale.range()),
            error_range: self.errors_in_colours.then(|| self.error_scale.range()),
        }
    }
}

/// The settings and facts that decide the colours of pictures.
pub(in crate::picture) struct ColouringInput<'a> {
    pub(in crate::picture) request: &'a PictureRequest,
    /// Numbers of a sample.
    pub(in crate::picture) channels: usize,
    pub(in crate::picture) config: &'a RenderConfig,
    pub(in crate::picture) pictures: &'a Targets,
    pub(in crate::picture) errors: Option<&'a Targets>,
    /// The colours of samples.
    pub(in crate::picture) colours: Option<&'a TransferFunction>,
    pub(in crate::picture) known: KnownSamples,
}

impl ColouringInput<'_> {
    /// The colours, over given ranges or those that `ranges` finds.
    pub(in crate::picture) fn colouring(
        &self,
        ranges: impl FnOnce(Needed) -> Result<Ranges>,
        reporter: &dyn Reporter,
    ) -> Result<Colouring> {
        let request = self.request;
        let pixel = self.pixel()?;
        let in_colours = !self.pictures.format.is_of_numbers() || request.colormap.is_some();
        let errors_in_colours = self.errors.is_some_and(|errors| !errors.format.is_of_numbers());
        let fixed = self.fixed_range(pixel);
        let is_clear = self.may_be_clear(pixel) && finds_clear(request);
        let sample_colours = self.colours.filter(|_| pixel != Pixel::Value);
        let map = sample_colours.map_or_else(|| value_colours(request, self.known), |colours| Ok(colours.clone()))?;
        let beyond = if in_colours { self.beyond(pixel, &map) } else { BeyondSpec::Nothing };
        let finds = fixed.is_none() || is_clear || beyond == BeyondSpec::Auto;
        let needed = Needed { pictures: in_colours && finds, beyond, errors: errors_in_colours };
        let ranges = ranges(needed)?;
        let beyond = match beyond {
            BeyondSpec::Value(value) => Some(value),
            BeyondSpec::Auto | BeyondSpec::Nothing => ranges.beyond,
        };
        let (range, norm) = match pixel {
            Pixel::Value => value_spread(request, self.known, &map, &ranges, in_colours, reporter)?,
            _ => (fixed.unwrap_or(ranges.up_from_zero()), Norm::Linear),
        };
        if (in_colours && fixed.is_none()) || errors_in_colours {
            report_ranges(range, errors_in_colours.then_some(ranges.errors.1), reporter);
        }
        if let Some(beyond) = beyond {
            reporter.detail(format_args!(
                "short rays are filled up with the value {beyond:.4e}; `beyond` none shows plain means"
            ));
        }
        let scale = |range, norm| Scale::new(&map, range, norm, background(request));
        // Where no ray meets anything, a composite has no error, and shows the background.
        let clear = (pixel == Pixel::Light).then_some(Clear { lo: 0.0, hi: 0.0, fade: 0.0 });
        let error_scale = scale(ranges.errors, Norm::Linear)?.with_clear(clear);
        let picture_scale = scale(range, norm)?;
        let may_be_clear = in_colours && self.may_be_clear(pixel);
        let clear = may_be_clear.then(|| clear_values(request, &ranges, range, reporter)).flatten();
        let picture_scale = picture_scale.with_clear(clear);
        Ok(Colouring { pixel, map, picture_scale, error_scale, beyond, in_colours, errors_in_colours })
    }

    /// The value beyond the volume, with which means are weighed. A logarithm is of plain means.
    fn beyond(&self, pixel: Pixel, map: &TransferFunction) -> BeyondSpec {
        let weighs = pixel == Pixel::Value && is_of_means(self.config) && self.request.norm == Norm::Linear;
        let fixed = (self.request.range.is_some() || map.is_of_values()).then(|| map.range());
        match (self.request.beyond, fixed) {
            _ if !weighs => BeyondSpec::Nothing,
            // Pictures over one range compare, whatever else they show.
            (BeyondSpec::Auto, Some((lo, hi))) if lo <= 0.0 && 0.0 <= hi => BeyondSpec::Value(0.0),
            (BeyondSpec::Auto, Some((lo, hi))) => BeyondSpec::Value(lo / 2.0 + hi / 2.0),
            (given, _) => given,
        }
    }

    /// Whether some values may show the background. Slices show them all.
    fn may_be_clear(&self, pixel: Pixel) -> bool {
        pixel == Pixel::Value && modes::mode_name(self.request) != ModeName::Slice
    }

    /// The meaning of a pixel's numbers. An error if options or formats cannot be used with colours.
    fn pixel(&self) -> Result<Pixel> {
        let pixel = if self.channels == 1 { self.config.mode.pixel() } else { Pixel::Channels };
        if pixel == Pixel::Value {
            return Ok(pixel);
        }
        let targets = std::iter::once(self.pictures).chain(self.errors);
        let mut grey = targets.filter(|targets| targets.format == PictureFormat::Gray16);
        if let Some(name) = grey.next().and_then(|targets| targets.names.first()) {
            let what = "gray16 holds one number a pixel, and colours are three; take png, npy or rgb24";
            return Err(Error::path(name, what));
        }
        refuse_for_colours(self.request)?;
        Ok(pixel)
    }

    /// The values of the first and the last colour, if small pictures are not needed to find them. Channels range from
    /// no to full brightness; only their sums along the ray have no limit. With a transfer function, `range` applies to
    /// samples.
    fn fixed_range(&self, pixel: Pixel) -> Option<(f64, f64)> {
        let range = self.request.range.map(|range| range.0.into());
        let bright = (self.request.quantity == Quantity::Mean).then_some((0.0, 1.0));
        match pixel {
            Pixel::Value => range,
            Pixel::Channels => range.filter(|_| self.colours.is_none()).or(bright),
            Pixel::Light => self.colours.map(TransferFunction::range),
        }
    }
}

/// The background: as given, or that of the theme.
fn background(request: &PictureRequest) -> Rgb {
    let theme_colour = match request.theme {
        Theme::Dark => [0; 3],
        Theme::Light => [255; 3],
    };
    request.background.map_or(theme_colour, |colour| colour.0)
}

/// Says what the first and the last colour stand for, and the largest error in colours, if there are errors.
fn report_ranges((lo, hi): (f64, f64), error: Option<f64>, reporter: &dyn Reporter) {
    reporter.detail(format_args!("colours from {lo:.4e} to {hi:.4e}; `range` sets them"));
    if let Some(error) = error {
        reporter.detail(format_args!("colours of errors from 0 to {error:.4e}"));
    }
}

/// The colours of a composite or of surfaces. A range that is not given ends at the largest value of small pictures.
/// Opacities that are not given are suggested from an overview of the samples.
pub(in crate::picture) fn automatic_colours(
    request: &PictureRequest,
    scene: &mut dyn Scene,
    distributions: &Distributions,
    config: &mut RenderConfig,
    colours: Option<TransferFunction>,
    reporter: &dyn Reporter,
) -> Result<Option<TransferFunction>> {
    let Some(mut colours) = colours else { return Ok(None) };
    if config.mode.pixel() != Pixel::Light {
        return Ok(Some(colours));
    }
    let mut overview = None;
    if modes::has_automatic_range(request)? {
        let needed = Needed { pictures: true, beyond: BeyondSpec::Nothing, errors: false };
        let ranges = Ranges::small(scene, config, needed, reporter)?;
        colours = modes::with_given_values(request, ranges.stretch(&colours)?)?;
        overview = ranges.into_overview();
        let (lo, hi) = colours.range();
        reporter.detail(format_args!("colours from {lo:.4e} to {hi:.4e}; `range` sets them"));
    }
    if modes::suggests_opacities(request, &colours) {
        let samples = ranges::distribution(scene, distributions, config, overview.as_ref(), reporter)?;
        colours = suggested_opacities(request, scene.grid(), &colours, samples.as_deref())?;
    }
    let planes = planes_of(&config.mode);
    config.mode = with_planes(modes::mode(request, Some(&colours))?, planes);
    Ok(Some(colours))
}

/// Says which surfaces no sample of the file reaches, and which have all samples on the source's sides.
pub(in crate::picture) fn note_surfaces(
    config: &RenderConfig,
    file: Option<&CoefficientFile>,
    reporter: &dyn Reporter,
) {
    let (Mode::Iso { surfaces, .. }, Some(file)) = (&config.mode, file) else { return };
    let (lo, hi) = file.source_range();
    for surface in surfaces.iter().filter(|surface| !(lo..=hi).contains(&surface.value)) {
        let value = surface.value;
        reporter.note(format_args!("`iso` {value}: no sample reaches it; they are from {lo:.4e} to {hi:.4e}"));
    }
    let kept = if file.keeps_sides() { file.metadata().keep().sides } else { Vec::new() };
    for surface in surfaces.iter().filter(|surface| kept.contains(&surface.value)) {
        let value = surface.value;
        reporter.note(format_args!(
            "`iso` {value}: every sample is on the source's side of it, so the surface among samples has the source's pieces and holes"
        ));
    }
}

/// The same colours, with opacities by how rare values are among some samples.
fn suggested_opacities(
    request: &PictureRequest,
    grid: &Grid,
    colours: &TransferFunction,
    samples: Option<&Distribution>,
) -> Result<TransferFunction> {
    let Some(samples) = samples else { return Ok(colours.clone()) };
    let volume: f64 = (0..3).map(|axis| grid.dims[axis] as f64 * grid.spacing[axis]).product();
    let path = volume.cbrt() / modes::opacity_unit(request, grid);
    let points = samples.opacities(colours.range(), path);
    colours.with_opacity(&points).map_err(|what| Error::value("opacity", "auto", what))
}
