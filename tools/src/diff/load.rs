//! Reads the frames to compare: PNGs and `.npy` arrays, one frame in memory at a time.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::mapped::{Access, FileBytes};
use wavesplat::base::sample::{self, SampleType};
use wavesplat::formats;
use wavesplat_demo::sheet::Image;

const PNG_MAGIC: &[u8] = b"\x89PNG";
const NPY_MAGIC: &[u8] = b"\x93NUMPY";
const DEFLATE: u64 = 1032; // deflate never compresses by a larger factor
const EXPECTED: &str = "expected a PNG, or an .npy of (H,W), (F,H,W) or (F,H,W,C)";

/// The shape of a stack's frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Shape {
    /// Number of frames.
    pub(crate) frames: usize,
    /// Rows.
    pub(crate) height: usize,
    /// Pixels a row.
    pub(crate) width: usize,
    /// Numbers a pixel.
    pub(crate) channels: usize,
    /// The type of the numbers.
    pub(crate) sample: SampleType,
}

impl Shape {
    /// Numbers of a frame.
    pub(crate) fn numbers(&self) -> usize {
        self.height * self.width * self.channels
    }

    /// A description in words.
    pub(crate) fn text(&self) -> String {
        let Self { frames, height, width, channels, sample } = self;
        format!("{frames} frame(s) of {width}x{height} pixels with {channels} channel(s) of {sample}")
    }
}

/// Pictures of one size and type, read on demand.
#[derive(Debug)]
pub(crate) struct Stack {
    /// What its frames are.
    pub(crate) shape: Shape,
    frames: Frames,
}

#[derive(Debug)]
enum Frames {
    /// One file per frame.
    Pngs(Vec<PathBuf>),
    /// All frames in one array.
    Array { file: FileBytes, start: u64, big_endian: bool },
}

impl Stack {
    /// Opens a PNG, an `.npy`, the PNGs of a folder, or the PNGs that match a pattern.
    ///
    /// # Errors
    /// Files are absent, damaged or neither of these; arrays have other dimensions; PNGs differ from the first.
    pub(crate) fn open(name: &Path) -> Result<Self> {
        let paths = formats::files(name, "png")?;
        match &paths[..] {
            [only] if begins(only)?.starts_with(NPY_MAGIC) => Self::open_array(only),
            _ => Self::open_pngs(paths),
        }
    }

    fn open_pngs(paths: Vec<PathBuf>) -> Result<Self> {
        let shapes = paths.iter().map(|path| Ok(png_shape(&open_png(path)?.0))).collect::<Result<Vec<_>>>()?;
        let first = shapes[0];
        if let Some(i) = shapes.iter().position(|shape| *shape != first) {
            let what = format!("is {}; expected {}, as {}", shapes[i].text(), first.text(), paths[0].display());
            return Err(Error::usage(format!("{}: {what}", paths[i].display())));
        }
        Ok(Self { shape: Shape { frames: paths.len(), ..first }, frames: Frames::Pngs(paths) })
    }

    fn open_array(path: &Path) -> Result<Self> {
        let header = formats::array_header(path)?;
        let file = FileBytes::open(path, Access::Read)?; // truncating a mapped file would end the program
        let refused = |what: String| Error::input(path, what);
        let shape = array_shape(&header.lengths, header.sample).map_err(refused)?;
        let bytes = header.lengths.iter().try_fold(header.sample.size() as u64, |all, n| all.checked_mul(*n));
        let expected = bytes.and_then(|bytes| bytes.checked_add(header.start));
        match expected {
            Some(expected) if expected == file.len() => {}
            Some(n) => return Err(refused(format!("expected {n} bytes for {}, found {}", shape.text(), file.len()))),
            None => return Err(refused("its sizes are too large for any file".into())),
        }
        let frames = Frames::Array { file, start: header.start, big_endian: header.big_endian };
        Ok(Self { shape, frames })
    }

    /// The files that it is read from.
    pub(crate) fn paths(&self) -> Vec<PathBuf> {
        match &self.frames {
            Frames::Pngs(paths) => paths.clone(),
            Frames::Array { file, .. } => vec![file.path().into()],
        }
    }

    /// Reads frame `index`: channels one after another at each pixel, row after row.
    pub(crate) fn read(&self, index: usize) -> Result<Vec<f64>> {
        let (sample, mut numbers) = (self.shape.sample, vec![0.0; self.shape.numbers()]);
        let bytes = match &self.frames {
            Frames::Pngs(paths) => self.read_png(&paths[index])?,
            Frames::Array { file, start, big_endian } => self.read_array(file, *start, *big_endian, index)?,
        };
        sample::load(sample, &bytes, &mut numbers);
        Ok(numbers)
    }

    fn read_array(&self, file: &FileBytes, start: u64, big_endian: bool, index: usize) -> Result<Vec<u8>> {
        let mut bytes = vec![0; self.shape.numbers() * self.shape.sample.size()];
        let offset = start + index as u64 * bytes.len() as u64;
        file.read_at(offset, &mut bytes).map_err(|e| Error::io(file.path(), format!("reading frame {index}"), e))?;
        if big_endian {
            sample::swap_endian(self.shape.sample, &mut bytes);
        }
        Ok(bytes)
    }

    fn read_png(&self, path: &Path) -> Result<Vec<u8>> {
        let (mut reader, bytes) = open_png(path)?;
        if png_shape(&reader) != (Shape { frames: 1, ..self.shape }) {
            return Err(Error::changed(path, "changed while it was being read"));
        }
        let mut pixels = vec![0; bytes];
        reader.next_frame(&mut pixels).and_then(|_| reader.finish()).map_err(|e| damaged(path, e))?;
        sample::swap_endian(self.shape.sample, &mut pixels); // PNGs have the most significant byte first
        Ok(pixels)
    }
}

/// The colours of a PNG of 8 bits a channel, without its opacities.
pub(crate) fn picture(path: &Path) -> Result<Image> {
    let stack = Stack::open(path)?;
    let (numbers, Shape { width, height, channels, .. }) = (stack.read(0)?, stack.shape);
    let pixel = |pixel: &[f64]| std::array::from_fn(|c| pixel[c.min(channels - 1)] as u8);
    Ok(Image { width, height, pixels: numbers.chunks_exact(channels).map(pixel).collect() })
}

/// A file's first bytes.
fn begins(path: &Path) -> Result<Vec<u8>> {
    let file = File::open(path).map_err(|e| Error::io(path, "opening", e))?;
    let mut bytes = Vec::new();
    let read = file.take(NPY_MAGIC.len() as u64).read_to_end(&mut bytes);
    read.map(|_| bytes).map_err(|e| Error::io(path, "reading", e))
}

fn array_shape(lengths: &[u64], sample: SampleType) -> std::result::Result<Shape, String> {
    let sizes: Option<Vec<usize>> = lengths.iter().map(|n| usize::try_from(*n).ok().filter(|n| *n > 0)).collect();
    let sizes = sizes.ok_or_else(|| format!("its array is empty: its lengths are {lengths:?}"))?;
    let (frames, height, width, channels) = match sizes[..] {
        [h, w] => (1, h, w, 1),
        [f, h, w] => (f, h, w, 1),
        [f, h, w, c] => (f, h, w, c),
        _ => return Err(format!("its array has {} dimension(s); {EXPECTED}", sizes.len())),
    };
    Ok(Shape { frames, height, width, channels, sample })
}

type PngReader = png::Reader<BufReader<File>>;

/// Opens a PNG, expands palettes and fewer than 8 bits to colours, and counts the bytes of its pixels.
fn open_png(path: &Path) -> Result<(PngReader, usize)> {
    if !begins(path)?.starts_with(PNG_MAGIC) {
        return Err(Error::input(path, EXPECTED));
    }
    let file = FileBytes::open(path, Access::Read)?.len();
    let opened = File::open(path).map_err(|e| Error::io(path, "opening", e))?;
    let mut decoder = png::Decoder::new(BufReader::new(opened));
    decoder.set_transformations(png::Transformations::EXPAND);
    let reader = decoder.read_info().map_err(|e| damaged(path, e))?;
    // The claimed size is allocated at once, so it must be possible. An expanded palette has 32 times as many bytes.
    let possible = |bytes: &usize| *bytes as u64 / (32 * DEFLATE) <= file;
    let bytes = reader.output_buffer_size().filter(possible);
    let (width, height) = (reader.info().width, reader.info().height);
    let what = || format!("claims {width}x{height} pixels, which its {file} bytes cannot hold");
    let bytes = bytes.ok_or_else(|| Error::input(path, what()))?;
    Ok((reader, bytes))
}

fn png_shape(reader: &PngReader) -> Shape {
    let (colour, depth) = reader.output_color_type();
    let sample = if depth == png::BitDepth::Sixteen { SampleType::U16 } else { SampleType::U8 };
    let [height, width] = [reader.info().height, reader.info().width].map(|n| n as usize);
    Shape { frames: 1, height, width, channels: colour.samples(), sample }
}

fn damaged(path: &Path, error: png::DecodingError) -> Error {
    match error {
        png::DecodingError::IoError(e) if e.kind() != io::ErrorKind::UnexpectedEof => Error::io(path, "reading", e),
        png::DecodingError::IoError(_) => Error::input(path, "ends inside the PNG; expected a whole one"),
        other => Error::input(path, format!("is damaged; expected a whole PNG: {other}")),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_png_reads_back() {
        let image = Image::from_fn(5, 2, |x, y| [x as u8, y as u8, 3]);
        let file = tempfile::NamedTempFile::new().unwrap();
        image.save(file.path(), true).unwrap();
        assert_eq!(picture(file.path()).unwrap(), image);
        std::fs::write(file.path(), b"no picture").unwrap();
        assert!(picture(file.path()).is_err());
    }
}
