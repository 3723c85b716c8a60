//! Splats blocks into bands of pictures. Blocks are read in batches, in file order, so that sums depend neither on
//! threads nor on memory.

use super::view_setup::ViewSetup;
use crate::base::error::Result;
use crate::render::plane_values::{BlockPlanes, BlockSource};
use rayon::prelude::*;
use std::ops::Range;
use std::time::{Duration, Instant};

/// A band of rows of a view's picture.
#[derive(Clone)]
pub(super) struct Band<'a> {
    pub(super) setup: &'a ViewSetup,
    pub(super) rows: Range<usize>,
}

impl Band<'_> {
    /// Whether a block must be splatted into this band: the picture sees it, and the band needs it.
    pub(super) fn sees(&self, block: usize) -> bool {
        let whole = 0..self.setup.camera.size[1];
        self.setup.sees(block, &whole) && (self.rows == whole || self.setup.needs(block, &self.rows))
    }
}

/// Counts and times of splatting blocks.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::render) struct SplatStats {
    /// Blocks that were read.
    pub(in crate::render) blocks: u64,
    /// Nonzero coefficients in these blocks.
    pub(in crate::render) coefficients: u64,
    /// Stored bytes that were read of these blocks.
    pub(in crate::render) bytes: u64,
    /// Time spent reading and decoding.
    pub(in crate::render) decode: Duration,
    /// Time spent splatting.
    pub(in crate::render) splat: Duration,
}

impl std::ops::AddAssign for SplatStats {
    fn add_assign(&mut self, other: Self) {
        self.blocks += other.blocks;
        self.coefficients += other.coefficients;
        self.bytes += other.bytes;
        self.decode += other.decode;
        self.splat += other.splat;
    }
}

/// Bands of several views that one backend splats together, so that a block is decoded once for all.
pub(super) trait BandGroup: Sync {
    /// A block that is prepared for the bands that it reaches.
    type Block<'b>: Send + Sync;

    /// The bands.
    fn bands(&self) -> &[Band<'_>];

    /// Prepares a block. Called by several threads.
    fn prepare<'b>(&self, block: usize, planes: Box<dyn BlockPlanes + 'b>) -> Result<Self::Block<'b>>;

    /// Whether the sums need more memory than they have, and are of no use.
    fn is_full(&self) -> bool {
        false
    }

    /// Adds blocks in order.
    fn add(&mut self, blocks: &[Self::Block<'_>]) -> Result<()>;
}

/// Splats the blocks that reach any band, in order, `batch` at a time. Ends early if the group is full.
pub(super) fn splat_in_batches(
    group: &mut impl BandGroup,
    (blocks, batch): (&[usize], usize),
    source: &dyn BlockSource,
) -> Result<SplatStats> {
    let is_visible = |block: &usize| group.bands().iter().any(|band| band.sees(*block));
    let visible: Vec<usize> = blocks.iter().copied().filter(is_visible).collect();
    let mut stats = SplatStats::default();
    source.fetch(&visible)?;
    for blocks in visible.chunks(batch) {
        let clock = Instant::now();
        source.fetch(blocks)?;
        let read = |block: &usize| {
            let planes = source.planes(*block)?;
            Ok((planes.held(), group.prepare(*block, planes)?))
        };
        let (held, ready): (Vec<_>, Vec<_>) =
            blocks.par_iter().map(read).collect::<Result<Vec<_>>>()?.into_iter().unzip();
        stats.decode += clock.elapsed();
        stats.blocks += blocks.len() as u64;
        let clock = Instant::now();
        group.add(&ready)?;
        stats.splat += clock.elapsed();
        for [coefficients, bytes] in held {
            stats.coefficients += coefficients;
            stats.bytes += bytes;
        }
        if group.is_full() {
            break;
        }
    }
    Ok(stats)
}
