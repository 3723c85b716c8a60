//! The types of numbers in HDF5, and their bytes.

use hdf5_reader::error::Error as Hdf5Error;
use hdf5_reader::{ByteOrder, Dataset, Datatype, EnumMember, H5Type};
use wavesplat_core::base::description::NumberType;
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::Parsed;

/// Runs an expression for numbers of a size in bytes.
macro_rules! sized {
    ($size:expr, |$n:ident| $run:expr) => {
        match $size {
            1 => {
                const $n: usize = 1;
                $run
            }
            2 => {
                const $n: usize = 2;
                $run
            }
            4 => {
                const $n: usize = 4;
                $run
            }
            _ => {
                const $n: usize = 8;
                $run
            }
        }
    };
}
pub(super) use sized;

pub(super) fn number_type(ty: &Datatype) -> Parsed<NumberType> {
    stored_type(ty)?.number().ok_or_else(|| format!("{} is not kept", kind(ty)))
}

pub(super) fn stored_type(ty: &Datatype) -> Parsed<StoredType> {
    Ok(match *ty {
        Datatype::FixedPoint { size: 1, signed: false, .. } => StoredType::U8,
        Datatype::FixedPoint { size: 1, signed: true, .. } => StoredType::I8,
        Datatype::FixedPoint { size: 2, signed: false, .. } => StoredType::U16,
        Datatype::FixedPoint { size: 2, signed: true, .. } => StoredType::I16,
        Datatype::FixedPoint { size: 4, signed: false, .. } => StoredType::U32,
        Datatype::FixedPoint { size: 4, signed: true, .. } => StoredType::I32,
        Datatype::FixedPoint { size: 8, signed: false, .. } => StoredType::U64,
        Datatype::FixedPoint { size: 8, signed: true, .. } => StoredType::I64,
        Datatype::FloatingPoint { size: 2, .. } => StoredType::F16,
        Datatype::FloatingPoint { size: 4, .. } => StoredType::F32,
        Datatype::FloatingPoint { size: 8, .. } => StoredType::F64,
        Datatype::Enum { ref base, ref members }
            if is_bool(members) && matches!(**base, Datatype::FixedPoint { size: 1, .. }) =>
        {
            StoredType::U8
        }
        Datatype::Enum { ref base, .. } => stored_type(base)?,
        Datatype::Bitfield { size: 1, .. } => StoredType::U8,
        Datatype::Bitfield { size: 2, .. } => StoredType::U16,
        Datatype::Bitfield { size: 4, .. } => StoredType::U32,
        Datatype::Bitfield { size: 8, .. } => StoredType::U64,
        Datatype::FixedPoint { size, .. } => return Err(format!("integer of {size} bytes")),
        Datatype::FloatingPoint { size, .. } => return Err(format!("float of {size} bytes")),
        Datatype::String { .. } => return Err("text".into()),
        Datatype::Compound { .. } => return Err("compound".into()),
        ref other => return Err(kind(other)),
    })
}

/// The first word of a type's description.
fn kind(ty: &Datatype) -> String {
    format!("{ty:?}").split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().to_lowercase()
}

/// Whether an enumeration is NumPy's bool, as h5py writes it.
fn is_bool(members: &[EnumMember]) -> bool {
    let names: Vec<&str> = members.iter().map(|member| member.name.as_str()).collect();
    names == ["FALSE", "TRUE"]
}

/// Bytes of the description of a type before its properties.
const PROPERTIES: usize = 8;

/// Classes of types in their descriptions.
const INTEGERS: u8 = 0;
const FLOATS: u8 = 1;
const ENUMS: u8 = 8;

/// The properties of floats of IEEE 754 after their number of bits: places and lengths of exponent and mantissa, and the
/// bias.
const IEEE: [&[u8]; 3] = [&[10, 5, 0, 10, 15, 0, 0, 0], &[23, 8, 0, 23, 127, 0, 0, 0], &[52, 11, 0, 52, 0xff, 3, 0, 0]];

/// The flag of floats in the order of bytes of a VAX.
const VAX: u8 = 0x40;

/// An error for numbers that fill their bytes in another way than usual: other floats than those of IEEE 754, or
/// integers of some of the bits.
pub(super) fn check_form(dataset: &Dataset) -> Parsed<()> {
    let is_number =
        matches!(dataset.dtype(), Datatype::FixedPoint { .. } | Datatype::FloatingPoint { .. } | Datatype::Enum { .. });
    if !is_number || is_usual(&dataset.raw_datatype().map_err(|e| e.to_string())?) {
        return Ok(());
    }
    Err("its numbers are neither floats of IEEE 754 nor integers of whole bytes, and are not read".into())
}

/// Whether the stored description of a type says that its numbers fill their bytes as usual.
fn is_usual(description: &[u8]) -> bool {
    let Some((head, properties)) = description.split_first_chunk::<PROPERTIES>() else { return false };
    let [class, flags, _, _, size @ ..] = *head;
    let bits = u32::from_le_bytes(size).wrapping_mul(8).to_le_bytes();
    let is_whole = properties.starts_with(&[0, 0, bits[0], bits[1]]);
    match class & 0x0f {
        INTEGERS => is_whole,
        FLOATS => is_whole && flags & VAX == 0 && properties.get(4..12).is_some_and(|rest| IEEE.contains(&rest)),
        ENUMS => is_usual(properties),
        _ => true,
    }
}

/// The stored bytes of a sample, with the least significant one first.
#[derive(Debug, Clone, Copy)]
pub(super) struct StoredBytes<const N: usize>([u8; N]);

impl<const N: usize> H5Type for StoredBytes<N> {
    fn hdf5_type() -> Datatype {
        Datatype::FixedPoint { size: N as u8, signed: false, byte_order: ByteOrder::LittleEndian }
    }

    fn from_bytes(bytes: &[u8], ty: &Datatype) -> std::result::Result<Self, Hdf5Error> {
        let mut stored = [0; N];
        stored.copy_from_slice(bytes.get(..N).ok_or_else(|| Hdf5Error::InvalidData("a sample is cut short".into()))?);
        if byte_order(ty) == ByteOrder::BigEndian {
            stored.reverse();
        }
        Ok(Self(stored))
    }

    fn element_size(_ty: &Datatype) -> usize {
        N
    }
}

fn byte_order(ty: &Datatype) -> ByteOrder {
    match ty {
        Datatype::FixedPoint { byte_order, .. }
        | Datatype::FloatingPoint { byte_order, .. }
        | Datatype::Bitfield { byte_order, .. } => *byte_order,
        Datatype::Enum { base, .. } => self::byte_order(base),
        _ => ByteOrder::LittleEndian,
    }
}

/// The bytes of numbers, one after another.
pub(super) fn joined<const N: usize>(numbers: impl IntoIterator<Item = StoredBytes<N>>) -> Vec<u8> {
    numbers.into_iter().flat_map(|stored| stored.0).collect()
}
