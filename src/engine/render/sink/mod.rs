//! Output of finished pictures: numbered files, one file for all, or a stream to another program. Formats with text
//! fields also store the provenance.

mod exr;
mod page_encoder;
mod movie;
mod ours;
mod page;
mod provenance;
mod png;
mod sheet;
mod stream;

pub use super::ray_lengths::{RayLengths, Weighing, weighed};
pub use movie::MovieFormat;
pub use ours::is_ours;
pub use page_encoder::{BlockOfFrames, PageEncoder};
pub use provenance::{Provenance, Shows};

use super::annotate::{Annotation, Finished};
use super::batches::Scene;
use super::config::RenderConfig;
use super::{Picture, Pixel, Rendered};
use movie::Movie;
use page::Page;
use png::Animation;
use rayon::prelude::*;
use sheet::Sheet;
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use wavesplat_core::base::choice::Choice;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::output::{Numbered, Output, STANDARD};
use wavesplat_core::colour::{Rgb, Scale};

/// How pictures are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// One PNG for each picture; in a stream, one after the other.
    Png,
    /// One OpenEXR file for each picture, of unconverted float32 numbers: Y for values, R, G and B for colours, and A
    /// too for light. Needs the feature `exr`.
    Exr,
    /// One NumPy array for all pictures: float32 (frames, H, W) for values, (frames, H, W, 3) for colours and (frames,
    /// H, W, 4) for light; uint8 (frames, H, W, 3) if a coloured array is requested.
    Npy,
    /// YUV4MPEG2, full range, 4:2:0 or, if a side is odd, 4:4:4: for video encoders and players.
    Y4m,
    /// Raw frames: three bytes per pixel, no header.
    Rgb24,
    /// Raw frames: two little-endian bytes per pixel, spread over the range, no header.
    Gray16,
    /// One animated PNG of all pictures, in an endless loop.
    Apng,
    /// One PNG with all pictures in rows.
    Sheet,
    /// One movie of all pictures, made by ffmpeg.
    Movie(MovieFormat),
    /// One web page with all pictures, which opens without a server.
    Page,
}

impl PictureFormat {
    /// Whether all pictures go to one file or stream at `path`.
    pub fn takes_all(self, path: &Path) -> bool {
        !matches!(self, Self::Png | Self::Exr) || path == Path::new(STANDARD)
    }

    /// Whether the format is a kind of PNG, whose pixels may have 16 bits per channel instead of 8.
    pub fn is_png(self) -> bool {
        matches!(self, Self::Png | Self::Apng | Self::Sheet)
    }

    /// Whether the format holds unconverted numbers unless colours are requested.
    pub fn is_of_numbers(self) -> bool {
        matches!(self, Self::Npy | Self::Exr)
    }

    /// An error if this build cannot write the format.
    pub fn check(self, path: &Path) -> Result<()> {
        if self == Self::Exr && !exr::IS_BUILT {
            return Err(Error::path(path, Note::with(exr::NOT_BUILT, Remedy::BuildWith("exr"))));
        }
        Ok(())
    }

    /// Memory in bytes to write a file of `pictures` pictures of `size` pixels.
    ///
    /// # Errors
    /// More pictures than fit on a sheet.
    pub fn memory(self, depth: Depth, size: [usize; 2], pictures: usize) -> Result<usize> {
        let pixels = |[width, height]: [usize; 2]| width.saturating_mul(height);
        let more = match (self, depth) {
            (Self::Sheet, Depth::Eight) => pixels(sheet::size(size, pictures)?) * size_of::<Rgb>(),
            (Self::Sheet, Depth::Sixteen) => pixels(sheet::size(size, pictures)?) * size_of::<[u16; 3]>(),
            (Self::Movie(_), _) => pixels(size) * size_of::<Rgb>(),
            (Self::Png | Self::Apng, Depth::Sixteen) => pixels(size) * size_of::<[u16; 3]>(),
            (Self::Page, _) => page_encoder::memory(size, pictures),
            (Self::Exr, _) => pixels(size) * Pixel::Light.numbers() * size_of::<f32>(),
            _ => 0,
        };
        Ok(Output::BUFFER + 2 * more) // pixels, and their compressed form
    }
}

/// The names are also the file extensions, except for the sheet.
impl Choice for PictureFormat {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[
        ("png", Self::Png, ""),
        ("npy", Self::Npy, ""),
        ("y4m", Self::Y4m, ""),
        ("rgb24", Self::Rgb24, ""),
        ("gray16", Self::Gray16, ""),
        ("apng", Self::Apng, ""),
        ("sheet", Self::Sheet, ""),
        ("mp4", Self::Movie(MovieFormat::Mp4), ""),
        ("webm", Self::Movie(MovieFormat::Webm), ""),
        ("gif", Self::Movie(MovieFormat::Gif), ""),
        ("html", Self::Page, ""),
        ("exr", Self::Exr, ""),
    ];
}

/// Bits per colour channel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Depth {
    /// 8 bits.
    #[default]
    Eight,
    /// 16 bits; one channel only if all colours are greys.
    Sixteen,
}

impl Choice for Depth {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[("8", Self::Eight, ""), ("16", Self::Sixteen, "")];

    fn named(name: &str) -> std::result::Result<Self, String> {
        match name {
            "8" => Ok(Self::Eight),
            "16" => Ok(Self::Sixteen),
            _ => Err("8 or 16".into()),
        }
    }
}

/// The settings of an output, shared by all pictures. [`SinkConfig::new`] gives the defaults; change them by struct
/// update.
#[derive(Debug, Clone)]
pub struct SinkConfig {
    /// The file format. Default: PNG.
    pub format: PictureFormat,
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// View and frame of each picture. Default: all frames of the first view.
    pub shown: Vec<(usize, usize)>,
    /// How the pictures were made. Default: by this library.
    pub provenance: Arc<Provenance>,
    /// Frames per second, for formats that store it. Default: 25.
    pub fps: f64,
    /// The kind of numbers in each pixel. Default: the kind of the scene and mode.
    pub pixel: Pixel,
    /// The map from values to colours.
    pub colours: Scale,
    /// Bits per colour channel in a PNG. Default: 8.
    pub depth: Depth,
    /// How means are weighed before they are coloured. Default: not at all.
    pub weighing: Option<Weighing>,
    /// Whether an array holds colours instead of values. Default: no.
    pub coloured_array: bool,
    /// Annotations drawn into coloured pictures. Default: none.
    pub annotation: Option<Annotation>,
    /// Whether to replace any existing files, also those that are no pictures of this library ([`is_ours`]). Default: no.
    pub force: bool,
}

impl SinkConfig {
    /// The default settings for the pictures that [`render`](crate::render::render) makes of a scene.
    pub fn new(scene: &dyn Scene, config: &RenderConfig, colours: Scale) -> Self {
        let software = format!("wavesplat {}", env!("CARGO_PKG_VERSION"));
        let size = config.size();
        Self {
            format: PictureFormat::Png,
            size,
            shown: config.frames.iter().map(|frame| (0, *frame)).collect(),
            provenance: Arc::new(Provenance { software, size, ..Provenance::default() }),
            fps: 25.0,
            pixel: if scene.channels() > 1 { Pixel::Channels } else { config.mode.pixel() },
            colours,
            depth: Depth::Eight,
            weighing: None,
            coloured_array: false,
            annotation: None,
            force: false,
        }
    }

    /// Whether an existing file may be replaced.
    fn may_replace(&self, path: &Path) -> bool {
        self.force || is_ours(path)
    }

    /// The frames per second as a fraction.
    fn frames_and_seconds(&self) -> [u16; 2] {
        let is_whole = self.fps.fract() == 0.0 || self.fps > 65.0;
        if is_whole { [self.fps.round() as u16, 1] } else { [(self.fps * 1000.0).round() as u16, 1000] }
    }

    /// The picture or the error bounds of a rendering, whichever this sink shows.
    fn shown_of<'a>(&self, rendered: &Rendered<'a>) -> Option<Picture<'a>> {
        match self.provenance.shows {
            Shows::Picture => Some(rendered.picture),
            Shows::CertifiedError => rendered.error,
        }
    }

    /// The numbers of a picture as they are coloured.
    fn as_coloured<'p>(&self, rendered: &Rendered<'_>, picture: Picture<'p>) -> Cow<'p, [f32]> {
        let view = rendered.views.get(rendered.view);
        let Some((weighing, view)) = self.weighing.as_ref().zip(view) else { return picture.into() };
        let shares = weighing.rays.shares(view, self.size);
        if shares.len() != picture.len() {
            return picture.into();
        }
        picture.iter().zip(shares).map(|(mean, share)| weighed(*mean, share, weighing.beyond)).collect()
    }

    /// A coloured picture with its annotations.
    fn image(&self, rendered: &Rendered<'_>, picture: Picture<'_>) -> Vec<Rgb> {
        let picture = &*self.as_coloured(rendered, picture);
        self.annotated(rendered, picture)
    }

    fn annotated(&self, rendered: &Rendered<'_>, picture: &[f32]) -> Vec<Rgb> {
        let mut image = self.plain(picture);
        if let Some(annotation) = &self.annotation {
            let numbers = self.pixel.numbers();
            annotation.draw(Finished {
                pixels: &mut image,
                size: self.size,
                background: self.colours.background(),
                frame: rendered.frame,
                view: rendered.views.get(rendered.view),
                with_angles: self.format == PictureFormat::Sheet && self.shown.iter().any(|(view, _)| *view > 0),
                scale: (self.pixel != Pixel::Channels).then_some(&self.colours),
                opacity: &|at| self.colours.opacity_of_pixel(&picture[at * numbers..][..numbers]),
            });
        }
        image
    }

    /// A coloured picture without annotations.
    fn plain(&self, picture: Picture<'_>) -> Vec<Rgb> {
        let pixels = picture.par_chunks_exact(self.pixel.numbers()).with_min_len(PIXELS);
        pixels.map(|pixel| self.colours.colour_of_pixel(pixel)).collect()
    }

    /// The same as [`Self::image`], with 16 bits per channel; annotations have 8.
    fn deep_image(&self, rendered: &Rendered<'_>, picture: Picture<'_>) -> Vec<[u16; 3]> {
        let picture = &*self.as_coloured(rendered, picture);
        let deep = |pixel| self.colours.exact_colour_of_pixel(pixel).map(|c| (c * 65535.0).round() as u16);
        let mut image: Vec<[u16; 3]> = picture.chunks_exact(self.pixel.numbers()).map(deep).collect();
        if self.annotation.is_some() {
            let (plain, drawn) = (self.plain(picture), self.annotated(rendered, picture));
            for (i, colour) in drawn.into_iter().enumerate().filter(|(i, colour)| plain[*i] != *colour) {
                image[i] = colour.map(|c| u16::from(c) * 257);
            }
        }
        image
    }
}

/// The least number of pixels that a thread colours.
const PIXELS: usize = 1 << 14;

/// The output of pictures.
pub struct Sink {
    target: Target,
    config: SinkConfig,
}

enum Target {
    /// One file or stream. The header is written with the first picture, so that a failed request leaves a pipe empty.
    One {
        out: Box<Output>,
        begun: bool,
    },
    /// One animated file.
    Animation(Animation),
    /// One file with all pictures in rows.
    Sheet(Box<Sheet>),
    Page(Box<Page>),
    /// One movie; none after ffmpeg failed.
    Movie(Option<Box<Movie>>),
    /// A file for each picture.
    Many(Numbered),
}

impl Sink {
    /// Opens `path`: `-` for standard output, a file, or a pattern such as `frame_%04d.png` for numbered files.
    pub fn open(path: &Path, config: SinkConfig) -> Result<Self> {
        if !config.format.takes_all(path) {
            let frames: Vec<usize> = config.shown.iter().map(|(_, frame)| *frame).collect();
            let paths = Self::paths(path, config.format, &frames)?;
            paths.iter().try_for_each(|path| Output::check(path, config.may_replace(path)))?;
            return Ok(Self { target: Target::Many(Numbered::new(path, frames.len())?), config });
        }
        if path != Path::new(STANDARD) && Numbered::new(path, 1)?.digits.is_some() {
            return Err(Error::path(path, "a pattern numbers .png and .exr files; others hold all frames"));
        }
        Self::to_output(Output::create(path, config.may_replace(path))?, config)
    }

    /// Writes all pictures to one file or stream.
    pub fn to_output(out: Output, config: SinkConfig) -> Result<Self> {
        let target = match config.format {
            PictureFormat::Apng => Target::Animation(Animation::new(out)),
            PictureFormat::Sheet => Target::Sheet(Box::new(Sheet::new(out, &config)?)),
            PictureFormat::Movie(format) => Target::Movie(Some(Box::new(Movie::new(out, format, &config)?))),
            PictureFormat::Page => Target::Page(Box::new(Page::new(out, &config)?)),
            _ => Target::One { out: Box::new(out), begun: false },
        };
        Ok(Self { target, config })
    }

    /// The files that the pictures of `frames` are written to.
    pub fn paths(path: &Path, format: PictureFormat, frames: &[usize]) -> Result<Vec<PathBuf>> {
        if format.takes_all(path) {
            return Ok(vec![path.into()]);
        }
        let names = Numbered::new(path, frames.len())?;
        Ok(frames.iter().map(|frame| names.path(*frame)).collect())
    }

    /// Writes the picture that the sink shows of a frame, if there is one.
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
            Target::Page(page) => page.picture(rendered),
            Target::Movie(movie) => {
                let sent = movie.as_mut().map_or(Ok(()), |movie| movie.picture(config, rendered, picture));
                match sent {
                    Ok(()) => Ok(()),
                    Err(e) => {
                        Err(movie.take().map_or_else(|| Error::io(Path::new("ffmpeg"), "writing", e), |m| m.failed()))
                    }
                }
            }
            Target::Many(names) => {
                let path = names.path(frame);
                let mut out = Output::create(&path, config.may_replace(&path))?;
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
            Target::Page(page) => page.finish(),
            Target::Movie(movie) => movie.map_or(Ok(()), |movie| movie.finish()),
            Target::Many(_) => Ok(()),
        }
    }
}
