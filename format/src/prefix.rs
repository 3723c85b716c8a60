//! Reads the complete windows at the start of a file that is unfinished or is to be appended to.

use crate::block::BlockId;
use crate::bytes::{FieldReader, ensure};
use crate::directory::{BlockEntry, entry_len};
use crate::file_id::FileId;
use crate::header::{Features, HEADER};
use crate::leaf::{LeafEntry, check_window, leaves_of};
use crate::limits::{MAX_METADATA, MAX_PARTS, align};
use crate::metadata::Metadata;
use crate::reader::read_header;
use crate::section::{SectionExtent, SectionId, decompress, section_at};
use crate::structure::check_padding;
use crate::window::{WINDOW_END, WindowEnd, WindowRecord};
use crate::{Result, Storage};

/// The complete windows at the start of a file, after which [`crate::Writer::resume`] continues.
#[derive(Debug, Clone)]
pub struct CompletePrefix {
    pub(crate) id: FileId,
    /// The features that the header announces.
    pub(crate) features: Features,
    /// Metadata of the complete windows; without frames if there are none.
    pub(crate) metadata: Metadata,
    /// The offset at which the last complete window ends.
    pub(crate) end: u64,
    pub(crate) leaves: Vec<LeafEntry>,
    /// Bytes of all their parts.
    pub(crate) stored: u64,
}

/// What reading a window adds to the prefix.
#[derive(Default)]
struct WindowScan {
    features: Features,
    tiers: u8,
    at: u64,
    leaves: Vec<LeafEntry>,
    stored: u64,
}

impl CompletePrefix {
    /// Reads a file from its first byte and checks every checksum, up to the first window that is not complete. Does not
    /// look for metadata, root and footer.
    ///
    /// # Errors
    /// The header or the start is not intact, so that nothing can be continued; or the storage fails.
    pub fn read(storage: &impl Storage) -> Result<Self> {
        let header = read_header(storage)?;
        let (id, features) = (header.id, header.features());
        let (extent, record) = plain_at(storage, id, SectionId::Start, HEADER as u64, MAX_METADATA)?;
        let metadata = Metadata::parse_start(&record).map_err(|what| SectionId::Start.corrupt(HEADER as u64, what))?;
        let mut prefix = Self { id, features, metadata, end: extent.end(), leaves: Vec::new(), stored: 0 };
        loop {
            match prefix.read_window(storage) {
                Ok(()) => {}
                Err(failed) if failed.is_io() => return Err(failed),
                Err(_) => return Ok(prefix),
            }
        }
    }

    /// The file's identity.
    pub fn id(&self) -> FileId {
        self.id
    }

    /// The features of the file, which further windows may use.
    pub fn features(&self) -> Features {
        self.features
    }

    /// The metadata of the complete windows; without frames if there are none.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// The number of bytes to keep. After them come incomplete windows, or metadata and root.
    pub fn bytes(&self) -> u64 {
        self.end
    }

    /// Reads the next window; fails if it is not complete.
    fn read_window(&mut self, storage: &impl Storage) -> Result<()> {
        let number = self.metadata.windows.len() as u32;
        let mut scan = WindowScan { at: self.end, features: self.features, ..WindowScan::default() };
        let at = scan.pad(storage)?;
        let (begin, record) = plain_at(storage, self.id, SectionId::Window(number), at, MAX_METADATA)?;
        scan.at = begin.end();
        let corrupt = |what: String| SectionId::Window(number).corrupt(at, what);
        let record = WindowRecord::parse(&record)
            .and_then(|record| record.window.check_announced(self.features).map(|()| record))
            .map_err(corrupt)?;
        scan.tiers = record.window.tiers();
        for (first, count) in leaves_of(&self.metadata, number, scan.tiers) {
            scan.read_leaf(storage, self.id, first, count)?;
        }
        let (section, at) = (SectionId::WindowEnd(number), scan.pad(storage)?);
        let (extent, end) = plain_at(storage, self.id, section, at, WINDOW_END)?;
        let checked = WindowEnd::parse(&end)
            .and_then(|end| self.metadata.push(record, &end))
            .and_then(|()| check_window(&self.metadata, number, &scan.leaves, self.end))
            .and_then(|end| ensure(end == extent.end(), || "not at the end of its window".into()));
        if let Err(what) = checked {
            self.metadata.truncate(number as usize);
            return Err(section.corrupt(at, what));
        }
        (self.end, self.stored) = (extent.end(), self.stored + scan.stored);
        self.leaves.append(&mut scan.leaves);
        Ok(())
    }
}

impl WindowScan {
    /// The offset of the next section; checks that the padding before it is zero.
    fn pad(&self, storage: &impl Storage) -> Result<u64> {
        check_padding(storage, self.at).map(|()| align(self.at))
    }

    /// Reads the next leaf and its blocks.
    fn read_leaf(&mut self, storage: &impl Storage, id: FileId, first: BlockId, count: u32) -> Result<()> {
        let mut leaf = LeafEntry::new(first, align(self.at));
        let mut entries = Vec::new();
        for block in (first.block..).take(count as usize) {
            let entry = self.read_block(storage, id, BlockId { block, ..first })?;
            leaf.add(&entry);
            entries.push(entry);
        }
        let (section, at) = (SectionId::Leaf(first), self.pad(storage)?);
        let (extent, stored) = section_at(storage, id, section, at, leaf.max_raw_len())?;
        let most = extent.raw_len as usize <= leaf.max_raw_len();
        let same = ensure(most, || "too long".into())
            .and_then(|()| decompress(&stored, extent.raw_len))
            .and_then(|raw| leaf.parse(&raw))
            .and_then(|stated| {
                ensure(stated.iter().map(BlockEntry::encoded).eq(entries.iter().map(BlockEntry::encoded)), || {
                    "differs from its blocks".into()
                })
            });
        same.map_err(|what| section.corrupt(at, what))?;
        leaf.set_extent(&extent);
        self.leaves.push(leaf);
        self.at = extent.end();
        Ok(())
    }

    /// Reads a block's entry from its own header at `offset`. Returns the entry and the end of its parts, which are not read.
    fn block_at(&self, storage: &impl Storage, file: FileId, id: BlockId, offset: u64) -> Result<(BlockEntry, u64)> {
        let section = SectionId::Block(id);
        let (_, bytes) = plain_at(storage, file, section, offset, entry_len(MAX_PARTS))?;
        let mut fields = FieldReader::new(&bytes);
        let entry = BlockEntry::decode(&mut fields).and_then(|entry| {
            fields.end()?;
            ensure(entry.id == id, || format!("says that it is {}", entry.id))?;
            entry.check(self.tiers, self.features)?;
            entry.check_place(offset)?;
            Ok(entry)
        });
        let entry = entry.map_err(|what| section.corrupt(offset, what))?;
        let end = offset + entry.header_len() + entry.stored_len();
        Ok((entry, end))
    }

    /// Reads the next block.
    fn read_block(&mut self, storage: &impl Storage, id: FileId, block: BlockId) -> Result<BlockEntry> {
        let (entry, end) = self.block_at(storage, id, block, self.pad(storage)?)?;
        for part in &entry.parts {
            part.read(storage, id, block)?;
            self.stored += u64::from(part.stored_len);
        }
        self.at = end;
        Ok(entry)
    }
}

/// Like [`section_at`], for a section that is not compressed.
fn plain_at(
    storage: &impl Storage,
    file: FileId,
    section: SectionId,
    offset: u64,
    most: usize,
) -> Result<(SectionExtent, Vec<u8>)> {
    let (extent, content) = section_at(storage, file, section, offset, most)?;
    let same = ensure(extent.raw_len == extent.stored_len, || format!("{} bytes in its frame", extent.raw_len));
    same.map_err(|what| section.corrupt(offset, what)).map(|()| (extent, content))
}
