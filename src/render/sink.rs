//! Finished pictures out: numbered PNG files, or one stream for another program.

use super::{Picture, Pixel};
use crate::colour::{Rgb, Scale};
use crate::error::{Error, Result};
use crate::npy;
use crate::output::{Output, STANDARD};
use crate::sample::SampleType;
use std::io::{self, Write};
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
}

impl PictureFormat {
    /// The formats by their names, which are also the endings of files.
    pub const NAMES: [(&'static str, Self); 5] =
        [("png", Self::Png), ("npy", Self::Npy), ("y4m", Self::Y4m), ("rgb24", Self::Rgb24), ("gray16", Self::Gray16)];
}

/// What all pictures have in common.
#[derive(Debug, Clone)]
pub struct SinkConfig {
    /// How they are written.
    pub format: PictureFormat,
    /// Width and height.
    pub size: [usize; 2],
    /// Which frames there will be.
    pub frames: Vec<usize>,
    /// Frames a second, where the format says it.
    pub fps: u32,
    /// What the numbers of a pixel are.
    pub pixel: Pixel,
    /// Values to colours.
    pub colours: Scale,
    /// Whether an array holds colours instead of values.
    pub coloured_array: bool,
    /// Replace existing files.
    pub force: bool,
}

impl SinkConfig {
    /// The colour of a pixel.
    fn colour(&self, pixel: &[f32]) -> Rgb {
        match *pixel {
            [value] => self.colours.colour(value),
            [r, g, b] => self.colours.colour_of_channels([r, g, b]),
            [r, g, b, opacity] => self.colours.over_background([r, g, b], opacity),
            _ => self.colours.background(),
        }
    }
}

/// Where pictures go.
#[derive(Debug)]
pub struct Sink {
    target: Target,
    config: SinkConfig,
}

#[derive(Debug)]
enum Target {
    /// One file or stream; what comes before the first picture is written with it, so that a request that cannot be
    /// met leaves a pipe empty.
    One { out: Box<Output>, begun: bool },
    /// A file for each.
    Many(Numbered),
}

impl Sink {
    /// Opens `path`: `-`, a file, or a pattern as `frame_%04d.png` that numbers PNG files.
    pub fn open(path: &Path, config: SinkConfig) -> Result<Self> {
        let target = if config.format == PictureFormat::Png && path != Path::new(STANDARD) {
            let paths = Self::paths(path, config.format, &config.frames)?;
            paths.iter().try_for_each(|path| Output::check(path, config.force))?;
            Target::Many(Numbered::new(path, config.frames.len())?)
        } else if path != Path::new(STANDARD) && Numbered::new(path, 1)?.digits.is_some() {
            let what = format!("{}: a pattern numbers .png files; other formats hold all frames", path.display());
            return Err(Error::usage(what));
        } else {
            Target::One { out: Box::new(Output::create(path, config.force)?), begun: false }
        };
        Ok(Self { target, config })
    }

    /// The files that pictures of some frames go to.
    pub fn paths(path: &Path, format: PictureFormat, frames: &[usize]) -> Result<Vec<PathBuf>> {
        if format != PictureFormat::Png || path == Path::new(STANDARD) {
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
                let header = if std::mem::replace(begun, true) { Ok(()) } else { begin(config, out) };
                let written = header.and_then(|()| write(config, picture, out));
                written.map_err(|e| Error::io(out.path(), format!("writing frame {frame}"), e))
            }
            Target::Many(names) => {
                let path = names.of(frame);
                let mut out = Output::create(&path, config.force)?;
                write(config, picture, &mut out).map_err(|e| Error::io(&path, "writing", e))?;
                out.commit()
            }
        }
    }

    /// Ends the stream and gives the file its final name.
    pub fn finish(self) -> Result<()> {
        match self.target {
            Target::One { out, .. } => out.commit(),
            Target::Many(_) => Ok(()),
        }
    }
}

/// Names of numbered files.
#[derive(Debug)]
struct Numbered {
    before: String,
    after: String,
    /// Digits of the number; none: there is but one file.
    digits: Option<usize>,
}

impl Numbered {
    /// From a name with one `%d` or `%0Nd`, or a plain name if there is but one picture.
    fn new(path: &Path, frames: usize) -> Result<Self> {
        let name = path.to_string_lossy().into_owned();
        let Some((before, digits, after)) = place_of_number(&name, 'd') else {
            if name.contains('%') {
                return Err(misplaced(&name));
            }
            if frames != 1 {
                let what = format!("{name}: {frames} frames need a numbered name, as frame_%04d.png");
                return Err(Error::usage(what));
            }
            return Ok(Self { before: name, after: String::new(), digits: None });
        };
        if before.contains('%') || after.contains('%') {
            return Err(misplaced(&name));
        }
        Ok(Self { before: before.into(), after: after.into(), digits: Some(digits) })
    }

    fn of(&self, frame: usize) -> PathBuf {
        match self.digits {
            Some(digits) => format!("{}{frame:0digits$}{}", self.before, self.after).into(),
            None => PathBuf::from(&self.before),
        }
    }
}

fn misplaced(name: &str) -> Error {
    Error::usage(format!("{name}: the number's place is %d or, with zeros, %04d; that of a view's %v or %03v"))
}

/// What is before and behind the first `%d` or `%0Nd` of a name, for another letter `%v` or `%0Nv`, and its N.
fn place_of_number(name: &str, letter: char) -> Option<(&str, usize, &str)> {
    name.match_indices('%').find_map(|(at, _)| {
        let (digits, after) = name[at + 1..].split_once(letter).filter(|(digits, _)| digits.len() < 4)?;
        let number = if digits.is_empty() { Some(1) } else { digits.parse().ok() };
        number.map(|number| (&name[..at], number, after))
    })
}

/// A name for the pictures of each of some views, whose number takes the place of `%v` or, with zeros, `%03v`.
pub fn names_of_views(path: &Path, views: usize) -> Result<Vec<PathBuf>> {
    let name = path.to_string_lossy();
    match place_of_number(&name, 'v') {
        Some((_, _, after)) if place_of_number(after, 'v').is_some() => Err(misplaced(&name)),
        Some((before, digits, after)) => {
            Ok((0..views).map(|view| format!("{before}{view:0digits$}{after}").into()).collect())
        }
        None if views == 1 => Ok(vec![path.into()]),
        None if path == Path::new(STANDARD) => {
            Err(Error::usage(format!("-: standard output takes one view, not {views}; files have their number as %v")))
        }
        None => Err(Error::usage(format!("{name}: {views} views need a name with their number, as view%v_%04d.png"))),
    }
}

/// Writes what comes before the first picture of a stream.
fn begin(config: &SinkConfig, out: &mut impl Write) -> io::Result<()> {
    let [width, height] = config.size;
    match config.format {
        PictureFormat::Npy if config.coloured_array => {
            npy::write_header(SampleType::U8, &[config.frames.len(), height, width, 3], out)
        }
        PictureFormat::Npy => {
            let shape = [config.frames.len(), height, width, config.pixel.numbers()];
            let axes = if config.pixel == Pixel::Value { 3 } else { 4 };
            npy::write_header(SampleType::F32, &shape[..axes], out)
        }
        PictureFormat::Y4m => {
            writeln!(out, "YUV4MPEG2 W{width} H{height} F{}:1 Ip A1:1 C444 XCOLORRANGE=FULL", config.fps)
        }
        PictureFormat::Png | PictureFormat::Rgb24 | PictureFormat::Gray16 => Ok(()),
    }
}

/// Writes one picture.
fn write(config: &SinkConfig, picture: Picture<'_>, out: &mut impl Write) -> io::Result<()> {
    let colours = || picture.chunks_exact(config.pixel.numbers()).map(|pixel| config.colour(pixel));
    let rgb = || colours().flatten().collect::<Vec<u8>>();
    match config.format {
        PictureFormat::Png => write_png(config.size, &rgb(), out),
        PictureFormat::Npy if !config.coloured_array => {
            out.write_all(&picture.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())
        }
        PictureFormat::Npy | PictureFormat::Rgb24 => out.write_all(&rgb()),
        PictureFormat::Y4m => {
            writeln!(out, "FRAME")?;
            let pixels: Vec<[u8; 3]> = colours().map(yuv).collect();
            (0..3).try_for_each(|plane| out.write_all(&pixels.iter().map(|p| p[plane]).collect::<Vec<u8>>()))
        }
        PictureFormat::Gray16 => {
            let level = |v: &f32| ((config.colours.share(*v) * 65535.0).round() as u16).to_le_bytes();
            out.write_all(&picture.iter().flat_map(level).collect::<Vec<u8>>())
        }
    }
}

fn write_png(size: [usize; 2], rgb: &[u8], out: &mut impl Write) -> io::Result<()> {
    let mut encoder = png::Encoder::new(out, size[0] as u32, size[1] as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header().map_err(cause)?;
    writer.write_image_data(rgb).map_err(cause)?;
    writer.finish().map_err(cause)
}

/// What the system said, whose kind tells a broken pipe from other failures.
fn cause(error: png::EncodingError) -> io::Error {
    match error {
        png::EncodingError::IoError(e) => e,
        other => io::Error::other(other),
    }
}

/// Full-range BT.601, what players assume of a stream that does not say more.
fn yuv([r, g, b]: [u8; 3]) -> [u8; 3] {
    let [r, g, b] = [r, g, b].map(f64::from);
    let y = 0.299 * r + 0.587 * g + 0.114 * b;
    let byte = |v: f64| v.round().clamp(0.0, 255.0) as u8;
    [byte(y), byte(128.0 + (b - y) / 1.772), byte(128.0 + (r - y) / 1.402)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_number_files() {
        let name = |pattern: &str, frame| Numbered::new(Path::new(pattern), 2).map(|n| n.of(frame));
        assert_eq!(name("a_%04d.png", 7).expect("a pattern"), Path::new("a_0007.png"));
        assert_eq!(name("a_%d.png", 12).expect("a pattern"), Path::new("a_12.png"));
        for bad in ["a.png", "a_%x.png", "a_%4d_%d.png", "a%"] {
            assert!(name(bad, 0).is_err(), "{bad}");
        }
        assert_eq!(Numbered::new(Path::new("a.png"), 1).expect("one picture").of(5), Path::new("a.png"));
    }

    #[test]
    fn views_have_names_of_their_own() {
        let names = |path: &str, views| names_of_views(Path::new(path), views).map_err(|e| e.to_string());
        assert_eq!(names("v%02v_%04d.png", 2).expect("a pattern"), ["v00_%04d.png", "v01_%04d.png"].map(PathBuf::from));
        assert_eq!(names("a_%d.npy", 1).expect("one view"), [PathBuf::from("a_%d.npy")]);
        for bad in ["a.npy", "-", "a%dv.npy", "%v%v.npy"] {
            assert!(names(bad, 2).is_err(), "{bad}");
        }
    }

    #[test]
    fn grey_has_no_chroma() {
        for level in [0, 1, 127, 255] {
            assert_eq!(yuv([level; 3]), [level, 128, 128]);
        }
    }
}
