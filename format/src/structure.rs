//! Checks the bytes that reading does not need: start, window sections, window's ends, block headers, description and
//! padding.

use crate::directory::BlockEntry;
use crate::header::HEADER;
use crate::leaf::LeafEntry;
use crate::limits::{ALIGN, align};
use crate::reader::Reader;
use crate::section::{FRAME, SectionExtent, SectionId, frame, read, read_checked};
use crate::{Error, Result, Storage};
use std::ops::Range;

/// Windows whose ends are read together.
const TOGETHER: u32 = 128;

impl<S: Storage> Reader<S> {
    /// Checks the start, the window sections, the ends of windows, the description, and the padding outside leaves.
    /// Together with [`Reader::open`], and with [`Reader::check_leaf`] and [`Reader::check_parts`] for all leaves and
    /// blocks, this finds any changed bit of the file. Calls `found` for each problem.
    ///
    /// # Errors
    /// The storage fails.
    pub fn check_structure(&self, found: &mut dyn FnMut(Error)) -> Result<()> {
        let metadata = self.metadata();
        let start = metadata.start().encode()?;
        note(self.check_section(SectionId::Start, HEADER as u64, &start), found)?;
        for window in 0..metadata.windows.len() as u32 {
            if window % TOGETHER == 0 {
                self.fetch_ends(window..window.saturating_add(TOGETHER))?;
            }
            let (begin, end) = (metadata.window_record(window).encode(), metadata.window_end(window).encode());
            let (begin, end) = begin.and_then(|begin| Ok((begin, end?))).map_err(Error::Invalid)?;
            let [Some(first), Some(last)] = [self.leaves(window).first(), self.leaves(window).last()] else { continue };
            let at = first.data_offset - align((FRAME + begin.len()) as u64);
            note(self.check_section(SectionId::Window(window), at, &begin), found)?;
            note(self.check_section(SectionId::WindowEnd(window), align(last.extent().end()), &end), found)?;
        }
        note(check_padding(self.storage(), self.footer().metadata.end()), found)?;
        note(self.description(), found)?;
        note(check_padding(self.storage(), self.footer().root.end()), found)?;
        note(check_padding(self.storage(), self.footer().last().end()), found)
    }

    /// Fetches the bytes just before and after the blocks of some windows.
    fn fetch_ends(&self, windows: Range<u32>) -> Result<()> {
        let ends = |window| {
            let leaves = self.leaves(window);
            let before = leaves.first().map(|first| first.data_offset.saturating_sub(1)..first.data_offset);
            let behind = leaves.last().map(|last| last.extent().end()..last.extent().end().saturating_add(1));
            before.into_iter().chain(behind)
        };
        let ends: Vec<Range<u64>> = windows.flat_map(ends).collect();
        Ok(self.storage().fetch(&ends)?)
    }

    /// Checks the headers of consecutive blocks against their entries, and the padding behind them. The first block
    /// begins at `at`. Calls `found` for each problem; returns where the next block begins.
    ///
    /// # Errors
    /// The storage fails.
    pub fn check_blocks(&self, mut at: u64, blocks: &[BlockEntry], found: &mut dyn FnMut(Error)) -> Result<u64> {
        for block in blocks {
            let mut entry = Vec::new();
            block.encode(&mut entry);
            let section = SectionId::Block(block.id);
            note(self.check_content(section, at, &entry), found)?;
            let end = at + block.header_len() + block.stored_len();
            note(check_padding(self.storage(), end), found)?;
            at = align(end);
        }
        Ok(at)
    }

    /// Checks all that [`Self::check_blocks`] and [`Self::check_leaf_end`] check.
    ///
    /// # Errors
    /// The storage fails.
    pub fn check_leaf(&self, leaf: &LeafEntry, blocks: &[BlockEntry], found: &mut dyn FnMut(Error)) -> Result<()> {
        self.check_blocks(leaf.data_offset, blocks, found)?;
        self.check_leaf_end(leaf, found)
    }

    /// Checks the padding behind a leaf. Calls `found` if it is wrong.
    ///
    /// # Errors
    /// The storage fails.
    pub fn check_leaf_end(&self, leaf: &LeafEntry, found: &mut dyn FnMut(Error)) -> Result<()> {
        note(check_padding(self.storage(), leaf.extent().end()), found)
    }

    /// Checks that a section holds this content and that its padding is zero.
    fn check_section(&self, section: SectionId, offset: u64, content: &[u8]) -> Result<()> {
        let end = self.check_content(section, offset, content)?;
        check_padding(self.storage(), end)
    }

    /// Checks that a section holds this content, uncompressed; returns its end.
    fn check_content(&self, section: SectionId, offset: u64, content: &[u8]) -> Result<u64> {
        let (len, checksum) = (content.len() as u32, section.checksum(self.id(), content));
        let extent = SectionExtent { offset, stored_len: len, raw_len: len, checksum };
        let expected = [&frame(section, &extent), content].concat();
        let range = offset..extent.end();
        read_checked(self.storage(), std::slice::from_ref(&range), || {
            match read(self.storage(), section, offset, expected.len() as u64)? == expected {
                true => Ok(extent.end()),
                false => Err(section.corrupt(offset, "differs from metadata and directory")),
            }
        })
    }
}

/// Checks that the bytes from `from` to the next multiple of [`ALIGN`] are zero.
pub(crate) fn check_padding(storage: &impl Storage, from: u64) -> Result<()> {
    let corrupt = |what: &str| Error::Corrupt { offset: from, place: "padding".into(), what: what.into() };
    if align(from) > storage.len() {
        return Err(corrupt("truncated"));
    }
    let range = from..align(from);
    read_checked(storage, std::slice::from_ref(&range), || {
        let mut padding = [0; ALIGN as usize];
        let padding = &mut padding[..(range.end - from) as usize];
        storage.read_at(from, padding)?;
        if padding.iter().all(|&byte| byte == 0) { Ok(()) } else { Err(corrupt("not zero")) }
    })
}

/// Passes errors of the file to `found`; returns an error only if the storage failed.
fn note<T>(checked: Result<T>, found: &mut dyn FnMut(Error)) -> Result<()> {
    match checked {
        Ok(_) => Ok(()),
        Err(failed) if failed.is_io() => Err(failed),
        Err(wrong) => {
            found(wrong);
            Ok(())
        }
    }
}
