//! What decoded samples need so that the sums of a block's frames are those of the source.

use crate::bits::{put_varint, take_varint};
use crate::bytes::{FieldReader, FieldWriter, ensure};

/// What keeps the sums of a block's frames.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SumCodes {
    /// Samples of a float type: a code times this is added to each sample of its frame.
    pub unit: f64,
    /// For each frame. Of an integer type: what is added to the sum, spread evenly over the samples.
    pub frames: Vec<i64>,
    /// Samples, `frame * voxels + voxel`, that stay as they are: they would leave their bound. They ascend.
    pub unshifted: Vec<u32>,
}

/// The largest magnitude of a code: floats hold it exactly.
const MOST: u64 = 1 << 53;

impl SumCodes {
    /// The number of frames whose samples change.
    pub fn count(&self) -> u64 {
        self.frames.iter().filter(|code| **code != 0).count() as u64
    }

    /// Whether codes can be stored.
    pub fn is_valid(&self) -> bool {
        self.unit.is_finite() && self.unit > 0.0 && self.frames.iter().all(|code| code.unsigned_abs() <= MOST)
    }
}

/// Packs the codes: the unit, then the lowest bytes of all frames, the next bytes, and so on, then the gaps between unshifted samples.
/// Codes 0, -1, 1, -2 are 0, 1, 2, 3.
pub fn pack_sums(codes: &SumCodes, out: &mut Vec<u8>) {
    out.put_f64(codes.unit);
    let unsigned = codes.frames.iter().map(|code| ((code << 1) ^ (code >> 63)).to_le_bytes());
    out.extend((0..8).flat_map(|byte| unsigned.clone().map(move |bytes| bytes[byte])));
    let mut next = 0;
    for sample in &codes.unshifted {
        put_varint((sample - next) as usize, out);
        next = sample + 1;
    }
}

/// Unpacks what [`pack_sums`] packed, for a block of so many frames and samples.
///
/// # Errors
/// The reason, if that is impossible.
pub fn unpack_sums(raw: &[u8], frames: usize, samples: usize) -> Result<SumCodes, String> {
    let mut fields = FieldReader::new(raw);
    let (unit, bytes) = (fields.f64()?, fields.take(8 * frames)?);
    let mut gaps = fields.take(fields.remaining())?;
    let (mut unshifted, mut next) = (Vec::new(), 0);
    while !gaps.is_empty() {
        let sample = take_varint(&mut gaps)?.saturating_add(next);
        ensure(sample < samples, || format!("sample {sample} of {samples}"))?;
        ensure(unshifted.len() < most_unshifted(samples), || "too many samples stay unshifted".into())?;
        unshifted.push(sample as u32);
        next = sample + 1;
    }
    let of_frame = |frame: usize| u64::from_le_bytes(std::array::from_fn(|byte| bytes[byte * frames + frame]));
    let signed = |code: u64| (code >> 1) as i64 ^ -((code & 1) as i64);
    let codes = SumCodes { unit, frames: (0..frames).map(of_frame).map(signed).collect(), unshifted };
    ensure(codes.is_valid(), || format!("a unit of {unit} or a code out of range"))?;
    Ok(codes)
}

/// The most samples of a block of so many that stay unshifted.
pub fn most_unshifted(samples: usize) -> usize {
    samples / 4
}

/// The most bytes of the payload for so many frames and samples: a gap takes at most 5.
pub(crate) fn max_sums(frames: usize, samples: usize) -> usize {
    8 + 8 * frames + 5 * most_unshifted(samples)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_read_as_written() {
        let (frames, unshifted) = (vec![0, -1, 1, 300, -(1 << 53), 1 << 53], vec![0, 2, 3, 1000, 1199]);
        let codes = SumCodes { unit: 0.25, frames, unshifted };
        let mut raw = Vec::new();
        pack_sums(&codes, &mut raw);
        assert_eq!(raw[8 + 8 * 6..], [0, 1, 0, 0xe4, 7, 0xc6, 1]);
        assert_eq!(&raw[8..20], [0, 1, 2, 88, 255, 0, 0, 0, 0, 2, 255, 0]);
        assert_eq!(unpack_sums(&raw, 6, 1200), Ok(codes));
        assert!(unpack_sums(&raw, 6, 1199).is_err() && unpack_sums(&raw[..raw.len() - 1], 6, 1200).is_err());
    }

    #[test]
    fn impossible_codes_are_refused() {
        let mut raw = Vec::new();
        pack_sums(&SumCodes { unit: 1.0, frames: vec![5, (1 << 53) + 1], ..SumCodes::default() }, &mut raw);
        assert!(unpack_sums(&raw, 2, 9).is_err_and(|what| what.contains("out of range")));
        assert!(unpack_sums(&raw, 3, 9).is_err() && unpack_sums(&[], 0, 9).is_err());
        for unit in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            raw.clear();
            pack_sums(&SumCodes { unit, frames: vec![5], ..SumCodes::default() }, &mut raw);
            assert!(unpack_sums(&raw, 1, 9).is_err(), "{unit}");
        }
    }
}
