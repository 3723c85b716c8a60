//! Series made to break a bound, with knowledge of the encoder's step, basis and bound.
//!
//! The attack may look inside the library. The check may not: it is [`crate::bounds::Trial`], in exact arithmetic.

mod climb;
mod codes;
mod values;

use crate::bounds::{BOUNDS, Case, TOLERANCES};
use crate::common::random::Random;
use crate::common::samples::{TYPES, bytes, special};
use crate::common::series::{Kind, Mask, extremes};
use proptest::prelude::*;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, Bound};
use wavesplat_core::wavelet::{LANES, Lane, TimeBasis, basis};

/// The attacked encoder: one window in one block, whose first two voxels fix the range.
#[derive(Debug, Clone)]
struct Target {
    case: Case,
    lo: f64,
    hi: f64,
    /// The series have a sample in one frame of so many; the others are missing (floats only).
    every: usize,
}

impl Target {
    /// A target with `frames` frames, and this many voxels in addition to the two that fix the range.
    fn new(
        ty: SampleType,
        (lo, hi): (f64, f64),
        tolerance: f64,
        (basis, bound): (Basis, Bound),
        frames: usize,
    ) -> Self {
        let (kind, mask, window, edge, dims, seed) = (Kind::Mixed, Mask::None, 7, 16, [16, 4, 4], 0);
        let case = Case { ty, kind, mask, basis, bound, tolerance, frames, window, edge, dims, seed };
        Self { case, lo, hi, every: 1 }
    }

    fn voxels(&self) -> usize {
        self.case.dims.iter().product::<usize>() - 2
    }

    fn delta(&self) -> f64 {
        self.case.tolerance * self.hi - self.case.tolerance * self.lo
    }

    /// A value of the range, from its lower end at 0 to its upper end at 1.
    fn value(&self, share: f64) -> f64 {
        self.lo * (1.0 - share) + self.hi * share
    }

    fn basis(&self) -> Box<dyn TimeBasis> {
        basis(self.case.basis, &[], self.case.frames)
    }

    /// The samples of an archive with these series, after the two voxels that fix the range.
    fn samples(&self, series: &[Vec<f64>]) -> Vec<u8> {
        assert_eq!(series.len(), self.voxels());
        let frame = |t: usize| [self.lo, self.hi].into_iter().chain(series.iter().map(move |s| self.present(t, s[t])));
        let all = (0..self.case.frames).flat_map(frame).map(|v| v.clamp(self.lo, self.hi));
        bytes(self.case.ty, &Vec::from_iter(all))
    }

    fn present(&self, frame: usize, value: f64) -> f64 {
        if frame.is_multiple_of(self.every) { value } else { f64::NAN }
    }

    /// Like the above, with missing samples in the series.
    fn punctured(&self, series: &[Vec<f64>], random: &mut Random) -> Vec<u8> {
        let mut samples = self.samples(series);
        let voxels = self.voxels() + 2;
        for (i, bytes) in samples.chunks_exact_mut(self.case.ty.size()).enumerate() {
            if i % voxels > 1 && random.below(9) == 0 {
                bytes.copy_from_slice(&special(self.case.ty, random.below(4)));
            }
        }
        samples
    }

    /// The step that the encoder chooses; none if it stores the block exactly.
    fn step(&self) -> Option<f64> {
        let rest = vec![vec![self.lo; self.case.frames]; self.voxels()];
        let file = self.case.trial(&self.samples(&rest)).file;
        let entries = file.leaf(&file.leaves(0)[0]).unwrap();
        Some(entries[0].stats.step).filter(|step| *step > 0.0)
    }

    /// The distance from a value to the next one of the sample type, near the larger end of the range.
    fn ulp(&self) -> f64 {
        let largest = self.lo.abs().max(self.hi.abs());
        match self.case.ty {
            SampleType::F64 => largest.next_up() - largest,
            SampleType::F32 => f64::from(largest as f32) * 2f64.powi(-23),
            SampleType::F16 => largest * 2f64.powi(-10),
            _ => 1.0,
        }
    }
}

/// The samples that coefficients decode to.
fn inverse(basis: &dyn TimeBasis, coefficients: &[f64]) -> Vec<f64> {
    let mut lanes: Vec<Lane> = coefficients.iter().map(|c| [*c; LANES]).collect();
    let mut series = vec![Lane::default(); basis.frames()];
    basis.inverse(&mut lanes, &mut series);
    series.iter().map(|lane| lane[0]).collect()
}

/// Ranges that fit a sample type.
fn ranges(ty: SampleType) -> Vec<(f64, f64)> {
    let (lo, hi, least) = extremes(ty);
    if !ty.is_float() {
        return vec![(lo, hi), (lo, lo + 10.0), (hi - 100.0, hi), (0.0, 1.0)];
    }
    let common =
        vec![(0.0, 1.0), (-1.0, 1.0), (100.0, 101.0), (-3e-3, 1e-3), (0.0, least * 1000.0), (lo, hi), (0.0, hi)];
    let large = if ty == SampleType::F16 { vec![] } else { vec![(1e6, 1e6 + 1.0), (-1e30, 3e38), (1e-37, 3e-37)] };
    [common, large].concat()
}

/// Targets of every type, with bounds from a fraction of an ulp to half of the range.
fn targets() -> impl Strategy<Value = Target> {
    let data = (0..TYPES.len(), any::<prop::sample::Index>(), 1..=33_usize);
    let coding = (any::<bool>(), 0..=BOUNDS.len(), any::<bool>(), 0..TOLERANCES.len(), 0.5..1.0, 0..40_u32);
    (data, coding).prop_map(|((ty, range, frames), (multi, bound, by_ulps, tolerance, share, halves))| {
        let ty = TYPES[ty];
        let (lo, hi) = *range.get(&ranges(ty));
        let basis = if multi { Basis::Multi } else { Basis::Haar };
        let as_of_range = Bound::Relative { floor: (hi - lo).min(f64::MAX) };
        let bound = BOUNDS.get(bound).copied().unwrap_or(as_of_range);
        let mut target = Target::new(ty, (lo, hi), TOLERANCES[tolerance] * share, (basis, bound), frames);
        let ulps = f64::from(halves) / 2.0 * target.ulp() / (hi - lo);
        if by_ulps && ulps <= 0.5 {
            target.case.tolerance = ulps;
        }
        target
    })
}
