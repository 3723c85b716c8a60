//! The blocks above others, decoded: many blocks share what is coarse.

use super::detail;
use std::collections::{BTreeSet, VecDeque};
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::{BlockGrid, Region};
use wavesplat_core::base::memory::FIXED;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::field::{Above, Field};
use wavesplat_format::{BlockEntry, BlockId, Metadata, Window};

/// The decoded blocks above that were used last, for all threads.
#[derive(Debug)]
pub(crate) struct AboveBlocks {
    /// The largest number of blocks that stay decoded.
    most: AtomicUsize,
    /// The most recently used comes last.
    kept: Mutex<Vec<(AboveKey, Slot)>>,
    /// The leaves of the directory that were read last, by their first blocks.
    leaves: Mutex<VecDeque<(BlockId, Arc<Vec<BlockEntry>>)>>,
}

/// Leaves that stay in memory: usually enough for one in every tier, and for blocks in nested order.
const LEAVES: usize = 16;

/// What is decoded of a block.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct AboveKey {
    pub(crate) id: BlockId,
    /// Every 2^lod-th of its nodes.
    pub(crate) lod: u32,
    pub(crate) wanted: Vec<bool>,
}

/// Empty until one thread has decoded it; others wait.
type Slot = Arc<Mutex<Option<Arc<Field<'static>>>>>;

/// The decoded blocks take at most one part in so many of a memory budget.
const SHARE: usize = 8;

/// A larger share for the blocks above a single block, and for coarser levels of detail, where other blocks take little.
const LARGER_SHARE: usize = 4;

/// Blocks above a single block: one of each tier, of which files of usual size have three, and one more. If fewer stay decoded,
/// neighbours decode the same ones again.
pub(crate) const OF_ONE_BLOCK: usize = 4;

impl AboveBlocks {
    /// Room for so many blocks.
    pub(crate) fn new(most: usize) -> Self {
        Self { most: AtomicUsize::new(most), kept: Mutex::default(), leaves: Mutex::default() }
    }

    /// The largest number of blocks that stay decoded.
    pub(crate) fn most(&self) -> usize {
        self.most.load(Relaxed)
    }

    /// An empty one with the same limit.
    pub(super) fn emptied(&self) -> Self {
        Self::new(self.most())
    }

    /// Sets the largest number of blocks that stay decoded.
    pub(super) fn limit(&self, most: usize) {
        self.most.store(most, Relaxed);
        drop_oldest(&mut self.kept.lock().unwrap_or_else(PoisonError::into_inner), most);
    }

    /// The first of some blocks that stay decoded together with those above them; at least one. Their window has so many tiers.
    pub(crate) fn staying(&self, file: &Metadata, tiers: u8, blocks: BTreeSet<BlockId>) -> Vec<BlockId> {
        let mut needed = BTreeSet::new();
        let stays = |id: &BlockId| {
            let is_first = needed.is_empty();
            needed.extend(with_blocks_above(file, tiers, *id));
            is_first || needed.len() <= self.most()
        };
        blocks.into_iter().take_while(stays).collect()
    }

    /// The entries of a leaf.
    pub(crate) fn leaf(
        &self,
        first: BlockId,
        read: impl FnOnce() -> Result<Vec<BlockEntry>>,
    ) -> Result<Arc<Vec<BlockEntry>>> {
        let leaves = || self.leaves.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, entries)) = leaves().iter().find(|(of, _)| *of == first) {
            return Ok(entries.clone());
        }
        let entries = Arc::new(read()?);
        let mut leaves = leaves();
        leaves.retain(|(of, _)| *of != first); // another thread may have read it meanwhile
        leaves.push_back((first, entries.clone()));
        let old = leaves.len().saturating_sub(LEAVES);
        leaves.drain(..old);
        Ok(entries)
    }

    /// A decoded block.
    pub(crate) fn field(
        &self,
        key: &AboveKey,
        decode: impl FnOnce() -> Result<Arc<Field<'static>>>,
    ) -> Result<Arc<Field<'static>>> {
        let slot = self.slot(key, None);
        let mut decoded = slot.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(field) = &*decoded {
            return Ok(field.clone());
        }
        let field = decoded.insert(decode()?).clone();
        self.slot(key, Some(&slot)); // it is needed longer than its own blocks above
        Ok(field)
    }

    /// The nodes of a block if they stay decoded and no thread decodes them now.
    pub(super) fn kept(&self, key: &AboveKey) -> Option<Arc<Field<'static>>> {
        let kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let (_, slot) = kept.iter().find(|(of, _)| of == key)?;
        slot.try_lock().ok()?.clone()
    }

    /// The place of a decoded block, which becomes the most recently used one: the place in the list, else `decoded`, else a new one.
    /// The least recently used blocks make room, and what else was decoded of the same block: readers that take turns with
    /// other coefficients of a file decode it again.
    fn slot(&self, key: &AboveKey, decoded: Option<&Slot>) -> Slot {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let known = kept.iter().position(|(of, _)| of.id == key.id).map(|at| kept.remove(at));
        let known = known.filter(|(of, _)| of == key).map(|(_, slot)| slot);
        let slot = known.or_else(|| decoded.cloned()).unwrap_or_default();
        kept.push((key.clone(), slot.clone()));
        drop_oldest(&mut kept, self.most());
        slot
    }
}

fn drop_oldest(kept: &mut Vec<(AboveKey, Slot)>, most: usize) {
    let old = kept.len().saturating_sub(most);
    kept.drain(..old);
}

/// The number of blocks of `bytes` bytes each in their share of a memory budget, at a level of detail; at least one.
pub(crate) fn most_within(memory: usize, bytes: usize, lod: u32) -> usize {
    let within = |share: usize| memory.saturating_sub(FIXED) / share / bytes.max(1);
    let larger = within(LARGER_SHARE);
    let most = if lod > 0 { larger } else { within(SHARE).max(larger.min(OF_ONE_BLOCK)) };
    most.clamp(1, MOST)
}

/// More blocks would take longer to search than they save.
const MOST: usize = 1024;

/// A block of a window with so many tiers, and those above it.
pub(super) fn with_blocks_above(file: &Metadata, tiers: u8, id: BlockId) -> impl Iterator<Item = BlockId> + '_ {
    std::iter::successors(Some(id), move |id| (id.tier < tiers).then(|| file.above(*id)))
}

/// Where the nodes lie that a block begins with.
pub(crate) struct PlaceAbove {
    /// The block above.
    pub(crate) id: BlockId,
    /// Its nodes along x, y, z.
    outer: [usize; 3],
    /// The first of them in the block.
    start: [usize; 3],
    /// Those in the block.
    size: [usize; 3],
}

impl PlaceAbove {
    /// The place of a block of a file; `above` is the codec of blocks above.
    pub(crate) fn new(file: &Metadata, codec: &WindowCodec, above: &WindowCodec, id: BlockId) -> Self {
        let id_above = file.above_in(id, above.tier);
        let [own, outer] = [id, id_above].map(|id| file.block_box(id.tier, id.block).unwrap_or_default());
        let apart = u32::from(above.tier) + above.lod;
        let start = std::array::from_fn(|a| ((own.0[a] - outer.0[a]) >> apart) as usize);
        let [size, outer] = [own.1, outer.1].map(|size| size.map(|n| n as usize));
        Self { id: id_above, outer: above.decoded_size(outer), start, size: codec.known_size(above, size) }
    }

    /// Copies the block's nodes out of the decoded block above.
    pub(crate) fn cut(&self, field: &Field<'_>) -> Above {
        self.cut_part(field, &self.whole())
    }

    /// Copies some of the block's nodes; the others are arbitrary.
    pub(super) fn cut_part(&self, field: &Field<'_>, part: &Region) -> Above {
        Above::new(field, self.outer, &self.in_block_above(&self.whole()), part)
    }

    /// Some of the block's nodes as nodes of the block above.
    pub(super) fn in_block_above(&self, part: &Region) -> Region {
        part.moved_by(self.start)
    }

    /// All nodes with which the block begins.
    fn whole(&self) -> Region {
        Region { start: [0; 3], end: self.size }
    }
}

/// Bytes of the decoded nodes of a block above others; 0 without tiers.
pub(super) fn bytes_above(m: &Metadata) -> usize {
    let bytes = |window: &Window| window.coefficients as usize * window.coefficient_size();
    let tiered = m.windows.iter().filter(|window| window.tiers() > 0);
    nodes_above(detail::whole(m).1) * tiered.map(bytes).max().unwrap_or(0)
}

/// An upper bound of the bytes of the decoded nodes of all blocks above others in a file.
pub(super) fn bytes_of_all_above(m: &Metadata) -> usize {
    let nodes = |tier: u8| {
        // Along an axis, a block has at most two nodes beyond its share: a ghost node, and one from rounding.
        let along = |axis: usize| (m.dims[axis].div_ceil(1 << tier) + 2 * m.blocks_per_axis(tier)[axis]) as f64;
        (0..3).map(along).product::<f64>()
    };
    let of_window = |window: &Window| {
        let tiers = (1..=window.tiers()).map(nodes).sum::<f64>();
        tiers * f64::from(window.coefficients) * window.coefficient_size() as f64
    };
    (m.windows.iter().map(of_window).sum::<f64>() * f64::from(m.channels)) as usize
}

/// The most nodes of a block above these, ghost nodes included.
pub(crate) fn nodes_above(blocks: BlockGrid) -> usize {
    blocks.region(0).dims().iter().map(|n| n + 1).product()
}
