//! Finished pictures out: numbered PNG files, one file for all, or a stream for another program.

mod names;
mod png;
mod sheet;
mod stream;

pub use names::names_of_views;

use super::annotate::Annotation;
use super::{Picture, Pixel};
use crate::colour::{Rgb, Scale};
use crate::error::{Error, Result};
use crate::output::{Output, STANDARD};
use names::Numbered;
use png::Animation;
use sheet::Sheet;
use std::path::{Path, PathBuf};

/// How pictures are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PictureFormat {
    /// One PNG for each, 8 bits a channel; in a stream one after the other.
    Png,
    /// One NumPy array for all: float32 (frames, H, W) or, of colours and of light, (frames, H, W, 3) and (frames, H, W, 4);
    /// uint8 (frames, H, W, 3) if colours were asked for.
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
    pub const NAMES: [(&'static str, Self); 7] = [
        ("png", Self::Png),
        ("npy", Self::Npy),
        ("y4m", Self::Y4m),
        ("rgb24", Self::Rgb24),
        ("gray16", Self::Gray16),
        ("apng", Self::Apng),
        ("sheet", Self::Sheet),
    ];

    /// Whether all pictures go to one `path`.
    pub fn takes_all(self, path: &Path) -> bool {
        self != Self::Png || path == Path::new(STANDARD)
    }

    /// Bytes that a file of `pictures` takes while it is written.
    ///
    /// # Errors
    /// More pictures than a sheet has room for.
    pub fn memory(self, size: [usize; 2], pictures: usize) -> Result<usize> {
        let sheet = if self == Self::Sheet { sheet::size(size, pictures)? } else { [0, 0] };
        Ok(Output::BUFFER + 2 * sheet[0] * sheet[1] * size_of::<Rgb>()) // and once more as it is compressed
    }
}

/// What all pictures have in common.
#[derive(Debug, Clone)]
pub struct SinkConfig {
    /// How they are written.
    pub format: PictureFormat,
    /// Width and height.
    pub size: [usize; 2],
    /// Which frame each picture is of.
    pub frames: Vec<usize>,
    /// Frames a second, where the format says it.
    pub fps: u32,
    /// What the numbers of a pixel are.
    pub pixel: Pixel,
    /// Values to colours.
    pub colours: Scale,
    /// Whether an array holds colours instead of values.
    pub coloured_array: bool,
    /// What is drawn into pictures that are in colours.
    pub annotation: Option<Annotation>,
    /// Replace existing files.
    pub force: bool,
}

impl SinkConfig {
    /// A picture in colours, and what is drawn into it.
    fn image(&self, frame: usize, picture: Picture<'_>) -> Vec<Rgb> {
        let mut image: Vec<Rgb> =
            picture.chunks_exact(self.pixel.numbers()).map(|pixel| self.colours.colour_of_pixel(pixel)).collect();
        if let Some(annotation) = &self.annotation {
            let scale = (self.pixel != Pixel::Channels).then_some(&self.colours);
            annotation.draw(&mut image, self.size[0], frame, self.colours.background(), scale);
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
    /// Opens `path`: `-`, a file, or a pattern as `frame_%04d.png` that numbers PNG files.
    pub fn open(path: &Path, config: SinkConfig) -> Result<Self> {
        if !config.format.takes_all(path) {
            let paths = Self::paths(path, config.format, &config.frames)?;
            paths.iter().try_for_each(|path| Output::check(path, config.force))?;
            return Ok(Self { target: Target::Many(Numbered::new(path, config.frames.len())?), config });
        }
        if path != Path::new(STANDARD) && Numbered::new(path, 1)?.digits.is_some() {
            let what = format!("{}: a pattern numbers .png files; other formats hold all frames", path.display());
            return Err(Error::usage(what));
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

    /// Writes the picture of a frame.
    pub fn picture(&mut self, frame: usize, picture: Picture<'_>) -> Result<()> {
        let config = &self.config;
        match &mut self.target {
            Target::One { out, begun } => {
                let header = if std::mem::replace(begun, true) { Ok(()) } else { stream::begin(config, out) };
                let written = header.and_then(|()| stream::write(config, frame, picture, out));
                written.map_err(|e| Error::io(out.path(), format!("writing frame {frame}"), e))
            }
            Target::Animation(animation) => animation.picture(config, frame, picture),
            Target::Sheet(sheet) => {
                sheet.picture(config, frame, picture);
                Ok(())
            }
            Target::Many(names) => {
                let path = names.of(frame);
                let mut out = Output::create(&path, config.force)?;
                stream::write(config, frame, picture, &mut out).map_err(|e| Error::io(&path, "writing", e))?;
                out.commit()
            }
        }
    }

    /// Ends the stream and gives the file its final name.
    pub fn finish(self) -> Result<()> {
        match self.target {
            Target::One { out, .. } => out.commit(),
            Target::Animation(animation) => animation.finish(),
            Target::Sheet(sheet) => sheet.finish(),
            Target::Many(_) => Ok(()),
        }
    }
}
