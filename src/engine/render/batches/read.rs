//! Reads blocks in order, some at a time, so that sums depend neither on threads nor on memory.

use super::plane_values::BlockPlanes;
use crate::render::report::RenderReport;
use rayon::prelude::*;
use std::time::Duration;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::progress::Progress;
use wavesplat_core::base::system::Instant;

/// A source of blocks.
pub(in crate::render) trait BlockSource: Sync {
    /// Prepares to read these blocks next.
    fn fetch(&self, _blocks: &[usize]) -> Result<()> {
        Ok(())
    }

    /// Reads a block.
    fn planes(&self, block: usize) -> Result<Box<dyn BlockPlanes + '_>>;
}

/// What adds blocks to sums.
pub(in crate::render) trait BlockAdder: Sync {
    /// A block that is ready to be added.
    type Block<'b>: Send;

    /// Prepares a block. Called by several threads.
    fn prepare<'b>(&self, block: usize, planes: Box<dyn BlockPlanes + 'b>) -> Result<Self::Block<'b>>;

    /// Whether the sums need more memory than they have, and are of no use.
    fn is_full(&self) -> bool {
        false
    }

    /// Adds blocks in order.
    fn add(&mut self, blocks: &[Self::Block<'_>]) -> Result<()>;
}

/// Reads blocks from a source.
pub(in crate::render) struct BlockReader<'a> {
    pub(in crate::render) source: &'a dyn BlockSource,
    /// Blocks to decode at a time.
    pub(in crate::render) at_a_time: usize,
    /// Tells whether the pictures are still wanted.
    pub(in crate::render) progress: &'a dyn Progress,
}

impl BlockReader<'_> {
    /// Reads blocks, and adds them in order. Ends early if the adder is full, and with an error if the pictures are not
    /// wanted any more.
    pub(in crate::render) fn read(&self, blocks: &[usize], adder: &mut impl BlockAdder) -> Result<ReadStats> {
        let mut stats = ReadStats::default();
        self.fetch(blocks)?;
        for blocks in blocks.chunks(self.at_a_time) {
            let clock = Instant::now();
            self.fetch(blocks)?;
            let read = |block: &usize| {
                let planes = self.source.planes(*block)?;
                Ok((planes.held(), adder.prepare(*block, planes)?))
            };
            let (held, ready): (Vec<_>, Vec<_>) =
                blocks.par_iter().map(read).collect::<Result<Vec<_>>>()?.into_iter().unzip();
            stats.decode += clock.elapsed();
            stats.blocks += blocks.len() as u64;
            let clock = Instant::now();
            adder.add(&ready)?;
            stats.add += clock.elapsed();
            for [coefficients, bytes] in held {
                stats.coefficients += coefficients;
                stats.bytes += bytes;
            }
            if adder.is_full() {
                break;
            }
        }
        Ok(stats)
    }

    fn fetch(&self, blocks: &[usize]) -> Result<()> {
        self.progress.check()?;
        self.source.fetch(blocks)
    }
}

/// Counts and times of reading blocks.
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::render) struct ReadStats {
    /// Blocks that were read.
    blocks: u64,
    /// Nonzero coefficients in these blocks.
    coefficients: u64,
    /// Stored bytes that were read of these blocks.
    bytes: u64,
    /// Time spent reading and decoding.
    decode: Duration,
    /// Time spent adding.
    add: Duration,
}

impl std::ops::AddAssign for ReadStats {
    fn add_assign(&mut self, other: Self) {
        self.blocks += other.blocks;
        self.coefficients += other.coefficients;
        self.bytes += other.bytes;
        self.decode += other.decode;
        self.add += other.add;
    }
}

impl RenderReport {
    /// Adds the counts of blocks that were read.
    pub(in crate::render) fn count_read(&mut self, stats: &ReadStats) {
        self.blocks_read += stats.blocks;
        self.coefficients += stats.coefficients;
        self.bytes_read += stats.bytes;
    }

    /// Adds the counts and times of blocks that were read.
    pub(in crate::render) fn add_read(&mut self, stats: &ReadStats) {
        self.count_read(stats);
        self.decode_seconds += stats.decode.as_secs_f64();
        self.splat_seconds += stats.add.as_secs_f64();
    }
}
