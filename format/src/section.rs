//! Sections and checksums. Every structure except the payloads of parts is a section: a frame of 24 bytes and its content.

use crate::block::{BlockId, PartKind};
use crate::bytes::{FieldReader, FieldWriter, ParseResult, ensure};
use crate::file_id::FileId;
use crate::{Error, Result, Storage};
use std::cell::RefCell;
use std::fmt;
use std::ops::Range;
use xxhash_rust::xxh3::{xxh3_64, xxh3_64_with_seed};
use zstd::zstd_safe;

/// Bytes of a section's frame.
pub(crate) const FRAME: usize = 24;

/// The zstd level of the directory: a fast one, because the directory is small.
const DIRECTORY_LEVEL: i32 = 3;

/// Position, length and checksum of a section.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct SectionExtent {
    /// Offset of the frame in the file.
    pub(crate) offset: u64,
    /// Bytes after the frame.
    pub(crate) stored_len: u32,
    /// Bytes of the content after decompression.
    pub(crate) raw_len: u32,
    /// Checksum of the stored bytes.
    pub(crate) checksum: u64,
}

impl SectionExtent {
    /// Offset of the first byte after the section, or `u64::MAX` on overflow.
    pub(crate) fn end(&self) -> u64 {
        self.offset.saturating_add(FRAME as u64 + u64::from(self.stored_len))
    }
}

/// The end of a section of `len` stored bytes at `offset`.
pub(crate) fn section_end(offset: u64, len: usize) -> u64 {
    offset.saturating_add((FRAME + len) as u64)
}

/// Identifies a section or part. It seeds the checksum, so that bytes of another section or part fail the check.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum SectionId {
    Part(BlockId, PartKind),
    Block(BlockId),
    Leaf(BlockId),
    Metadata,
    Root,
    Start,
    Window(u32),
    WindowEnd(u32),
    Description,
}

impl SectionId {
    /// The block, and kind and level, in the seed.
    fn identity(self) -> (BlockId, [u8; 2]) {
        let none = BlockId::new(0, 0, 0);
        match self {
            Self::Part(id, kind) => (id, kind.code()),
            Self::Block(id) => (id, [16, 0]),
            Self::Leaf(id) => (id, [17, 0]),
            Self::Metadata => (none, [18, 0]),
            Self::Root => (none, [19, 0]),
            Self::Start => (none, [20, 0]),
            Self::Window(window) => (BlockId { window, ..none }, [21, 0]),
            Self::WindowEnd(window) => (BlockId { window, ..none }, [22, 0]),
            Self::Description => (none, [23, 0]),
        }
    }

    /// The tag that starts the section; parts have none.
    fn tag(self) -> [u8; 4] {
        match self {
            Self::Part(..) => [0; 4],
            Self::Block(_) => *b"BLCK",
            Self::Leaf(_) => *b"LEAF",
            Self::Metadata => *b"META",
            Self::Root => *b"ROOT",
            Self::Start => *b"STRT",
            Self::Window(_) => *b"WNDW",
            Self::WindowEnd(_) => *b"WEND",
            Self::Description => *b"DESC",
        }
    }

    /// The checksum of the stored bytes in the file `file`.
    pub(crate) fn checksum(self, file: FileId, stored: &[u8]) -> u64 {
        let (id, kind) = self.identity();
        let mut seed = Vec::with_capacity(28);
        seed.put(&file.0);
        seed.put_u32(id.window);
        seed.put_u32(id.block);
        seed.put(&id.place());
        seed.put(&kind);
        xxh3_64_with_seed(stored, xxh3_64(&seed))
    }

    /// An error at `offset` in this section.
    pub(crate) fn corrupt(self, offset: u64, what: impl Into<String>) -> Error {
        Error::Corrupt { offset, place: self.to_string(), what: what.into() }
    }
}

impl fmt::Display for SectionId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Part(id, kind) => write!(f, "{id} {kind}"),
            Self::Block(id) => write!(f, "{id} header"),
            Self::Leaf(id) => write!(f, "directory leaf of {id}"),
            Self::Metadata => f.write_str("metadata"),
            Self::Root => f.write_str("directory root"),
            Self::Start => f.write_str("start"),
            Self::Description => f.write_str("description"),
            Self::Window(window) => write!(f, "beginning of window {window}"),
            Self::WindowEnd(window) => write!(f, "end of window {window}"),
        }
    }
}

/// The bytes of a section's frame.
pub(crate) fn frame(section: SectionId, extent: &SectionExtent) -> Vec<u8> {
    let mut out = Vec::with_capacity(FRAME);
    out.put(&section.tag());
    out.put_u32(extent.stored_len);
    out.put_u32(extent.raw_len);
    out.put_u32(0);
    out.put_u64(extent.checksum);
    out
}

/// Reads `len` bytes at `offset`. Checks the bounds before it allocates.
pub(crate) fn read(storage: &impl Storage, section: SectionId, offset: u64, len: u64) -> Result<Vec<u8>> {
    let inside = offset.checked_add(len).is_some_and(|end| end <= storage.len());
    let size = usize::try_from(len).ok().filter(|_| inside);
    let Some(size) = size else {
        return Err(
            section.corrupt(offset, format!("{len} bytes extend past the end of the file at {}", storage.len()))
        );
    };
    let mut out = vec![0; size];
    storage.read_at(offset, &mut out)?;
    Ok(out)
}

/// Reads and checks something in these ranges. If it is wrong, and the storage kept it, reads it from its source once more:
/// bytes may have changed on their way.
pub(crate) fn read_checked<T>(
    storage: &impl Storage,
    ranges: &[Range<u64>],
    read: impl Fn() -> Result<T>,
) -> Result<T> {
    let is_inside = || ranges.iter().all(|range| range.end <= storage.len());
    read().or_else(|wrong| if !wrong.is_io() && is_inside() && storage.forget(ranges) { read() } else { Err(wrong) })
}

/// Reads the stored bytes of a section; checks its frame and checksum.
pub(crate) fn read_section(
    storage: &impl Storage,
    file: FileId,
    section: SectionId,
    extent: &SectionExtent,
) -> Result<Vec<u8>> {
    let range = extent.offset..extent.end();
    read_checked(storage, std::slice::from_ref(&range), || read_section_once(storage, file, section, extent))
}

fn read_section_once(
    storage: &impl Storage,
    file: FileId,
    section: SectionId,
    extent: &SectionExtent,
) -> Result<Vec<u8>> {
    let mut bytes = read(storage, section, extent.offset, FRAME as u64 + u64::from(extent.stored_len))?;
    if !bytes.starts_with(&frame(section, extent)) {
        return Err(section.corrupt(extent.offset, "the section's frame differs from the reference to it"));
    }
    bytes.drain(..FRAME);
    if section.checksum(file, &bytes) != extent.checksum {
        return Err(section.corrupt(extent.offset + FRAME as u64, "the checksum does not match"));
    }
    Ok(bytes)
}

/// Reads the section at `offset`, of at most `most` stored bytes; checks its frame and checksum.
pub(crate) fn section_at(
    storage: &impl Storage,
    file: FileId,
    section: SectionId,
    offset: u64,
    most: usize,
) -> Result<(SectionExtent, Vec<u8>)> {
    let bytes = read(storage, section, offset, FRAME as u64)?;
    let extent = parse_frame(section, offset, &bytes).map_err(|what| section.corrupt(offset, what))?;
    if extent.stored_len as usize > most {
        return Err(section.corrupt(offset, format!("{} bytes, at most {most}", extent.stored_len)));
    }
    let stored = read_section(storage, file, section, &extent)?;
    Ok((extent, stored))
}

fn parse_frame(section: SectionId, offset: u64, bytes: &[u8]) -> ParseResult<SectionExtent> {
    let mut fields = FieldReader::new(bytes);
    ensure(fields.array()? == section.tag(), || "another section's tag".into())?;
    let (stored_len, raw_len) = (fields.u32()?, fields.u32()?);
    fields.reserved::<4>()?;
    Ok(SectionExtent { offset, stored_len, raw_len, checksum: fields.u64()? })
}

/// Compresses `raw` bytes of the directory to one zstd frame.
pub(crate) fn compress_directory(raw: &[u8]) -> Result<Vec<u8>> {
    let mut compressor = zstd::bulk::Compressor::new(DIRECTORY_LEVEL)?;
    compressor.include_checksum(true)?;
    Ok(compressor.compress(raw)?)
}

thread_local! {
    /// One for each thread, as its tables take longer to allocate than a small part to decompress.
    static DECOMPRESSOR: RefCell<Option<zstd::bulk::Decompressor<'static>>> = const { RefCell::new(None) };
}

/// Decompresses exactly one zstd frame, which must declare and hold exactly `raw_len` bytes. The caller limits `raw_len`.
pub(crate) fn decompress(stored: &[u8], raw_len: u32) -> ParseResult<Vec<u8>> {
    let whole = zstd_safe::find_frame_compressed_size(stored) == Ok(stored.len());
    ensure(whole, || "not one whole zstd frame".into())?;
    ensure(stored.get(4).is_some_and(|descriptor| descriptor & 4 != 0), || "the zstd frame has no checksum".into())?;
    let declared = zstd_safe::get_frame_content_size(stored).ok().flatten();
    ensure(declared == Some(u64::from(raw_len)), || format!("the zstd frame does not declare {raw_len} bytes"))?;
    let raw = DECOMPRESSOR.with_borrow_mut(|slot| {
        let decompressor = match slot {
            Some(decompressor) => decompressor,
            None => slot.insert(zstd::bulk::Decompressor::new()?),
        };
        decompressor.decompress(stored, raw_len as usize)
    });
    let raw = raw.map_err(|e| format!("zstd: {e}"))?;
    ensure(raw.len() == raw_len as usize, || format!("{} bytes decompressed instead of {raw_len}", raw.len()))?;
    Ok(raw)
}
