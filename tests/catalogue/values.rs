//! Single values: zeros, subnormals, the largest numbers, and numbers that a narrower type could not distinguish.

use super::kept;
use crate::common::random::Random;
use crate::common::samples::{TYPES, bytes};
use crate::common::series::{Mask, extremes};
use wavesplat::base::sample::SampleType;
use wavesplat::convert::Bound;

const FLOATS: [SampleType; 3] = [SampleType::F16, SampleType::F32, SampleType::F64];

/// An archive with `frames` frames of 40 voxels.
fn archive(ty: SampleType, frames: usize, value: impl FnMut(usize) -> f64) -> Vec<u8> {
    bytes(ty, &Vec::from_iter((0..40 * frames).map(value)))
}

#[test]
fn zeros_keep_their_sign_without_a_tolerance_and_their_bound_with_one() {
    for ty in FLOATS {
        let mut random = Random(6);
        let samples = archive(ty, 9, |_| [0.0, -0.0, 1.0][random.below(3)]);
        // With a tolerance of 0, samples are compared bit for bit.
        kept(ty, Mask::None, 40, &samples, 0.0);
        kept(ty, Mask::None, 40, &samples, 0.1);
        kept(ty, Mask::None, 40, &archive(ty, 9, |i| if i % 2 == 0 { 0.0 } else { -0.0 }), 0.5);
    }
}

#[test]
fn subnormals_are_numbers_like_others() {
    for ty in FLOATS {
        let least = extremes(ty).2;
        for tolerance in [0.0, 1e-3, 0.1, 0.5] {
            let powers =
                archive(ty, 12, |i| least * 2f64.powi((i * 7 % 10) as i32) * if i % 3 == 0 { -1.0 } else { 1.0 });
            kept(ty, Mask::None, 40, &powers, tolerance);
            let tiny = archive(ty, 12, |i| (i * i % 23) as f64 * least);
            kept(ty, Mask::None, 40, &tiny, tolerance);
        }
    }
    let mut random = Random(38);
    let around = archive(SampleType::F32, 12, |_| 1e-38 * random.signed());
    kept(SampleType::F32, Mask::None, 40, &around, 1e-4);
}

#[test]
fn the_largest_numbers_do_not_overflow() {
    for ty in TYPES {
        let (lo, hi, _) = extremes(ty);
        for tolerance in [0.0, 1e-7, 1e-3, 0.4] {
            let mut random = Random(8);
            let ends = archive(ty, 16, |_| [lo, hi, 0.0][random.below(3)]);
            kept(ty, Mask::None, 40, &ends, tolerance);
            let near = archive(ty, 16, |_| if ty.is_float() { hi * (1.0 - 1e-3 * random.unit()) } else { hi });
            kept(ty, Mask::None, 40, &near, tolerance);
        }
    }
    the_largest_code_does_not_overflow(10);
    let mut random = Random(38);
    let large = archive(SampleType::F32, 16, |_| 1e38 * random.signed());
    kept(SampleType::F32, Mask::None, 40, &large, 1e-3);
}

#[test]
#[ignore = "exhaustive"]
fn the_code_of_the_largest_double_does_not_overflow_at_any_tolerance() {
    the_largest_code_does_not_overflow(1);
}

/// The code of the largest `f64` may decode to more than that. Tries every `step`-th tolerance.
fn the_largest_code_does_not_overflow(step: usize) {
    for tolerance in (1..200).step_by(step).map(|n| 1e-9 * f64::from(n) / 1.234) {
        let one = archive(SampleType::F64, 1, |i| if i == 1 { f64::MAX } else { 0.0 });
        kept(SampleType::F64, Mask::None, 40, &one, tolerance);
    }
}

#[test]
fn integers_reach_both_ends_of_their_range() {
    for ty in TYPES.into_iter().filter(|ty| !ty.is_float()) {
        let (lo, hi, _) = extremes(ty);
        let mut random = Random(21);
        let all = archive(ty, 20, |_| [lo, lo + 1.0, hi - 1.0, hi, (lo + hi) / 2.0, 0.0][random.below(6)]);
        let sure = 0.499 / (hi - lo); // integers nearer than a half are equal
        for trial in kept(ty, Mask::None, 40, &all, sure).iter().step_by(2) {
            assert_eq!(trial.found, trial.source, "{ty}");
        }
        for tolerance in [0.0, 1.0 / (hi - lo), 1.5 / (hi - lo), 0.02, 0.5] {
            kept(ty, Mask::None, 40, &all, tolerance);
        }
    }
}

#[test]
fn doubles_are_not_rounded_to_singles() {
    for (middle, width) in [(1.0, 1e-9), (1e6, 1e-6), (-3e100, 1e88), (1e-60, 1e-70)] {
        let mut random = Random(22);
        let samples = archive(SampleType::F64, 33, |_| middle + width * random.signed());
        let trials = kept(SampleType::F64, Mask::None, 40, &samples, 1e-3);
        for trial in trials.iter().filter(|t| t.case.bound == Bound::Pointwise) {
            // The bound itself is checked exactly; an `f32` could not distinguish the samples.
            let far = trial.found.iter().zip(&trial.source).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(far < 1e-2 * width && f64::from(middle as f32) == f64::from((middle + width) as f32));
        }
    }
}
