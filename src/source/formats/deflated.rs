//! Frames in one compressed stream, of gzip or zlib: taken one after another, from the beginning again if need be.

use crate::error::{Error, Result};
use crate::mapped::{Access, FileBytes};
use crate::source::described::Decode;
use crate::source::held::{Held, read_some};
use flate2::read::{MultiGzDecoder, ZlibDecoder};
use std::fmt;
use std::io::{self, BufReader, Read};
use std::ops::Range;
use std::path::Path;

const CHUNK: usize = 1 << 20; // bytes taken at a time

/// How a stream is compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::source) enum Compression {
    Gzip,
    Zlib,
}

/// Where the frames are in a compressed stream.
#[derive(Debug, Clone, Copy)]
pub(in crate::source) struct Place {
    pub(in crate::source) compression: Compression,
    /// Where the stream starts in the file.
    pub(in crate::source) start: u64,
    /// Bytes of what the stream holds that come before the first frame.
    pub(in crate::source) skip: u64,
    /// Frames that lie together.
    pub(in crate::source) together: usize,
    /// All frames.
    pub(in crate::source) frames: usize,
    /// Bytes of one.
    pub(in crate::source) frame_bytes: usize,
}

/// Decodes what is at such a place.
pub(in crate::source) struct Deflated {
    place: Place,
    /// What goes on, and the frame that it comes to next.
    reader: Option<(Box<dyn Read + Send>, usize)>,
}

impl Deflated {
    pub(in crate::source) fn new(place: Place) -> Self {
        Self { place, reader: None }
    }

    /// A reader that comes to a frame next.
    fn reader_at(&mut self, path: &Path, frame: usize) -> Result<Box<dyn Read + Send>> {
        let Place { start, skip, frame_bytes, .. } = self.place;
        let (mut reader, skipped) = match self.reader.take().filter(|(_, next)| *next <= frame) {
            Some((reader, next)) => (reader, ((frame - next) * frame_bytes) as u64),
            None => (self.place.compression.open(path, start)?, skip + (frame * frame_bytes) as u64),
        };
        let passed = io::copy(&mut reader.by_ref().take(skipped), &mut io::sink());
        match passed.map_err(|e| damaged(path, frame, &e))? {
            n if n == skipped => Ok(reader),
            _ => Err(Error::input(path, format!("what it holds ends before frame {frame}"))),
        }
    }
}

impl Compression {
    /// What is decompressed of a file from this byte on.
    pub(in crate::source) fn open(self, path: &Path, start: u64) -> Result<Box<dyn Read + Send>> {
        let reader =
            BufReader::with_capacity(64 << 10, FileReader { file: FileBytes::open(path, Access::Read)?, at: start });
        Ok(match self {
            Self::Gzip => Box::new(MultiGzDecoder::new(reader)),
            Self::Zlib => Box::new(ZlibDecoder::new(reader)),
        })
    }
}

impl Decode for Deflated {
    fn together(&self) -> usize {
        self.place.together
    }

    fn decode(&mut self, path: &Path, frames: Range<usize>, out: &mut Held) -> Result<()> {
        let mut reader = self.reader_at(path, frames.start)?;
        let bytes = frames.len() * self.place.frame_bytes;
        let (mut got, mut chunk) = (0, vec![0; CHUNK.min(bytes)]);
        while got < bytes {
            let wanted = chunk.len().min(bytes - got);
            let at = frames.start + got / self.place.frame_bytes;
            let n = read_some(&mut reader, &mut chunk[..wanted]).map_err(|e| damaged(path, at, &e))?;
            if n == 0 {
                return Err(Error::input(
                    path,
                    format!("what it holds ends inside frame {at} of {}", self.place.frames),
                ));
            }
            out.write_at(got as u64, &chunk[..n]).map_err(|e| Error::io(path, format!("holding frame {at}"), e))?;
            got += n;
        }
        if frames.end == self.place.frames {
            return expect_end(&mut reader, path);
        }
        self.reader = Some((reader, frames.end));
        Ok(())
    }

    fn rest(&mut self) {
        self.reader = None;
    }
}

fn damaged(path: &Path, frame: usize, error: &io::Error) -> Error {
    Error::input(path, format!("frame {frame} cannot be decompressed: {error}"))
}

/// An error if anything comes; this also makes the checksum at the end be looked at.
fn expect_end(reader: &mut dyn Read, path: &Path) -> Result<()> {
    match read_some(reader, &mut [0]) {
        Ok(0) => Ok(()),
        Ok(_) => Err(Error::input(path, "holds more than its header says")),
        Err(e) => Err(Error::input(path, format!("its compressed data do not end well: {e}"))),
    }
}

impl fmt::Debug for Deflated {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Deflated").field("place", &self.place).finish_non_exhaustive()
    }
}

/// The bytes of a file one after another.
struct FileReader {
    file: FileBytes,
    at: u64,
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
