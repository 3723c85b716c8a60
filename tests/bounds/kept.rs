//! What files keep besides their bound, checked sample by sample.

use super::Trial;
use crate::common::exact::Limit;
use std::ops::Range;
use wavesplat::base::sample::SampleType;
use wavesplat_core::codec::WindowCodec;
use wavesplat_format::{Derivative, DerivativeBound, RelativeBound};

impl Trial {
    /// Checks that `found` has the samples of some frames on their sides.
    pub(super) fn keeps_sides(&self, frames: Range<usize>, found: &[f64]) {
        let sides = self.file.metadata().keep().sides;
        for i in self.present(frames) {
            let same = |v: &f64| found[i].partial_cmp(v) == self.source[i].partial_cmp(v);
            assert!(sides.iter().all(same), "{:?}: {} for {} beside {sides:?}", self.case, found[i], self.source[i]);
        }
    }

    /// Checks that samples keep the extremes of their window.
    pub(super) fn keeps_range(&self, frames: Range<usize>) {
        let present = self.present(frames);
        let [lo, hi] = [f64::min, f64::max].map(|of| present.clone().map(|i| self.source[i]).reduce(of));
        if self.file.metadata().keep().range {
            present.for_each(|i| assert!(lo <= Some(self.found[i]) && Some(self.found[i]) <= hi, "{:?}", self.case));
        }
    }

    /// Checks that `found` keeps the errors of large samples in some frames.
    pub(super) fn keeps_shares(&self, frames: Range<usize>, found: &[f64]) {
        let Some(RelativeBound { share, floor }) = self.file.metadata().keep().relative else { return };
        let holds = |i: usize| Limit::relative(share, 0.0, self.source[i]).holds(found[i], self.source[i]);
        let mut large = self.present(frames).filter(|i| self.source[*i].abs() >= floor);
        assert!(large.all(holds), "{:?}: a large sample is beyond {share}", self.case);
    }

    /// Checks the derivatives at the samples of some frames, as differences of errors; also across blocks and windows.
    pub(super) fn keeps_derivatives(&self, frames: Range<usize>) {
        let (whole, keep) = (self.file.grid.whole(), self.file.metadata().keep());
        let steps = [1, self.case.dims[0], self.case.dims[0] * self.case.dims[1]];
        let error = |i: usize| (!self.missing[i]).then(|| self.found[i] - self.source[i]);
        for DerivativeBound { derivative, error: allowed } in keep.derivatives {
            for i in self.present(frames.clone()) {
                let at = whole.voxel(i % whole.voxels());
                let beside = |a: usize| {
                    let inside = at[a] > 0 && at[a] + 1 < self.case.dims[a];
                    inside.then(|| Some([error(i - steps[a])?, error(i + steps[a])?])).flatten()
                };
                let first = |a: usize| beside(a).map_or(0.0, |[l, r]| (0.5 * (r - l)).abs());
                let second = |a: usize| beside(a).zip(error(i)).map_or(0.0, |([l, r], m)| l - 2.0 * m + r);
                let before = i.checked_sub(whole.voxels()).and_then(error);
                let of_axes = [0, 1, 2].map(first);
                let found = match derivative {
                    Derivative::Difference => before.zip(error(i)).map_or(0.0, |(a, b)| (b - a).abs()),
                    Derivative::Gradient => of_axes.into_iter().fold(0.0, f64::max),
                    // Errors of other components may be as large, with any sign.
                    Derivative::Curl => of_axes.iter().sum::<f64>() - of_axes.into_iter().fold(f64::MAX, f64::min),
                    Derivative::Divergence => of_axes.iter().sum(),
                    Derivative::Laplacian => [0, 1, 2].map(second).iter().sum::<f64>().abs(),
                };
                assert!(found <= allowed, "{:?}: {derivative:?} is off by {found}, sample {i}", self.case);
            }
        }
    }

    /// Checks the sums of a block's frames; `places` are its samples in the archive.
    pub(super) fn keeps_sums(&self, codec: &WindowCodec, places: &[usize]) {
        if !self.file.metadata().keep().sum {
            return;
        }
        let present = |all: &[usize]| all.iter().copied().filter(|i| !self.missing[*i]).collect::<Vec<_>>();
        let largest = present(places).into_iter().map(|i| self.source[i].abs()).fold(0.0, f64::max) + codec.bound.delta;
        let (eps, least) = match codec.sample {
            SampleType::F16 => (1.0 / 1024.0, 2f64.powi(-24)),
            SampleType::F32 => (f64::from(f32::EPSILON), 2f64.powi(-149)),
            SampleType::F64 => (f64::EPSILON, 5e-324),
            _ => (0.0, 0.0),
        };
        for frame in places.chunks(places.len() / codec.frames()) {
            let errors = || present(frame).into_iter().map(|i| self.found[i] - self.source[i]);
            // Positive and negative errors by themselves, smallest first.
            let of_sign = |sign: f64| {
                let mut found: Vec<f64> = errors().filter(|e| e * sign > 0.0).collect();
                found.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
                found.into_iter().sum::<f64>()
            };
            let sum = of_sign(1.0) + of_sign(-1.0);
            let allowed = 2.0 * present(frame).len() as f64 * (eps * largest.min(f64::MAX)).max(least);
            assert!(sum.abs() <= allowed, "{:?}: a sum is off by {sum}, {allowed} are allowed", self.case);
        }
    }
}
