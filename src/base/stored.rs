//! The types of numbers as files store them: those of samples, and integers of 64 bits, which are samples of 32.

use crate::base::sample::{self, SampleType};
use std::fmt;

/// The type of a stored number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum StoredType {
    /// A type that samples have too.
    Sample(SampleType),
    /// Signed, of 64 bits.
    I64,
    /// Unsigned, of 64 bits.
    U64,
}

impl From<SampleType> for StoredType {
    fn from(ty: SampleType) -> Self {
        Self::Sample(ty)
    }
}

impl StoredType {
    /// Every type.
    #[cfg(test)]
    pub(crate) fn all() -> impl Iterator<Item = Self> {
        SampleType::ALL.into_iter().map(Self::Sample).chain([Self::I64, Self::U64])
    }

    /// Bytes of one number.
    pub(crate) const fn size(self) -> usize {
        match self {
            Self::Sample(ty) => ty.size(),
            Self::I64 | Self::U64 => 8,
        }
    }

    /// What it is called in messages.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Sample(ty) => ty.name(),
            Self::I64 => "i64",
            Self::U64 => "u64",
        }
    }

    /// The type of the samples that such numbers are.
    pub(crate) const fn sample(self) -> SampleType {
        match self {
            Self::Sample(ty) => ty,
            Self::I64 => SampleType::I32,
            Self::U64 => SampleType::U32,
        }
    }

    /// Whether it has more bits than its samples.
    pub(crate) const fn is_wide(self) -> bool {
        matches!(self, Self::I64 | Self::U64)
    }

    /// Turns the byte order of every number.
    pub(crate) fn swap_endian(self, bytes: &mut [u8]) {
        let ty = if let Self::Sample(ty) = self { ty } else { SampleType::F64 }; // as many bytes
        sample::swap_endian(ty, bytes);
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
        for ty in StoredType::all() {
            assert_eq!(ty.is_wide(), ty.size() != ty.sample().size());
            assert_eq!(ty.is_wide(), ty.name() != ty.sample().name());
        }
        let mut bytes = [1, 2, 3, 4, 5, 6, 7, 8];
        StoredType::I64.swap_endian(&mut bytes);
        assert_eq!(bytes, [8, 7, 6, 5, 4, 3, 2, 1]);
        StoredType::Sample(SampleType::U16).swap_endian(&mut bytes);
        assert_eq!(bytes, [7, 8, 5, 6, 3, 4, 1, 2]);
    }
}
