//! The check that every byte of a file is accounted for.

use crate::directory::BlockEntry;
use crate::limits::{ALIGN, align};
use crate::reader::Reader;
use crate::section::{Extent, Owner, frame, read};
use crate::{Error, Result, Storage};

impl<S: Storage> Reader<S> {
    /// Checks all leaves, all blocks' headers against them, and all padding. Together with [`Reader::open`] and
    /// [`Reader::check_parts`] of every block this finds any changed bit of the file.
    pub fn check_structure(&self) -> Result<()> {
        for window in 0..self.metadata().windows.len() as u32 {
            for leaf in self.leaves(window) {
                let mut at = leaf.data_offset;
                for block in self.leaf(leaf)? {
                    at = self.check_block(at, &block)?;
                }
                self.check_padding(leaf.extent().end())?;
            }
        }
        self.check_padding(self.footer.metadata.end())?;
        self.check_padding(self.footer.root.end()).map(|_| ())
    }

    /// Whether the header of a block at `start` repeats its entry, and zeros follow its parts; its aligned end.
    fn check_block(&self, start: u64, block: &BlockEntry) -> Result<u64> {
        let owner = Owner::Block(block.id);
        let mut entry = Vec::new();
        block.encode(&mut entry);
        let len = entry.len() as u32;
        let checksum = owner.checksum(self.id(), &entry);
        let mut expected = frame(owner, &Extent { offset: start, stored_len: len, raw_len: len, checksum });
        expected.append(&mut entry);
        if read(self.storage(), owner, start, expected.len() as u64)? != expected {
            return Err(owner.corrupt(start, "differs from the directory"));
        }
        self.check_padding(start + block.header_len() + block.stored_len())
    }

    /// Whether zeros reach from `from` to the next aligned place; that place.
    fn check_padding(&self, from: u64) -> Result<u64> {
        let to = align(from);
        let mut padding = [0; ALIGN as usize];
        let padding = &mut padding[..(to - from) as usize];
        self.storage().read_at(from, padding)?;
        if padding.iter().any(|&byte| byte != 0) {
            return Err(Error::Corrupt { offset: from, place: "padding".into(), what: "not zero".into() });
        }
        Ok(to)
    }
}
