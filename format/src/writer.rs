//! Writes a file from front to back, without seeking.

use crate::block::{BlockId, EncodedBlock};
use crate::bytes::ensure;
use crate::description::Description;
use crate::directory::{BlockEntry, PartEntry};
use crate::file_id::FileId;
use crate::footer::{FOOTER, Footer};
use crate::header::{Features, Header};
use crate::leaf::{LEAF_ENTRY, LeafEntry, check_window};
use crate::limits::{ALIGN, BLOCKS_PER_LEAF, MAX_METADATA, MAX_ROOT_RAW, align};
use crate::metadata::Metadata;
use crate::prefix::CompletePrefix;
use crate::section::{SectionExtent, SectionId, compress_directory, frame};
use crate::window::{WindowEnd, WindowRecord};
use crate::{Error, Result};
use std::io::Write;

/// The sizes of a written file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Summary {
    /// Bytes of the whole file.
    pub bytes: u64,
    /// Number of blocks.
    pub blocks: u64,
    /// Number of leaves in the directory.
    pub leaves: u64,
    /// Bytes of all parts, without headers, padding and directory.
    pub stored: u64,
}

/// Writes a file. After an error every call fails, because the file is incomplete.
#[derive(Debug)]
pub struct Writer<W: Write> {
    out: W,
    id: FileId,
    features: Features,
    /// Bytes written so far.
    position: u64,
    /// Whether the last call succeeded.
    intact: bool,
    /// Metadata of the ended windows.
    metadata: Metadata,
    /// Upper bound on the bytes of the metadata record, with the window being written; `None` until first counted.
    record: Option<usize>,
    /// Offset at which the last ended window ends.
    ended: u64,
    /// The window being written, and its last block.
    window: Option<WindowRecord>,
    last: Option<BlockId>,
    stored: u64,
    /// The leaf being filled and its entries' bytes.
    leaf: Option<LeafEntry>,
    entries: Vec<u8>,
    leaves: Vec<LeafEntry>,
    /// The number of leaves of the ended windows.
    ended_leaves: usize,
}

impl<W: Write> Writer<W> {
    /// Starts a file without a description with the features of the windows in `metadata`.
    ///
    /// # Errors
    /// As [`Self::with_features`].
    pub fn new(out: W, id: FileId, metadata: &Metadata) -> Result<Self> {
        Self::with_features(out, id, metadata, metadata.features())
    }

    /// Starts a file: writes its header and its start, which is the metadata that does not depend on frames.
    ///
    /// # Errors
    /// [`Error::Invalid`] or [`Error::TooLarge`] if the metadata cannot be encoded, [`Error::Io`] if writing fails.
    pub fn with_features(out: W, id: FileId, metadata: &Metadata, features: Features) -> Result<Self> {
        let (start, leaves) = (metadata.start(), Vec::new());
        let record = start.encode()?;
        let nothing = CompletePrefix { id, features, metadata: start, end: 0, leaves, stored: 0 };
        let mut writer = Self::continue_from(out, nothing);
        writer.write(&Header::new(id, features).encode())?;
        writer.write_section(SectionId::Start, &record, record.len())?;
        writer.ended = writer.position;
        Ok(writer)
    }

    /// Continues a file after its complete windows. `out` must be positioned at their end.
    pub fn resume(out: W, prefix: CompletePrefix) -> Self {
        Self::continue_from(out, prefix)
    }

    fn continue_from(out: W, begun: CompletePrefix) -> Self {
        let CompletePrefix { id, features, metadata, end, leaves, stored } = begun;
        let (intact, window, last, leaf, entries) = (true, None, None, None, Vec::new());
        Self {
            out,
            id,
            features,
            position: end,
            intact,
            metadata,
            record: None,
            ended: end,
            window,
            last,
            stored,
            leaf,
            entries,
            ended_leaves: leaves.len(),
            leaves,
        }
    }

    /// The output.
    pub fn out(&mut self) -> &mut W {
        &mut self.out
    }

    /// The metadata of the ended windows.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// Begins the next window. Its section and the start are enough to decode its blocks, even if the rest of the file is
    /// never written.
    ///
    /// # Errors
    /// [`Error::Invalid`] if this cannot be the next window, [`Error::TooLarge`] if the metadata would exceed its limit,
    /// [`Error::Io`] if writing fails.
    pub fn begin_window(&mut self, record: WindowRecord) -> Result<()> {
        self.begin_call()?;
        let bytes = record.encode().map_err(Error::Invalid)?;
        let next = WindowRecord::parse(&bytes).and_then(|record| {
            let next = self.window.is_none() && record.number as usize == self.metadata.windows.len();
            ensure(next, || format!("window {} out of order", record.number))?;
            record.window.check_announced(self.features)
        });
        next.map_err(Error::Invalid)?;
        self.count_record(bytes.len())?;
        self.write_section(SectionId::Window(record.number), &bytes, bytes.len())?;
        (self.window, self.intact) = (Some(record), true);
        Ok(())
    }

    /// Fails with [`Error::TooLarge`] if the metadata cannot hold another window. Checking here reports this before the
    /// window is written and not at the end.
    fn count_record(&mut self, more: usize) -> Result<()> {
        let so_far = self.record.map_or_else(|| self.metadata.encode().map(|record| record.len()), Ok)?;
        let (size, limit) = ((so_far + more) as u64, MAX_METADATA as u64);
        if size > limit {
            let what = "bytes of metadata for so many windows or times (longer windows take less)".into();
            return Err(Error::TooLarge { what, size, limit });
        }
        self.record = Some(so_far + more);
        Ok(())
    }

    /// Appends a block to the current window. Blocks must come in the order of channel and block, without omissions.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the block is out of order or its statistics are impossible, [`Error::Io`] if writing fails.
    pub fn append(&mut self, block: &EncodedBlock) -> Result<()> {
        self.write_block(block, false)
    }

    /// Appends a lost block in place of one whose data are missing.
    ///
    /// # Errors
    /// As [`Self::append`].
    pub fn append_lost(&mut self, id: BlockId) -> Result<()> {
        let stats = BlockEntry::lost(id).stats;
        self.write_block(&EncodedBlock { id, stats, parts: Vec::new() }, true)
    }

    fn write_block(&mut self, block: &EncodedBlock, lost: bool) -> Result<()> {
        self.begin_call()?;
        self.check_follows(block.id)?;
        self.start_leaf_for(block.id)?;
        self.pad()?;
        let entry = self.entry_here(block, lost)?;
        let tiers = self.window.as_ref().map_or(0, |record| record.window.tiers());
        entry.check(tiers, self.features).map_err(|what| Error::Invalid(format!("{}: {what}", block.id)))?;
        let mut bytes = Vec::new();
        entry.encode(&mut bytes);
        let leaf = self.leaf.get_or_insert_with(|| LeafEntry::new(block.id, self.position));
        leaf.add(&entry);
        self.entries.extend_from_slice(&bytes);
        self.write_section(SectionId::Block(block.id), &bytes, bytes.len())?;
        block.parts.iter().try_for_each(|part| self.write(&part.stored))?;
        (self.last, self.intact) = (Some(block.id), true);
        self.stored += entry.stored_len();
        Ok(())
    }

    /// Ends the current window after its last block: writes its last leaf and its totals.
    ///
    /// # Errors
    /// [`Error::Invalid`] if blocks are missing or the totals do not match them, [`Error::Io`] if writing fails.
    pub fn end_window(&mut self, end: &WindowEnd) -> Result<()> {
        self.begin_call()?;
        self.flush_leaf()?;
        let number = self.metadata.windows.len() as u32;
        let bytes = end.encode().map_err(Error::Invalid)?;
        let record = self.window.take().ok_or_else(|| Error::Invalid(format!("window {number} was not begun")))?;
        self.metadata.push(record, end).map_err(Error::Invalid)?;
        let leaves = &self.leaves[self.ended_leaves..];
        let whole = leaves.len() as u64 == self.metadata.leaves_of_window(number);
        let checked = ensure(whole, || format!("window {number}: blocks are missing"))
            .and_then(|()| check_window(&self.metadata, number, leaves, self.ended));
        checked.map_err(Error::Invalid)?;
        self.write_section(SectionId::WindowEnd(number), &bytes, bytes.len())?;
        (self.ended, self.last, self.intact) = (self.position, None, true);
        self.ended_leaves = self.leaves.len();
        Ok(())
    }

    /// As [`Self::finish_described`], without a description.
    ///
    /// # Errors
    /// As [`Self::finish_described`].
    pub fn finish(self) -> Result<(W, Summary)> {
        self.finish_described(None)
    }

    /// Finishes the file: writes metadata, root, description and footer, and flushes the output.
    ///
    /// # Errors
    /// [`Error::Invalid`] if there is no window or the last one was not ended, or if there is a description and the header
    /// says otherwise; [`Error::TooLarge`] if the root exceeds its limit, [`Error::Io`] if writing fails.
    pub fn finish_described(mut self, description: Option<&Description>) -> Result<(W, Summary)> {
        self.begin_call()?;
        let announced = self.features.described == description.is_some();
        ensure(announced, || "the header and the file's end disagree about a description".into())
            .map_err(Error::Invalid)?;
        let record = self.metadata.encode()?;
        let ended = self.window.is_none() && self.metadata.frames > 0;
        ensure(ended, || "the file has no windows, or its last window was not ended".into()).map_err(Error::Invalid)?;
        let metadata = self.write_section(SectionId::Metadata, &record, record.len())?;
        let root = self.write_root()?;
        let description = description.map(|description| self.write_description(description)).transpose()?;
        self.pad()?;
        let (total, blocks) = (self.position + FOOTER as u64, self.metadata.blocks());
        let leaves = self.leaves.len() as u64;
        self.write(&Footer { id: self.id, total, metadata, root, blocks, leaves, description }.encode())?;
        self.out.flush()?;
        Ok((self.out, Summary { bytes: total, blocks, leaves, stored: self.stored }))
    }

    /// Fails if an earlier call failed. Marks the file as incomplete until the caller sets `intact` again.
    fn begin_call(&mut self) -> Result<()> {
        if !std::mem::replace(&mut self.intact, false) {
            return Err(Error::Invalid("an earlier error left the file incomplete".into()));
        }
        Ok(())
    }

    /// Checks that `id` is the next block or starts the next channel. [`Self::end_window`] checks that none is missing.
    fn check_follows(&self, id: BlockId) -> Result<()> {
        let window = self.metadata.windows.len() as u32;
        let follows = match self.last {
            None => {
                let tiers = self.window.as_ref().map(|record| record.window.tiers());
                tiers.is_some_and(|tier| id == BlockId { tier, ..BlockId::new(window, 0, 0) })
            }
            Some(last) => {
                let next_block = BlockId { block: last.block.wrapping_add(1), ..last };
                let next_channel = BlockId { block: 0, channel: last.channel.wrapping_add(1), ..last };
                let next_tier = BlockId { block: 0, channel: 0, tier: last.tier.wrapping_sub(1), ..last };
                last < id && (id == next_block || id == next_channel || id == next_tier)
            }
        };
        if follows { Ok(()) } else { Err(Error::Invalid(format!("{id} after {:?}", self.last))) }
    }

    /// Ends the current leaf if `id` does not belong to it.
    fn start_leaf_for(&mut self, id: BlockId) -> Result<()> {
        let other = |leaf: LeafEntry| leaf.channel != id.channel || leaf.tier != id.tier;
        let full = |leaf: LeafEntry| u32::from(leaf.count) == BLOCKS_PER_LEAF;
        if self.leaf.is_some_and(|leaf| other(leaf) || full(leaf)) { self.flush_leaf() } else { Ok(()) }
    }

    /// The entry of a block that starts at the current position.
    fn entry_here(&self, block: &EncodedBlock, lost: bool) -> Result<BlockEntry> {
        let (id, stats, parts) = (block.id, block.stats, Vec::with_capacity(block.parts.len()));
        let mut entry = BlockEntry { id, stats, parts, lost };
        for part in &block.parts {
            let (kind, stats, raw_len) = (part.kind, part.stats, part.raw_len);
            let stored_len = stored_length(&part.stored)?;
            let checksum = SectionId::Part(block.id, kind).checksum(self.id, &part.stored);
            entry.parts.push(PartEntry { kind, stats, offset: 0, stored_len, raw_len, checksum });
        }
        let mut offset = self.position + entry.header_len();
        for part in &mut entry.parts {
            part.offset = offset;
            offset += u64::from(part.stored_len);
        }
        Ok(entry)
    }

    /// Writes the current leaf, if there is one, directly after its blocks.
    fn flush_leaf(&mut self) -> Result<()> {
        let Some(mut leaf) = self.leaf.take() else { return Ok(()) };
        let raw = std::mem::take(&mut self.entries);
        let extent = self.write_section(SectionId::Leaf(leaf.first()), &compress_directory(&raw)?, raw.len())?;
        leaf.set_extent(&extent);
        self.leaves.push(leaf);
        Ok(())
    }

    fn write_root(&mut self) -> Result<SectionExtent> {
        let size = (self.leaves.len() * LEAF_ENTRY) as u64;
        if size > MAX_ROOT_RAW {
            return Err(Error::TooLarge { what: "bytes of the directory's root".into(), size, limit: MAX_ROOT_RAW });
        }
        let mut raw = Vec::with_capacity(self.leaves.len() * LEAF_ENTRY);
        self.leaves.iter().for_each(|leaf| leaf.encode(&mut raw));
        self.write_section(SectionId::Root, &compress_directory(&raw)?, raw.len())
    }

    fn write_description(&mut self, description: &Description) -> Result<SectionExtent> {
        let raw = description.encode(&self.metadata)?;
        self.write_section(SectionId::Description, &compress_directory(&raw)?, raw.len())
    }

    /// Writes a section at the next multiple of [`ALIGN`].
    fn write_section(&mut self, section: SectionId, stored: &[u8], raw_len: usize) -> Result<SectionExtent> {
        self.pad()?;
        let checksum = section.checksum(self.id, stored);
        let raw_len = u32::try_from(raw_len).unwrap_or(u32::MAX);
        let extent = SectionExtent { offset: self.position, stored_len: stored_length(stored)?, raw_len, checksum };
        self.write(&frame(section, &extent))?;
        self.write(stored)?;
        Ok(extent)
    }

    fn pad(&mut self) -> Result<()> {
        let zeros = [0; ALIGN as usize];
        let missing = align(self.position) - self.position;
        self.write(&zeros[..missing as usize])
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        self.out.write_all(bytes)?;
        self.position += bytes.len() as u64;
        Ok(())
    }
}

/// The length of stored bytes as a field of a file.
fn stored_length(bytes: &[u8]) -> Result<u32> {
    let (size, limit) = (bytes.len() as u64, u64::from(u32::MAX));
    u32::try_from(size).map_err(|_| Error::TooLarge { what: "stored bytes".into(), size, limit })
}
