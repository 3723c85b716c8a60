//! Frames assembled from pieces. A piece is a box of voxels that is decoded from its first byte to its last.

use super::deflated::{Compression, FileReader, expect_end, hold};
use std::fmt::Debug;
use std::io::{self, Read};
use std::ops::Range;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::{Access, FileBytes, State};
use wavesplat_core::source::parts::Decode;
use wavesplat_core::source::spill_buffer::SpillBuffer;

/// The samples of a piece in their file.
pub(crate) trait Packed: Debug + Send {
    /// Reads all samples of the piece, x fastest.
    fn open(&self, file: FileBytes) -> io::Result<Box<dyn Read>>;
}

/// Samples in a file, raw or compressed.
#[derive(Debug)]
pub(crate) struct Stream {
    /// Where the samples start in the file, or the compressed stream that holds them.
    pub(crate) start: u64,
    /// Decompressed bytes before the samples, in a compressed stream.
    pub(crate) skip: u64,
    pub(crate) bytes: usize,
    pub(crate) compression: Option<Compression>,
}

impl Packed for Stream {
    fn open(&self, file: FileBytes) -> io::Result<Box<dyn Read>> {
        let reader = FileReader::new(file, self.start);
        let Some(compression) = self.compression else { return Ok(Box::new(reader.take(self.bytes as u64))) };
        let mut reader = compression.reader(reader);
        io::copy(&mut reader.by_ref().take(self.skip), &mut io::sink())?; // where it ends before, no samples come
        Ok(reader)
    }
}

/// A box of a frame.
#[derive(Debug)]
pub(crate) struct Piece {
    /// The file with its samples.
    pub(crate) path: PathBuf,
    /// The file's state when it was checked.
    pub(crate) state: State,
    /// Its first voxel.
    pub(crate) start: [usize; 3],
    /// Its voxels along x, y, z.
    pub(crate) dims: [usize; 3],
    /// Where its samples are.
    pub(crate) samples: Box<dyn Packed>,
}

/// Decodes frames piece by piece.
#[derive(Debug)]
pub(crate) struct Pieces {
    /// Voxels of a frame along x, y, z.
    pub(crate) dims: [usize; 3],
    /// Bytes of a voxel, all components together.
    pub(crate) voxel: usize,
    /// The number of frames that are stored together and decoded as one.
    pub(crate) together: usize,
    /// The pieces of each frame, all within its dimensions.
    pub(crate) frames: Vec<Vec<Piece>>,
}

impl Decode for Pieces {
    fn frames_per_chunk(&self) -> usize {
        self.together
    }

    fn decode(&mut self, _path: &Path, frames: Range<usize>, out: &mut SpillBuffer) -> Result<()> {
        self.frames[frames.start / self.together].iter().try_for_each(|piece| self.copy(piece, out))
    }
}

impl Pieces {
    fn copy(&self, piece: &Piece, out: &mut SpillBuffer) -> Result<()> {
        let path = &piece.path;
        let file = FileBytes::open(path, Access::Read)?;
        piece.state.check(path, &file.state())?;
        let mut reader = piece.samples.open(file).map_err(|e| damaged(path, e))?;
        let (run, starts) = self.runs(piece);
        let mut seen = 0;
        for start in starts {
            let got = hold(&mut *reader, path, start as u64..(start + run) as u64, out, |_, e| damaged(path, e))?;
            seen += got;
            if got < run {
                return Err(Error::input(path, format!("its samples end early, after {seen} bytes")));
            }
        }
        expect_end(&mut *reader, path, 0)
    }

    /// Bytes of a piece that lie together in a frame, and where these start there.
    fn runs(&self, piece: &Piece) -> (usize, impl Iterator<Item = usize>) {
        let ([x, y, _], [i, j, k]) = (self.dims, piece.dims);
        let (run, rows, planes) = match (i == x, j == y) {
            (true, true) => (i * j * k, 1, 1),
            (true, false) => (i * j, 1, k),
            (false, _) => (i, j, k),
        };
        let (voxel, [first, row, plane]) = (self.voxel, piece.start);
        let start = move |(k, j): (usize, usize)| (((plane + k) * y + row + j) * x + first) * voxel;
        (run * voxel, (0..planes).flat_map(move |k| (0..rows).map(move |j| (k, j))).map(start))
    }
}

fn damaged(path: &Path, error: io::Error) -> Error {
    match error.raw_os_error() {
        Some(_) => Error::io(path, "reading its samples", error),
        None => Error::input(path, format!("its samples cannot be decoded: {error}")),
    }
}
