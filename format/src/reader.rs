//! Reads a file: opens it, finds blocks, reads and decompresses parts. Everything is checked before it is used: length,
//! bounds, checksum, fields, decompression into the declared and limited size, exact length, valid values.

use crate::block::{BlockId, EncodedBlock, EncodedPart, PartKind};
use crate::bytes::{FieldReader, ParseResult, ensure};
use crate::codes::sparse::{CodeBox, SparseCodes};
use crate::description::Description;
use crate::directory::{BlockEntry, PartEntry};
use crate::file_id::FileId;
use crate::footer::{FOOTER, Footer};
use crate::geometry::BlockGeometry;
use crate::header::{Features, HEADER, Header, check_magic};
use crate::leaf::{LEAF_ENTRY, LeafEntry, MIN_BLOCK, check_leaves};
use crate::limits::{BLOCKS_PER_LEAF, MAX_DESCRIPTION, MAX_METADATA, MAX_ROOT_RAW, align};
use crate::listed::unpack_listed;
use crate::metadata::Metadata;
use crate::payload::{Outliers, unpack_codes, unpack_exact, unpack_missing, unpack_outliers};
use crate::section::{FRAME, SectionId, decompress, read_checked, read_section};
use crate::sides::{SideCodes, unpack_sides};
use crate::sums::{SumCodes, unpack_sums};
use crate::{Error, Result, Storage};

/// An open file. Every method takes `&self`; threads can share it if the storage is `Sync`.
#[derive(Debug)]
pub struct Reader<S: Storage> {
    storage: S,
    index: Index,
}

/// The parts that are read when a file is opened.
#[derive(Debug)]
struct Index {
    features: Features,
    footer: Footer,
    metadata: Metadata,
    leaves: Vec<LeafEntry>,
    /// The number of the first leaf of each window, and of all leaves.
    starts: Vec<usize>,
}

impl<S: Storage> Reader<S> {
    /// Opens a file. Reads and checks header, footer, metadata and the directory's root, but no leaf and no block.
    ///
    /// # Errors
    /// [`Error::Foreign`], [`Error::Unsupported`] or [`Error::Corrupt`] if the file is not valid, [`Error::Io`] if the
    /// storage fails.
    pub fn open(storage: S) -> Result<Self> {
        let (header, footer) = read_ends(&storage)?;
        storage.fetch(std::slice::from_ref(&(footer.metadata.offset..footer.total)))?;
        let metadata = read_metadata(&storage, &footer)?;
        let features = header.features();
        let announced = metadata.windows.iter().try_for_each(|window| window.check_announced(features));
        announced.map_err(|what| SectionId::Metadata.corrupt(footer.metadata.offset, what))?;
        check_announced(&header, &footer)?;
        let leaves = read_root(&storage, &footer, &metadata)?;
        let mut starts = vec![0];
        for window in 0..metadata.windows.len() as u32 {
            starts.push(starts[window as usize] + metadata.leaves_of_window(window) as usize);
        }
        Ok(Self { storage, index: Index { features, footer, metadata, leaves, starts } })
    }

    pub(crate) fn footer(&self) -> &Footer {
        &self.index.footer
    }

    /// The archive's metadata.
    pub fn metadata(&self) -> &Metadata {
        &self.index.metadata
    }

    /// The features that the header announces.
    pub fn features(&self) -> Features {
        self.index.features
    }

    /// The file's identity.
    pub fn id(&self) -> FileId {
        self.index.footer.id
    }

    /// Reads the source's description; `None` if the file has none.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if the description is damaged, [`Error::Io`] if the storage fails.
    pub fn description(&self) -> Result<Option<Description>> {
        let (section, Some(extent)) = (SectionId::Description, self.index.footer.description) else { return Ok(None) };
        let corrupt = |what: String| section.corrupt(extent.offset, what);
        if extent.raw_len as usize > MAX_DESCRIPTION {
            return Err(corrupt(format!("{} bytes, at most {MAX_DESCRIPTION}", extent.raw_len)));
        }
        let stored = read_section(&self.storage, self.id(), section, &extent)?;
        let raw = decompress(&stored, extent.raw_len).map_err(corrupt)?;
        Description::parse(&raw, self.metadata()).map(Some).map_err(corrupt)
    }

    /// The storage that holds the file's bytes.
    pub fn storage(&self) -> &S {
        &self.storage
    }

    /// The leaves of a window, ordered by tier, channel and block; empty if the archive has no such window.
    pub fn leaves(&self, window: u32) -> &[LeafEntry] {
        match self.index.starts.get(window as usize..).unwrap_or_default() {
            [start, end, ..] => &self.index.leaves[*start..*end],
            _ => &[],
        }
    }

    /// The leaves of a window's tier and channel, ordered by block; empty if the archive has none.
    pub fn leaves_of(&self, window: u32, tier: u8, channel: u16) -> &[LeafEntry] {
        let leaves = self.leaves(window);
        let start = leaves.partition_point(|leaf| leaf.first() < BlockId { window, block: 0, channel, tier });
        let end = leaves.partition_point(|leaf| leaf.first() <= BlockId { window, block: u32::MAX, channel, tier });
        &leaves[start..end]
    }

    /// Reads the entries of a leaf's blocks, in order.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if the leaf is damaged, [`Error::Io`] if the storage fails.
    pub fn leaf(&self, leaf: &LeafEntry) -> Result<Vec<BlockEntry>> {
        let section = SectionId::Leaf(leaf.first());
        if leaf.raw_len as usize > leaf.max_raw_len() {
            return Err(section.corrupt(leaf.offset, format!("{} bytes, at most {}", leaf.raw_len, leaf.max_raw_len())));
        }
        let stored = read_section(&self.storage, self.id(), section, &leaf.extent())?;
        let entries = decompress(&stored, leaf.raw_len).and_then(|raw| self.parse_leaf(leaf, &raw));
        entries.map_err(|what| section.corrupt(leaf.offset, what))
    }

    fn parse_leaf(&self, leaf: &LeafEntry, raw: &[u8]) -> ParseResult<Vec<BlockEntry>> {
        let entries = leaf.parse(raw)?;
        let (mut sums, mut at) = (LeafEntry::new(leaf.first(), leaf.data_offset), leaf.data_offset);
        for entry in &entries {
            at = self
                .check_entry(entry)
                .and_then(|()| entry.check_place(at))
                .map_err(|what| format!("{}: {what}", entry.id))?;
            sums.add(entry);
        }
        ensure(at == leaf.offset, || format!("blocks end at byte {at}"))?;
        sums.set_extent(&leaf.extent());
        ensure(sums.encoded() == leaf.encoded(), || "its sums differ from the directory's root".into())?;
        Ok(entries)
    }

    fn check_entry(&self, entry: &BlockEntry) -> ParseResult {
        let geometry = self.index.metadata.geometry(entry.id).ok_or("no such block")?;
        entry.check(geometry.window.tiers(), self.index.features)?;
        entry.parts.iter().try_for_each(|part| geometry.check(part))
    }

    /// Reads a block's entry; this reads one leaf.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the archive has no such block; otherwise as [`Self::leaf`].
    pub fn entry(&self, id: BlockId) -> Result<BlockEntry> {
        self.geometry(id)?;
        let leaves = self.leaves_of(id.window, id.tier, id.channel);
        let found = leaves.get((id.block / BLOCKS_PER_LEAF) as usize).map(|leaf| self.leaf(leaf)).transpose()?;
        let entry = found.and_then(|entries| entries.into_iter().nth((id.block % BLOCKS_PER_LEAF) as usize));
        entry.ok_or_else(|| no_block(id))
    }

    /// The sizes of a block.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the archive has no such block.
    pub fn geometry(&self, id: BlockId) -> Result<BlockGeometry<'_>> {
        self.index.metadata.geometry(id).ok_or_else(|| no_block(id))
    }

    /// Reads the payload of a part, checks its checksum and decompresses it to exactly the length that the entry declares
    /// and the geometry allows.
    ///
    /// # Errors
    /// [`Error::Corrupt`] if a check fails, [`Error::Invalid`] if the archive has no such block, [`Error::Io`] if the
    /// storage fails.
    pub fn part(&self, block: &BlockEntry, part: &PartEntry) -> Result<Vec<u8>> {
        let section = SectionId::Part(block.id, part.kind);
        self.geometry(block.id)?.check(part).map_err(|what| section.corrupt(part.offset, what))?;
        let stored = part.read(&self.storage, self.id(), block.id)?;
        decompress(&stored, part.raw_len).map_err(|what| section.corrupt(part.offset, what))
    }

    /// Reads a block as it is stored, to be written into another file. Checks its checksums, but decodes nothing.
    ///
    /// # Errors
    /// [`Error::Lost`] if the block is lost; otherwise as [`Self::part`].
    pub fn stored(&self, block: &BlockEntry) -> Result<EncodedBlock> {
        self.check_present(block)?;
        let geometry = self.geometry(block.id)?;
        let part = |part: &PartEntry| {
            let PartEntry { kind, stats, raw_len, offset, .. } = *part;
            geometry.check(part).map_err(|what| SectionId::Part(block.id, kind).corrupt(offset, what))?;
            Ok(EncodedPart { kind, stats, raw_len, stored: part.read(&self.storage, self.id(), block.id)? })
        };
        let parts = block.parts.iter().map(part).collect::<Result<_>>()?;
        Ok(EncodedBlock { id: block.id, stats: block.stats, parts })
    }

    /// Fails with [`Error::Lost`] if the block is lost.
    fn check_present(&self, block: &BlockEntry) -> Result<()> {
        if block.lost { Err(Error::Lost(block.id)) } else { Ok(()) }
    }

    /// Fills `codes` with the codes of a level: `codes[k * voxels + voxel]`, or pass after pass with a pyramid. They are all
    /// zero if the block lacks the part.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the window has no such level or `codes` has the wrong length, [`Error::Lost`] if the block is
    /// lost; otherwise as [`Self::part`].
    pub fn codes(&self, block: &BlockEntry, level: u8, codes: &mut [i32]) -> Result<()> {
        let geometry = self.geometry(block.id)?;
        if geometry.codes(level) != Some(codes.len()) {
            return Err(Error::Invalid(format!("{}: no level {level} of {} codes", block.id, codes.len())));
        }
        self.check_present(block)?;
        let Some(part) = block.part(PartKind::Level(level)) else {
            codes.fill(0);
            return Ok(());
        };
        let raw = self.part(block, part)?;
        let found = unpack_level(&geometry, level, &raw, codes);
        unpacked(block, part, found, |&count| count).map(|_| ())
    }

    /// Appends the codes of a level of a pyramid that are not zero, with their places in `boxes`: the nodes that each pass of
    /// the level adds. Codes that are [not needed](CodeBox::needed) may be left out.
    ///
    /// # Errors
    /// [`Error::Invalid`] if the window has no such level or the boxes have other extents, [`Error::Lost`] if the block is
    /// lost; otherwise as [`Self::part`].
    pub fn sparse_codes(
        &self,
        block: &BlockEntry,
        level: u8,
        boxes: &[CodeBox],
        codes: &mut SparseCodes,
    ) -> Result<()> {
        let geometry = self.geometry(block.id)?;
        if !boxes.iter().map(|of| of.extents).eq(geometry.boxes(level).iter().map(|of| of.extents)) {
            return Err(Error::Invalid(format!("{}: other passes in level {level}", block.id)));
        }
        self.check_present(block)?;
        let Some(part) = block.part(PartKind::Level(level)) else {
            codes.skip(boxes);
            return Ok(());
        };
        let raw = self.part(block, part)?;
        let found = geometry.window.packing().unpack(&raw, boxes, codes);
        unpacked(block, part, found, |&count| count).map(|_| ())
    }

    /// Reads the outliers of a block; empty if it has none.
    ///
    /// # Errors
    /// [`Error::Lost`] if the block is lost; otherwise as [`Self::part`].
    pub fn outliers(&self, block: &BlockEntry) -> Result<Outliers> {
        self.check_present(block)?;
        let Some(part) = block.part(PartKind::Outliers) else { return Ok(Outliers::default()) };
        let (raw, geometry) = (self.part(block, part)?, self.geometry(block.id)?);
        let outliers = unpack_outliers(&raw, geometry.sample_size, geometry.samples());
        unpacked(block, part, outliers, |outliers| outliers.positions.len())
    }

    /// Reads the mask of a block's missing samples (`frame * voxels + voxel`) and their bytes; `None` if it has none.
    ///
    /// # Errors
    /// [`Error::Lost`] if the block is lost; otherwise as [`Self::part`].
    pub fn missing(&self, block: &BlockEntry) -> Result<Option<(Vec<bool>, Vec<u8>)>> {
        self.check_present(block)?;
        let Some(part) = block.part(PartKind::Missing) else { return Ok(None) };
        let (raw, geometry) = (self.part(block, part)?, self.geometry(block.id)?);
        let missing = unpack_missing(&raw, geometry.sample_size, geometry.samples());
        unpacked(block, part, missing, |(_, bytes)| bytes.len() / geometry.sample_size).map(Some)
    }

    /// Reads the little-endian bytes of all samples of an exact block (`frame * voxels + voxel`); `None` for other blocks.
    ///
    /// # Errors
    /// [`Error::Lost`] if the block is lost; otherwise as [`Self::part`].
    pub fn exact(&self, block: &BlockEntry) -> Result<Option<Vec<u8>>> {
        self.check_present(block)?;
        let Some(part) = block.parts.iter().find(|part| part.kind.is_exact()) else { return Ok(None) };
        let (raw, geometry) = (self.part(block, part)?, self.geometry(block.id)?);
        let samples = match part.kind {
            PartKind::Listed => unpack_listed(&raw, geometry.sample_size, geometry.extents()),
            _ => unpack_exact(&raw, geometry.sample_size, geometry.samples()),
        };
        unpacked(block, part, samples, |bytes| bytes.len() / geometry.sample_size).map(Some)
    }

    /// Reads how samples of a block get to their sides of the values that the file [keeps](crate::Keep); `None` if all are there.
    ///
    /// # Errors
    /// [`Error::Lost`] if the block is lost; otherwise as [`Self::part`].
    pub fn sides(&self, block: &BlockEntry) -> Result<Option<Vec<SideCodes>>> {
        self.check_present(block)?;
        let Some(part) = block.part(PartKind::Sides) else { return Ok(None) };
        let (raw, geometry) = (self.part(block, part)?, self.geometry(block.id)?);
        let sides = unpack_sides(&raw, geometry.samples());
        unpacked(block, part, sides, |_| part.stats.count as usize).map(Some)
    }

    /// Reads what keeps the sums of a block's frames; `None` if decoded samples have them.
    ///
    /// # Errors
    /// [`Error::Lost`] if the block is lost; otherwise as [`Self::part`].
    pub fn sums(&self, block: &BlockEntry) -> Result<Option<SumCodes>> {
        self.check_present(block)?;
        let Some(part) = block.part(PartKind::Sums) else { return Ok(None) };
        let (raw, geometry) = (self.part(block, part)?, self.geometry(block.id)?);
        let sums = unpack_sums(&raw, geometry.window.frames as usize, geometry.samples());
        unpacked(block, part, sums, |sums| sums.count() as usize).map(Some)
    }

    /// Checks the checksum of every part of a block.
    ///
    /// # Errors
    /// [`Error::Lost`] if the block is lost, [`Error::Corrupt`] if a checksum is wrong, [`Error::Io`] if the storage fails.
    pub fn check_stored(&self, block: &BlockEntry) -> Result<()> {
        self.check_present(block)?;
        block.parts.iter().try_for_each(|part| part.read(&self.storage, self.id(), block.id).map(drop))
    }

    /// Reads and unpacks every part of a block to check it.
    ///
    /// # Errors
    /// [`Error::Lost`] if the block is lost; otherwise as [`Self::part`].
    pub fn check_parts(&self, block: &BlockEntry) -> Result<()> {
        self.check_present(block)?;
        let geometry = self.geometry(block.id)?;
        block.parts.iter().try_for_each(|part| {
            let checked = check_payload(&geometry, part, &self.part(block, part)?);
            checked.map_err(|what| SectionId::Part(block.id, part.kind).corrupt(part.offset, what))
        })
    }
}

/// Unpacks the payload of a part; returns the number of its items.
fn unpack(geometry: &BlockGeometry<'_>, part: &PartEntry, raw: &[u8]) -> ParseResult<usize> {
    let (size, samples) = (geometry.sample_size, geometry.samples());
    match part.kind {
        PartKind::Level(level) => {
            let mut codes = vec![0; geometry.codes(level).unwrap_or(0)];
            unpack_level(geometry, level, raw, &mut codes)
        }
        PartKind::Outliers => unpack_outliers(raw, size, samples).map(|outliers| outliers.positions.len()),
        PartKind::Missing => unpack_missing(raw, size, samples).map(|(_, bytes)| bytes.len() / size),
        PartKind::Exact => unpack_exact(raw, size, samples).map(|bytes| bytes.len() / size),
        PartKind::Listed => unpack_listed(raw, size, geometry.extents()).map(|bytes| bytes.len() / size),
        PartKind::Sides => unpack_sides(raw, samples).map(|_| part.stats.count as usize), // only decoding shows it
        PartKind::Sums => unpack_sums(raw, geometry.window.frames as usize, samples).map(|sums| sums.count() as usize),
    }
}

fn unpack_level(geometry: &BlockGeometry<'_>, level: u8, raw: &[u8], codes: &mut [i32]) -> ParseResult<usize> {
    match &geometry.window.pyramid {
        Some(pyramid) => pyramid.packing.unpack_all(raw, &geometry.boxes(level), codes),
        None => unpack_codes(raw, codes),
    }
}

/// Checks that the payload of a part can be unpacked and holds as many items as the entry says.
pub(crate) fn check_payload(geometry: &BlockGeometry<'_>, part: &PartEntry, raw: &[u8]) -> ParseResult {
    unpack(geometry, part, raw).and_then(|held| check_count(held, part))
}

fn check_count(held: usize, part: &PartEntry) -> ParseResult {
    let (held, said) = (held as u64, part.stats.count);
    ensure(held == said, || format!("holds {held} items, but its entry says {said}"))
}

/// Returns an unpacked payload if it holds as many items as its entry says.
fn unpacked<T>(
    block: &BlockEntry,
    part: &PartEntry,
    payload: ParseResult<T>,
    count: impl Fn(&T) -> usize,
) -> Result<T> {
    let checked = payload.and_then(|payload| check_count(count(&payload), part).map(|()| payload));
    checked.map_err(|what| SectionId::Part(block.id, part.kind).corrupt(part.offset, what))
}

fn no_block(id: BlockId) -> Error {
    Error::Invalid(format!("{id}: the archive has no such block"))
}

/// Reads the header and the footer.
fn read_ends(storage: &impl Storage) -> Result<(Header, Footer)> {
    let ends = [0..HEADER as u64, storage.len().saturating_sub(FOOTER as u64)..storage.len()];
    read_checked(storage, &ends, || {
        let header = read_header(storage)?;
        let footer = read_footer(storage, header.id)?;
        Ok((header, footer))
    })
}

pub(crate) fn read_header(storage: &impl Storage) -> Result<Header> {
    let mut bytes = [0; HEADER];
    let present = storage.len().min(HEADER as u64) as usize;
    storage.read_at(0, &mut bytes[..present])?;
    check_magic(&bytes[..present])?;
    if present < HEADER {
        let what = format!("truncated: {} bytes of it and everything after it are missing", HEADER - present);
        return Err(Error::Corrupt { offset: present as u64, place: "header".into(), what });
    }
    Header::decode(&bytes)
}

pub(crate) fn read_footer(storage: &impl Storage, id: FileId) -> Result<Footer> {
    let (len, size) = (storage.len(), FOOTER as u64);
    let corrupt = |what: String| Error::Corrupt { offset: len.saturating_sub(size), place: "footer".into(), what };
    let offset = len.checked_sub(size).filter(|&offset| offset >= HEADER as u64);
    let offset = offset.ok_or_else(|| corrupt("missing: the file is truncated or was never finished".into()))?;
    let footer = footer_at(storage, offset)?.map_err(|what| corrupt(explain(storage, what)))?;
    ensure(footer.id == id, || "belongs to another file".into()).map_err(corrupt)?;
    let total = footer.total;
    ensure(total <= len, || format!("the file is {} bytes too short: {len} instead of {total}", total - len))
        .map_err(corrupt)?;
    ensure(total == len, || format!("the file is {} bytes too long: {len} instead of {total}", len - total))
        .map_err(corrupt)?;
    Ok(footer)
}

fn footer_at(storage: &impl Storage, offset: u64) -> Result<ParseResult<Footer>> {
    let mut bytes = [0; FOOTER];
    storage.read_at(offset, &mut bytes)?;
    Ok(Footer::decode(&bytes))
}

/// Explains why the footer is invalid: looks for a valid one a little earlier, which means that bytes were appended.
fn explain(storage: &impl Storage, what: String) -> String {
    let len = storage.len();
    let earlier = (1..=4096).map_while(|extra| len.checked_sub(extra)).filter(|end| end.is_multiple_of(64));
    let ends = |end: &u64| {
        let footer = end.checked_sub(FOOTER as u64).and_then(|offset| footer_at(storage, offset).ok()?.ok());
        footer.is_some_and(|footer| footer.total == *end)
    };
    match earlier.into_iter().find(ends) {
        Some(end) => format!("the file is {} bytes too long: {len} instead of {end}", len - end),
        None => what,
    }
}

/// Checks that header and footer agree about a description.
fn check_announced(header: &Header, footer: &Footer) -> Result<()> {
    let agree = header.features().described == footer.description.is_some();
    let corrupt = |what| Error::Corrupt { offset: footer.total - FOOTER as u64, place: "footer".into(), what };
    ensure(agree, || "header and footer disagree about a description".into()).map_err(corrupt)
}

fn read_metadata(storage: &impl Storage, footer: &Footer) -> Result<Metadata> {
    let (extent, section) = (footer.metadata, SectionId::Metadata);
    let corrupt = |what: String| section.corrupt(extent.offset, what);
    let sized = extent.stored_len == extent.raw_len && extent.raw_len as usize <= MAX_METADATA;
    ensure(sized, || format!("{} bytes, at most {MAX_METADATA}", extent.raw_len)).map_err(corrupt)?;
    let last = footer.last();
    let placed = align(extent.end()) == footer.root.offset
        && footer.description.is_none_or(|description| align(footer.root.end()) == description.offset)
        && align(last.end()).checked_add(FOOTER as u64) == Some(footer.total);
    ensure(placed, || "metadata, root, description and footer do not follow each other".into()).map_err(corrupt)?;
    let record = read_section(storage, footer.id, section, &extent)?;
    Metadata::parse(&record).map_err(|what| section.corrupt(extent.offset + FRAME as u64, what))
}

fn read_root(storage: &impl Storage, footer: &Footer, metadata: &Metadata) -> Result<Vec<LeafEntry>> {
    let (extent, section) = (footer.root, SectionId::Root);
    let corrupt = |what: String| section.corrupt(extent.offset, what);
    let blocks = metadata.blocks();
    let counted = footer.blocks == blocks && blocks.checked_mul(MIN_BLOCK).is_some_and(|bytes| bytes <= footer.total);
    ensure(counted, || format!("{blocks} blocks in the metadata, {} in the footer", footer.blocks)).map_err(corrupt)?;
    let size = footer.leaves.checked_mul(LEAF_ENTRY as u64).filter(|&size| size <= MAX_ROOT_RAW);
    let sized = size == Some(extent.raw_len.into()) && footer.leaves <= blocks;
    ensure(sized, || format!("{} bytes for {} leaves", extent.raw_len, footer.leaves)).map_err(corrupt)?;
    let stored = read_section(storage, footer.id, section, &extent)?;
    let raw = decompress(&stored, extent.raw_len).map_err(corrupt)?;
    let leaves: ParseResult<Vec<_>> =
        raw.chunks(LEAF_ENTRY).map(|entry| LeafEntry::decode(&mut FieldReader::new(entry))).collect();
    let leaves = leaves.map_err(corrupt)?;
    let end = check_leaves(metadata, &leaves).map_err(corrupt)?;
    let follows = align(end) == footer.metadata.offset;
    ensure(follows, || format!("windows end at byte {end}, but the metadata does not follow them")).map_err(corrupt)?;
    Ok(leaves)
}
