//! The colours of the pictures of a run.

use super::along::ModeName;
use super::args::{Cli, QuantityName};
use super::cuts::{planes_of, with_planes};
use super::ranges::{self, Ranges};
use super::targets::Targets;
use crate::base::error::{Error, Result};
use crate::colour::{Norm, Rgb, Scale, TransferFunction};
use crate::file::CoefficientFile;
use crate::render::sink::PictureFormat;
use crate::render::{Mode, Pixel, RenderConfig, Scene};
use serde::Serialize;

/// The colours of pictures and of pictures of their errors.
pub(crate) struct Colouring {
    /// The meaning of a pixel's numbers.
    pub(crate) pixel: Pixel,
    pub(crate) map: TransferFunction,
    pub(crate) of_pictures: Scale,
    pub(crate) of_errors: Scale,
    /// Whether pictures, and pictures of errors, are in colours.
    in_colours: (bool, bool),
}

/// The values of the first and the last colour, for pictures that are in colours.
#[derive(Serialize)]
pub(crate) struct ColouredPictures {
    pub(crate) range: Option<(f64, f64)>,
    pub(crate) error_range: Option<(f64, f64)>,
}

impl Colouring {
    pub(crate) fn coloured(&self) -> ColouredPictures {
        let (pictures, errors) = self.in_colours;
        ColouredPictures {
            range: pictures.then(|| self.of_pictures.range()),
            error_range: errors.then(|| self.of_errors.range()),
        }
    }
}

impl Cli {
    /// The colours, over given ranges or those that `ranges` finds: of pictures, and of their errors, if they are needed.
    pub(crate) fn colouring(
        &self,
        channels: usize,
        config: &RenderConfig,
        (pictures, errors): (&Targets, Option<&Targets>),
        colours: Option<&TransferFunction>,
        ranges: impl FnOnce((bool, bool)) -> Result<Ranges>,
    ) -> Result<Colouring> {
        let pixel = self.pixel(channels, config, [Some(pictures), errors])?;
        let in_colours = !pictures.format.is_of_numbers() || self.colour.is_asked();
        let of_errors = errors.is_some_and(|errors| !errors.format.is_of_numbers());
        let fixed = self.fixed_range(pixel, colours);
        let is_clear = self.may_be_clear(pixel) && self.colour.finds_clear();
        let needed = (in_colours && (fixed.is_none() || is_clear), of_errors);
        let ranges = ranges(needed)?;
        let map = colours.filter(|_| pixel != Pixel::Value).map_or_else(|| self.colour.map(), |c| Ok(c.clone()))?;
        let (range, norm) = match pixel {
            Pixel::Value => self.colour.spread(&map, &ranges, in_colours, &self.common)?,
            _ => (fixed.unwrap_or(ranges.up_from_zero()), Norm::Linear),
        };
        self.report_ranges(range, &ranges, (needed.0 && fixed.is_none(), of_errors));
        let scale = |range, norm| Scale::new(&map, range, norm, self.background());
        let (of_pictures, of_errors_too) = (scale(range, norm)?, scale(ranges.errors, Norm::Linear)?);
        let clear = (in_colours && self.may_be_clear(pixel)).then(|| self.colour.clear(&ranges, range, &self.common));
        let of_pictures = of_pictures.with_clear(clear.flatten());
        Ok(Colouring { pixel, of_pictures, of_errors: of_errors_too, in_colours: (in_colours, of_errors), map })
    }

    /// Whether some values may show the background. Slices show them all.
    fn may_be_clear(&self, pixel: Pixel) -> bool {
        pixel == Pixel::Value && self.along.mode_name() != ModeName::Slice
    }

    /// The background: as given, or that of the theme.
    fn background(&self) -> Rgb {
        self.colour.background.unwrap_or_else(|| self.around.background())
    }

    fn report_ranges(&self, (lo, hi): (f64, f64), ranges: &Ranges, (of_pictures, of_errors): (bool, bool)) {
        if of_pictures || of_errors {
            self.common.detail(format_args!("colours from {lo:.4e} to {hi:.4e}; --range sets them"));
        }
        if of_errors {
            self.common.detail(format_args!("colours of errors from 0 to {:.4e}", ranges.errors.1));
        }
    }

    /// The meaning of a pixel's numbers. An error if options or formats cannot be used with colours.
    fn pixel(&self, channels: usize, config: &RenderConfig, targets: [Option<&Targets>; 2]) -> Result<Pixel> {
        let pixel = if channels == 1 { config.mode.pixel() } else { Pixel::Channels };
        if pixel == Pixel::Value {
            return Ok(pixel);
        }
        let mut grey = targets.into_iter().flatten().filter(|targets| targets.format == PictureFormat::Gray16);
        if let Some(name) = grey.next().and_then(|targets| targets.names.first()) {
            let what = "gray16 holds one number a pixel, and colours are three; take png, npy or rgb24";
            return Err(Error::usage(format!("{}: {what}", name.display())));
        }
        self.colour.refuse_for_colours()?;
        Ok(pixel)
    }

    /// The values of the first and the last colour, if small pictures are not needed to find them. Channels range from
    /// no to full brightness; only their sums along the ray have no limit. With a transfer function, --range applies to
    /// samples.
    fn fixed_range(&self, pixel: Pixel, colours: Option<&TransferFunction>) -> Option<(f64, f64)> {
        let range = self.colour.range.map(|range| range.0.into());
        let bright = (self.quantity == QuantityName::Mean).then_some((0.0, 1.0));
        match pixel {
            Pixel::Value => range,
            Pixel::Channels => range.filter(|_| colours.is_none()).or(bright),
            Pixel::Light => colours.map(TransferFunction::range),
        }
    }
}

impl Cli {
    /// The colours of a composite or of surfaces. A range that is not given ends at the largest value of small pictures.
    /// Opacities that are not given are suggested from an overview of the samples.
    pub(crate) fn automatic_colours(
        &self,
        scene: &mut dyn Scene,
        config: &mut RenderConfig,
        colours: Option<TransferFunction>,
    ) -> Result<Option<TransferFunction>> {
        let Some(mut colours) = colours else { return Ok(None) };
        if config.mode.pixel() != Pixel::Light {
            return Ok(Some(colours));
        }
        if self.along.is_automatic(self.colour.range)? {
            colours = Ranges::small(scene, config, (true, false), &self.common)?.stretch(&colours)?;
            let (lo, hi) = colours.range();
            self.common.detail(format_args!("colours from {lo:.4e} to {hi:.4e}; --range sets them"));
        }
        if self.along.suggests_opacities(&colours) {
            colours = self.suggested_opacities(scene, config, &colours)?;
        }
        let planes = planes_of(&config.mode);
        config.mode = with_planes(self.along.mode(Some(&colours))?, planes);
        Ok(Some(colours))
    }

    /// Says which surfaces no sample of the file reaches.
    pub(crate) fn note_surfaces(&self, config: &RenderConfig, file: Option<&CoefficientFile>) {
        let (Mode::Iso { surfaces, .. }, Some(file)) = (&config.mode, file) else { return };
        let (lo, hi) = file.source_range();
        for surface in surfaces.iter().filter(|surface| !(lo..=hi).contains(&surface.value)) {
            let value = surface.value;
            self.common.note(format_args!("--iso {value}: no sample reaches it; they are from {lo:.4e} to {hi:.4e}"));
        }
    }

    /// The same colours, with opacities by how rare values are.
    fn suggested_opacities(
        &self,
        scene: &mut dyn Scene,
        config: &RenderConfig,
        colours: &TransferFunction,
    ) -> Result<TransferFunction> {
        let Some(samples) = ranges::distribution(scene, config, &self.common)? else { return Ok(colours.clone()) };
        let grid = scene.grid();
        let volume: f64 = (0..3).map(|axis| grid.dims[axis] as f64 * grid.spacing[axis]).product();
        let path = volume.cbrt() / self.along.unit(grid);
        let points = samples.opacities(colours.range(), path);
        colours.with_opacity(&points).map_err(|what| Error::usage(format!("--opacity auto: {what}")))
    }
}
