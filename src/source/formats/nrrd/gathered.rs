//! Frames that are put together from several files: slices, say.

use crate::error::{Error, Result};
use crate::mapped::{Access, FileBytes, State};
use crate::source::described::Decode;
use crate::source::formats::deflated::{Compression, FileReader, expect_end, hold};
use crate::source::held::Held;
use std::io::{self, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// A file that holds a piece of what is gathered.
#[derive(Debug)]
pub(super) struct Piece {
    pub(super) path: PathBuf,
    /// Its state when it was checked.
    pub(super) state: State,
    /// Where the samples start in it, or the stream that they are in.
    pub(super) start: u64,
    /// Bytes of what the stream holds that come before the samples.
    pub(super) skip: u64,
    pub(super) gzip: bool,
}

/// Pieces of equal size, one after another.
#[derive(Debug)]
pub(super) struct Gathered {
    pub(super) pieces: Vec<Piece>,
    /// Bytes of each.
    pub(super) bytes: usize,
    /// Frames that lie together: one, or all of them.
    pub(super) together: usize,
    pub(super) frames: usize,
}

impl Decode for Gathered {
    fn together(&self) -> usize {
        self.together
    }

    fn decode(&mut self, _path: &Path, frames: Range<usize>, out: &mut Held) -> Result<()> {
        let each = self.pieces.len() / self.frames.div_ceil(self.together);
        let first = frames.start / self.together * each;
        for (i, piece) in self.pieces[first..][..each].iter().enumerate() {
            piece.copy((i * self.bytes) as u64, self.bytes, out)?;
        }
        Ok(())
    }
}

impl Piece {
    fn copy(&self, at: u64, bytes: usize, out: &mut Held) -> Result<()> {
        let path = &self.path;
        let file = FileBytes::open(path, Access::Read)?;
        self.state.check(path, &file.state())?;
        let failed = |e: &io::Error| Error::input(path, format!("cannot be read: {e}"));
        let mut reader: Box<dyn Read> = if self.gzip {
            Box::new(Compression::Gzip.open(path, self.start)?)
        } else {
            Box::new(FileReader::new(file, self.start))
        };
        let skipped = io::copy(&mut reader.by_ref().take(self.skip), &mut io::sink()).map_err(|e| failed(&e))?;
        let got = hold(&mut reader, path, (at, bytes), out, |_, e| failed(e))?;
        if skipped < self.skip || got < bytes {
            return Err(Error::input(path, format!("holds {got} bytes of samples, not {bytes}")));
        }
        expect_end(&mut reader, path, 0)
    }
}
