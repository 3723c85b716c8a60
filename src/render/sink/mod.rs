//! Finished pictures out: numbered files, one file for all, or a stream for another program. What made a picture goes
//! with it where the format has a place for words.

mod exr;
mod provenance;
mod png;
mod sheet;
mod stream;

pub use provenance::{Provenance, Shows};

use super::annotate::Annotation;
use super::config::RenderConfig;
use super::scene::Scene;
use super::{Picture, Pixel, Rendered};
use crate::base::error::{Error, Note, Remedy, Result};
use crate::base::output::{Numbered, Output, STANDARD};
use crate::colour::{Rgb, Scale};
use png::Animation;
use sheet::Sheet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How pictures are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// One PNG for each; in a stream one after the other.
    Png,
    /// One OpenEXR file for each, of float32 numbers as in an array: Y, or R, G and B, and of light A. Only where the
    /// program was built with it.
    Exr,
    /// One NumPy array for all: float32 (frames, H, W) or, of colours and of light, (frames, H, W, 3) and (frames, H,
    /// W, 4); uint8 (frames, H, W, 3) if colours were asked for.
    Npy,
    /// YUV4MPEG2, 4:4:4, full range: for video encoders and players.
    Y4m,
    /// Three bytes a pixel, nothing else.
    Rgb24,
    /// Two little-endian bytes a pixel over the range, nothing else.
    Gray16,
    /// One PNG that shows all one after another, again and again.
    Apng,
    /// One PNG with all in rows.
    Sheet,
}

impl PictureFormat {
    /// The formats by their names, which are also the endings of files, but for that of a sheet.
    pub const NAMES: [(&'static str, Self); 8] = [
        ("png", Self::Png),
        ("npy", Self::Npy),
        ("y4m", Self::Y4m),
        ("rgb24", Self::Rgb24),
        ("gray16", Self::Gray16),
        ("apng", Self::Apng),
        ("sheet", Self::Sheet),
        ("exr", Self::Exr),
    ];

    /// Whether all pictures go to one `path`.
    pub fn takes_all(self, path: &Path) -> bool {
        !matches!(self, Self::Png | Self::Exr) || path == Path::new(STANDARD)
    }

    /// Whether its pixels may have 16 bits a channel instead of 8.
    pub fn is_png(self) -> bool {
        matches!(self, Self::Png | Self::Apng | Self::Sheet)
    }

    /// Whether it holds numbers as they are, and not colours, unless these are asked for.
    pub fn is_of_numbers(self) -> bool {
        matches!(self, Self::Npy | Self::Exr)
    }

    /// An error if the program was built without what writes `path`.
    pub fn check(self, path: &Path) -> Result<()> {
        if self == Self::Exr && !exr::IS_BUILT {
            return Err(Error::path(path, Note::with(exr::NOT_BUILT, Remedy::BuildWith("exr"))));
        }
        Ok(())
    }

    /// Bytes that a file of `pictures` takes while it is written.
    ///
    /// # Errors
    /// More pictures than a sheet has room for.
    pub fn memory(self, depth: Depth, size: [usize; 2], pictures: usize) -> Result<usize> {
        let pixels = |[width, height]: [usize; 2]| width.saturating_mul(height);
        let more = match (self, depth) {
            (Self::Sheet, Depth::Eight) => pixels(sheet::size(size, pictures)?) * size_of::<Rgb>(),
            (Self::Sheet, Depth::Sixteen) => pixels(sheet::size(size, pictures)?) * size_of::<[u16; 3]>(),
            (Self::Png | Self::Apng, Depth::Sixteen) => pixels(size) * size_of::<[u16; 3]>(),
            (Self::Exr, _) => pixels(size) * Pixel::Light.numbers() * size_of::<f32>(),
            _ => 0,
        };
        Ok(Output::BUFFER + 2 * more) // and once more as it is compressed
    }
}

/// Bits a channel of colours.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Depth {
    /// 8.
    #[default]
    Eight,
    /// 16; where all colours are greys, of one channel.
    Sixteen,
}

/// What all pictures have in common. [`SinkConfig::new`] has the defaults; change others by struct update.
#[derive(Debug, Clone)]
pub struct SinkConfig {
    /// How they are written. Default: PNG.
    pub format: PictureFormat,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Which view and which frame each picture is of. Default: all frames of the first view.
    pub shown: Vec<(usize, usize)>,
    /// What made the pictures. Default: this library.
    pub provenance: Arc<Provenance>,
    /// Frames a second, where the format says it. Default: 25.
    pub fps: u32,
    /// What the numbers of a pixel are. Default: those of the scene and mode.
    pub pixel: Pixel,
    /// Values to colours.
    pub colours: Scale,
    /// Bits of these in a PNG. Default: 8.
    pub depth: Depth,
    /// Whether an array holds colours instead of values. Default: no.
    pub coloured_array: bool,
    /// What is drawn into pictures that are in colours. Default: nothing.
    pub annotation: Option<Annotation>,
    /// Whether existing files are replaced. Default: no.
    pub force: bool,
}

impl SinkConfig {
    /// For what [`render`](crate::render::render) makes of a scene.
    pub fn new(scene: &dyn Scene, config: &RenderConfig, colours: Scale) -> Self {
        let software = format!("wavesplat {}", env!("CARGO_PKG_VERSION"));
        let size = config.size();
        Self {
            format: PictureFormat::Png,
            size,
            shown: config.frames.iter().map(|frame| (0, *frame)).collect(),
            provenance: Arc::new(Provenance { software, size, ..Provenance::default() }),
            fps: 25,
            pixel: if scene.channels() > 1 { Pixel::Channels } else { config.mode.pixel() },
            colours,
            depth: Depth::Eight,
            coloured_array: false,
            annotation: None,
            force: false,
        }
    }

    /// What of a rendering is to be written.
    fn shown_of<'a>(&self, rendered: &Rendered<'a>) -> Option<Picture<'a>> {
        match self.provenance.shows {
            Shows::Picture => Some(rendered.picture),
            Shows::CertifiedError => rendered.error,
        }
    }

    /// A picture in colours, and what is drawn into it.
    fn image(&self, frame: usize, picture: Picture<'_>) -> Vec<Rgb> {
        let mut image = self.plain(picture);
        if let Some(annotation) = &self.annotation {
            let scale = (self.pixel != Pixel::Channels).then_some(&self.colours);
            annotation.draw(&mut image, self.size[0], frame, self.colours.background(), scale);
        }
        image
    }

    /// The same without what is drawn.
    fn plain(&self, picture: Picture<'_>) -> Vec<Rgb> {
        picture.chunks_exact(self.pixel.numbers()).map(|pixel| self.colours.colour_of_pixel(pixel)).collect()
    }

    /// As [`Self::image`], with 16 bits a channel; what is drawn has 8.
    fn deep_image(&self, frame: usize, picture: Picture<'_>) -> Vec<[u16; 3]> {
        let deep = |pixel| self.colours.exact_colour_of_pixel(pixel).map(|c| (c * 65535.0).round() as u16);
        let mut image: Vec<[u16; 3]> = picture.chunks_exact(self.pixel.numbers()).map(deep).collect();
        if self.annotation.is_some() {
            let (plain, drawn) = (self.plain(picture), self.image(frame, picture));
            for (i, colour) in drawn.into_iter().enumerate().filter(|(i, colour)| plain[*i] != *colour) {
                image[i] = colour.map(|c| u16::from(c) * 257);
            }
        }
        image
    }
}

/// Where pictures go.
pub struct Sink {
    target: Target,
    config: SinkConfig,
}

enum Target {
    /// One file or stream; what comes before the first picture is written with it, so that a request that cannot be
    /// met leaves a pipe empty.
    One { out: Box<Output>, begun: bool },
    /// One file that moves.
    Animation(Animation),
    /// One file that has room for all.
    Sheet(Box<Sheet>),
    /// A file for each.
    Many(Numbered),
}

impl Sink {
    /// Opens `path`: `-`, a file, or a pattern as `frame_%04d.png` that numbers files.
    pub fn open(path: &Path, config: SinkConfig) -> Result<Self> {
        if !config.format.takes_all(path) {
            let frames: Vec<usize> = config.shown.iter().map(|(_, frame)| *frame).collect();
            let paths = Self::paths(path, config.format, &frames)?;
            paths.iter().try_for_each(|path| Output::check(path, config.force))?;
            return Ok(Self { target: Target::Many(Numbered::new(path, frames.len())?), config });
        }
        if path != Path::new(STANDARD) && Numbered::new(path, 1)?.digits.is_some() {
            return Err(Error::path(path, "a pattern numbers .png and .exr files; others hold all frames"));
        }
        let out = Output::create(path, config.force)?;
        let target = match config.format {
            PictureFormat::Apng => Target::Animation(Animation::new(out)),
            PictureFormat::Sheet => Target::Sheet(Box::new(Sheet::new(out, &config)?)),
            _ => Target::One { out: Box::new(out), begun: false },
        };
        Ok(Self { target, config })
    }

    /// The files that pictures of some frames go to.
    pub fn paths(path: &Path, format: PictureFormat, frames: &[usize]) -> Result<Vec<PathBuf>> {
        if format.takes_all(path) {
            return Ok(vec![path.into()]);
        }
        let names = Numbered::new(path, frames.len())?;
        Ok(frames.iter().map(|frame| names.of(*frame)).collect())
    }

    /// Writes what it shows of a frame, if there is such a thing.
    pub fn picture(&mut self, rendered: &Rendered<'_>) -> Result<()> {
        let (config, frame) = (&self.config, rendered.frame);
        let Some(picture) = config.shown_of(rendered) else { return Ok(()) };
        match &mut self.target {
            Target::One { out, begun } => {
                let header = if std::mem::replace(begun, true) { Ok(()) } else { stream::begin(config, out) };
                let written = header.and_then(|()| stream::write(config, rendered, picture, out));
                written.map_err(|e| Error::io(out.path(), format!("writing frame {frame}"), e))
            }
            Target::Animation(animation) => animation.picture(config, rendered, picture),
            Target::Sheet(sheet) => {
                sheet.picture(config, rendered, picture);
                Ok(())
            }
            Target::Many(names) => {
                let path = names.of(frame);
                let mut out = Output::create(&path, config.force)?;
                stream::write(config, rendered, picture, &mut out).map_err(|e| Error::io(&path, "writing", e))?;
                out.commit()
            }
        }
    }

    /// Ends the stream and gives the file its final name.
    pub fn finish(self) -> Result<()> {
        match self.target {
            Target::One { out, .. } => out.commit(),
            Target::Animation(animation) => animation.finish(),
            Target::Sheet(sheet) => sheet.finish(&self.config),
            Target::Many(_) => Ok(()),
        }
    }
}
