//! Blocks of an open file that stay unpacked or decoded for the next pictures and reads, up to a number of bytes.

use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use wavesplat_core::base::grid::Region;
use wavesplat_core::codec::buffer::Buffer;
use wavesplat_core::codec::decode::Block;
use wavesplat_core::codec::field::Field;
use wavesplat_core::codec::{self, WindowCodec};
use wavesplat_format::{BlockEntry, BlockId, PartKind};

/// A block, and its coefficients if they have to be decoded together.
#[derive(Debug)]
pub(crate) struct DecodedBlock {
    pub(crate) block: Arc<Block>,
    pub(crate) field: Option<Field<'static>>,
}

impl DecodedBlock {
    fn bytes(&self) -> usize {
        self.block.held_bytes() + self.field.as_ref().map_or(0, Field::held_bytes)
    }
}

/// The values of a block in the frames of a picture.
#[derive(Debug)]
pub(crate) struct BlockValues {
    pub(crate) voxels: usize,
    /// Dense values of the frames: `frame * voxels + voxel`; empty if all are zero.
    pub(crate) dense: Vec<f64>,
    /// For each plane, values of single voxels, ascending by voxel; empty if there are none.
    pub(crate) few: Vec<Vec<(u32, f64)>>,
    /// Nonzero coefficients, and the stored bytes read.
    pub(crate) held: [u64; 2],
}

impl BlockValues {
    fn bytes(&self) -> usize {
        let few: usize = self.few.iter().map(Vec::capacity).sum();
        size_of_val(&self.dense[..]) + few * size_of::<(u32, f64)>()
    }
}

/// What is decoded of a block at a level of detail.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct DecodedKey {
    pub(super) id: BlockId,
    pub(super) lod: u32,
    pub(super) form: DecodedForm,
}

/// The form in which a block is decoded.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) enum DecodedForm {
    /// The codes of the coefficients that are marked.
    Codes { wanted: Vec<bool>, of: PartsRead },
    /// Values in some frames, made by one of two sums.
    Values { frames: Vec<usize>, by_coefficients: bool, of: PartsRead },
    /// All coefficients of the window.
    All,
    /// All samples of the window.
    Samples,
    /// The samples of some frames of the window, which a loop over frames reads soon.
    Frames(Range<usize>),
}

/// The parts of a block that are decoded, and whether it begins with the nodes of the block above.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct PartsRead {
    parts: Vec<PartKind>,
    begins_above: bool,
}

impl PartsRead {
    /// Those of a directory entry.
    pub(super) fn new(codec: &WindowCodec, entry: &BlockEntry) -> Self {
        let parts = entry.parts.iter().map(|part| part.kind).collect();
        Self { parts, begins_above: entry.begins_above(codec.tiers()) }
    }
}

#[derive(Debug, Clone)]
enum Decoded {
    Unpacked(Arc<Block>),
    Block(Arc<DecodedBlock>),
    Values(Arc<BlockValues>),
    Samples(Arc<Buffer<u8>>),
}

/// A cache of decoded blocks. A new block replaces the least recently used ones, but none that the previous run used: so a
/// run over more blocks than fit still finds some of them. Frames that were read ahead make room for the next ones.
#[derive(Debug)]
pub(super) struct DecodedBlocks {
    room: usize,
    kept: Mutex<Kept>,
}

/// Whether somebody waits for a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) enum Rank {
    #[default]
    Now,
    /// It replaces nothing that is kept, and counts as a part of the run before.
    Ahead,
}

#[derive(Debug, Default)]
struct Kept {
    entries: HashMap<DecodedKey, Entry>,
    rank: Rank,
    /// Blocks whose samples were read.
    read: HashSet<(BlockId, u32)>,
    /// Blocks that pictures used.
    drawn: HashSet<(BlockId, u32)>,
    bytes: usize,
    run: u64,
    /// The run that read last, and what it read.
    last: Option<(u64, FramesRead)>,
    /// The frames that are read ahead.
    ahead: Option<FramesRead>,
}

/// Frames of a region, as numbers in the file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct FramesRead {
    pub(super) channel: usize,
    pub(super) region: Region,
    pub(super) frames: Range<usize>,
}

impl FramesRead {
    /// Whether a read of `self` after one of `other` may be a step of a loop.
    fn follows(&self, other: &Self) -> bool {
        self.is_of_region_of(other) && self.frames.start == other.frames.end
    }

    fn is_within(&self, other: &Self) -> bool {
        let (own, all) = (&self.frames, &other.frames);
        self.is_of_region_of(other) && all.start <= own.start && own.end <= all.end
    }

    fn is_of_region_of(&self, other: &Self) -> bool {
        (self.channel, self.region) == (other.channel, other.region)
    }
}

#[derive(Debug)]
struct Entry {
    decoded: Decoded,
    bytes: usize,
    /// The last run that used it.
    used: u64,
}

/// The largest number of blocks in `read` and in `drawn`; with more, a set begins anew.
const MOST_SEEN: usize = 1 << 16;

impl DecodedBlocks {
    /// Room for this many bytes.
    pub(super) fn new(room: usize) -> Self {
        Self { room, kept: Mutex::default() }
    }

    /// The same room, empty.
    pub(super) fn emptied(&self) -> Self {
        Self::new(self.room)
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Begins a run: a picture, or a read of samples.
    pub(super) fn begin_run(&self, rank: Rank) {
        let mut kept = self.kept();
        kept.rank = rank;
        kept.run += u64::from(rank == Rank::Now);
    }

    /// Whether samples of a block were read before. It is remembered.
    pub(super) fn is_read_again(&self, id: BlockId, lod: u32) -> bool {
        is_met_again(&mut self.kept().read, (id, lod))
    }

    /// Whether a block was drawn before. It is remembered.
    pub(super) fn is_drawn_again(&self, id: BlockId, lod: u32) -> bool {
        is_met_again(&mut self.kept().drawn, (id, lod))
    }

    /// Whether samples of a block were read before.
    pub(super) fn was_read(&self, id: BlockId, lod: u32) -> bool {
        self.kept().read.contains(&(id, lod))
    }

    /// The frames that a read should decode and keep together, more than it asks for. None unless it begins with the frame after those
    /// that an earlier run read last, and if the whole window fits. A frame takes `bytes`.
    pub(super) fn ahead(&self, read: &FramesRead, bytes: usize, of_window: &Range<usize>) -> Option<Range<usize>> {
        let (mut kept, bytes) = (self.kept(), bytes.max(1));
        let run = kept.run;
        let goes_on = kept.last.as_ref().is_some_and(|(before, last)| *before < run && read.follows(last));
        kept.last = Some((run, read.clone()));
        if let Some(ahead) = kept.ahead.as_ref().filter(|ahead| read.is_within(ahead)) {
            return Some(ahead.frames.clone());
        }
        if !goes_on || bytes * of_window.len() <= self.room {
            return None;
        }
        kept.forget_frames();
        let most = self.room.saturating_sub(kept.bytes - kept.old_bytes()) / bytes;
        if most <= read.frames.len() {
            return None;
        }
        let frames = read.frames.start..of_window.end.min(read.frames.start + most);
        kept.ahead = Some(FramesRead { frames: frames.clone(), ..read.clone() });
        Some(frames)
    }

    /// Whether something of a block is kept. This is no use of it.
    pub(super) fn has(&self, key: &DecodedKey) -> bool {
        self.kept().entries.contains_key(key)
    }

    /// A block that is unpacked, if it is kept.
    pub(super) fn unpacked(&self, key: &DecodedKey) -> Option<Arc<Block>> {
        match self.kept().get(key)? {
            Decoded::Unpacked(block) => Some(block),
            _ => None,
        }
    }

    /// The coefficients of a block, if they are kept.
    pub(super) fn block(&self, key: &DecodedKey) -> Option<Arc<DecodedBlock>> {
        match self.kept().get(key)? {
            Decoded::Block(block) => Some(block),
            _ => None,
        }
    }

    /// The values of a block, if they are kept.
    pub(super) fn values(&self, key: &DecodedKey) -> Option<Arc<BlockValues>> {
        match self.kept().get(key)? {
            Decoded::Values(values) => Some(values),
            _ => None,
        }
    }

    /// Whether so many bytes fit in the empty cache.
    pub(super) fn fits(&self, bytes: usize) -> bool {
        bytes <= self.room
    }

    /// The samples of a block, if they are kept.
    pub(super) fn samples(&self, key: &DecodedKey) -> Option<Arc<Buffer<u8>>> {
        match self.kept().get(key)? {
            Decoded::Samples(samples) => Some(samples),
            _ => None,
        }
    }

    /// Whether so many bytes can be kept.
    pub(super) fn has_room(&self, bytes: usize) -> bool {
        let kept = self.kept();
        kept.bytes - kept.old_bytes() + bytes <= self.room
    }

    /// Keeps an unpacked block if there is room.
    pub(super) fn keep_unpacked(&self, key: DecodedKey, block: &Arc<Block>) {
        self.kept().put(key, Decoded::Unpacked(block.clone()), block.held_bytes(), self.room);
    }

    /// Keeps the coefficients of a block if there is room.
    pub(super) fn keep_block(&self, key: DecodedKey, block: &Arc<DecodedBlock>) {
        self.kept().put(key, Decoded::Block(block.clone()), block.bytes(), self.room);
    }

    /// Keeps values if there is room.
    pub(super) fn keep_values(&self, key: DecodedKey, values: &Arc<BlockValues>) {
        self.kept().put(key, Decoded::Values(values.clone()), values.bytes(), self.room);
    }

    /// Keeps samples if there is room, in a copy if their buffer is more than twice as long.
    pub(super) fn keep_samples(&self, key: DecodedKey, samples: &Arc<Buffer<u8>>) {
        let is_wasteful = samples.held_bytes() > 2 * samples.len();
        let samples = if is_wasteful { Arc::new(Buffer::to_keep(samples)) } else { samples.clone() };
        let bytes = samples.held_bytes();
        self.kept().put(key, Decoded::Samples(samples), bytes, self.room);
    }
}

impl Drop for DecodedBlocks {
    /// Returns the memory to the system: buffers that are dropped go to a pool.
    fn drop(&mut self) {
        self.kept().entries.clear();
        codec::release_spare();
    }
}

impl Kept {
    /// Entries that neither this run nor the one before used.
    fn old(&self) -> impl Iterator<Item = (&DecodedKey, &Entry)> {
        self.entries.iter().filter(|(_, entry)| entry.used + 1 < self.run)
    }

    fn old_bytes(&self) -> usize {
        self.old().map(|(_, entry)| entry.bytes).sum()
    }

    /// Drops what was read ahead.
    fn forget_frames(&mut self) {
        self.ahead = None;
        let is_ahead = |key: &DecodedKey| matches!(key.form, DecodedForm::Frames(_));
        let dropped = self.entries.extract_if(|key, _| is_ahead(key));
        self.bytes -= dropped.map(|(_, entry)| entry.bytes).sum::<usize>();
    }

    fn get(&mut self, key: &DecodedKey) -> Option<Decoded> {
        let entry = self.entries.get_mut(key)?;
        entry.used = self.run;
        Some(entry.decoded.clone())
    }

    fn put(&mut self, key: DecodedKey, decoded: Decoded, bytes: usize, room: usize) {
        if bytes > room || self.entries.contains_key(&key) {
            return;
        }
        while self.bytes + bytes > room {
            let oldest = self.old().filter(|_| self.rank == Rank::Now).min_by_key(|(_, entry)| entry.used);
            let Some(oldest) = oldest.map(|(key, _)| key.clone()) else { return };
            self.bytes -= self.entries.remove(&oldest).map_or(0, |entry| entry.bytes);
        }
        self.bytes += bytes;
        self.entries.insert(key, Entry { decoded, bytes, used: self.run });
    }
}

/// Whether a set has a block. Adds it.
fn is_met_again(set: &mut HashSet<(BlockId, u32)>, block: (BlockId, u32)) -> bool {
    if set.len() >= MOST_SEEN {
        set.clear();
    }
    !set.insert(block)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(block: u32) -> DecodedKey {
        DecodedKey { id: BlockId::new(0, 0, block), lod: 0, form: DecodedForm::Samples }
    }

    fn keep(blocks: &DecodedBlocks, block: u32) {
        blocks.keep_samples(key(block), &Arc::new(Buffer::with_len(100)));
    }

    fn kept(blocks: &DecodedBlocks, all: std::ops::Range<u32>) -> Vec<u32> {
        all.filter(|block| blocks.kept().entries.contains_key(&key(*block))).collect()
    }

    #[test]
    fn reads_go_on_with_frames_that_fit() {
        let blocks = DecodedBlocks::new(100);
        let ahead = |bytes, end, frames| {
            blocks.begin_run(Rank::Now);
            let region = Region { start: [0; 3], end: [end; 3] };
            blocks.ahead(&FramesRead { channel: 0, region, frames }, bytes, &(8..20))
        };
        assert_eq!(ahead(30, 2, 8..9), None, "a first read");
        assert_eq!(ahead(30, 2, 9..10), Some(9..12));
        assert_eq!(ahead(30, 2, 10..11), Some(9..12));
        assert_eq!(ahead(30, 2, 15..16), None, "elsewhere");
        assert_eq!(ahead(30, 2, 11..12), Some(9..12), "still kept");
        assert_eq!(ahead(30, 3, 12..13), None, "another region");
        assert_eq!(ahead(30, 3, 13..15), Some(13..16));
        assert_eq!(ahead(30, 3, 15..19), None, "more than fits");
        assert_eq!(ahead(30, 3, 19..20), Some(19..20), "the last of the window");
        assert_eq!(ahead(8, 3, 8..9), None);
        assert_eq!(ahead(8, 3, 9..10), None, "the whole window fits");
        blocks.keep_samples(key(7), &Arc::new(Buffer::to_keep(&[0; 40])));
        ahead(30, 4, 8..9);
        assert!(blocks.samples(&key(7)).is_some());
        assert_eq!(ahead(30, 4, 9..10), Some(9..11), "beside what the last run used");
        let twice = FramesRead { channel: 0, region: Region { start: [0; 3], end: [5; 3] }, frames: 8..9 };
        blocks.begin_run(Rank::Now);
        let next = FramesRead { frames: 9..10, ..twice.clone() };
        assert_eq!([&twice, &next].map(|read| blocks.ahead(read, 30, &(8..20))), [None, None], "one run");
    }

    #[test]
    fn never_more_is_kept_than_there_is_room_for() {
        let blocks = DecodedBlocks::new(1000);
        for run in 0..50 {
            blocks.begin_run(Rank::Now);
            (0..7).for_each(|block| keep(&blocks, run * 3 + block));
            let kept = blocks.kept();
            assert!(kept.bytes <= 1000 && kept.bytes == 100 * kept.entries.len());
        }
        blocks.keep_samples(key(1000), &Arc::new(Buffer::with_len(1001)));
        assert!(kept(&blocks, 1000..1001).is_empty());
    }

    #[test]
    fn a_run_through_too_many_blocks_finds_some_again() {
        let blocks = DecodedBlocks::new(1000);
        for _ in 0..5 {
            blocks.begin_run(Rank::Now);
            (0..40).for_each(|block| keep(&blocks, block));
            assert_eq!(kept(&blocks, 0..40), (0..10).collect::<Vec<_>>());
            assert!((0..10).all(|block| blocks.samples(&key(block)).is_some()));
        }
    }

    #[test]
    fn the_least_recently_used_make_room() {
        let blocks = DecodedBlocks::new(300);
        (0..3).for_each(|block| keep(&blocks, block));
        for run in 0..4 {
            blocks.begin_run(Rank::Now);
            assert!(blocks.samples(&key(run % 2)).is_some());
        }
        keep(&blocks, 3);
        assert_eq!(kept(&blocks, 0..4), [0, 1, 3]);
    }

    #[test]
    fn runs_ahead_replace_nothing() {
        let blocks = DecodedBlocks::new(300);
        (0..2).for_each(|block| keep(&blocks, block));
        (0..3).for_each(|_| blocks.begin_run(Rank::Now));
        blocks.begin_run(Rank::Ahead);
        (2..9).for_each(|block| keep(&blocks, block));
        assert_eq!(kept(&blocks, 0..9), [0, 1, 2], "one fits beside them");
        blocks.begin_run(Rank::Now);
        keep(&blocks, 9);
        assert_eq!(kept(&blocks, 0..10).len(), 3);
        assert!(blocks.samples(&key(9)).is_some());
    }
}
