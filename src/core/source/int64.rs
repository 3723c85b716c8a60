//! Converts 64-bit integers to samples that hold them exactly.

use crate::base::sample::{self, SampleType};
use crate::base::stored::StoredType;

/// A stored integer that does not fit in its sample type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Unfit {
    /// Its place among the integers.
    pub(crate) index: usize,
    pub(crate) value: i128,
}

impl Unfit {
    /// The message about the integer at a voxel.
    pub(crate) fn message(&self, [x, y, z]: [usize; 3], sample: SampleType) -> String {
        let value = self.value;
        format!("voxel ({x}, {y}, {z}) is {value}, which no {sample} sample is exactly: write the array as f32 or f64")
    }
}

/// The integers of little-endian bytes.
fn integers(stored: StoredType, bytes: &[u8]) -> impl Iterator<Item = i128> {
    let is_signed = stored == StoredType::I64;
    let integer =
        move |b: &[u8; 8]| if is_signed { i64::from_le_bytes(*b).into() } else { u64::from_le_bytes(*b).into() };
    bytes.as_chunks().0.iter().map(integer)
}

/// Fills `out` with samples (little-endian) of half as many bytes.
pub(crate) fn narrow(stored: StoredType, bytes: &[u8], out: &mut [u8]) -> Result<(), Unfit> {
    let is_signed = stored == StoredType::I64;
    for ((index, value), out) in integers(stored, bytes).enumerate().zip(out.as_chunks_mut().0) {
        let sample = if is_signed {
            i32::try_from(value).map(i32::to_le_bytes)
        } else {
            u32::try_from(value).map(u32::to_le_bytes)
        };
        *out = sample.map_err(|_| Unfit { index, value })?;
    }
    Ok(())
}

/// Fills `out` with the samples (little-endian, of type `ty`) that `unpacked` makes of integers. One that an f64 does not
/// hold exactly is an error, unless its sample is NaN.
pub(crate) fn unpack(
    stored: StoredType,
    ty: SampleType,
    unpacked: impl Fn(f64) -> f64,
    bytes: &[u8],
    out: &mut [u8],
) -> Result<(), Unfit> {
    for ((index, value), out) in integers(stored, bytes).enumerate().zip(out.chunks_exact_mut(ty.size())) {
        let (number, sample) = (value as f64, unpacked(value as f64));
        if number as i128 != value && !sample.is_nan() {
            return Err(Unfit { index, value });
        }
        sample::store(ty, &[sample], out);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::source::packing::Packing;

    fn bytes(values: &[i64]) -> Vec<u8> {
        values.iter().flat_map(|value| value.to_le_bytes()).collect()
    }

    #[test]
    fn integers_that_fit_stay_as_they_are_and_others_are_named() {
        let (least, most) = (i64::from(i32::MIN), i64::from(i32::MAX));
        let mut out = vec![0; 12];
        assert_eq!(narrow(StoredType::I64, &bytes(&[least, -1, most]), &mut out), Ok(()));
        assert_eq!(out, [i32::MIN, -1, i32::MAX].map(i32::to_le_bytes).concat());
        let found = narrow(StoredType::I64, &bytes(&[0, least - 1, 0]), &mut out);
        assert_eq!(found, Err(Unfit { index: 1, value: i128::from(least) - 1 }));
        assert_eq!(narrow(StoredType::U64, &bytes(&[0, i64::from(u32::MAX), 7]), &mut out), Ok(()));
        assert_eq!(out, [0, u32::MAX, 7].map(u32::to_le_bytes).concat());
        let found = narrow(StoredType::U64, &bytes(&[0, 0, -1]), &mut out);
        assert_eq!(found, Err(Unfit { index: 2, value: u64::MAX.into() }));
    }

    #[test]
    fn packed_integers_are_exact_or_missing() {
        let packing = Packing { missing: vec![i64::MIN as f64], ..Packing::scaled(0.5, 1.0) };
        let mut out = vec![0; 24];
        assert_eq!(packing.unpack(StoredType::I64, &bytes(&[i64::MIN + 1, 1 << 53, -4]), &mut out), Ok(()));
        let mut values = [0.0; 3];
        sample::load(SampleType::F64, &out, &mut values);
        assert!(values[0].is_nan() && values[1..] == [2_f64.powi(52) + 1.0, -1.0], "{values:?}");
        let large = (1 << 53) + 1;
        let found = packing.unpack(StoredType::I64, &bytes(&[large]), &mut out);
        assert_eq!(found, Err(Unfit { index: 0, value: large.into() }));
    }
}
