//! Frames in one compressed stream of deflate, gzip or zlib. Going back to an earlier frame starts again from the beginning.

use crate::shared::words::wrong;
use flate2::Crc;
use flate2::read::{DeflateDecoder, MultiGzDecoder, ZlibDecoder};
use std::fmt;
use std::io::{self, BufReader, Read};
use std::ops::Range;
use std::path::Path;
use wavesplat_core::base::description::AxisRole;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::{Access, FileBytes, State};
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::Parsed;
use wavesplat_core::source::layout::Layout;
use wavesplat_core::source::parts::{DataLocation, Decode, Part, Stored};
use wavesplat_core::source::spill_buffer::{SpillBuffer, read_some};

const CHUNK: usize = 1 << 20; // bytes taken at a time
const MOST: u64 = 1032; // bytes that one compressed byte can stand for

/// How a stream is compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Compression {
    Gzip,
    Zlib,
    /// Without a header. The decompressed bytes have this CRC-32.
    Deflate {
        checksum: u32,
    },
}

/// Where frames are in a compressed stream.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StreamOffset {
    pub(crate) compression: Compression,
    /// Where the stream starts in the file.
    pub(crate) start: u64,
    /// Decompressed bytes before the first frame.
    pub(crate) skip: u64,
    /// Frames that lie together.
    pub(crate) together: usize,
    /// All frames.
    pub(crate) frames: usize,
    /// Bytes of one.
    pub(crate) frame_bytes: usize,
}

/// A compressed stream in a file, that an array is in.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Stream {
    pub(crate) compression: Compression,
    /// Where it starts in the file.
    pub(crate) start: u64,
    /// Decompressed bytes before the array; fewer than 2^63.
    pub(crate) skip: u64,
}

impl Stream {
    /// The frames of the array: one after another where they lie so, else all together.
    pub(crate) fn part(
        self,
        path: &Path,
        state: State,
        array: &Layout,
        ty: StoredType,
        big_endian: bool,
    ) -> Parsed<Part> {
        let Self { compression, start, skip } = self;
        let all = array.bytes(ty.size())?;
        check_room(state.len, skip.saturating_add(all as u64))?;
        let (before, array) = array.chosen_part();
        let frames = array.len(AxisRole::Frames);
        let in_turn = array.0.first().is_none_or(|axis| axis.role == AxisRole::Frames);
        let together = if in_turn { 1 } else { frames };
        let (bytes, before) = (array.bytes(ty.size())?, before * ty.size());
        let stored = Stored::new(&array.with_frames(together), ty, big_endian)?;
        let skip = skip + before as u64;
        let offset = StreamOffset { compression, start, skip, together, frames, frame_bytes: bytes / frames };
        let decoder = Deflated { after: (all - before - bytes) as u64, ..Deflated::new(offset) };
        Ok(Part { path: path.into(), state, frames, stored, at: DataLocation::Decoded(Box::new(decoder)) })
    }
}

/// Decodes the frames at a [`StreamOffset`].
pub(crate) struct Deflated {
    offset: StreamOffset,
    /// Bytes that the stream holds after the last frame.
    after: u64,
    /// The open reader, and its next frame.
    reader: Option<(Box<dyn Read + Send>, usize)>,
}

impl Deflated {
    pub(crate) fn new(offset: StreamOffset) -> Self {
        Self { offset, after: 0, reader: None }
    }

    /// A reader that comes to a frame next.
    fn reader_at(&mut self, path: &Path, frame: usize) -> Result<Box<dyn Read + Send>> {
        let StreamOffset { start, skip, frame_bytes, .. } = self.offset;
        let (mut reader, skipped) = match self.reader.take().filter(|(_, next)| *next <= frame) {
            Some((reader, next)) => (reader, ((frame - next) * frame_bytes) as u64),
            None => (self.offset.compression.open(path, start)?, skip + (frame * frame_bytes) as u64),
        };
        let passed = io::copy(&mut reader.by_ref().take(skipped), &mut io::sink());
        match passed.map_err(|e| damaged(path, frame, &e))? {
            n if n == skipped => Ok(reader),
            _ => Err(Error::input(path, format!("what it holds ends before frame {frame}"))),
        }
    }
}

impl Compression {
    /// Decompresses a file from the byte `start` on.
    pub(crate) fn open(self, path: &Path, start: u64) -> Result<Box<dyn Read + Send>> {
        Ok(self.reader(FileReader::new(FileBytes::open(path, Access::Read)?, start)))
    }

    /// Decompresses a reader.
    pub(crate) fn reader(self, reader: impl Read + Send + 'static) -> Box<dyn Read + Send> {
        let reader = BufReader::with_capacity(64 << 10, reader);
        match self {
            Self::Gzip => Box::new(MultiGzDecoder::new(reader)),
            Self::Zlib => Box::new(ZlibDecoder::new(reader)),
            Self::Deflate { checksum } => {
                Box::new(Checked { reader: DeflateDecoder::new(reader), crc: Crc::new(), checksum })
            }
        }
    }

    /// Gzip if a file says so at this byte, else zlib.
    pub(crate) fn at(file: &FileBytes, start: u64) -> Result<Self> {
        let mut magic = [0; 2];
        if file.len().checked_sub(start).is_some_and(|left| left >= 2) {
            file.read_at(start, &mut magic).map_err(|e| Error::io(file.path(), "reading", e))?;
        }
        Ok(if magic == [0x1f, 0x8b] { Self::Gzip } else { Self::Zlib })
    }
}

/// Passes on the bytes of a reader, with an error at its end if the checksum is wrong.
struct Checked<R> {
    reader: R,
    crc: Crc,
    checksum: u32,
}

impl<R: Read> Read for Checked<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let got = self.reader.read(out)?;
        self.crc.update(&out[..got]);
        if got == 0 && !out.is_empty() && self.crc.sum() != self.checksum {
            return Err(wrong("its checksum is wrong".into()));
        }
        Ok(got)
    }
}

impl Decode for Deflated {
    fn frames_per_chunk(&self) -> usize {
        self.offset.together
    }

    fn decode(&mut self, path: &Path, frames: Range<usize>, out: &mut SpillBuffer) -> Result<()> {
        let mut reader = self.reader_at(path, frames.start)?;
        let StreamOffset { frame_bytes, frames: all, .. } = self.offset;
        let bytes = frames.len() * frame_bytes;
        let at = |got: usize| frames.start + got / frame_bytes;
        let got = hold(&mut reader, path, 0..bytes as u64, out, |got, e| damaged(path, at(got), &e))?;
        if got < bytes {
            return Err(Error::input(path, format!("what it holds ends inside frame {} of {all}", at(got))));
        }
        if frames.end == self.offset.frames {
            return expect_end(&mut reader, path, self.after);
        }
        self.reader = Some((reader, frames.end));
        Ok(())
    }

    fn close_file(&mut self) {
        self.reader = None;
    }
}

fn damaged(path: &Path, frame: usize, error: &io::Error) -> Error {
    Error::input(path, format!("frame {frame} cannot be decompressed: {error}"))
}

/// An error if so few compressed bytes cannot hold so many bytes.
pub(crate) fn check_room(compressed: u64, bytes: u64) -> Parsed<()> {
    if bytes <= compressed.saturating_mul(MOST) {
        return Ok(());
    }
    Err(format!("expected {bytes} bytes of what it holds, but {compressed} compressed bytes cannot be so many"))
}

/// Copies bytes from a reader into a range of `out`, and returns how many there were. `failed` converts an error of
/// reading, given the number of bytes read before it.
pub(crate) fn hold(
    reader: &mut dyn Read,
    path: &Path,
    bytes: Range<u64>,
    out: &mut SpillBuffer,
    failed: impl Fn(usize, io::Error) -> Error,
) -> Result<usize> {
    let len = (bytes.end - bytes.start) as usize;
    let (mut got, mut chunk) = (0, vec![0; CHUNK.min(len)]);
    while got < len {
        let wanted = chunk.len().min(len - got);
        let n = read_some(reader, &mut chunk[..wanted]).map_err(|e| failed(got, e))?;
        if n == 0 {
            break;
        }
        out.write_at(bytes.start + got as u64, &chunk[..n]).map_err(|e| Error::io(path, "holding its frames", e))?;
        got += n;
    }
    Ok(got)
}

/// An error unless exactly `after` bytes follow. Reading to the end also checks the checksum.
pub(crate) fn expect_end(reader: &mut dyn Read, path: &Path, after: u64) -> Result<()> {
    let bad = |e| Error::input(path, format!("the end of its compressed data is damaged: {e}"));
    let passed = io::copy(&mut reader.take(after), &mut io::sink()).map_err(bad)?;
    match read_some(reader, &mut [0]).map_err(bad)? {
        0 if passed == after => Ok(()),
        0 => Err(Error::input(path, "holds less than its header says")),
        _ => Err(Error::input(path, "holds more than its header says")),
    }
}

impl fmt::Debug for Deflated {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Deflated").field("offset", &self.offset).finish_non_exhaustive()
    }
}

/// The bytes of a file one after another.
pub(crate) struct FileReader {
    file: FileBytes,
    at: u64,
}

impl FileReader {
    pub(crate) fn new(file: FileBytes, start: u64) -> Self {
        Self { file, at: start }
    }
}

impl Read for FileReader {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let left = self.file.len().saturating_sub(self.at);
        let len = usize::try_from(left).unwrap_or(usize::MAX).min(out.len());
        self.file.read_at(self.at, &mut out[..len])?;
        self.at += len as u64;
        Ok(len)
    }
}
