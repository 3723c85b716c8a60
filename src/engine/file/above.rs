//! The blocks above others, decoded: many blocks share what is coarse.

use std::sync::{Arc, Mutex, PoisonError};
use wavesplat_core::base::error::Result;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::field::{Above, Field};
use wavesplat_format::{BlockId, Metadata};

/// The decoded blocks above that were used last, for all threads.
#[derive(Debug)]
pub(crate) struct AboveBlocks {
    /// Bytes that stay decoded.
    room: usize,
    /// The most recently used comes last.
    kept: Mutex<Vec<Kept>>,
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

#[derive(Debug)]
struct Kept {
    key: AboveKey,
    slot: Slot,
    bytes: usize,
}

/// Bytes of an open file that stay decoded.
const ROOM: usize = 64 << 20;

impl Default for AboveBlocks {
    fn default() -> Self {
        Self::new(ROOM)
    }
}

impl AboveBlocks {
    /// Room for so many bytes, and for the block that was used last.
    pub(crate) fn new(room: usize) -> Self {
        Self { room, kept: Mutex::default() }
    }

    /// A decoded block of `bytes` bytes.
    pub(crate) fn field(
        &self,
        key: AboveKey,
        bytes: usize,
        decode: impl FnOnce() -> Result<Arc<Field<'static>>>,
    ) -> Result<Arc<Field<'static>>> {
        let slot = self.slot(key, bytes);
        let mut slot = slot.lock().unwrap_or_else(PoisonError::into_inner);
        match &*slot {
            Some(field) => Ok(field.clone()),
            None => Ok(slot.insert(decode()?).clone()),
        }
    }

    /// The place of a decoded block. Makes room for its bytes.
    fn slot(&self, key: AboveKey, bytes: usize) -> Slot {
        let mut kept = self.kept.lock().unwrap_or_else(PoisonError::into_inner);
        let found = kept.iter().position(|kept| kept.key == key).map(|at| kept.remove(at));
        let used = found.unwrap_or_else(|| Kept { key, slot: Slot::default(), bytes });
        let slot = used.slot.clone();
        kept.push(used);
        while kept.len() > 1 && kept.iter().map(|kept| kept.bytes).sum::<usize>() > self.room {
            kept.remove(0);
        }
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

    /// Bytes of the decoded nodes of all k.
    pub(crate) fn bytes(&self, codec: &WindowCodec) -> usize {
        let is_single = codec.scheme.pyramid.as_ref().is_some_and(|pyramid| pyramid.single);
        let each = if is_single { size_of::<f32>() } else { size_of::<f64>() };
        self.size.iter().product::<usize>() * codec.basis.coefficients() * each
    }

    pub(crate) fn with(self, field: Arc<Field<'static>>) -> Above {
        Above { field, size: self.size, start: self.start }
    }
}
