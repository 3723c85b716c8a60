//! The fields and codes of a NIfTI header. It has 348 bytes in version 1 and 540 in version 2, in
//! either byte order.

use crate::shared::types::Types;
use wavesplat_core::base::stored::StoredType;

/// Bytes of the header of version 1.
pub(super) const FIRST: usize = 348;

/// Bytes of the header of version 2.
pub(super) const SECOND: usize = 540;

/// The offsets of fields. Real numbers have 32 bits in version 1 and 64 in version 2, codes 16 and 32, lengths 16 and 64.
pub(super) struct Offsets {
    /// The magic of a file with header and samples; a header alone has `ni` for `n+`.
    pub(super) magic: (usize, &'static [u8]),
    /// A number of 16 bits, then another with the bits of a sample.
    pub(super) datatype: usize,
    /// Lengths: the number of axes, and then that of each.
    pub(super) dim: usize,
    /// Reals: the hand of the axes, and the step along each.
    pub(super) pixdim: usize,
    /// A real number in version 1, a length in version 2.
    pub(super) vox_offset: usize,
    /// Reals: slope and intercept.
    pub(super) slope: usize,
    /// A real: the time of the first frame.
    pub(super) toffset: usize,
    /// The code of the units of space and time. All of them fit in the first byte.
    pub(super) units: usize,
    /// Codes: of the qform, and of the sform.
    pub(super) form_codes: usize,
    /// Reals: b, c, d of a quaternion.
    pub(super) quaternion: usize,
    /// Reals: where the first voxel is by the qform.
    pub(super) qoffset: usize,
    /// Reals: rows of an affine matrix.
    pub(super) sform: usize,
    /// A text of 16 bytes.
    pub(super) intent_name: usize,
}

const OF_FIRST: Offsets = Offsets {
    magic: (344, b"n+1\0"),
    datatype: 70,
    dim: 40,
    pixdim: 76,
    vox_offset: 108,
    slope: 112,
    toffset: 136,
    units: 123,
    form_codes: 252,
    quaternion: 256,
    qoffset: 268,
    sform: 280,
    intent_name: 328,
};

const OF_SECOND: Offsets = Offsets {
    magic: (4, b"n+2\0\r\n\x1a\n"),
    datatype: 12,
    dim: 16,
    pixdim: 104,
    vox_offset: 168,
    slope: 176,
    toffset: 216,
    units: 500,
    form_codes: 344,
    quaternion: 352,
    qoffset: 376,
    sform: 400,
    intent_name: 508,
};

/// Codes of types.
pub(super) const DATATYPES: Types<i64> = Types(&[
    (StoredType::U8, &[2]),
    (StoredType::I16, &[4]),
    (StoredType::I32, &[8]),
    (StoredType::F32, &[16]),
    (StoredType::F64, &[64]),
    (StoredType::I8, &[256]),
    (StoredType::U16, &[512]),
    (StoredType::U32, &[768]),
    (StoredType::I64, &[1024]),
    (StoredType::U64, &[1280]),
]);

/// Codes of other types.
pub(super) const UNSUPPORTED: [(i64, &str); 7] = [
    (1, "single bits"),
    (32, "complex numbers of 2 x 32 bits"),
    (128, "colours of 3 x 8 bits"),
    (1536, "floats of 128 bits"),
    (1792, "complex numbers of 2 x 64 bits"),
    (2048, "complex numbers of 2 x 128 bits"),
    (2304, "colours of 4 x 8 bits"),
];

/// Codes of units, and their names, the one that is read first.
type UnitCodes = &'static [(u8, &'static [&'static str])];

pub(super) const SPACE_UNITS: UnitCodes = &[(1, &["m", "metre", "meter"]), (2, &["mm"]), (3, &["um", "\u{b5}m"])];

pub(super) const TIME_UNITS: UnitCodes = &[(8, &["s", "sec", "seconds"]), (16, &["ms"]), (24, &["us", "\u{b5}s"])];

/// Units of a fourth axis that is not time.
pub(super) const OTHER_UNITS: UnitCodes = &[(32, &["Hz"]), (40, &["ppm"]), (48, &["rad/s"])];

/// The bytes of a header.
#[derive(Debug, Clone, Copy)]
pub(super) struct NiftiBytes<B> {
    pub(super) bytes: B,
    pub(super) big_endian: bool,
}

impl<B: AsRef<[u8]>> NiftiBytes<B> {
    pub(super) fn is_first(&self) -> bool {
        self.bytes.as_ref().len() == FIRST
    }

    pub(super) fn offsets(&self) -> &'static Offsets {
        if self.is_first() { &OF_FIRST } else { &OF_SECOND }
    }

    /// The bytes of a number, the least significant one first.
    pub(super) fn get<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut bytes = [0; N];
        bytes.copy_from_slice(&self.bytes.as_ref()[at..at + N]);
        if self.big_endian {
            bytes.reverse();
        }
        bytes
    }

    /// A length.
    pub(super) fn length(&self, at: usize, index: usize) -> i64 {
        match self.is_first() {
            true => i16::from_le_bytes(self.get(at + 2 * index)).into(),
            false => i64::from_le_bytes(self.get(at + 8 * index)),
        }
    }

    /// A code.
    pub(super) fn code(&self, at: usize, index: usize) -> i64 {
        match self.is_first() {
            true => i16::from_le_bytes(self.get(at + 2 * index)).into(),
            false => i32::from_le_bytes(self.get(at + 4 * index)).into(),
        }
    }

    /// A real number.
    pub(super) fn real(&self, at: usize, index: usize) -> f64 {
        match self.is_first() {
            true => f32::from_le_bytes(self.get(at + 4 * index)).into(),
            false => f64::from_le_bytes(self.get(at + 8 * index)),
        }
    }
}
