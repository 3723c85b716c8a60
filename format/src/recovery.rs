//! Recovers a damaged file: finds its intact sections without trusting its directory, and writes a new file with them
//! (FORMAT.md section 12).

use crate::block::{BlockId, EncodedBlock, EncodedPart, PartKind};
use crate::bytes::{FieldReader, ParseResult, ensure};
use crate::description::Description;
use crate::directory::{BlockEntry, PartEntry, entry_len};
use crate::file_id::FileId;
use crate::footer::FOOTER;
use crate::header::Features;
use crate::leaf::{LeafEntry, MIN_BLOCK, leaves_of};
use crate::limits::{BLOCKS_PER_LEAF, MAX_DESCRIPTION, MAX_METADATA, MAX_PARTS, MAX_WINDOW_FRAMES};
use crate::metadata::Metadata;
use crate::reader::{check_payload, read_footer, read_header};
use crate::section::{FRAME, SectionId, decompress, read, section_at};
use crate::window::{WINDOW_END, Window, WindowEnd, WindowRecord};
use crate::writer::{Summary, Writer};
use crate::{Error, Result, Storage};
use memchr::memmem::Finder;
use std::collections::BTreeMap;
use std::io::Write;

/// The intact sections of a damaged file. Parts of blocks are checked only when they are written.
#[derive(Debug)]
pub struct Recovery {
    id: FileId,
    /// Metadata with the described windows, without the totals of their blocks.
    metadata: Metadata,
    /// The totals of the windows that were found.
    ends: BTreeMap<u32, WindowEnd>,
    /// Windows without a description of their coding.
    undescribed: Vec<u32>,
    /// Offsets of the header of each block and the section of each leaf.
    blocks: BTreeMap<BlockId, u64>,
    leaves: BTreeMap<BlockId, u64>,
    /// Number of blocks after the last described window.
    left_behind: u64,
    /// Whether metadata or a footer were found; these say how many windows there are.
    all_known: bool,
    /// The description, if it was found and fits the metadata.
    description: Option<Description>,
    /// The features of the file.
    features: Features,
}

/// The result of recovering a damaged file.
#[derive(Debug, Clone, PartialEq)]
pub struct Recovered {
    /// The sizes of the new file.
    pub summary: Summary,
    /// Its lost blocks, in order.
    pub lost: Vec<BlockId>,
    /// Its windows without a description of their coding. All their blocks are lost.
    pub undescribed: Vec<u32>,
    /// Number of intact blocks that were not recovered, because their windows come later and have no description.
    pub left_behind: u64,
    /// Whether it is certain that there were no more windows.
    pub all_known: bool,
    /// Whether the file was to have a description, and it is lost. It is written last.
    pub description_lost: bool,
}

/// The sections found in a file.
#[derive(Default)]
struct FoundSections {
    start: Option<Metadata>,
    /// The last metadata in the file, which covers the most windows.
    metadata: Option<Metadata>,
    windows: BTreeMap<u32, WindowRecord>,
    ends: BTreeMap<u32, WindowEnd>,
    blocks: BTreeMap<BlockId, u64>,
    leaves: BTreeMap<BlockId, u64>,
    /// The record of the description.
    description: Option<Vec<u8>>,
    /// Whether a block lists its values.
    listed: bool,
}

/// The tags that the search looks for.
const TAGS: [&[u8; 4]; 7] = [b"STRT", b"WNDW", b"BLCK", b"LEAF", b"WEND", b"META", b"DESC"];

/// Largest ratio of the new file's least possible size to the damaged file's size. Forged records may claim lost blocks
/// without limit.
const MAX_LOST_RATIO: u64 = 64;

/// Smallest size of a window's record in bytes. It bounds how many lost windows a record with a large number can create.
const MIN_WINDOW_RECORD: usize = 128;

/// Smallest size of a window in a file without its blocks: window section, a leaf and window's end.
const MIN_WINDOW: u64 = 192 + 64 + 128;

/// Largest ratio of the claimed sizes of all sections to the file's size. Forged sections may overlap, and each is read.
const MAX_CLAIMED_RATIO: u64 = 8;

/// Number of bytes that are searched at a time.
const SEARCH_CHUNK: u64 = 1 << 20;

impl Recovery {
    /// Searches a whole file for intact sections. Calls `searched` with the number of bytes after each step. Needs about 60
    /// bytes of memory per block.
    ///
    /// # Errors
    /// [`Error::Invalid`] if nothing can be recovered, because the file id or the size of the volume is unknown;
    /// [`Error::Unsupported`] for a newer version; [`Error::Io`] if the storage fails.
    pub fn search(storage: &impl Storage, searched: &mut dyn FnMut(u64)) -> Result<Self> {
        let header = match read_header(storage) {
            Err(newer @ Error::Unsupported(_)) => return Err(newer),
            header => header.ok(),
        };
        let mut ids = candidate_ids(storage)?;
        let mut whole = false;
        let mut found = FoundSections::default();
        let finders = TAGS.map(Finder::new);
        let mut left = storage.len().max(SEARCH_CHUNK).saturating_mul(MAX_CLAIMED_RATIO);
        for offset in (0..storage.len()).step_by(SEARCH_CHUNK as usize) {
            let len = (SEARCH_CHUNK + 3).min(storage.len() - offset); // a tag may cross the boundary
            let mut bytes = vec![0; len as usize];
            storage.read_at(offset, &mut bytes)?;
            let mut places: Vec<(usize, &[u8; 4])> = Vec::new();
            for (tag, finder) in TAGS.iter().zip(&finders) {
                places.extend(finder.find_iter(&bytes).map(|at| (at, *tag)));
            }
            places.sort_unstable();
            for (at, tag) in places {
                let at = offset + at as u64;
                let claimed = claimed_len(storage, tag, at);
                left = left.checked_sub(claimed).ok_or_else(|| unrecoverable("sections overlap"))?;
                if let Some(id) =
                    ids.iter().copied().find(|id| found.add_section(storage, *id, tag, at).is_ok_and(|added| added))
                {
                    (ids, whole) = (vec![id], true);
                }
            }
            searched(len.min(SEARCH_CHUNK));
        }
        let id = ids.first().copied().filter(|_| whole);
        let told = id.and_then(|id| read_footer(storage, id).ok()).map(|footer| footer.blocks);
        let mut recovery = found.assemble(id, storage.len())?;
        recovery.all_known |= told == Some(recovery.metadata.blocks());
        let header = header.filter(|header| header.id == recovery.id); // it may be another file's
        if let Some(told) = header.map_or_else(|| recovery.told_by_id(), |header| Some(header.features())) {
            recovery.features = told.with_those_of(recovery.metadata.features());
        }
        Ok(recovery)
    }

    /// The metadata of the file that [`Self::write`] makes, without the windows' totals.
    pub fn metadata(&self) -> &Metadata {
        &self.metadata
    }

    /// The features that the file's id was made from (FORMAT.md, section 3).
    fn told_by_id(&self) -> Option<Features> {
        let first_digest = self.metadata.windows.first().map_or(0, |window| window.digest);
        let has_id = |features: &Features| self.metadata.file_id(first_digest, *features).is_ok_and(|id| id == self.id);
        Features::all().find(has_id)
    }

    /// The features of the file that [`Self::write`] makes.
    fn features(&self) -> Features {
        Features { described: self.description.is_some(), ..self.features }
    }

    /// Writes a file with everything that is intact. Calls `done` after every block.
    ///
    /// # Errors
    /// [`Error::Io`] if the storage or writing fails.
    pub fn write<W: Write>(&self, storage: &impl Storage, out: W, done: &mut dyn FnMut()) -> Result<(W, Recovered)> {
        let mut writer = Writer::with_features(out, self.id, &self.metadata, self.features())?;
        let mut lost: Vec<BlockId> = Vec::new();
        for window in 0..self.metadata.windows.len() as u32 {
            writer.begin_window(self.metadata.window_record(window))?;
            let mut end = WindowEnd::empty(window);
            for (first, count) in leaves_of(&self.metadata, window, self.metadata.tiers(window)) {
                let entries = self.leaf(storage, first, count);
                for (block, entry) in (first.block..).zip(entries) {
                    let id = BlockId { block, ..first };
                    // Blocks come after the one above them, in the order of their ids.
                    let is_lost = |above| lost.binary_search(&above).is_ok();
                    let begins_intact = |block: &EncodedBlock| !block.block_above(&self.metadata).is_some_and(is_lost);
                    match self.block(storage, id, entry)?.filter(begins_intact) {
                        Some(block) => {
                            end.add(&block);
                            writer.append(&block)?;
                        }
                        None => {
                            lost.push(id);
                            writer.append_lost(id)?;
                        }
                    }
                    done();
                }
            }
            writer.end_window(&self.end(end))?;
        }
        let (out, summary) = writer.finish_described(self.description.as_ref())?;
        let (undescribed, left_behind, all_known) = (self.undescribed.clone(), self.left_behind, self.all_known);
        let description_lost = self.features.described && self.description.is_none();
        Ok((out, Recovered { summary, lost, undescribed, left_behind, all_known, description_lost }))
    }

    /// The totals of a window. If they were found, these without the counts of lost blocks; otherwise the sums over the
    /// recovered blocks.
    fn end(&self, added: WindowEnd) -> WindowEnd {
        let WindowEnd { coded, outliers, .. } = added;
        match self.ends.get(&added.number) {
            Some(known) => WindowEnd { coded, outliers, ..*known },
            None => WindowEnd { share: if added.reached > 0.0 { 1.0 } else { 0.0 }, ..added },
        }
    }

    /// The entries of a leaf's blocks, if the leaf is intact.
    fn leaf(&self, storage: &impl Storage, first: BlockId, count: u32) -> Vec<Option<BlockEntry>> {
        let leaf = LeafEntry { count: count as u16, ..LeafEntry::new(first, 0) };
        let entries = self.leaves.get(&first).and_then(|at| {
            let (extent, stored) =
                section_at(storage, self.id, SectionId::Leaf(first), *at, leaf.max_raw_len()).ok()?;
            let raw = (extent.raw_len as usize <= leaf.max_raw_len()).then(|| decompress(&stored, extent.raw_len))?;
            leaf.parse(&raw.ok()?).ok()
        });
        entries.map_or(vec![None; count as usize], |entries| entries.into_iter().map(Some).collect())
    }

    /// Reads a block; `None` if it is not intact or cannot be decoded. Fails if the storage fails.
    fn block(&self, storage: &impl Storage, id: BlockId, in_leaf: Option<BlockEntry>) -> Result<Option<EncodedBlock>> {
        if self.undescribed.contains(&id.window) {
            return Ok(None);
        }
        let own = self.blocks.get(&id).and_then(|at| entry_at(storage, self.id, id, *at).ok());
        for entry in own.into_iter().chain(in_leaf).filter(|entry| !entry.lost) {
            match self.parts(storage, &entry) {
                Ok(block) => return Ok(Some(block)),
                Err(failed) if failed.is_io() => return Err(failed),
                Err(_) => {}
            }
        }
        Ok(None)
    }

    fn parts(&self, storage: &impl Storage, entry: &BlockEntry) -> Result<EncodedBlock> {
        let geometry = self.metadata.geometry(entry.id).ok_or(Error::Lost(entry.id))?;
        let part = |part: &PartEntry| {
            let PartEntry { kind, stats, raw_len, .. } = *part;
            geometry.check(part).map_err(Error::Invalid)?;
            let stored = part.read(storage, self.id, entry.id)?;
            let raw = decompress(&stored, raw_len).map_err(Error::Invalid)?;
            check_payload(&geometry, part, &raw).map_err(Error::Invalid)?;
            Ok(EncodedPart { kind, stats, raw_len, stored })
        };
        entry.check(geometry.window.tiers(), self.features()).map_err(Error::Invalid)?;
        let parts = entry.parts.iter().map(part).collect::<Result<_>>()?;
        Ok(EncodedBlock { id: entry.id, stats: entry.stats, parts })
    }
}

/// The possible file ids: those in the header and in the footer.
fn candidate_ids(storage: &impl Storage) -> Result<Vec<FileId>> {
    let places = [Some(32), storage.len().checked_sub(FOOTER as u64)];
    let mut ids = Vec::new();
    for place in places.into_iter().flatten().filter(|place| place + 16 <= storage.len()) {
        let mut id = [0; 16];
        storage.read_at(place, &mut id)?;
        ids.push(FileId(id));
    }
    Ok(ids)
}

/// Reads a block's entry from its header at `at`. Sets the offsets of its parts to follow that header, whatever they were.
fn entry_at(storage: &impl Storage, file: FileId, id: BlockId, at: u64) -> Result<BlockEntry> {
    let section = SectionId::Block(id);
    let (_, bytes) = section_at(storage, file, section, at, max_stored(b"BLCK"))?;
    let mut fields = FieldReader::new(&bytes);
    let entry = BlockEntry::decode(&mut fields).and_then(|entry| fields.end().map(|()| entry));
    let mut entry = entry.map_err(|what| section.corrupt(at, what))?;
    let mut offset = at + entry.header_len();
    for part in &mut entry.parts {
        part.offset = offset;
        offset = offset.saturating_add(part.stored_len.into());
    }
    Ok(entry)
}

impl FoundSections {
    /// Adds the section that starts at `at` with a tag. Returns false or an error if it is not an intact section of `id`.
    fn add_section(&mut self, storage: &impl Storage, id: FileId, tag: &[u8; 4], at: u64) -> Result<bool> {
        let record = |section: SectionId| section_at(storage, id, section, at, MAX_METADATA).map(|(_, record)| record);
        match tag {
            b"STRT" => self.start = Metadata::parse_start(&record(SectionId::Start)?).ok().or(self.start.take()),
            b"META" => self.metadata = Metadata::parse(&record(SectionId::Metadata)?).ok().or(self.metadata.take()),
            b"BLCK" => {
                let block = id_at(storage, at)?;
                self.listed |= entry_at(storage, id, block, at)?.part(PartKind::Listed).is_some();
                self.blocks.entry(block).or_insert(at);
            }
            b"LEAF" => return self.add_leaf(storage, id, at),
            b"DESC" => self.add_description(storage, id, at)?,
            b"WNDW" => {
                let record = WindowRecord::parse(&read_numbered(storage, id, tag, at, SectionId::Window)?)
                    .map_err(Error::Invalid)?;
                self.windows.entry(record.number).or_insert(record);
            }
            _ => {
                let end = WindowEnd::parse(&read_numbered(storage, id, tag, at, SectionId::WindowEnd)?)
                    .map_err(Error::Invalid)?;
                self.ends.entry(end.number).or_insert(end);
            }
        }
        Ok(true)
    }

    /// Adds a leaf. Only its content says which blocks it describes.
    fn add_leaf(&mut self, storage: &impl Storage, id: FileId, at: u64) -> Result<bool> {
        let max = max_stored(b"LEAF");
        let frame = read(storage, SectionId::Root, at, FRAME as u64)?;
        let mut fields = FieldReader::new(&frame[4..]);
        let (Ok(stored_len), Ok(raw_len)) = (fields.u32(), fields.u32()) else { return Ok(false) };
        if stored_len as usize > max || raw_len as usize > max {
            return Ok(false);
        }
        let stored = read(storage, SectionId::Root, at + FRAME as u64, stored_len.into())?;
        let Ok(raw) = decompress(&stored, raw_len) else { return Ok(false) };
        let mut entries = FieldReader::new(&raw);
        let Ok(first) = BlockEntry::decode(&mut entries) else { return Ok(false) };
        section_at(storage, id, SectionId::Leaf(first.id), at, max)?;
        let mut others = std::iter::from_fn(|| BlockEntry::decode(&mut entries).ok());
        let is_listed = |entry: BlockEntry| entry.part(PartKind::Listed).is_some();
        self.leaves.entry(first.id).or_insert(at);
        self.listed |= others.any(is_listed) || is_listed(first);
        Ok(true)
    }

    /// Adds the description. Only the last one in the file can be that of all windows.
    fn add_description(&mut self, storage: &impl Storage, id: FileId, at: u64) -> Result<()> {
        let section = SectionId::Description;
        let (extent, stored) = section_at(storage, id, section, at, max_stored(b"DESC"))?;
        ensure(extent.raw_len as usize <= MAX_DESCRIPTION, || "too long".into()).map_err(Error::Invalid)?;
        self.description = Some(decompress(&stored, extent.raw_len).map_err(Error::Invalid)?);
        Ok(())
    }

    fn assemble(self, id: Option<FileId>, len: u64) -> Result<Recovery> {
        let Self { start, metadata, mut windows, mut ends, blocks, leaves, description, listed } = self;
        for (number, m) in metadata.iter().flat_map(|m| (0..m.windows.len() as u32).map(move |number| (number, m))) {
            windows.entry(number).or_insert_with(|| m.window_record(number));
            ends.entry(number).or_insert_with(|| m.window_end(number));
        }
        let id = id.ok_or_else(|| unrecoverable("no section is intact"))?;
        let last = blocks.keys().map(|id| id.window).max();
        // drops a last window without blocks and end
        windows.retain(|number, _| Some(*number) <= last || ends.contains_key(number));
        let (all_known, start) = (metadata.is_some(), metadata.map(|m| m.start()).or(start));
        let mut all = start
            .ok_or_else(|| unrecoverable("start and metadata are missing, so the size of the volume is unknown"))?;
        let mut undescribed = Vec::new();
        let count = windows.last_key_value().map_or(0, |(number, _)| u64::from(*number) + 1);
        let of_tier = |tier| u64::from(all.blocks_per_channel(tier)) * u64::from(all.channels);
        let above = |record: &WindowRecord| (1..=record.window.tiers()).map(of_tier).fold(0, u64::saturating_add);
        let blocks_above = windows.values().map(above).fold(0, u64::saturating_add);
        let per_window = of_tier(0).saturating_mul(MIN_BLOCK).saturating_add(MIN_WINDOW);
        let least = count.saturating_mul(per_window).saturating_add(blocks_above.saturating_mul(MIN_BLOCK));
        if least > len.saturating_mul(MAX_LOST_RATIO) {
            return Err(unrecoverable("the file is too short for the number of blocks in its records"));
        }
        for (number, record) in windows {
            fill_gap(&mut all, &record, &mut undescribed).map_err(|what| unrecoverable(&what))?;
            all.push(record, &WindowEnd::empty(number)).map_err(|what| unrecoverable(&what))?;
        }
        if all.frames == 0 {
            return Err(unrecoverable("no window was begun"));
        }
        let left_behind = blocks.keys().filter(|id| id.window as usize >= all.windows.len()).count() as u64;
        let description = description.and_then(|record| Description::parse(&record, &all).ok());
        let features = Features { listed, ..all.features() };
        Ok(Recovery {
            id,
            metadata: all,
            ends,
            undescribed,
            blocks,
            leaves,
            left_behind,
            all_known,
            description,
            features,
        })
    }
}

fn unrecoverable(what: &str) -> Error {
    Error::Invalid(format!("nothing can be recovered: {what}"))
}

/// Upper bound on the bytes that [`FoundSections::add_section`] reads or unpacks for the section at `at` with a tag.
fn claimed_len(storage: &impl Storage, tag: &[u8; 4], at: u64) -> u64 {
    let Ok(frame) = read(storage, SectionId::Root, at, FRAME as u64) else { return 0 };
    let (mut fields, max) = (FieldReader::new(&frame[4..]), max_stored(tag) as u64);
    let (Ok(stored_len), Ok(raw_len)) = (fields.u32(), fields.u32()) else { return 0 };
    let raw_len = if matches!(tag, b"LEAF" | b"DESC") { u64::from(raw_len) } else { 0 };
    let end = at.saturating_add(stored_len.into());
    if u64::from(stored_len).max(raw_len) > max || end > storage.len() { 0 } else { raw_len + u64::from(stored_len) }
}

/// Upper bound on the stored bytes of a section.
fn max_stored(tag: &[u8; 4]) -> usize {
    match tag {
        b"BLCK" => entry_len(MAX_PARTS),
        b"LEAF" => BLOCKS_PER_LEAF as usize * entry_len(MAX_PARTS),
        b"WEND" => WINDOW_END,
        _ => MAX_METADATA,
    }
}

/// The id in the block header at `at`, unchecked.
fn id_at(storage: &impl Storage, at: u64) -> Result<BlockId> {
    let mut bytes = [0; 10];
    storage.read_at(at.saturating_add(FRAME as u64), &mut bytes)?;
    let mut fields = FieldReader::new(&bytes);
    let mut id = || Ok(BlockId::at_place(fields.u32()?, fields.u32()?, fields.array()?));
    id().map_err(|what: String| SectionId::Root.corrupt(at, what))
}

/// Reads the section at `at`, whose content starts with the number of its window.
fn read_numbered(
    storage: &impl Storage,
    file: FileId,
    tag: &[u8; 4],
    at: u64,
    section: fn(u32) -> SectionId,
) -> Result<Vec<u8>> {
    let mut number = [0; 4];
    storage.read_at(at.saturating_add(FRAME as u64), &mut number)?;
    section_at(storage, file, section(u32::from_le_bytes(number)), at, max_stored(tag)).map(|(_, record)| record)
}

/// Adds lost windows for those before `record` that have no description. Their lengths are as equal as possible.
fn fill_gap(all: &mut Metadata, record: &WindowRecord, undescribed: &mut Vec<u32>) -> ParseResult {
    let possible = record.number as usize <= MAX_METADATA / MIN_WINDOW_RECORD;
    ensure(possible, || format!("window {} is beyond what metadata can hold", record.number))?;
    let time = record.times.first().copied(); // lost frames get the time of the next known frame
    for number in all.windows.len() as u32..record.number {
        let left = record.window.first_frame.saturating_sub(all.frames);
        let frames = u32::try_from(left / u64::from(record.number - number)).unwrap_or(u32::MAX);
        let window = Window::lost(all.frames, frames);
        let times = time.map_or(Vec::new(), |time| vec![time; frames.min(MAX_WINDOW_FRAMES) as usize]);
        all.push(WindowRecord { number, window, times }, &WindowEnd::empty(number))?;
        undescribed.push(number);
    }
    Ok(())
}
