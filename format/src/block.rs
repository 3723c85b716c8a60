//! Blocks and their parts before they are written, and the compressor that makes a part.

use crate::directory::{begins_above, entry_len};
use crate::limits::{MAX_PART_RAW, align};
use crate::section::{FRAME, decompress};
use crate::{Error, Metadata, Result};
use std::cmp::{Ordering, Reverse};
use std::fmt;

/// Identifies a block: one box of voxels in one window and one channel, and one of the lattices on which it is coded. The order
/// is that of the file: by window, then tier from the coarsest on, then channel, then block.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct BlockId {
    /// Number of the window, from 0.
    pub window: u32,
    /// Number of the box: `bx + nx * (by + ny * bz)`.
    pub block: u32,
    /// Number of the channel, from 0.
    pub channel: u16,
    /// The lattice of its nodes: all voxels (0), or those at multiples of 2^tier along x, y and z, in a box that is 2^tier times as
    /// wide.
    pub tier: u8,
}

impl BlockId {
    /// A block of the finest tier.
    pub fn new(window: u32, channel: u16, block: u32) -> Self {
        Self { window, block, channel, tier: 0 }
    }

    /// Channel and tier as stored in a file.
    pub(crate) fn place(self) -> [u8; 2] {
        [self.channel as u8, self.tier]
    }

    /// The block with this number at a stored place.
    pub(crate) fn at_place(window: u32, block: u32, [channel, tier]: [u8; 2]) -> Self {
        Self { window, block, channel: channel.into(), tier }
    }
}

impl Ord for BlockId {
    fn cmp(&self, other: &Self) -> Ordering {
        let key = |id: &Self| (id.window, Reverse(id.tier), id.channel, id.block);
        key(self).cmp(&key(other))
    }
}

impl PartialOrd for BlockId {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl fmt::Display for BlockId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "window {} block {} channel {}", self.window, self.block, self.channel)?;
        if self.tier > 0 { write!(f, " tier {}", self.tier) } else { Ok(()) }
    }
}

/// The kind of a part. The order is that of the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum PartKind {
    /// Quantised coefficients of one group of levels; 0 is the coarsest.
    Level(u8),
    /// Samples stored exactly, because the error of their decoded values would exceed the bound.
    Outliers,
    /// A mask of the missing samples, and their bytes.
    Missing,
    /// The exact values of all samples, in place of levels and outliers.
    Exact,
    /// The same, as places in a list of their values.
    Listed,
    /// On which side of some values samples are that would be decoded on another.
    Sides,
    /// The shifts that keep the sums of a block's frames.
    Sums,
}

impl PartKind {
    /// Whether a block with such a part stores all its samples exactly.
    pub fn is_exact(self) -> bool {
        matches!(self, Self::Exact | Self::Listed)
    }

    /// Kind and level as stored in a file.
    pub(crate) fn code(self) -> [u8; 2] {
        match self {
            Self::Level(level) => [0, level],
            Self::Outliers => [1, 0],
            Self::Missing => [2, 0],
            Self::Exact => [3, 0],
            Self::Listed => [3, 1],
            Self::Sides => [4, 0],
            Self::Sums => [5, 0],
        }
    }

    /// The kind that these stored bytes stand for.
    pub(crate) fn from_code(code: [u8; 2]) -> Option<Self> {
        match code {
            [0, level] => Some(Self::Level(level)),
            [1, 0] => Some(Self::Outliers),
            [2, 0] => Some(Self::Missing),
            [3, 0] => Some(Self::Exact),
            [3, 1] => Some(Self::Listed),
            [4, 0] => Some(Self::Sides),
            [5, 0] => Some(Self::Sums),
            _ => None,
        }
    }
}

impl fmt::Display for PartKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Level(level) => write!(f, "level {level}"),
            Self::Outliers => f.write_str("outliers"),
            Self::Missing => f.write_str("missing samples"),
            Self::Exact => f.write_str("exact samples"),
            Self::Listed => f.write_str("listed samples"),
            Self::Sides => f.write_str("sides"),
            Self::Sums => f.write_str("sums"),
        }
    }
}

/// Statistics of a part, from which a reader decides whether to skip it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PartStats {
    /// Number of nonzero coefficients, outliers, missing samples, samples, or changes of sides; at least 1.
    pub count: u64,
    /// Sum of squares of the coefficients in the part. With a pyramid: of the changes of all coefficients if this part and
    /// all finer ones are omitted. 0 for parts without coefficients; may overflow to infinity.
    pub energy: f64,
    /// Largest |coefficient| in the part; with a pyramid, the largest such change. Finite; 0 for parts without coefficients.
    pub largest: f64,
}

/// A compressed part, ready to be written.
#[derive(Debug, Clone, PartialEq)]
pub struct EncodedPart {
    /// The kind of its content.
    pub kind: PartKind,
    /// Statistics for skipping.
    pub stats: PartStats,
    /// Bytes before compression.
    pub raw_len: u32,
    /// One zstd frame.
    pub stored: Vec<u8>,
}

impl EncodedPart {
    /// The payload, before compression.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it cannot be decompressed.
    pub fn payload(&self) -> Result<Vec<u8>> {
        decompress(&self.stored, self.raw_len).map_err(Error::Invalid)
    }
}

/// Statistics of a block, for skipping and reports, in the units of the samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlockStats {
    /// Quantisation step: a coefficient is its code times this; finite, not negative.
    pub step: f64,
    /// Smallest decoded finite sample; infinity if there is none.
    pub min: f64,
    /// Largest decoded finite sample; minus infinity if there is none.
    pub max: f64,
    /// Largest error of a sample, rounded up.
    pub reached: f64,
    /// About the sum of the squared errors of the samples; may overflow to infinity.
    pub squared_error: f64,
    /// Energy of coefficients lost by dropping and quantisation; may overflow to infinity.
    pub dropped: f64,
}

/// A block ready to be written. Parts ascend by kind; a part that would hold only zeros is omitted.
#[derive(Debug, Clone, PartialEq)]
pub struct EncodedBlock {
    /// The block's identity.
    pub id: BlockId,
    /// Statistics for skipping.
    pub stats: BlockStats,
    /// Its parts in order.
    pub parts: Vec<EncodedPart>,
}

impl EncodedBlock {
    /// As [`BlockEntry::block_above`](crate::BlockEntry::block_above).
    pub(crate) fn block_above(&self, metadata: &Metadata) -> Option<BlockId> {
        let is_exact = self.parts.iter().any(|part| part.kind.is_exact());
        let begins = begins_above(self.id, self.stats, is_exact, metadata.tiers(self.id.window));
        begins.then(|| metadata.above(self.id))
    }

    /// Bytes of the block in a file, up to what follows it.
    pub fn stored_len(&self) -> u64 {
        let parts: usize = self.parts.iter().map(|part| part.stored.len()).sum();
        align(FRAME as u64 + self.entry_len() + parts as u64)
    }

    /// Bytes of its entry: once in the block, and once more in a leaf of the directory before that is compressed.
    pub fn entry_len(&self) -> u64 {
        entry_len(self.parts.len()) as u64
    }
}

/// Compresses parts. Each worker reuses one compressor. The compressed bytes depend only on the input and the level.
pub struct Compressor {
    inner: zstd::bulk::Compressor<'static>,
}

impl fmt::Debug for Compressor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Compressor")
    }
}

impl Compressor {
    /// A compressor with a zstd level.
    ///
    /// # Errors
    /// zstd refuses the level or runs out of memory.
    pub fn new(level: i32) -> Result<Self> {
        let mut inner = zstd::bulk::Compressor::new(level)?;
        inner.include_checksum(true)?;
        inner.include_contentsize(true)?;
        Ok(Self { inner })
    }

    /// Compresses the payload `raw` of a part.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if the payload exceeds the limit for parts.
    pub fn part(&mut self, kind: PartKind, stats: PartStats, raw: &[u8]) -> Result<EncodedPart> {
        let size = raw.len() as u64;
        let raw_len = u32::try_from(size).ok().filter(|_| size <= MAX_PART_RAW);
        let too_large = || Error::TooLarge { what: format!("bytes of {kind}"), size, limit: MAX_PART_RAW };
        let raw_len = raw_len.ok_or_else(too_large)?;
        let mut stored = self.inner.compress(raw)?;
        stored.shrink_to_fit();
        Ok(EncodedPart { kind, stats, raw_len, stored })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reused_compressor_gives_the_bytes_of_a_fresh_one() {
        let stats = PartStats { count: 1, energy: 0.0, largest: 0.0 };
        let raw: Vec<u8> = (0..40_000u32).map(|i| ((i * i) >> 7) as u8).collect();
        let mut reused = Compressor::new(3).expect("level 3");
        let first = reused.part(PartKind::Exact, stats, &raw).expect("fits");
        reused.part(PartKind::Outliers, stats, &raw[9..]).expect("fits");
        assert_eq!(reused.part(PartKind::Exact, stats, &raw).expect("fits"), first);
    }

    #[test]
    fn files_order_by_window_then_channel_then_block() {
        let id = BlockId::new;
        assert!(id(0, 0, 9) < id(0, 1, 0) && id(0, 9, 9) < id(1, 0, 0));
        assert!(BlockId { tier: 1, ..id(3, 5, 7) } < id(3, 0, 0) && id(2, 0, 0) < BlockId { tier: 1, ..id(3, 5, 7) });
        assert_eq!(id(3, 0, 7).to_string(), "window 3 block 7 channel 0");
    }
}
