//! Writes a file from front to back, without a seek.

use crate::block::{BlockId, EncodedBlock};
use crate::directory::{BlockEntry, PartEntry};
use crate::footer::{FOOTER, Footer};
use crate::header::{FileId, Header};
use crate::leaf::{LEAF_ENTRY, LeafEntry, check_leaves};
use crate::limits::{ALIGN, BLOCKS_PER_LEAF, MAX_ROOT_RAW, align};
use crate::metadata::Metadata;
use crate::section::{Extent, Owner, compress_directory, frame};
use crate::{Error, Result};
use std::io::Write;

/// What was written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Summary {
    /// Bytes of the whole file.
    pub bytes: u64,
    /// Blocks.
    pub blocks: u64,
    /// Leaves of the directory.
    pub leaves: u64,
    /// Bytes of all parts, without headers, padding and directory.
    pub stored: u64,
}

/// A file being written. After an error it refuses to go on: what was written is incomplete.
#[derive(Debug)]
pub struct Writer<W: Write> {
    out: W,
    id: FileId,
    /// Bytes written.
    at: u64,
    /// Whether the last call succeeded.
    sound: bool,
    last: Option<BlockId>,
    blocks: u64,
    stored: u64,
    /// The leaf being filled and its entries' bytes.
    leaf: Option<LeafEntry>,
    entries: Vec<u8>,
    leaves: Vec<LeafEntry>,
}

impl<W: Write> Writer<W> {
    /// Starts a file: writes its header.
    pub fn new(out: W, id: FileId) -> Result<Self> {
        let (leaf, entries, leaves) = (None, Vec::new(), Vec::new());
        let mut writer = Self { out, id, at: 0, sound: true, last: None, blocks: 0, stored: 0, leaf, entries, leaves };
        writer.write(&Header::new(id).encode())?;
        Ok(writer)
    }

    /// Appends a block. Blocks come ordered by window, channel and block, none left out; [`Error::Invalid`] otherwise
    /// and for statistics that no block can have.
    pub fn append(&mut self, block: &EncodedBlock) -> Result<()> {
        self.begin()?;
        self.check_follows(block.id)?;
        self.make_room(block.id)?;
        self.pad()?;
        let entry = self.place(block)?;
        entry.check().map_err(|what| Error::Invalid(format!("{}: {what}", block.id)))?;
        let mut bytes = Vec::new();
        entry.encode(&mut bytes);
        let leaf = self.leaf.get_or_insert_with(|| LeafEntry::new(block.id, self.at));
        leaf.add(&entry);
        self.entries.extend_from_slice(&bytes);
        self.section(Owner::Block(block.id), &bytes, bytes.len())?;
        block.parts.iter().try_for_each(|part| self.write(&part.stored))?;
        (self.last, self.sound) = (Some(block.id), true);
        self.blocks += 1;
        self.stored += entry.stored_len();
        Ok(())
    }

    /// Ends the file: writes metadata, directory and footer, and flushes. [`Error::Invalid`] if the metadata does not
    /// describe the blocks that were appended.
    pub fn finish(mut self, metadata: &Metadata) -> Result<(W, Summary)> {
        self.begin()?;
        self.flush_leaf()?;
        let record = metadata.encode()?;
        check_leaves(metadata, &self.leaves).map_err(Error::Invalid)?;
        let metadata = self.section(Owner::Metadata, &record, record.len())?;
        let root = self.write_root()?;
        self.pad()?;
        let (total, blocks, leaves) = (self.at + FOOTER as u64, self.blocks, self.leaves.len() as u64);
        self.write(&Footer { id: self.id, total, metadata, root, blocks, leaves }.encode())?;
        self.out.flush()?;
        Ok((self.out, Summary { bytes: total, blocks, leaves, stored: self.stored }))
    }

    /// Refuses after an error; assumes one until the caller says otherwise.
    fn begin(&mut self) -> Result<()> {
        if !std::mem::replace(&mut self.sound, false) {
            return Err(Error::Invalid("the file: an earlier error left it incomplete".into()));
        }
        Ok(())
    }

    /// Whether `id` is the next block or begins the next channel or window; [`check_leaves`] sees to the rest.
    fn check_follows(&self, id: BlockId) -> Result<()> {
        let BlockId { window, block, channel } =
            self.last.unwrap_or(BlockId { window: 0, block: u32::MAX, channel: 0 });
        let next_block = BlockId { window, block: block.wrapping_add(1), channel };
        let next_channel = BlockId { window, block: 0, channel: channel.wrapping_add(1) };
        let next_window = BlockId { window: window.wrapping_add(1), block: 0, channel: 0 };
        let follows =
            id == next_block || self.last.is_some_and(|last| last < id) && (id == next_channel || id == next_window);
        if follows { Ok(()) } else { Err(Error::Invalid(format!("{id} after {:?}", self.last))) }
    }

    /// Ends the current leaf if `id` does not belong to it.
    fn make_room(&mut self, id: BlockId) -> Result<()> {
        let other = |leaf: LeafEntry| (leaf.window, leaf.channel) != (id.window, id.channel);
        let full = |leaf: LeafEntry| u32::from(leaf.count) == BLOCKS_PER_LEAF;
        if self.leaf.is_some_and(|leaf| other(leaf) || full(leaf)) { self.flush_leaf() } else { Ok(()) }
    }

    /// The entry of a block that starts here.
    fn place(&self, block: &EncodedBlock) -> Result<BlockEntry> {
        let mut entry = BlockEntry { id: block.id, stats: block.stats, parts: Vec::with_capacity(block.parts.len()) };
        for part in &block.parts {
            let (kind, stats, raw_len) = (part.kind, part.stats, part.raw_len);
            let stored_len = length(&part.stored)?;
            let checksum = Owner::Part(block.id, kind).checksum(self.id, &part.stored);
            entry.parts.push(PartEntry { kind, stats, offset: 0, stored_len, raw_len, checksum });
        }
        let mut offset = self.at + entry.header_len();
        for part in &mut entry.parts {
            part.offset = offset;
            offset += u64::from(part.stored_len);
        }
        Ok(entry)
    }

    /// Ends the current leaf, if there is one, right after its blocks.
    fn flush_leaf(&mut self) -> Result<()> {
        let Some(mut leaf) = self.leaf.take() else { return Ok(()) };
        let raw = std::mem::take(&mut self.entries);
        let extent = self.section(Owner::Leaf(leaf.first()), &compress_directory(&raw)?, raw.len())?;
        leaf.set_extent(&extent);
        self.leaves.push(leaf);
        Ok(())
    }

    fn write_root(&mut self) -> Result<Extent> {
        let size = (self.leaves.len() * LEAF_ENTRY) as u64;
        if size > MAX_ROOT_RAW {
            return Err(Error::TooLarge { what: "bytes of the directory's root".into(), size, limit: MAX_ROOT_RAW });
        }
        let mut raw = Vec::with_capacity(self.leaves.len() * LEAF_ENTRY);
        self.leaves.iter().for_each(|leaf| leaf.encode(&mut raw));
        self.section(Owner::Root, &compress_directory(&raw)?, raw.len())
    }

    /// Writes a section at the next aligned place.
    fn section(&mut self, owner: Owner, stored: &[u8], raw_len: usize) -> Result<Extent> {
        self.pad()?;
        let checksum = owner.checksum(self.id, stored);
        let raw_len = u32::try_from(raw_len).unwrap_or(u32::MAX);
        let extent = Extent { offset: self.at, stored_len: length(stored)?, raw_len, checksum };
        self.write(&frame(owner, &extent))?;
        self.write(stored)?;
        Ok(extent)
    }

    fn pad(&mut self) -> Result<()> {
        let zeros = [0; ALIGN as usize];
        let missing = align(self.at) - self.at;
        self.write(&zeros[..missing as usize])
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.out.write_all(bytes)?;
        self.at += bytes.len() as u64;
        Ok(())
    }
}

/// A length as it is in a file.
fn length(bytes: &[u8]) -> Result<u32> {
    let (size, limit) = (bytes.len() as u64, u64::from(u32::MAX));
    u32::try_from(size).map_err(|_| Error::TooLarge { what: "stored bytes".into(), size, limit })
}
