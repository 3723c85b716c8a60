//! Where pictures go, and in which colours.

use crate::Cli;
use crate::QuantityName;
use crate::colours::Ranges;
use crate::targets::Targets;
use serde::Serialize;
use wavesplat::colour::{Norm, Scale, TransferFunction};
use wavesplat::error::{Error, Result};
use wavesplat::render::annotate::Annotation;
use wavesplat::render::sink::{PictureFormat, Sink, SinkConfig};
use wavesplat::render::{Mode, Pixel, RenderConfig, Scene, check};

/// Slabs of small pictures that only a range is judged by.
const FEW_SLABS: usize = 32;

impl Cli {
    /// Where the pictures of each view go, where those of their errors go, if anywhere, and the values of their colours.
    pub(crate) fn sinks(
        &self,
        scene: &mut dyn Scene,
        config: &RenderConfig,
        (pictures, errors): (Targets, Option<Targets>),
        (times, colours): (Vec<f64>, Option<&TransferFunction>),
    ) -> Result<(Vec<Sink>, Vec<Sink>, Coloured)> {
        let pixel = self.pixel(scene, config, [Some(&pictures), errors.as_ref()])?;
        let certify = errors.as_ref().is_some_and(|errors| errors.format != PictureFormat::Npy);
        let in_colours = pictures.format != PictureFormat::Npy || self.colour.is_asked();
        let fixed = self.fixed_range(pixel, colours);
        let needed = in_colours && fixed.is_none() || certify;
        let mode = if config.mode.is_projection() { Mode::Projection } else { Mode::Mip { slabs: Some(FEW_SLABS) } };
        let looking = RenderConfig { certify, mode, ..config.clone() };
        if needed {
            check(scene, config)?; // or small pictures would be made in vain, and what they need be named
        }
        let seen = if needed { Ranges::of(scene, looking)? } else { Ranges::default() };
        let map = if pixel == Pixel::Value {
            self.colour.map()?
        } else {
            colours.map_or_else(|| self.colour.map(), |c| Ok(c.clone()))?
        };
        let (range, norm) = match (pixel, fixed) {
            (Pixel::Value, _) => self.colour.spread(&map, &seen, in_colours, &self.common)?,
            (_, fixed) => (fixed.unwrap_or(seen.up_from_zero()), Norm::Linear),
        };
        if needed {
            self.common.detail(format_args!("colours from {:.4e} to {:.4e}; --range sets them", range.0, range.1));
        }
        if certify {
            self.common.detail(format_args!("colours of errors from 0 to {:.4e}", seen.errors.1));
        }
        let annotation = self.colour.annotate.then_some(Annotation { times });
        let open = |targets: Targets, pixel, colours, coloured_array| {
            let sink = SinkConfig {
                format: targets.format,
                size: self.size.0,
                frames: targets.frames(config),
                fps: self.fps,
                pixel,
                colours,
                coloured_array,
                annotation: annotation.clone(),
                force: self.force,
            };
            targets.names.iter().map(|name| Sink::open(name, sink.clone())).collect::<Result<Vec<_>>>()
        };
        let scale = |range, norm| Scale::new(&map, range, norm, self.colour.background);
        let (of_errors, of_error) =
            (scale(seen.errors, Norm::Linear)?, if pixel == Pixel::Light { Pixel::Value } else { pixel });
        let errors = errors.map_or(Ok(Vec::new()), |errors| open(errors, of_error, of_errors, false))?;
        let coloured = Coloured { range: in_colours.then_some(range), error_range: certify.then_some(seen.errors) };
        Ok((open(pictures, pixel, scale(range, norm)?, self.colour.is_asked())?, errors, coloured))
    }

    /// The colours of a composite that nobody gave a range for, by the largest values that small pictures show.
    pub(crate) fn without_spots(
        &self,
        scene: &mut dyn Scene,
        config: &mut RenderConfig,
        colours: Option<TransferFunction>,
    ) -> Result<Option<TransferFunction>> {
        let Some(all) = colours.as_ref().filter(|_| config.mode.pixel() == Pixel::Light) else { return Ok(colours) };
        if !self.along.is_automatic(self.colour.range)? {
            return Ok(colours);
        }
        check(scene, config)?;
        let looking = RenderConfig { mode: Mode::Mip { slabs: Some(FEW_SLABS) }, ..config.clone() };
        let colours = Ranges::of(scene, looking)?.without_spots(all)?;
        let (lo, hi) = colours.range();
        self.common.detail(format_args!("colours from {lo:.4e} to {hi:.4e}; --range sets them"));
        config.mode = self.along.mode(Some(&colours))?;
        Ok(Some(colours))
    }

    /// What the numbers of a pixel are; an error where options or formats have no use for colours.
    fn pixel(&self, scene: &dyn Scene, config: &RenderConfig, targets: [Option<&Targets>; 2]) -> Result<Pixel> {
        let pixel = if scene.channels() == 1 { config.mode.pixel() } else { Pixel::Channels };
        if pixel == Pixel::Value {
            return Ok(pixel);
        }
        if targets.into_iter().flatten().any(|targets| targets.format == PictureFormat::Gray16) {
            return Err(Error::usage("gray16: holds one number a pixel, and colours are three"));
        }
        self.colour.refuse_for_colours()?;
        Ok(pixel)
    }

    /// The values of the first and the last colour, where small pictures need not tell. Channels are bright between none and all;
    /// only their sums along the ray know no end. With a transfer function --range is that of samples.
    fn fixed_range(&self, pixel: Pixel, colours: Option<&TransferFunction>) -> Option<(f64, f64)> {
        let bright = (self.quantity == QuantityName::Mean).then_some((0.0, 1.0));
        match pixel {
            Pixel::Value => self.range(),
            Pixel::Channels => self.range().filter(|_| colours.is_none()).or(bright),
            Pixel::Light => colours.map(TransferFunction::range),
        }
    }

    fn range(&self) -> Option<(f64, f64)> {
        self.colour.range.map(|range| range.0.into())
    }
}

/// The values of the first and the last colour, of what is in colours.
#[derive(Serialize)]
pub(crate) struct Coloured {
    range: Option<(f64, f64)>,
    error_range: Option<(f64, f64)>,
}

/// Where the pictures of a view go: all may go to one.
pub(crate) fn of_view(sinks: &mut [Sink], view: usize) -> Option<&mut Sink> {
    let place = if sinks.len() == 1 { 0 } else { view };
    sinks.get_mut(place)
}
