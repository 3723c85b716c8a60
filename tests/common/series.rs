//! Series for which error bounds are hard to keep.

use super::random::Random;
use super::samples::{append, special};
use wavesplat::base::sample::SampleType;

/// The shape of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Constant,
    Ramp,
    Alternation,
    Flash,
    TinyOnLarge,
    NearTheLargest,
    Subnormal,
    Spike,
    AnyBits,
    SignedZero,
    Noise,
    Wave,
    BelowSingle,
    Steps,
    /// A different kind for every voxel.
    Mixed,
}

pub(crate) const KINDS: [Kind; 15] = [
    Kind::Constant,
    Kind::Ramp,
    Kind::Alternation,
    Kind::Flash,
    Kind::TinyOnLarge,
    Kind::NearTheLargest,
    Kind::Subnormal,
    Kind::Spike,
    Kind::AnyBits,
    Kind::SignedZero,
    Kind::Noise,
    Kind::Wave,
    Kind::BelowSingle,
    Kind::Steps,
    Kind::Mixed,
];

/// Which samples are missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Mask {
    None,
    /// NaN and infinities at scattered samples (floats only).
    Special,
    /// This declared value, wherever it occurs.
    Declared(f64),
    /// All frames of most voxels, and all voxels of some frames (floats only).
    Most,
    /// All but one frame in eleven, another one in each voxel (floats only).
    NearlyAll,
}

/// Smallest and largest sample, and the smallest step from zero.
pub(crate) fn extremes(ty: SampleType) -> (f64, f64, f64) {
    match ty {
        SampleType::U8 => (0.0, 255.0, 1.0),
        SampleType::I8 => (-128.0, 127.0, 1.0),
        SampleType::U16 => (0.0, 65535.0, 1.0),
        SampleType::I16 => (-32768.0, 32767.0, 1.0),
        SampleType::U32 => (0.0, 4_294_967_295.0, 1.0),
        SampleType::I32 => (-2_147_483_648.0, 2_147_483_647.0, 1.0),
        SampleType::F16 => (-65504.0, 65504.0, 2f64.powi(-24)),
        SampleType::F32 => (f32::MIN.into(), f32::MAX.into(), f32::from_bits(1).into()),
        SampleType::F64 => (f64::MIN, f64::MAX, 5e-324),
    }
}

/// The values of one series before conversion to samples; `offset` and `height` are those of the volume.
fn values(
    kind: Kind,
    ty: SampleType,
    (offset, height): (f64, f64),
    frames: usize,
    voxel: usize,
    random: &mut Random,
) -> Vec<f64> {
    let (lo, hi, least) = extremes(ty);
    let own = height * random.signed();
    let place = voxel % frames;
    let value = |t: usize| match kind {
        Kind::Constant => offset + own,
        Kind::Ramp => offset + own * t as f64 / frames as f64,
        Kind::Alternation => offset + if (t + voxel).is_multiple_of(2) { own } else { -own },
        Kind::Flash => offset + if t == place { own } else { 0.0 },
        Kind::TinyOnLarge => 1e6 + 1e-3 * random.signed(),
        Kind::NearTheLargest => {
            if random.bits() & 1 == 0 {
                hi * random.unit().sqrt()
            } else {
                lo * random.unit().sqrt()
            }
        }
        Kind::Subnormal => least * (random.below(9) as f64 - 4.0),
        Kind::Spike => {
            if voxel % 50 == 7 && t == place {
                hi.min(1e30)
            } else {
                1e-3 * random.signed()
            }
        }
        Kind::AnyBits if ty == SampleType::F64 => f64::from_bits(random.bits()),
        Kind::AnyBits => f64::from(f32::from_bits(random.bits() as u32)),
        Kind::SignedZero => [0.0, -0.0, -0.0, least, -least, own][random.below(6)],
        Kind::Noise => offset + height * random.signed(),
        Kind::Wave => offset + own * (0.2 * t as f64 * (1.0 + own.abs() / height) + voxel as f64).sin(),
        Kind::BelowSingle => 1.0 + 1e-9 * random.signed() * height.min(1.0),
        Kind::Steps => (offset + own + (t / (1 + voxel % 7)) as f64).round() + 0.5,
        Kind::Mixed => unreachable!("chosen by the caller"),
    };
    (0..frames).map(value).map(|v| if v.is_finite() { v } else { 0.25 }).collect()
}

/// A volume of series as samples, t slowest.
pub(crate) fn volume(kind: Kind, ty: SampleType, mask: Mask, voxels: usize, frames: usize, seed: u64) -> Vec<u8> {
    let mut random = Random(seed);
    let (lo, hi, _) = extremes(ty);
    let height =
        if ty.is_float() { 10f64.powi(random.below(7) as i32 - 3) } else { (hi - lo) * 0.5 * random.unit().powi(3) };
    let offset = if ty.is_float() { random.signed() * 10.0 } else { (hi + lo) / 2.0 };
    let mut series = Vec::new();
    for voxel in 0..voxels {
        let kind = if kind == Kind::Mixed { KINDS[random.below(KINDS.len() - 1)] } else { kind };
        series.push(values(kind, ty, (offset, height), frames, voxel, &mut random));
    }
    let mut out = Vec::new();
    for t in 0..frames {
        for (voxel, values) in series.iter().enumerate() {
            let missing = match mask {
                Mask::Special => random.below(12) == 0 || voxel % 9 == 4,
                Mask::Most => voxel % 5 != 2 || t % 8 == 1,
                Mask::NearlyAll => (t + voxel) % 11 != 0,
                Mask::Declared(value) if random.below(7) == 0 => {
                    append(ty, value, &mut out);
                    continue;
                }
                _ => false,
            };
            if missing { out.extend(special(ty, random.below(4))) } else { append(ty, values[t], &mut out) }
        }
    }
    out
}
