//! A bare stream: a file without the parts that a reader can make of the rest (FORMAT.md section 13). Small archives, such as chunks of an
//! array, take less room as bare streams.

use crate::block::{EncodedBlock, EncodedPart};
use crate::bytes::{FieldReader, FieldWriter, ParseResult, ensure};
use crate::directory::{BlockEntry, PartEntry};
use crate::header::{Features, HEADER, Header};
use crate::leaf::leaves_of;
use crate::limits::MAX_BARE_HEAD;
use crate::section::{SectionId, compress_directory, decompress};
use crate::{BlockId, Error, FileId, Metadata, Reader, Result, Storage, Writer};
use xxhash_rust::xxh3::xxh3_64;

/// The first bytes of every bare stream.
const MAGIC: [u8; 8] = [0x89, b'W', b'S', b'B', 0x0D, 0x0A, 0x1A, 0x0A];

/// Bytes before the head: magic, the head's bytes as stored and after decompression, and its checksum.
const PRELUDE: usize = 24;

/// The bare stream of a file.
///
/// # Errors
/// [`Error::Invalid`] if the file has a description, [`Error::TooLarge`] if it has too many blocks, [`Error::Lost`] if one is
/// lost; otherwise as [`Reader::stored`].
pub fn to_bare<S: Storage>(file: &Reader<S>) -> Result<Vec<u8>> {
    let features = file.features();
    ensure(!features.described, || "a bare stream has no description".into()).map_err(Error::Invalid)?;
    let metadata = file.metadata().encode()?;
    let mut head = Header::new(file.id(), features).encode();
    head.put_u32(metadata.len() as u32);
    head.put(&metadata);
    let mut parts = Vec::new();
    for leaf in (0..file.metadata().windows.len() as u32).flat_map(|window| file.leaves(window)) {
        for mut entry in file.leaf(leaf)? {
            file.stored(&entry)?.parts.iter().for_each(|part| parts.extend_from_slice(&part.stored));
            entry.parts.iter_mut().for_each(|part| part.offset = 0);
            entry.encode(&mut head);
        }
    }
    let (size, limit) = (head.len() as u64, MAX_BARE_HEAD as u64);
    if size > limit {
        return Err(Error::TooLarge { what: "bytes of a bare stream's head".into(), size, limit });
    }
    let stored = compress_directory(&head)?;
    let mut out = Vec::with_capacity(PRELUDE + stored.len() + parts.len());
    out.put(&MAGIC);
    out.put_u32(stored.len() as u32);
    out.put_u32(head.len() as u32);
    out.put_u64(xxh3_64(&stored));
    out.put(&stored);
    out.put(&parts);
    Ok(out)
}

/// The file of the bare stream at the start of `bytes`, and the bytes after the stream. Checks every checksum.
///
/// # Errors
/// [`Error::Foreign`], [`Error::Unsupported`] or [`Error::Corrupt`] if the stream is not valid.
pub fn from_bare(bytes: &[u8]) -> Result<(Vec<u8>, &[u8])> {
    let (head, rest) = split_head(bytes)?;
    let (header, after) = head.split_first_chunk::<HEADER>().ok_or_else(|| corrupt("ends in its header"))?;
    let header = Header::decode(header)?;
    let mut stream = Stream { id: header.id, entries: FieldReader::new(after), parts: rest };
    let metadata = stream.metadata().map_err(corrupt)?;
    let file = stream.file(&metadata, header.features()).map_err(invalid)?;
    stream.entries.end().map_err(corrupt)?;
    Ok((file, stream.parts))
}

/// The head, decompressed, and the bytes after it.
fn split_head(bytes: &[u8]) -> Result<(Vec<u8>, &[u8])> {
    let mut fields = FieldReader::new(bytes);
    let foreign = |_| Error::Foreign("not a bare stream".into());
    let magic: [u8; 8] = fields.array().map_err(foreign)?;
    ensure(magic == MAGIC, String::new).map_err(foreign)?;
    let mut parsed = || {
        let (stored, raw, checksum) = (fields.u32()?, fields.u32()?, fields.u64()?);
        let stored = fields.take(stored as usize)?;
        ensure(xxh3_64(stored) == checksum, || "the checksum of its head does not match".into())?;
        ensure(raw as usize <= MAX_BARE_HEAD, || format!("a head of {raw} bytes, at most {MAX_BARE_HEAD}"))?;
        decompress(stored, raw)
    };
    let head = parsed().map_err(corrupt)?;
    Ok((head, fields.rest()))
}

/// What is not read yet of a stream.
struct Stream<'head, 'parts> {
    id: FileId,
    /// The rest of the head.
    entries: FieldReader<'head>,
    parts: &'parts [u8],
}

impl Stream<'_, '_> {
    fn metadata(&mut self) -> ParseResult<Metadata> {
        let len = self.entries.u32()? as usize;
        Metadata::parse(self.entries.take(len)?)
    }

    /// The file of these windows, written anew.
    fn file(&mut self, metadata: &Metadata, features: Features) -> Result<Vec<u8>> {
        let mut file = Writer::with_features(Vec::new(), self.id, &metadata.start(), features)?;
        for number in 0..metadata.windows.len() as u32 {
            file.begin_window(metadata.window_record(number))?;
            for (first, count) in leaves_of(metadata, number, metadata.tiers(number)) {
                for block in (first.block..).take(count as usize) {
                    file.append(&self.block(BlockId { block, ..first }).map_err(corrupt)?)?;
                }
            }
            file.end_window(&metadata.window_end(number))?;
        }
        Ok(file.finish()?.0)
    }

    /// The next block, which must be this one.
    fn block(&mut self, id: BlockId) -> ParseResult<EncodedBlock> {
        let entry = BlockEntry::decode(&mut self.entries)?;
        ensure(entry.id == id && !entry.lost, || format!("{} instead of {id}", entry.id))?;
        let parts = entry.parts.iter().map(|part| self.part(id, part)).collect::<ParseResult<_>>()?;
        Ok(EncodedBlock { id, stats: entry.stats, parts })
    }

    fn part(&mut self, block: BlockId, entry: &PartEntry) -> ParseResult<EncodedPart> {
        let PartEntry { kind, stats, offset, stored_len, raw_len, checksum } = *entry;
        let section = SectionId::Part(block, kind);
        ensure(offset == 0, || format!("{section}: an offset"))?;
        let cut = || format!("{section}: {stored_len} bytes extend past the end");
        let (stored, rest) = self.parts.split_at_checked(stored_len as usize).ok_or_else(cut)?;
        ensure(section.checksum(self.id, stored) == checksum, || format!("{section}: the checksum does not match"))?;
        self.parts = rest;
        Ok(EncodedPart { kind, stats, raw_len, stored: stored.to_vec() })
    }
}

/// An error in the stream's head, or in what it describes.
fn corrupt(what: impl Into<String>) -> Error {
    Error::Corrupt { offset: 0, place: "bare stream".into(), what: what.into() }
}

/// The error of a stream that a writer refuses.
fn invalid(error: Error) -> Error {
    match error {
        Error::Invalid(what) => corrupt(what),
        Error::TooLarge { .. } => corrupt(error.to_string()),
        other => other,
    }
}
