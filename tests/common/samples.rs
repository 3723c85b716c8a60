//! Converts numbers to little-endian samples and back, without the library.

use half::f16;
use wavesplat::base::sample::SampleType;

pub(crate) const TYPES: [SampleType; 9] = [
    SampleType::U8,
    SampleType::I8,
    SampleType::U16,
    SampleType::I16,
    SampleType::U32,
    SampleType::I32,
    SampleType::F16,
    SampleType::F32,
    SampleType::F64,
];

/// Rounds a number to the nearest finite sample.
pub(crate) fn append(ty: SampleType, value: f64, out: &mut Vec<u8>) {
    match ty {
        SampleType::U8 => out.push(value.round() as u8),
        SampleType::I8 => out.extend((value.round() as i8).to_le_bytes()),
        SampleType::U16 => out.extend((value.round() as u16).to_le_bytes()),
        SampleType::I16 => out.extend((value.round() as i16).to_le_bytes()),
        SampleType::U32 => out.extend((value.round() as u32).to_le_bytes()),
        SampleType::I32 => out.extend((value.round() as i32).to_le_bytes()),
        SampleType::F16 => out.extend(nearest_half(value.clamp(-65504.0, 65504.0)).to_le_bytes()),
        SampleType::F32 => out.extend((value.clamp(f32::MIN.into(), f32::MAX.into()) as f32).to_le_bytes()),
        SampleType::F64 => out.extend(value.to_le_bytes()),
    }
}

pub(crate) fn bytes(ty: SampleType, values: &[f64]) -> Vec<u8> {
    let mut out = Vec::new();
    values.iter().for_each(|v| append(ty, *v, &mut out));
    out
}

/// The exact values of samples.
pub(crate) fn numbers(ty: SampleType, bytes: &[u8]) -> Vec<f64> {
    bytes.chunks_exact(ty.size()).map(|b| number(ty, b)).collect()
}

fn number(ty: SampleType, b: &[u8]) -> f64 {
    match ty {
        SampleType::U8 => b[0].into(),
        SampleType::I8 => i8::from_le_bytes([b[0]]).into(),
        SampleType::U16 => u16::from_le_bytes([b[0], b[1]]).into(),
        SampleType::I16 => i16::from_le_bytes([b[0], b[1]]).into(),
        SampleType::U32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
        SampleType::I32 => i32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
        SampleType::F16 => f16::from_le_bytes([b[0], b[1]]).into(),
        SampleType::F32 => f32::from_le_bytes([b[0], b[1], b[2], b[3]]).into(),
        SampleType::F64 => f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]),
    }
}

/// A NaN with a payload, an infinity, or a negative NaN; for floats only.
pub(crate) fn special(ty: SampleType, which: usize) -> Vec<u8> {
    match ty {
        SampleType::F16 => [0x7e12_u16, 0x7c00, 0xfc00, 0xfd01][which % 4].to_le_bytes().into(),
        SampleType::F32 => [0x7fc0_1234_u32, 0x7f80_0000, 0xff80_0000, 0xffa0_0001][which % 4].to_le_bytes().into(),
        SampleType::F64 => {
            [0x7ff8_1234_5678_9abc_u64, 0x7ff0_0000_0000_0000, 0xfff0_0000_0000_0000, 0xfff4_0000_0000_0001][which % 4]
                .to_le_bytes()
                .into()
        }
        _ => unreachable!("{ty} has no such value"),
    }
}

/// The nearest half-precision number, with ties to the even one. Searches all numbers.
fn nearest_half(value: f64) -> f16 {
    let (mut low, mut high) = (0_u16, f16::MAX.to_bits()); // magnitudes grow with their bits
    while low < high {
        let middle = low + (high - low).div_ceil(2);
        if f64::from(f16::from_bits(middle)) <= value.abs() { low = middle } else { high = middle - 1 }
    }
    let next = (low + 1).min(f16::MAX.to_bits());
    let off = |bits: u16| (f64::from(f16::from_bits(bits)) - value.abs()).abs();
    let nearest = match off(low).total_cmp(&off(next)) {
        std::cmp::Ordering::Equal => low + (low & 1),
        std::cmp::Ordering::Less => low,
        std::cmp::Ordering::Greater => next,
    };
    f16::from_bits(nearest | if value.is_sign_negative() { 0x8000 } else { 0 })
}
