//! Stored numbers that are scaled and have missing values.

use super::int64::{self, Unfit};
use crate::base::sample::{self, SampleType};
use crate::base::stored::StoredType;

/// How stored numbers become samples: `stored * scale + offset`, NaN for what is missing.
#[derive(Debug, Clone, PartialEq)]
pub struct Packing {
    /// The factor.
    pub scale: f64,
    /// What is added to the product.
    pub offset: f64,
    /// Stored numbers that stand for missing samples.
    pub missing: Vec<f64>,
    /// The least and the largest stored number that is valid.
    pub valid: (f64, f64),
}

impl Packing {
    /// Numbers that are samples without scaling.
    pub const NONE: Self =
        Self { scale: 1.0, offset: 0.0, missing: Vec::new(), valid: (f64::NEG_INFINITY, f64::INFINITY) };

    /// Numbers that are scaled.
    pub fn scaled(scale: f64, offset: f64) -> Self {
        Self { scale, offset, ..Self::NONE }
    }

    /// The type of the samples: f32 if it is fine enough for the scaled numbers, else f64.
    pub fn sample(&self, stored: SampleType) -> SampleType {
        let fine = self.scale.abs() / 4.0;
        match stored {
            SampleType::U32 | SampleType::I32 | SampleType::F64 => SampleType::F64,
            _ if !stored.is_float() && sample::rounding(SampleType::F32, self.offset.abs()) > fine => SampleType::F64,
            _ => SampleType::F32,
        }
    }

    /// The sample of a stored number.
    pub(crate) fn value(&self, stored: f64) -> f64 {
        let valid = self.valid.0 <= stored && stored <= self.valid.1 && !self.missing.contains(&stored);
        if valid { stored * self.scale + self.offset } else { f64::NAN }
    }

    /// Fills `out` with samples (little-endian, of the type that [`Packing::sample`] says) of stored numbers
    /// (little-endian).
    ///
    /// # Errors
    /// Integers of 64 bits that are not exactly a sample.
    pub(crate) fn unpack(&self, stored: StoredType, bytes: &[u8], out: &mut [u8]) -> Result<(), Unfit> {
        let ty = self.sample(stored.sample());
        if stored.is_64_bit() {
            return int64::unpack(stored, ty, |number| self.value(number), bytes, out);
        }
        let stored = stored.sample();
        let mut values = Vec::new();
        sample::for_each_run(stored, bytes, |first, numbers| {
            values.clear();
            values.extend(numbers.iter().map(|number| self.value(*number)));
            sample::store(ty, &values, &mut out[first * ty.size()..][..values.len() * ty.size()]);
        });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_scaled_and_missing_ones_are_not_a_number() {
        let packing = Packing { missing: vec![-7.0], valid: (-50.0, 50.0), ..Packing::scaled(0.5, 3.0) };
        let stored: Vec<u8> = [0_i16, -7, 4, 51, -50].into_iter().flat_map(i16::to_le_bytes).collect();
        let mut out = vec![0; 20];
        packing.unpack(SampleType::I16.into(), &stored, &mut out).expect("16 bits");
        let mut values = [0.0; 5];
        sample::load(SampleType::F32, &out, &mut values);
        assert_eq!(Packing::scaled(1e-5, 300.0).sample(SampleType::I16), SampleType::F64);
        assert_eq!(values.map(|v| if v.is_nan() { 99.0 } else { v }), [3.0, 99.0, 5.0, 99.0, -22.0]);
    }
}
