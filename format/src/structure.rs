//! The check that every byte of a file is accounted for.

use crate::directory::BlockEntry;
use crate::header::HEADER;
use crate::leaf::LeafEntry;
use crate::limits::{ALIGN, align};
use crate::reader::Reader;
use crate::section::{Extent, FRAME, Owner, frame, read};
use crate::{Error, Result, Storage};

impl<S: Storage> Reader<S> {
    /// Checks what is not inside leaves' stretches: start, beginnings and ends of windows, padding. Together with [`Reader::open`],
    /// and [`Reader::check_leaf`] and [`Reader::check_parts`] of all leaves and blocks, this finds any changed bit of the
    /// file. `found` is called with all that is wrong; an error if the storage fails.
    pub fn check_structure(&self, found: &mut dyn FnMut(Error)) -> Result<()> {
        let metadata = self.metadata();
        let start = metadata.start().encode()?;
        note(self.check_section(Owner::Start, HEADER as u64, &start), found)?;
        for window in 0..metadata.windows.len() as u32 {
            let (begin, end) = (metadata.record(window).encode(), metadata.end(window).encode());
            let (begin, end) = begin.and_then(|begin| Ok((begin, end?))).map_err(Error::Invalid)?;
            let [Some(first), Some(last)] = [self.leaves(window).first(), self.leaves(window).last()] else { continue };
            let at = first.data_offset - align((FRAME + begin.len()) as u64);
            note(self.check_section(Owner::Window(window), at, &begin), found)?;
            note(self.check_section(Owner::WindowEnd(window), align(last.extent().end()), &end), found)?;
        }
        note(check_padding(self.storage(), self.footer().metadata.end()), found)?;
        note(check_padding(self.storage(), self.footer().root.end()), found)
    }

    /// Checks the headers of a leaf's blocks, of these entries, and all padding between them.
    pub fn check_leaf(&self, leaf: &LeafEntry, blocks: &[BlockEntry], found: &mut dyn FnMut(Error)) -> Result<()> {
        let mut at = leaf.data_offset;
        for block in blocks {
            let mut entry = Vec::new();
            block.encode(&mut entry);
            let owner = Owner::Block(block.id);
            note(self.check_content(owner, at, &entry), found)?;
            let end = at + block.header_len() + block.stored_len();
            note(check_padding(self.storage(), end), found)?;
            at = align(end);
        }
        note(check_padding(self.storage(), leaf.extent().end()), found)
    }

    /// Whether a section holds this content, and zeros follow.
    fn check_section(&self, owner: Owner, offset: u64, content: &[u8]) -> Result<()> {
        let end = self.check_content(owner, offset, content)?;
        check_padding(self.storage(), end)
    }

    /// Whether a section holds this content, uncompressed; its end.
    fn check_content(&self, owner: Owner, offset: u64, content: &[u8]) -> Result<u64> {
        let (len, checksum) = (content.len() as u32, owner.checksum(self.id(), content));
        let extent = Extent { offset, stored_len: len, raw_len: len, checksum };
        let expected = [&frame(owner, &extent), content].concat();
        if read(self.storage(), owner, offset, expected.len() as u64)? != expected {
            return Err(owner.corrupt(offset, "differs from metadata and directory"));
        }
        Ok(extent.end())
    }
}

/// Whether zeros reach from `from` to the next aligned place.
pub(crate) fn check_padding(storage: &impl Storage, from: u64) -> Result<()> {
    let corrupt = |what: &str| Error::Corrupt { offset: from, place: "padding".into(), what: what.into() };
    let mut padding = [0; ALIGN as usize];
    let padding = &mut padding[..(align(from) - from) as usize];
    if align(from) > storage.len() {
        return Err(corrupt("cut short"));
    }
    storage.read_at(from, padding)?;
    if padding.iter().all(|&byte| byte == 0) { Ok(()) } else { Err(corrupt("not zero")) }
}

/// Passes on what is wrong with the file; an error if the storage failed.
fn note<T>(checked: Result<T>, found: &mut dyn FnMut(Error)) -> Result<()> {
    match checked {
        Ok(_) => Ok(()),
        Err(failed) if failed.is_of_storage() => Err(failed),
        Err(wrong) => {
            found(wrong);
            Ok(())
        }
    }
}
