//! Files whose damaged blocks are taken for missing samples.

use super::CoefficientFile;
use super::check::BLOCKS_TOGETHER;
use super::damage::Damage;
use rayon::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_format::{BlockId, LeafEntry};

impl CoefficientFile {
    /// Reads every block, then treats damaged ones as missing samples.
    ///
    /// # Errors
    /// The storage cannot be read.
    pub fn skip_damaged(mut self) -> Result<Self> {
        let leaves = (0..self.metadata().windows.len() as u32).flat_map(|window| self.leaves(window));
        let leaves: Vec<_> = leaves.copied().collect();
        let found = match self.is_remote() {
            true => leaves.iter().map(|leaf| self.damage(leaf)).collect::<Result<Vec<_>>>()?, // threads would push out each other's pages
            false => leaves.par_iter().map(|leaf| self.damage(leaf)).collect::<Result<Vec<_>>>()?,
        };
        let blocks = self.with_blocks_below(found.into_iter().flatten().collect())?;
        self.skipped = Some(Damage::new(blocks).into());
        // Blocks kept so far were decoded without knowing the damage.
        self.kept = self.kept.map(|kept| Arc::new(kept.emptied()));
        self.above = Arc::new(self.above.emptied());
        Ok(self)
    }

    /// Damaged blocks, and those that begin with the nodes of one of them.
    fn with_blocks_below(&self, mut damaged: BTreeMap<BlockId, String>) -> Result<BTreeMap<BlockId, String>> {
        let windows: BTreeSet<u32> = damaged.keys().filter(|id| id.tier > 0).map(|id| id.window).collect();
        for leaf in windows.into_iter().flat_map(|window| self.leaves(window)) {
            if leaf.ids().all(|id| damaged.contains_key(&id)) {
                continue; // the leaf itself may be damaged
            }
            for entry in self.reader.leaf(leaf).map_err(|e| self.failed(e))? {
                let wrong = entry.block_above(self.metadata()).and_then(|above| damaged.get(&above).cloned());
                wrong.into_iter().for_each(|wrong| _ = damaged.entry(entry.id).or_insert(wrong));
            }
        }
        Ok(damaged)
    }

    /// The damage to the blocks of a leaf; an error if the storage fails.
    fn damage(&self, leaf: &LeafEntry) -> Result<Vec<(BlockId, String)>> {
        let entries = match self.reader.leaf(leaf) {
            Err(failed) if failed.is_io() => return Err(self.failed(failed)),
            Err(wrong) => return Ok(leaf.ids().map(|id| (id, wrong.to_string())).collect()),
            Ok(entries) => entries,
        };
        let mut found = Vec::new();
        for entries in entries.chunks(BLOCKS_TOGETHER) {
            self.fetch_whole(entries)?;
            for entry in entries {
                match self.reader.check_stored(entry) {
                    Ok(()) => {}
                    Err(failed) if failed.is_io() => return Err(self.failed(failed)),
                    Err(wrong) => found.push((entry.id, wrong.to_string())),
                }
            }
        }
        Ok(found)
    }

    /// Whether blocks are skipped.
    pub(crate) fn skips_damage(&self) -> bool {
        self.skipped().is_some()
    }

    /// What [`Self::skip_damaged`] found.
    pub(super) fn skipped(&self) -> Option<&Damage> {
        self.skipped.as_deref().filter(|damage| !damage.is_empty())
    }

    /// An error that names the damaged blocks that were skipped, if any were. Call it last.
    ///
    /// # Errors
    /// Blocks were skipped.
    pub fn refuse_skipped(&self) -> Result<()> {
        self.skipped().and_then(Damage::words).map_or(Ok(()), |what| Err(Error::input(self.path(), what)))
    }

    /// Whether any sample of a window may be missing.
    pub fn has_missing(&self, window: u32) -> bool {
        let record = &self.metadata().windows[window as usize];
        record.missing > 0 || self.skipped().is_some_and(|damage| damage.is_in_window(window))
    }
}
