//! Keeps the sum of the samples of each block and frame, so that means and totals are those of the source.
//!
//! Let e be the errors of the decoded samples of a frame of a block that are not missing, n their number, m the largest magnitude of the
//! block's source samples, delta the error allowed, and eps the distance from 1 to the next number of the sample type. Then
//!
//! ```text
//! |sum of e| <= 2 n eps (m + delta)        0 for integers                                                     (eq 48)
//! ```
//!
//! Decoded samples of a float type get the same number each. To integers a whole number is added in total, spread evenly: each of the N
//! voxels gets floor(code / N), and those with i m mod N < code mod N get 1 more, where m is the least number above 0.618 N without a
//! common divisor with N. So a larger code never makes a sample smaller. Samples that would leave their bound are not shifted. All are then
//! clamped, restored and moved to their sides as without sums.

use super::WindowCodec;
use crate::base::sample::{self, SampleType};
use wavesplat_format::SumCodes;

/// The largest sum of the errors of `count` samples of up to some magnitude that keeps their sum (eq 48).
pub fn allowed_sum(ty: SampleType, magnitude: f64, delta: f64, count: usize) -> f64 {
    2.0 * count as f64 * spacing(ty, (magnitude + delta).min(f64::MAX))
}

/// The distance of numbers of a float type near a magnitude, or twice that; 0 for integers.
pub(super) fn spacing(ty: SampleType, magnitude: f64) -> f64 {
    let (relative, least) = match ty {
        SampleType::F16 => (2f64.powi(-10), 2f64.powi(-24)),
        SampleType::F32 => (f64::from(f32::EPSILON), f64::from(f32::from_bits(1))),
        SampleType::F64 => (f64::EPSILON, f64::from_bits(1)),
        _ => return 0.0,
    };
    (magnitude * relative).max(least)
}

/// A compensated sum: with what rounding loses ([Knuth](crate::bibliography)).
#[derive(Debug, Clone, Copy, Default)]
pub struct CompensatedSum {
    sum: f64,
    lost: f64,
}

impl CompensatedSum {
    /// Adds a number.
    pub fn add(&mut self, number: f64) {
        let sum = self.sum + number;
        let added = sum - self.sum;
        self.lost += (self.sum - (sum - added)) + (number - added);
        self.sum = sum;
    }

    /// The sum.
    pub fn total(self) -> f64 {
        self.sum + self.lost
    }
}

/// Some consecutive voxels of a frame of a block.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrameRun {
    pub(super) frame: usize,
    /// The number of the first voxel.
    pub(super) first: usize,
    /// The number of the block's voxels.
    pub(super) voxels: usize,
}

impl FrameRun {
    /// Those from a sample on, `frame * voxels + voxel`.
    pub(super) fn of(sample: usize, voxels: usize) -> Self {
        Self { frame: sample / voxels, first: sample % voxels, voxels }
    }
}

/// Stores decoded values as a reader returns them.
pub(super) fn store(codec: &WindowCodec, sums: Option<&SumCodes>, run: FrameRun, values: &[f64], out: &mut [u8]) {
    sample::store(codec.sample, values, out);
    shift_and_clip(codec, sums, run, out);
}

/// Shifts decoded samples so that sums are kept, and clamps them to the extremes of the source, if the file says so.
pub(super) fn shift_and_clip(codec: &WindowCodec, sums: Option<&SumCodes>, run: FrameRun, samples: &mut [u8]) {
    if let Some(sums) = sums {
        add_shifts(codec.sample, sums, run, samples);
    }
    if let Some((lo, hi)) = codec.clip {
        sample::clip(codec.sample, lo, hi, samples);
    }
}

/// Adds to some samples what keeps the sum of their frame.
fn add_shifts(ty: SampleType, codes: &SumCodes, run: FrameRun, samples: &mut [u8]) {
    let (first, end) = (run.first, run.first + samples.len() / ty.size());
    let place = |voxel: usize| (run.frame * run.voxels + voxel) as u32;
    let from = codes.unshifted.partition_point(|sample| *sample < place(first));
    let to = codes.unshifted.partition_point(|sample| *sample < place(end));
    let stops = codes.unshifted[from..to].iter().map(|sample| *sample as usize - run.frame * run.voxels);
    let mut begin = first;
    for stop in stops.chain([end]) {
        let bytes = &mut samples[(begin - first) * ty.size()..(stop - first) * ty.size()];
        shift_all(ty, codes, FrameRun { first: begin, ..run }, bytes);
        begin = stop + 1;
    }
}

/// Adds to all of some samples what keeps the sum of their frame.
fn shift_all(ty: SampleType, codes: &SumCodes, run: FrameRun, samples: &mut [u8]) {
    let (mut values, code) = ([0.0; RUN], codes.frames[run.frame]);
    if code == 0 {
        return;
    }
    for (at, bytes) in (run.first..).step_by(RUN).zip(samples.chunks_mut(RUN * ty.size())) {
        let values = &mut values[..bytes.len() / ty.size()];
        sample::load(ty, bytes, values);
        shift(ty, codes.unit, code, FrameRun { first: at, ..run }, values);
        sample::store(ty, values, bytes);
    }
}

/// No sample of a block of so many voxels is shifted by more.
pub(super) fn largest_shift(ty: SampleType, codes: &SumCodes, voxels: usize) -> f64 {
    let largest = codes.frames.iter().map(|code| code.unsigned_abs()).max().unwrap_or(0) as f64;
    if ty.is_float() { (largest * codes.unit).next_up() } else { (largest / voxels as f64).ceil() }
}

/// Samples that are shifted together.
pub(super) const RUN: usize = 512;

fn shift(ty: SampleType, unit: f64, code: i64, run: FrameRun, values: &mut [f64]) {
    if ty.is_float() {
        let each = code as f64 * unit;
        return values.iter_mut().for_each(|value| *value += each);
    }
    let voxels = run.voxels as i64;
    let (each, rest) = (code.div_euclid(voxels) as f64, code.rem_euclid(voxels) as u64);
    let (voxels, step) = (run.voxels as u64, stride(run.voxels as u64));
    let mut rank = (u128::from(step) * run.first as u128 % u128::from(voxels)) as u64;
    for value in values {
        *value += each + if rank < rest { 1.0 } else { 0.0 };
        rank = (rank + step) % voxels;
    }
}

/// What [`shift_and_clip`] does to singles that are loaded as numbers, for the same shift of all.
#[inline(always)]
pub(super) fn shift_singles(singles: &[f64], by: f64, clip: (f64, f64), samples: &mut [f64]) {
    for (sample, single) in samples.iter_mut().zip(singles) {
        let shifted = f64::from((single + by) as f32);
        let least = if shifted < clip.0 { clip.0 } else { shifted };
        *sample = if least > clip.1 { clip.1 } else { least };
    }
}

/// The least number above 0.618 `voxels` without a common divisor with it: its multiples spread over the voxels.
fn stride(voxels: u64) -> u64 {
    let divisor = |of: u64| std::iter::successors(Some([voxels, of]), |[a, b]| (*b > 0).then(|| [*b, a % b])).last();
    let is_prime_to = |of: &u64| divisor(*of).is_some_and(|[divisor, _]| divisor == 1);
    (voxels * 618 / 1000 + 1..).find(is_prime_to).unwrap_or(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shifts_of_integers_add_up_however_they_are_divided() {
        for (voxels, code) in [(7, 3), (7, -3), (64, 1000), (64, -1), (5, 0), (1, -9), (6, 1 << 40)] {
            let of = |first, count| {
                let mut values = vec![0.0; count];
                shift(SampleType::I32, 1.0, code, FrameRun { frame: 0, first, voxels }, &mut values);
                values
            };
            let all_of = |code| {
                let mut values = vec![0.0; voxels];
                shift(SampleType::I32, 1.0, code, FrameRun { frame: 0, first: 0, voxels }, &mut values);
                values
            };
            let all = of(0, voxels);
            assert_eq!(all.iter().sum::<f64>(), code as f64);
            assert!(all.iter().all(|v| (v - code as f64 / voxels as f64).abs() < 1.0), "{all:?}");
            assert!(of(0, voxels).iter().zip(&all_of(code + 1)).all(|(a, b)| a <= b), "a larger code");
            (0..=voxels).for_each(|at| assert_eq!([of(0, at), of(at, voxels - at)].concat(), all));
        }
    }

    #[test]
    fn numbers_of_singles_are_shifted_as_their_bytes_are() {
        let singles = Vec::from_iter((0..700).map(|n| f64::from((f64::from(n * 7919 % 701) * 0.37 - 120.0) as f32)));
        for (unit, code, clip) in [(1e-7, 12_345, None), (0.25, -9, Some((-100.0, 60.0))), (1e30, 1 << 40, None)] {
            let mut bytes = vec![0; singles.len() * 4];
            sample::store(SampleType::F32, &singles, &mut bytes);
            let codes = SumCodes { unit, frames: vec![code], unshifted: Vec::new() };
            add_shifts(SampleType::F32, &codes, FrameRun { frame: 0, first: 0, voxels: 700 }, &mut bytes);
            if let Some((lo, hi)) = clip {
                sample::clip(SampleType::F32, lo, hi, &mut bytes);
            }
            let [mut expected, mut found] = [(); 2].map(|()| vec![0.0; singles.len()]);
            sample::load(SampleType::F32, &bytes, &mut expected);
            let clip = clip.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
            shift_singles(&singles, code as f64 * unit, clip, &mut found);
            assert_eq!(expected, found);
        }
    }

    #[test]
    fn compensated_sums_lose_little() {
        let mut sum = CompensatedSum::default();
        [1e16, 1.0, -1e16, 3.0, 1e-20].into_iter().for_each(|number| sum.add(number));
        assert_eq!(sum.total(), 4.0);
        assert!(CompensatedSum { sum: f64::NAN, lost: 0.0 }.total().is_nan());
    }
}
