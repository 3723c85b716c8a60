//! The blocks above others, decoded: many blocks share what is coarse.

use std::sync::{Arc, Mutex, PoisonError};
use wavesplat_core::base::error::Result;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::field::{Above, Field};
use wavesplat_format::{BlockId, Metadata};

/// The decoded blocks above that were used last, for all threads.
#[derive(Debug)]
pub(crate) struct AboveBlocks {
    /// The largest number of blocks that stay decoded.
    most: usize,
    /// The most recently used comes last.
    kept: Mutex<Vec<(AboveKey, Slot)>>,
}

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

/// The blocks of an open file that stay decoded for each thread.
const FOR_A_THREAD: usize = 2;

impl Default for AboveBlocks {
    fn default() -> Self {
        Self::new(FOR_A_THREAD * rayon::current_num_threads())
    }
}

impl AboveBlocks {
    /// The largest number of blocks above others that are decoded at a time, for each thread.
    pub(crate) const HELD_BY_A_THREAD: usize = FOR_A_THREAD + 1;

    /// Room for so many blocks, at least one.
    pub(crate) fn new(most: usize) -> Self {
        Self { most: most.max(1), kept: Mutex::default() }
    }

    /// A decoded block.
    pub(crate) fn field(
        &self,
        key: AboveKey,
        decode: impl FnOnce() -> Result<Arc<Field<'static>>>,
    ) -> Result<Arc<Field<'static>>> {
        let slot = self.slot(key);
        let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
        match &*slot {
            Some(field) => Ok(field.clone()),
            None => Ok(slot.insert(decode()?).clone()),
        }
    }

    /// The place of a decoded block. The least recently used ones make room.
    fn slot(&self, key: AboveKey) -> Slot {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let found = kept.iter().position(|(kept, _)| *kept == key).map(|at| kept.remove(at));
        let used = found.unwrap_or_else(|| (key, Slot::default()));
        let slot = used.1.clone();
        kept.push(used);
        let old = kept.len().saturating_sub(self.most);
        kept.drain(..old);
        slot
    }
}

/// Where the nodes lie that a block begins with: the block of a tier above, the first of these nodes on its lattice at a level of
/// detail, and the number of nodes of that lattice.
pub(crate) struct PlaceAbove {
    pub(crate) id: BlockId,
    start: [usize; 3],
    size: [usize; 3],
}

impl PlaceAbove {
    pub(crate) fn new(file: &Metadata, codec: &WindowCodec, id: BlockId, tier: u8, lod: u32) -> Self {
        let mut above = id;
        while above.tier < tier {
            above = file.above(above);
        }
        let [own, outer] = [id, above].map(|id| file.block_box(id.tier, id.block).unwrap_or_default());
        let start = std::array::from_fn(|a| ((own.0[a] - outer.0[a]) >> (u32::from(tier) + lod)) as usize);
        Self { id: above, start, size: codec.at(tier, lod).decoded_size(outer.1.map(|n| n as usize)) }
    }

    pub(crate) fn with(self, field: Arc<Field<'static>>) -> Above {
        Above { field, size: self.size, start: self.start }
    }
}
