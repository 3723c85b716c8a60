//! Blocks of an open file that stay decoded for the next pictures and reads, up to a number of bytes.

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
    pub(crate) block: Block,
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
        let few: usize = self.few.iter().map(|few| size_of_val(&few[..])).sum();
        size_of_val(&self.dense[..]) + few
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
    /// The coefficients that are marked.
    Coefficients { wanted: Vec<bool>, of: PartsRead },
    /// Values in some frames.
    Values { frames: Vec<usize>, of: PartsRead },
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
    Block(Arc<DecodedBlock>),
    Values(Arc<BlockValues>),
    Samples(Arc<Buffer<u8>>),
}

/// A cache of decoded blocks. A new block replaces the least recently used ones, but none that the previous run used: so a
/// run over more blocks than fit still finds some of them.
#[derive(Debug)]
pub(super) struct DecodedBlocks {
    room: usize,
    kept: Mutex<Kept>,
}

#[derive(Debug, Default)]
struct Kept {
    entries: HashMap<DecodedKey, Entry>,
    /// Blocks that were read.
    seen: HashSet<(BlockId, u32)>,
    bytes: usize,
    run: u64,
    /// The channel and region that were read last, and the frame after those.
    last: Option<(usize, Region, usize)>,
    ahead: Ahead,
}

/// Frames that a loop reads soon: their number in the file, of a channel and region.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct Ahead {
    of: Option<(usize, Region)>,
    frames: Range<usize>,
}

#[derive(Debug)]
struct Entry {
    decoded: Decoded,
    bytes: usize,
    /// The last run that used it.
    used: u64,
}

/// The largest number of blocks in `seen`; with more, the set begins anew.
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
    pub(super) fn begin_run(&self) {
        self.kept().run += 1;
    }

    /// Whether a block was read before. It is remembered.
    pub(super) fn is_read_again(&self, id: BlockId, lod: u32) -> bool {
        let seen = &mut self.kept().seen;
        if seen.len() >= MOST_SEEN {
            seen.clear();
        }
        !seen.insert((id, lod))
    }

    /// Whether a block was read before.
    pub(super) fn was_read(&self, id: BlockId, lod: u32) -> bool {
        self.kept().seen.contains(&(id, lod))
    }

    /// The frames that a read of some of them decodes and keeps together: as many as there is room for, if the read goes on with the
    /// frame after those of the last read, and not all of the window's frames fit. Each takes `bytes`.
    pub(super) fn ahead(
        &self,
        [channel, bytes]: [usize; 2],
        region: &Region,
        frames: &Range<usize>,
        of_window: &Range<usize>,
    ) -> Option<Range<usize>> {
        let (mut kept, most) = (self.kept(), self.room / bytes.max(1));
        let goes_on = kept.last == Some((channel, *region, frames.start));
        kept.last = Some((channel, *region, frames.end));
        let is_ahead = kept.ahead.of == Some((channel, *region));
        if is_ahead && kept.ahead.frames.start <= frames.start && frames.end <= kept.ahead.frames.end {
            return Some(kept.ahead.frames.clone());
        }
        if !goes_on || most >= of_window.len() || most <= frames.len() {
            return None;
        }
        kept.forget_frames();
        let ahead = frames.start..of_window.end.min(frames.start + most);
        kept.ahead = Ahead { of: Some((channel, *region)), frames: ahead.clone() };
        Some(ahead)
    }

    /// Whether something of a block is kept. This is no use of it.
    pub(super) fn has(&self, key: &DecodedKey) -> bool {
        self.kept().entries.contains_key(key)
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
        let old = kept.old().map(|(_, entry)| entry.bytes).sum::<usize>();
        kept.bytes - old + bytes <= self.room
    }

    /// Keeps a block if there is room.
    pub(super) fn keep_block(&self, key: DecodedKey, block: &Arc<DecodedBlock>) {
        self.kept().put(key, Decoded::Block(block.clone()), block.bytes(), self.room);
    }

    /// Keeps values if there is room.
    pub(super) fn keep_values(&self, key: DecodedKey, values: &Arc<BlockValues>) {
        self.kept().put(key, Decoded::Values(values.clone()), values.bytes(), self.room);
    }

    /// Keeps samples if there is room.
    pub(super) fn keep_samples(&self, key: DecodedKey, samples: &Arc<Buffer<u8>>) {
        self.kept().put(key, Decoded::Samples(samples.clone()), samples.held_bytes(), self.room);
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

    /// Drops what was read ahead.
    fn forget_frames(&mut self) {
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
            let oldest = self.old().min_by_key(|(_, entry)| entry.used);
            let Some(oldest) = oldest.map(|(key, _)| key.clone()) else { return };
            self.bytes -= self.entries.remove(&oldest).map_or(0, |entry| entry.bytes);
        }
        self.bytes += bytes;
        self.entries.insert(key, Entry { decoded, bytes, used: self.run });
    }
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
        let box_of = |end| Region { start: [0; 3], end: [end; 3] };
        let ahead = |bytes, end, frames| blocks.ahead([0, bytes], &box_of(end), &frames, &(8..20));
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
    }

    #[test]
    fn never_more_is_kept_than_there_is_room_for() {
        let blocks = DecodedBlocks::new(1000);
        for run in 0..50 {
            blocks.begin_run();
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
            blocks.begin_run();
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
            blocks.begin_run();
            assert!(blocks.samples(&key(run % 2)).is_some());
        }
        keep(&blocks, 3);
        assert_eq!(kept(&blocks, 0..4), [0, 1, 3]);
    }
}
