//! The damaged blocks of a file that are left out, and which of them were asked for.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Mutex, PoisonError};
use wavesplat_format::BlockId;

/// The damage to a file, block by block.
#[derive(Debug, Default)]
pub(super) struct Damage {
    blocks: BTreeMap<BlockId, String>,
    /// The damaged blocks that were asked for.
    met: Mutex<BTreeSet<BlockId>>,
}

impl Damage {
    pub(super) fn new(blocks: BTreeMap<BlockId, String>) -> Self {
        Self { blocks, met: Mutex::default() }
    }

    /// Whether there is none.
    pub(super) fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Whether a block is damaged.
    pub(super) fn has(&self, id: BlockId) -> bool {
        self.blocks.contains_key(&id)
    }

    /// Notes that a damaged block was asked for.
    pub(super) fn meet(&self, id: BlockId) {
        self.met.lock().unwrap_or_else(PoisonError::into_inner).insert(id);
    }

    /// The number of damaged blocks that were asked for, and the problem of the first; `None` if all blocks that were
    /// asked for are whole.
    pub(super) fn words(&self) -> Option<String> {
        let met = self.met.lock().unwrap_or_else(PoisonError::into_inner);
        let first = self.blocks.get(met.first()?)?;
        Some(format!("{} damaged blocks were left out; the first: {first}", met.len()))
    }

    pub(super) fn is_in_window(&self, window: u32) -> bool {
        let first = BlockId::new(window, 0, 0);
        self.blocks.range(first..).next().is_some_and(|(id, _)| id.window == window)
    }
}
