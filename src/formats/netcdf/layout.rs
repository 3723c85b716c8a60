//! What classic NetCDF files are made of.

use wavesplat_core::base::description::NumberType;

/// How every classic file starts; the number of its form follows.
pub(super) const MAGIC: &[u8] = b"CDF";

/// Zeros after the values of a variable fill up to a multiple of this many bytes.
pub(super) const ALIGNMENT: u64 = 4;

/// Tags of lists.
pub(super) const DIMENSIONS: u32 = 0x0a;
pub(super) const VARIABLES: u32 = 0x0b;
pub(super) const ATTRIBUTES: u32 = 0x0c;

/// The code of text.
pub(super) const TEXT: u32 = 2;

/// The attribute with the value of missing samples.
pub(super) const FILL: &str = "_FillValue";

/// The code of a type.
pub(super) fn code(ty: NumberType) -> u32 {
    match ty {
        NumberType::I8 => 1,
        NumberType::Char => TEXT,
        NumberType::I16 => 3,
        NumberType::I32 => 4,
        NumberType::F32 => 5,
        NumberType::F64 => 6,
        NumberType::U8 => 7,
        NumberType::U16 => 8,
        NumberType::U32 => 9,
        NumberType::I64 => 10,
        NumberType::U64 => 11,
    }
}
