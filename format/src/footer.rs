//! The fixed-size footer: the offsets of metadata and directory, and the length of the file.

use crate::bytes::{FieldReader, FieldWriter, ParseResult, ensure};
use crate::file_id::FileId;
use crate::section::SectionExtent;
use xxhash_rust::xxh3::xxh3_64;

/// Bytes of the footer.
pub(crate) const FOOTER: usize = 128;

/// The last bytes of every complete file.
pub(crate) const END_MAGIC: [u8; 8] = [0x89, b'W', b'S', b'P', b'E', b'N', b'D', 0x0A];

/// The fields of a footer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Footer {
    pub(crate) id: FileId,
    /// Bytes of the whole file, this footer included.
    pub(crate) total: u64,
    pub(crate) metadata: SectionExtent,
    pub(crate) root: SectionExtent,
    pub(crate) blocks: u64,
    pub(crate) leaves: u64,
    pub(crate) description: Option<SectionExtent>,
}

impl Footer {
    /// The section before the footer.
    pub(crate) fn last(&self) -> &SectionExtent {
        self.description.as_ref().unwrap_or(&self.root)
    }

    pub(crate) fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(FOOTER);
        out.put(&self.id.0);
        out.put_u64(self.total);
        put_extent(&self.metadata, &mut out);
        put_extent(&self.root, &mut out);
        out.put_u64(self.blocks);
        out.put_u64(self.leaves);
        match &self.description {
            Some(extent) => put_extent(extent, &mut out),
            None => out.put(&[0; EXTENT]),
        }
        out.put_u64(xxh3_64(&out));
        out.put(&END_MAGIC);
        out
    }

    /// Checks end magic, checksum and reserved bytes, in this order.
    pub(crate) fn decode(bytes: &[u8; FOOTER]) -> ParseResult<Self> {
        ensure(bytes.ends_with(&END_MAGIC), || {
            "the end magic is missing: the file is truncated or was never finished".into()
        })?;
        let (fields, tail) = bytes.split_at(FOOTER - 16);
        let matches = FieldReader::new(tail).u64()? == xxh3_64(fields);
        ensure(matches, || "the checksum does not match".into())?;
        let mut fields = FieldReader::new(fields);
        let footer = Self {
            id: FileId(fields.array()?),
            total: fields.u64()?,
            metadata: extent(&mut fields)?,
            root: extent(&mut fields)?,
            blocks: fields.u64()?,
            leaves: fields.u64()?,
            description: extent(&mut fields).map(|extent| Some(extent).filter(|extent| *extent != ABSENT))?,
        };
        fields.end()?;
        Ok(footer)
    }
}

/// Bytes of a section's extent.
const EXTENT: usize = 24;

/// The extent of a section that the file lacks.
const ABSENT: SectionExtent = SectionExtent { offset: 0, stored_len: 0, raw_len: 0, checksum: 0 };

fn put_extent(extent: &SectionExtent, out: &mut Vec<u8>) {
    out.put_u64(extent.offset);
    out.put_u32(extent.stored_len);
    out.put_u32(extent.raw_len);
    out.put_u64(extent.checksum);
}

fn extent(fields: &mut FieldReader<'_>) -> ParseResult<SectionExtent> {
    let (offset, stored_len, raw_len) = (fields.u64()?, fields.u32()?, fields.u32()?);
    Ok(SectionExtent { offset, stored_len, raw_len, checksum: fields.u64()? })
}
