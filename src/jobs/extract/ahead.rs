//! Pieces of a remote file that are fetched before they are decoded, many in few requests.

use super::{ExtractConfig, InWindow, Piece};
use wavesplat_core::base::error::Result;
use wavesplat_engine::file::{CoefficientFile, Prefetch};

/// Fetches what the next pieces need, as many pieces as fit. Returns their number. Does nothing for local files.
pub(super) fn fetch_ahead(file: &CoefficientFile, config: &ExtractConfig, pieces: &[Piece]) -> Result<usize> {
    let &ExtractConfig { channel, ref region, .. } = config;
    let Some(mut prefetch) = Prefetch::new(file) else { return Ok(pieces.len()) };
    let mut last = None;
    let is_next = |frames: &&[usize]| last.replace(file.window_of(frames[0])) != Some(file.window_of(frames[0]));
    let windows = pieces.iter().flat_map(|piece| file.by_window(&piece.frames)).filter(is_next);
    prefetch.leaves(windows, channel, region)?;
    let fetched = prefetch.gather(pieces, |piece, prefetch| {
        file.by_window(&piece.frames).try_for_each(|frames| add(prefetch, file, channel, piece, frames))
    })?;
    prefetch.finish()?;
    Ok(fetched)
}

/// Adds the parts of the blocks of a piece that frames of one window need.
fn add(
    prefetch: &mut Prefetch<'_>,
    file: &CoefficientFile,
    channel: usize,
    piece: &Piece,
    frames: &[usize],
) -> Result<()> {
    let InWindow { window, codec, wanted } = InWindow::new(file, frames)?;
    for entries in file.entries(window, channel, &piece.region) {
        entries?.iter().try_for_each(|entry| prefetch.add(&codec, entry, &wanted.coefficients))?;
    }
    Ok(())
}
