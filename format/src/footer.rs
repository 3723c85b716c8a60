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
}

impl Footer {
    pub(crate) fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(FOOTER);
        out.put(&self.id.0);
        out.put_u64(self.total);
        for extent in [self.metadata, self.root] {
            out.put_u64(extent.offset);
            out.put_u32(extent.stored_len);
            out.put_u32(extent.raw_len);
            out.put_u64(extent.checksum);
        }
        out.put_u64(self.blocks);
        out.put_u64(self.leaves);
        out.put(&[0; 24]);
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
        };
        fields.reserved::<24>()?;
        fields.end()?;
        Ok(footer)
    }
}

fn extent(fields: &mut FieldReader<'_>) -> ParseResult<SectionExtent> {
    let (offset, stored_len, raw_len) = (fields.u64()?, fields.u32()?, fields.u32()?);
    Ok(SectionExtent { offset, stored_len, raw_len, checksum: fields.u64()? })
}
