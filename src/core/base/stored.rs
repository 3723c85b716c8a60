//! The types of numbers as files store them: those of samples, and integers of 64 bits, which are samples of 32.

use crate::base::sample::SampleType;
use std::fmt;
use wavesplat_format::NumberType;

/// The type of a stored number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names say it")]
pub enum StoredType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F16,
    F32,
    F64,
}

/// Each type, that of its samples, and that of such numbers in a description, which has no halves.
const TYPES: [(StoredType, SampleType, Option<NumberType>); 11] = [
    (StoredType::U8, SampleType::U8, Some(NumberType::U8)),
    (StoredType::I8, SampleType::I8, Some(NumberType::I8)),
    (StoredType::U16, SampleType::U16, Some(NumberType::U16)),
    (StoredType::I16, SampleType::I16, Some(NumberType::I16)),
    (StoredType::U32, SampleType::U32, Some(NumberType::U32)),
    (StoredType::I32, SampleType::I32, Some(NumberType::I32)),
    (StoredType::U64, SampleType::U32, Some(NumberType::U64)),
    (StoredType::I64, SampleType::I32, Some(NumberType::I64)),
    (StoredType::F16, SampleType::F16, None),
    (StoredType::F32, SampleType::F32, Some(NumberType::F32)),
    (StoredType::F64, SampleType::F64, Some(NumberType::F64)),
];

impl From<SampleType> for StoredType {
    fn from(ty: SampleType) -> Self {
        let own = TYPES.iter().find(|(stored, sample, _)| *sample == ty && !stored.is_64_bit());
        own.map_or(Self::F64, |(stored, ..)| *stored)
    }
}

impl StoredType {
    /// Every type.
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        TYPES.into_iter().map(|(stored, ..)| stored)
    }

    /// The type of numbers in a description; none for characters.
    pub fn from_number(ty: NumberType) -> Option<Self> {
        TYPES.into_iter().find(|(.., number)| *number == Some(ty)).map(|(stored, ..)| stored)
    }

    /// The type of such numbers in a description; none for halves.
    pub const fn number(self) -> Option<NumberType> {
        TYPES[self as usize].2
    }

    /// The type of the samples that such numbers are.
    pub const fn sample(self) -> SampleType {
        TYPES[self as usize].1
    }

    /// Whether it has more bits than its samples.
    pub const fn is_64_bit(self) -> bool {
        matches!(self, Self::I64 | Self::U64)
    }

    /// Bytes of one number.
    pub const fn size(self) -> usize {
        if self.is_64_bit() { 8 } else { self.sample().size() }
    }

    /// Its name in messages.
    pub const fn name(self) -> &'static str {
        match self {
            Self::I64 => "i64",
            Self::U64 => "u64",
            _ => self.sample().name(),
        }
    }

    /// Turns the byte order of every number.
    pub fn swap_endian(self, bytes: &mut [u8]) {
        bytes.chunks_exact_mut(self.size()).for_each(<[u8]>::reverse);
    }
}

impl fmt::Display for StoredType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_integers_of_64_bits_differ_from_their_samples() {
        for (number, ty) in StoredType::all().enumerate() {
            assert_eq!(TYPES[number].0 as usize, number, "rows are in the order of the types");
            assert_eq!(ty.is_64_bit(), ty.size() != ty.sample().size());
            assert_eq!(ty.is_64_bit(), ty.name() != ty.sample().name());
            assert_eq!(ty.is_64_bit(), StoredType::from(ty.sample()) != ty);
            assert!(ty.number().is_none_or(|number| StoredType::from_number(number) == Some(ty)));
            assert!(ty.number().is_none_or(|number| number.size() == ty.size()));
        }
        let mut bytes = [1, 2, 3, 4, 5, 6, 7, 8];
        StoredType::I64.swap_endian(&mut bytes);
        assert_eq!(bytes, [8, 7, 6, 5, 4, 3, 2, 1]);
        StoredType::U16.swap_endian(&mut bytes);
        assert_eq!(bytes, [7, 8, 5, 6, 3, 4, 1, 2]);
    }
}
