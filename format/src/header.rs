//! The fixed-size header: magic, version, required features and file id.

use crate::bytes::{FieldReader, FieldWriter, ParseResult};
use crate::file_id::FileId;
use crate::pyramid::Packing;
use crate::{Error, Result};
use xxhash_rust::xxh3::xxh3_64;

/// Bytes of the header.
pub(crate) const HEADER: usize = 128;

/// The first bytes of every file. As in PNG, they hold a high bit, a name, both line endings and an end-of-file character.
pub(crate) const MAGIC: [u8; 8] = [0x89, b'W', b'S', b'P', 0x0D, 0x0A, 0x1A, 0x0A];

/// The version of files without features.
pub(crate) const VERSION: (u16, u16) = (1, 0);

/// The version of files with any feature.
const FEATURES_VERSION: (u16, u16) = (1, 1);

/// The version of files with tiers, listed values, sides or sums.
const LATEST_VERSION: (u16, u16) = (1, 2);

/// The required features that this reader supports, by bit, as messages for readers that do not.
const REQUIRED: [&str; 6] = [
    "nested parts (version 1.1 of the format): wavesplat 0.2 or later",
    "a description (version 1.1 of the format): wavesplat 0.2 or later",
    "tiers (version 1.2 of the format): wavesplat 0.2 or later",
    "listed values (version 1.2 of the format): wavesplat 0.2 or later",
    "sides of values (version 1.2 of the format): wavesplat 0.2 or later",
    "sums of frames (version 1.2 of the format): wavesplat 0.2 or later",
];

/// The bit of [`Packing::Nested`].
const NESTED: u64 = 1;

/// The bit of a description.
const DESCRIBED: u64 = 2;

/// The bit of tiers.
const TIERED: u64 = 4;

/// The bit of listed values.
const LISTED: u64 = 8;

/// The bit of sides.
const SIDED: u64 = 16;

/// The bit of sums.
const SUMMED: u64 = 32;

/// The required features of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Features {
    /// How codes may be packed.
    pub packing: Packing,
    /// Whether the file has a description.
    pub described: bool,
    /// Whether windows may have tiers.
    pub tiered: bool,
    /// Whether blocks may list their values.
    pub listed: bool,
    /// Whether samples keep their sides of some values.
    pub sided: bool,
    /// Whether the sums of frames are those of the source.
    pub summed: bool,
}

impl Features {
    /// The version of files with them: major and minor.
    pub fn version(self) -> (u16, u16) {
        match self.bits() {
            0 => VERSION,
            1..TIERED => FEATURES_VERSION,
            TIERED.. => LATEST_VERSION,
        }
    }

    /// These features and others.
    pub(crate) fn with_those_of(self, other: Self) -> Self {
        Self::of_bits(self.bits() | other.bits())
    }

    /// All combinations of features.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        (0..1 << REQUIRED.len()).map(Self::of_bits)
    }

    /// The features that these bits of `required` mean.
    fn of_bits(required: u64) -> Self {
        let packing = if required & NESTED == 0 { Packing::Flat } else { Packing::Nested };
        let has = |bit: u64| required & bit != 0;
        Self {
            packing,
            described: has(DESCRIBED),
            tiered: has(TIERED),
            listed: has(LISTED),
            sided: has(SIDED),
            summed: has(SUMMED),
        }
    }

    /// The field `required` of the header.
    pub(crate) fn bits(self) -> u64 {
        let nested = if self.packing == Packing::Nested { NESTED } else { 0 };
        let bit = |has: bool, bit: u64| if has { bit } else { 0 };
        nested
            | bit(self.described, DESCRIBED)
            | bit(self.tiered, TIERED)
            | bit(self.listed, LISTED)
            | bit(self.sided, SIDED)
            | bit(self.summed, SUMMED)
    }
}

impl From<Packing> for Features {
    fn from(packing: Packing) -> Self {
        Self { packing, ..Self::default() }
    }
}

/// The fields of a header.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Header {
    pub(crate) version: (u16, u16),
    pub(crate) required: u64,
    pub(crate) optional: u64,
    pub(crate) id: FileId,
    /// Message for users whose reader lacks a required feature; empty if no feature is required.
    pub(crate) needs: String,
}

/// Bytes of the field `needs`.
const NEEDS: usize = 72;

impl Header {
    /// The header of a new file with these features.
    pub(crate) fn new(id: FileId, features: Features) -> Self {
        let (required, version) = (features.bits(), features.version());
        // The newest, but of version 1.1 the first, as its writers did.
        let newest = required.checked_ilog2().unwrap_or(u32::MAX);
        let told = if required < TIERED { required.trailing_zeros() } else { newest };
        let needs = REQUIRED.get(told as usize).copied().unwrap_or_default();
        Self { version, required, optional: 0, id, needs: needs.into() }
    }

    /// The features that it announces.
    pub(crate) fn features(&self) -> Features {
        Features::of_bits(self.required)
    }

    pub(crate) fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEADER);
        out.put(&MAGIC);
        out.put_u16(self.version.0);
        out.put_u16(self.version.1);
        out.put_u32(0);
        out.put_u64(self.required);
        out.put_u64(self.optional);
        out.put(&self.id.0);
        let mut needs = [0; NEEDS];
        let len = self.needs.floor_char_boundary(NEEDS);
        needs[..len].copy_from_slice(&self.needs.as_bytes()[..len]);
        out.put(&needs);
        out.put_u64(xxh3_64(&out));
        out
    }

    /// Checks magic, checksum, version, features and reserved bytes, in this order.
    pub(crate) fn decode(bytes: &[u8; HEADER]) -> Result<Self> {
        check_magic(bytes)?;
        let (header, reserved) = Self::parse(bytes).map_err(damaged)?;
        header.check_supported()?;
        reserved.map_err(damaged)?;
        Ok(header)
    }

    fn parse(bytes: &[u8; HEADER]) -> ParseResult<(Self, ParseResult)> {
        let (fields, checksum) = bytes.split_at(HEADER - 8);
        if FieldReader::new(checksum).u64()? != xxh3_64(fields) {
            return Err("the checksum does not match".into());
        }
        let mut fields = FieldReader::new(fields);
        fields.array::<8>()?;
        let version = (fields.u16()?, fields.u16()?);
        let first = fields.reserved::<4>();
        let (required, optional) = (fields.u64()?, fields.u64()?);
        let id = FileId(fields.array()?);
        let words = fields.array::<NEEDS>()?;
        let words = words.split(|&byte| byte == 0).next().unwrap_or_default();
        let needs = String::from_utf8_lossy(words).chars().filter(|c| !c.is_control()).collect();
        Ok((Self { version, required, optional, id, needs }, first))
    }

    fn check_supported(&self) -> Result<()> {
        let (major, minor) = self.version;
        if major != VERSION.0 {
            return Err(Error::Unsupported(format!(
                "format version {major}.{minor}{}; this reader knows 1.x",
                self.quoted_needs()
            )));
        }
        match (0..64).find(|bit| self.required >> bit & 1 == 1 && REQUIRED.get(*bit).is_none()) {
            Some(bit) => {
                let what = format!("required feature bit {bit}{}, unknown to this reader", self.quoted_needs());
                Err(Error::Unsupported(what))
            }
            None => Ok(()),
        }
    }

    fn quoted_needs(&self) -> String {
        if self.needs.is_empty() { String::new() } else { format!(" ({})", self.needs) }
    }
}

/// Checks the magic; the error names the likely reason if it is wrong.
pub(crate) fn check_magic(start: &[u8]) -> Result<()> {
    let start = &start[..start.len().min(8)];
    if start == MAGIC {
        return Ok(());
    }
    let why = match start {
        [] => "it is empty",
        [0x09, b'W', b'S', b'P', ..] => "a transfer stripped the high bits of its bytes",
        [0x89, b'W', b'S', b'P', 0x0A, ..] | [0x89, b'W', b'S', b'P', 0x0D, 0x0D, ..] => {
            "a transfer in text mode changed its line endings"
        }
        _ if MAGIC.starts_with(start) => "it ends within its first 8 bytes",
        _ => "its first 8 bytes belong to another format",
    };
    Err(Error::Foreign(why.into()))
}

fn damaged(what: String) -> Error {
    Error::Corrupt { offset: 0, place: "header".into(), what }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(header: &Header) -> Result<Header> {
        let bytes: [u8; HEADER] = header.encode().try_into().expect("128 bytes");
        Header::decode(&bytes)
    }

    #[test]
    fn versions_and_features_are_refused_by_name() {
        let good = Header::new(FileId([7; 16]), Packing::Flat.into());
        assert_eq!(decode(&good).expect("valid"), good);
        let newer = decode(&Header { version: (2, 3), ..good.clone() });
        assert!(matches!(newer, Err(Error::Unsupported(what)) if what.contains("2.3")));
        let needs = "octree codes, since wavesplat 7".to_string();
        let feature = decode(&Header { required: 1 << 41, needs, ..good.clone() });
        assert!(
            matches!(feature, Err(Error::Unsupported(what)) if what.contains("41 (octree codes, since wavesplat 7)"))
        );
        assert!(decode(&Header { version: (1, 9), optional: u64::MAX, ..good }).is_ok());
    }

    #[test]
    fn reserved_bytes_must_be_zero() {
        let mut bytes: [u8; HEADER] =
            Header::new(FileId([7; 16]), Packing::Flat.into()).encode().try_into().expect("128 bytes");
        bytes[12] = 1;
        let checksum = xxh3_64(&bytes[..120]).to_le_bytes();
        bytes[120..].copy_from_slice(&checksum);
        assert!(matches!(Header::decode(&bytes), Err(Error::Corrupt { .. })));
    }

    #[test]
    fn foreign_files_are_explained() {
        for (start, word) in
            [(&b"\x09WSP"[..], "stripped"), (b"\x89WSP\n", "line endings"), (b"CDF\x01....", "another")]
        {
            assert!(matches!(check_magic(start), Err(Error::Foreign(why)) if why.contains(word)));
        }
    }
}
