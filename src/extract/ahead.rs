//! Pieces of a remote file that are fetched before they are decoded, many in few requests.

use super::{InWindow, Piece};
use crate::base::error::Result;
use crate::codec::decode::Block;
use crate::file::{CoefficientFile, Gathered, WINDOWS_TOGETHER};
use wavesplat_format::{BlockEntry, PartEntry};

/// How far decoding and fetching have come in a list of pieces.
#[derive(Debug, Default)]
pub(super) struct Ahead {
    decoded: usize,
    fetched: usize,
}

impl Ahead {
    /// Prepares for decoding the next `count` pieces. If one of them is not fetched yet, fetches them and as many later
    /// ones as fit. Does nothing for local files.
    pub(super) fn fetch(
        &mut self,
        (file, channel): (&CoefficientFile, usize),
        pieces: &[Piece],
        count: usize,
    ) -> Result<()> {
        self.decoded += count;
        if !file.is_remote() || self.fetched >= self.decoded {
            return Ok(());
        }
        let next = &pieces[self.decoded - count..];
        let soon = next.iter().flat_map(|piece| windows(file, piece)).map(|frames| file.window_of(frames[0]));
        file.fetch_leaves_of(soon.take(WINDOWS_TOGETHER), channel, &next[0].region)?;
        let mut gathered = Gathered::default();
        self.fetched = self.decoded - count;
        for piece in next.iter().take(WINDOWS_TOGETHER) {
            for frames in windows(file, piece) {
                gathered.add(parts_of(file, channel, (piece, frames))?);
            }
            self.fetched += 1;
            if gathered.is_full() {
                break;
            }
        }
        file.fetch_gathered(&gathered)
    }
}

/// The frames of a piece, window by window.
fn windows<'a>(file: &'a CoefficientFile, piece: &'a Piece) -> impl Iterator<Item = &'a [usize]> {
    piece.frames.chunk_by(|a, b| file.window_of(*a) == file.window_of(*b))
}

/// The parts of the blocks of a piece that frames of one window need.
fn parts_of(file: &CoefficientFile, channel: usize, (piece, frames): (&Piece, &[usize])) -> Result<Vec<PartEntry>> {
    let InWindow { window, codec, wanted, .. } = InWindow::new(file, frames)?;
    let of_block = |entry: &BlockEntry| Block::parts(&codec, entry, &wanted).copied().collect::<Vec<_>>();
    let mut parts = Vec::new();
    for entries in file.entries(window, channel, &piece.region) {
        parts.extend(entries?.iter().flat_map(of_block));
    }
    Ok(parts)
}
