//! Checks of the bytes of a file: checksums, headers and padding, without decoding.

use super::CoefficientFile;
use rayon::prelude::*;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_format::{BlockEntry, CompletePrefix, LeafEntry};

/// Blocks that are fetched together to be checked.
pub(super) const BLOCKS_TOGETHER: usize = 32;

impl CoefficientFile {
    /// Checks every byte of the file outside blocks and leaves. Calls `found` for each problem.
    pub(crate) fn check_structure(&self, found: &mut dyn FnMut(Error)) -> Result<()> {
        self.reader.check_structure(&mut |wrong| found(self.failed(wrong))).map_err(|e| self.failed(e))
    }

    /// Checks every byte outside parts of consecutive blocks; the first block begins at `at`. Calls `found` for each
    /// problem. Returns where the next block begins.
    pub(crate) fn check_blocks(&self, at: u64, blocks: &[BlockEntry], found: &mut dyn FnMut(Error)) -> Result<u64> {
        let mut found = |wrong| found(self.failed(wrong));
        self.reader.check_blocks(at, blocks, &mut found).map_err(|e| self.failed(e))
    }

    /// Checks the padding behind a leaf. Calls `found` if it is wrong.
    pub(crate) fn check_leaf_end(&self, leaf: &LeafEntry, found: &mut dyn FnMut(Error)) -> Result<()> {
        let mut found = |wrong| found(self.failed(wrong));
        self.reader.check_leaf_end(leaf, &mut found).map_err(|e| self.failed(e))
    }

    /// Compares the checksums of every byte of the file, and returns the first error. Lost blocks have nothing to
    /// check.
    pub fn check_stored(&self) -> Result<()> {
        let mut wrong = None;
        let mut found = |error| wrong = wrong.take().or(Some(error));
        self.check_structure(&mut found)?;
        for leaf in (0..self.metadata().windows.len() as u32).flat_map(|window| self.leaves(window)) {
            let mut at = leaf.data_offset;
            for entries in self.leaf(leaf)?.chunks(BLOCKS_TOGETHER) {
                self.fetch_whole(entries)?;
                at = self.check_blocks(at, entries, &mut found)?;
                let present = entries.par_iter().filter(|entry| !entry.lost);
                present.try_for_each(|entry| self.reader.check_stored(entry)).map_err(|e| self.failed(e))?;
            }
            self.check_leaf_end(leaf, &mut found)?;
        }
        wrong.map_or(Ok(()), Err)
    }

    /// Checks every byte of all windows, and returns the windows.
    pub(crate) fn whole_windows(&self) -> Result<CompletePrefix> {
        let whole = CompletePrefix::read(self.reader.storage()).map_err(|e| self.failed(e))?;
        match whole.metadata() == self.metadata() {
            true => Ok(whole),
            false => {
                self.check_stored().and(Err(self.contradiction("windows that the metadata does not tell of".into())))
            }
        }
    }
}
