//! The pages of a file, decoded strip by strip or tile by tile.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use tiff::ColorType;
use tiff::decoder::{Decoder, DecodingSampleType, Limits};
use tiff::tags::{ByteOrder, Tag};
use tiff::{TiffError, TiffResult};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::files;
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::Parsed;
use wavesplat_core::source::layout::Layout;
use wavesplat_core::source::spill_buffer::SpillBuffer;

const MOST_TEXT: usize = 64 << 20; // bytes of a description, or of a page's list of strips

/// Compressions by their numbers, and whether they are decoded.
const COMPRESSIONS: [(u16, &str, bool); 14] = [
    (1, "none", true),
    (2, "CCITT", false),
    (3, "CCITT Group 3", false),
    (4, "CCITT Group 4", false),
    (5, "LZW", true),
    (6, "JPEG", false),
    (7, "JPEG", false),
    (8, "deflate", true),
    (32773, "PackBits", true),
    (32946, "deflate", true),
    (33003, "JPEG 2000", false),
    (34712, "JPEG 2000", false),
    (34925, "LZMA", false),
    (50000, "Zstandard", false),
];

/// The size and the sample type of a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Page {
    /// Pixels along x and y.
    pub(super) dims: [usize; 2],
    pub(super) ty: StoredType,
    /// Pixels of a strip or tile along x and y; it may extend beyond the page.
    chunk: [usize; 2],
    /// Whether it says that 0 is white: then the decoder inverts samples, which are to be as they are stored.
    is_inverted: bool,
}

impl Page {
    /// Bytes of its samples; none if too many.
    pub(super) fn bytes(&self) -> Option<usize> {
        let [x, y] = self.dims;
        Layout::plain([x, y, 1], 1).bytes(self.ty.size()).ok()
    }

    /// Bytes of a strip or tile.
    pub(super) fn chunk_bytes(&self) -> usize {
        let [x, y] = self.chunk;
        x.saturating_mul(y).saturating_mul(self.ty.size())
    }

    /// The strips or tiles: the first pixel and the pixels of each, in their order.
    fn chunks(&self) -> impl Iterator<Item = ([usize; 2], [usize; 2])> + use<> {
        let Self { dims: [x, y], chunk: [w, h], .. } = *self;
        let row = move |j: usize| (0..x).step_by(w).map(move |i| ([i, j], [w.min(x - i), h.min(y - j)]));
        (0..y).step_by(h).flat_map(row)
    }
}

/// An open file.
pub(super) struct Pages {
    path: PathBuf,
    decoder: Decoder<BufReader<File>>,
}

impl Pages {
    /// Opens a file at its first page.
    pub(super) fn open(path: &Path) -> Result<Self> {
        let file = files::open(path)?;
        let mut limits = Limits::unlimited(); // the size of strips and tiles is known before one is decoded
        (limits.ifd_value_size, limits.decoding_buffer_size) = (MOST_TEXT, MOST_TEXT); // the latter of lists, too
        let decoder = Decoder::new(BufReader::new(file)).map_err(|e| refused(path, &e))?;
        Ok(Self { path: path.into(), decoder: decoder.with_limits(limits) })
    }

    /// What this page is made of.
    pub(super) fn page(&mut self) -> Result<Page> {
        let refused = |e: String| Error::input(&self.path, e);
        let found = page(&mut self.decoder).map_err(|e| self::refused(&self.path, &e))?;
        found.map_err(refused)
    }

    /// The text of this page; empty if it has none.
    pub(super) fn description(&mut self) -> String {
        self.decoder.get_tag_ascii_string(Tag::ImageDescription).unwrap_or_default()
    }

    /// Pixels in a unit along x and y.
    pub(super) fn pixels_per_unit(&mut self) -> [Option<f64>; 2] {
        [Tag::XResolution, Tag::YResolution].map(|tag| {
            let ratio = self.decoder.get_tag(tag).ok()?;
            match ratio {
                tiff::decoder::ifd::Value::Rational(a, b) if b > 0 => Some(f64::from(a) / f64::from(b)),
                _ => None,
            }
        })
    }

    /// Counts the pages after this one, including it, and checks that they are alike. Then returns to the first page.
    pub(super) fn count(&mut self, first: &Page) -> Result<usize> {
        let mut count = 1;
        while self.decoder.more_images() {
            self.decoder.next_image().map_err(|e| refused(&self.path, &e))?;
            self.check(count, first)?;
            count += 1;
        }
        self.go_to(0)?;
        Ok(count)
    }

    /// Whether numbers have their most significant byte first.
    pub(super) fn is_big_endian(&self) -> bool {
        self.decoder.byte_order() == ByteOrder::BigEndian
    }

    /// Where the samples of all pages start, if the file has one page alone and they lie behind each other.
    pub(super) fn contiguous(&mut self, page: &Page, bytes: u64, len: u64) -> Result<u64> {
        let start = self.start(page).map_err(|e| refused(&self.path, &e))?;
        match start {
            Some(start) if start.checked_add(bytes).is_some_and(|end| end <= len) => Ok(start),
            Some(start) => {
                let found = len.saturating_sub(start);
                let what =
                    format!("has one page of the images that it says, and {found} bytes of samples, not {bytes}");
                Err(Error::input(&self.path, what))
            }
            None => {
                let what = "has one page of the images that it says, and this is compressed or in pieces";
                Err(Error::input(&self.path, what))
            }
        }
    }

    /// Where the samples of this page start, if they are not compressed and lie in one piece.
    fn start(&mut self, page: &Page) -> TiffResult<Option<u64>> {
        let compression = self.decoder.find_tag_unsigned::<u16>(Tag::Compression)?.unwrap_or(1);
        let is_tiled = self.decoder.find_tag_unsigned::<u32>(Tag::TileWidth)?.is_some();
        if compression != 1 || is_tiled {
            return Ok(None);
        }
        let starts = self.decoder.get_tag_u64_vec(Tag::StripOffsets)?;
        let strip = page.chunk_bytes() as u64;
        let is_joined = starts.windows(2).all(|pair| pair[0].checked_add(strip) == Some(pair[1]));
        Ok(starts.first().copied().filter(|_| is_joined))
    }

    fn check(&mut self, index: usize, first: &Page) -> Result<()> {
        let found = self.page()?;
        if (found.dims, found.ty) != (first.dims, first.ty) {
            let shown = |page: &Page| format!("{}x{} {} samples", page.dims[0], page.dims[1], page.ty);
            let what = format!("page {index} has {}, but the first one has {}", shown(&found), shown(first));
            return Err(Error::input(&self.path, what));
        }
        if found.chunk_bytes() > first.chunk_bytes() {
            return Err(Error::input(
                &self.path,
                format!("page {index} has larger strips or tiles than the first one"),
            ));
        }
        Ok(())
    }

    fn go_to(&mut self, index: usize) -> Result<()> {
        self.decoder.seek_to_image(index).map_err(|e| refused(&self.path, &e))
    }

    /// Puts the samples of a page like the first one, with the least significant byte first, into their place.
    pub(super) fn read(&mut self, index: usize, first: &Page, at: u64, out: &mut SpillBuffer) -> Result<()> {
        self.go_to(index)?;
        self.check(index, first)?;
        let page = self.page()?; // its strips may be others
        let (size, row) = (page.ty.size(), page.dims[0] * page.ty.size());
        let mut bytes = Vec::new();
        for (chunk, ([i, j], [w, h])) in page.chunks().enumerate() {
            self.read_chunk(chunk, w * h * size, &mut bytes)
                .map_err(|e| Error::input(&self.path, format!("page {index} cannot be decoded: {e}")))?;
            if page.is_inverted {
                bytes.iter_mut().for_each(|byte| *byte = !*byte);
            }
            if cfg!(target_endian = "big") {
                page.ty.swap_endian(&mut bytes);
            }
            let start = at + (j * row + i * size) as u64;
            let lines = if w == page.dims[0] { bytes.len() } else { w * size };
            for (line, bytes) in bytes.chunks(lines).enumerate() {
                let held = out.write_at(start + (line * row) as u64, bytes);
                held.map_err(|e| Error::io(&self.path, format!("holding page {index}"), e))?;
            }
        }
        Ok(())
    }

    fn read_chunk(&mut self, chunk: usize, expected: usize, bytes: &mut Vec<u8>) -> TiffResult<()> {
        let chunk = u32::try_from(chunk)?;
        let layout = self.decoder.image_chunk_buffer_layout(chunk)?;
        if layout.len != expected {
            return Err(TiffError::IntSizeError);
        }
        bytes.resize(expected, 0);
        self.decoder.read_chunk_bytes(chunk, bytes)
    }
}

/// The layout of the current page, or why it is not supported.
fn page(decoder: &mut Decoder<BufReader<File>>) -> TiffResult<Parsed<Page>> {
    let compression = decoder.find_tag_unsigned::<u16>(Tag::Compression)?.unwrap_or(1);
    let (x, y) = decoder.dimensions()?;
    let known = COMPRESSIONS.iter().find(|(number, ..)| *number == compression);
    match known {
        Some((_, _, true)) => {}
        Some((_, name, _)) => return Ok(Err(unsupported(&format!("compression {name}")))),
        None => return Ok(Err(unsupported(&format!("compression {compression}")))),
    }
    match decoder.colortype()? {
        ColorType::Gray(8 | 16 | 32 | 64) => {}
        other => return Ok(Err(unsupported(&format!("{other:?}")))),
    }
    let dims = [x as usize, y as usize];
    let chunk = match chunk(decoder, dims)? {
        Ok(chunk) => chunk,
        Err(e) => return Ok(Err(e)),
    };
    let ty = match decoder.image_chunk_buffer_layout(0)?.sample_type {
        Some(ty) => stored_type(ty),
        None => return Ok(Err(unsupported("its type of samples"))),
    };
    let is_inverted = decoder.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation)? == Some(0);
    if is_inverted && !matches!(ty, StoredType::U8 | StoredType::U16 | StoredType::U32 | StoredType::U64) {
        return Ok(Err(unsupported(&format!("{ty} samples of which 0 is white"))));
    }
    Ok(Ok(Page { dims, ty, chunk, is_inverted }))
}

/// Pixels of a strip or tile; a tile may go beyond the page.
fn chunk(decoder: &mut Decoder<BufReader<File>>, [x, y]: [usize; 2]) -> TiffResult<Parsed<[usize; 2]>> {
    let mut length = |tag| decoder.find_tag_unsigned::<u32>(tag);
    let (width, height) = match length(Tag::TileWidth)? {
        Some(width) => (width as usize, length(Tag::TileLength)?),
        None => (x, length(Tag::RowsPerStrip)?),
    };
    let height = height.map_or(y, |height| (height as usize).min(y));
    match [width, height] {
        chunk if chunk.contains(&0) || [x, y].contains(&0) => Ok(Err("has a page without pixels".into())),
        chunk => Ok(Ok(chunk)),
    }
}

fn unsupported(what: &str) -> String {
    format!("has {what}, which is not supported; write one grey channel, plain or with LZW, deflate or PackBits")
}

fn stored_type(ty: DecodingSampleType) -> StoredType {
    match ty {
        DecodingSampleType::U8 => StoredType::U8,
        DecodingSampleType::U16 => StoredType::U16,
        DecodingSampleType::U32 => StoredType::U32,
        DecodingSampleType::U64 => StoredType::U64,
        DecodingSampleType::I8 => StoredType::I8,
        DecodingSampleType::I16 => StoredType::I16,
        DecodingSampleType::I32 => StoredType::I32,
        DecodingSampleType::I64 => StoredType::I64,
        DecodingSampleType::F16 => StoredType::F16,
        DecodingSampleType::F32 => StoredType::F32,
        DecodingSampleType::F64 => StoredType::F64,
    }
}

fn refused(path: &Path, error: &TiffError) -> Error {
    match error {
        TiffError::IoError(e) if e.raw_os_error().is_some() => Error::input(path, format!("cannot be read: {e}")),
        error => Error::input(path, format!("is no TIFF that can be read: {error}")),
    }
}
