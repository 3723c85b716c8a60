//! Tells what a file makes of results that people compute, by comparing some of its blocks with the source.

use super::estimate::{EstimatedErrors, some_blocks};
use crate::file::CoefficientFile;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::memory::FIXED;
use wavesplat_core::codec::derived::{Computed, DerivedErrors};
use wavesplat_core::source::{FrameSource, FrameWindow, read_frames};

/// Blocks are compared in at most so many windows, and at most so many in each.
const WINDOWS: usize = 3;
const BLOCKS: usize = 8;

/// The errors of what is computed from the samples of some blocks, spread over the volume and over time; with the sides that the file
/// keeps. `None` of colours, and if `memory` bytes have no room for a block beside its source.
///
/// # Errors
/// The file or the source cannot be read, or the source is a stream, or has other frames than were converted.
pub fn errors_of_results(
    file: &CoefficientFile,
    source: &mut dyn FrameSource,
    memory: usize,
) -> Result<Option<EstimatedErrors>> {
    file.limit_shared(memory);
    let needed = FIXED + file.shared_bytes(memory) + source.archive().memory + bytes_of_block(file);
    if file.colour_transform().is_some() || needed > memory || file.frames() == 0 {
        return Ok(None);
    }
    let computed = Computed { spacing: file.grid.spacing, values: file.metadata().keep().sides };
    let (blocks, all) = (some_blocks(&file.blocks, BLOCKS), file.metadata().windows.len());
    let (count, mut found) = (all.min(WINDOWS), DerivedErrors::default());
    for window in (0..count).map(|i| (2 * i + 1) * all / (2 * count)) {
        let frames = file.window_range(window as u32);
        let source = source.window(frames.start, frames.len())?;
        for block in &blocks {
            found = found.join(&errors_of_block(file, source.as_ref(), &computed, window as u32, *block)?);
        }
        source.check_unchanged()?;
    }
    Ok(Some(EstimatedErrors::new(&found)))
}

/// Bytes of a block, its samples in the source and decoded, and four frames as numbers.
fn bytes_of_block(file: &CoefficientFile) -> usize {
    let numbers = 4 * file.blocks.region(0).voxels() * size_of::<f64>();
    file.block_bytes() + 2 * file.largest_block() * file.sample().size() + numbers
}

fn errors_of_block(
    file: &CoefficientFile,
    source: &dyn FrameWindow,
    computed: &Computed,
    window: u32,
    block: usize,
) -> Result<DerivedErrors> {
    let (codec, region) = (file.codec(window)?, file.blocks.region(block));
    let mut found = DerivedErrors::default();
    for entries in file.entries(window, 0, &region) {
        for entry in entries?.iter().filter(|entry| !entry.lost) {
            let decoded = file.block(&codec, entry, &vec![true; codec.basis.coefficients()])?.samples(&codec);
            let source = read_frames(source, 0..codec.frames(), &region, codec.sample)?;
            found = found.join(&computed.errors(&codec, region.dims(), [&source, &decoded]));
        }
    }
    Ok(found)
}
