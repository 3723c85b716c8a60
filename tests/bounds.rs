//! The error bounds (eq 21-23) and what is kept beside them, searched for series that break them. Nothing here calls the library's own
//! bound.

mod kept;

use crate::common::exact::Limit;
use crate::common::memory::Memory;
use crate::common::samples::{TYPES, numbers};
use crate::common::series::{KINDS, Kind, Mask, volume};
use crate::common::{BASES, Stored, cases, extracted, is_taken, settings, stored, times, tried};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngAlgorithm, TestRng, TestRunner};
use std::cell::Cell;
use std::ops::Range;
use std::time::Instant;
use wavesplat::base::grid::Grid;
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, Bound};
use wavesplat::file::CoefficientFile;
use wavesplat::file::verify::verify;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::decode::WantedFrames;
use wavesplat_format::{Derivative, Keep};

/// Seeds with a remainder of 0 or [`ERRORS_KEPT`] - 1 limit no errors besides the bound.
pub(crate) const ERRORS_KEPT: u64 = 7;

#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) ty: SampleType,
    pub(crate) kind: Kind,
    pub(crate) mask: Mask,
    pub(crate) basis: Basis,
    pub(crate) bound: Bound,
    pub(crate) tolerance: f64,
    pub(crate) frames: usize,
    /// log2 of the window's length, or of the length minus one.
    pub(crate) window: u32,
    pub(crate) edge: usize,
    pub(crate) dims: [usize; 3],
    pub(crate) seed: u64,
}

/// An archive, and the samples that came back from its file.
pub(crate) struct Trial {
    pub(crate) case: Case,
    pub(crate) file: CoefficientFile,
    pub(crate) source: Vec<f64>,
    missing: Vec<bool>,
    pub(crate) found: Vec<f64>,
}

impl Case {
    /// Keeps the range, and the sides of values that occur, of their mean, and of 0; nothing for some seeds.
    fn keep(&self, source: &[f64]) -> Keep {
        let place = |n: u64| {
            (self.seed.wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(7 * n as u32) % source.len() as u64) as usize
        };
        let present = |n: u64| source.iter().cycle().skip(place(n)).take(source.len()).copied().find(|v| v.is_finite());
        let (Some(a), Some(b)) = (present(1), present(2)) else { return Keep::default() };
        let values = match self.seed % 4 {
            0 => return Keep::default(),
            1 => vec![0.0],
            2 => vec![a, 0.5 * a + 0.5 * b],
            _ => vec![b, 0.0, 0.25 * a + 0.75 * b],
        };
        // Shifted samples near an extreme are clamped, and go to their sides.
        let present = || source.iter().copied().filter(|v| v.is_finite() && !self.is_declared(*v));
        let [lo, hi] = [f64::min, f64::max].map(|of| present().reduce(of).unwrap_or(0.0));
        let near = (1 + self.seed % 64) as f64 / 640.0;
        let at = |share: f64| lo * (1.0 - share) + hi * share;
        let (values, range) = match self.seed % ERRORS_KEPT {
            4 => (vec![at(near), at(1.0 - near)], " range"),
            _ => (values, if self.seed % 5 > 2 { " range" } else { "" }),
        };
        let words: Vec<String> = values.iter().map(|value| format!("side={value}")).collect();
        Keep::parse(&(words.join(" ") + range + &self.keep_of_errors(source))).unwrap()
    }

    fn is_declared(&self, value: f64) -> bool {
        matches!(self.mask, Mask::Declared(declared) if declared == value)
    }

    /// Words that limit errors, more and less than the bound does.
    fn keep_of_errors(&self, source: &[f64]) -> String {
        let largest = source.iter().filter(|v| v.is_finite()).fold(0.0, |largest: f64, v| largest.max(v.abs()));
        let error = (largest * self.tolerance * [0.3, 1.7, 9.0][self.seed as usize % 3]).min(f64::MAX);
        let error = if self.ty.is_float() { error } else { error.max(24.0) };
        let derivative = Derivative::ALL[self.seed as usize % 5].name();
        match self.seed % ERRORS_KEPT {
            1 => format!(" {derivative}={error:?}"),
            2 => format!(" {derivative}={error:?} relative={:?}@{:?}", self.tolerance, 0.4 * largest),
            3 if self.ty.is_float() => format!(" relative={:?}", 2.0 * self.tolerance),
            3 => format!(" relative={:?}@{:?}", 2.0 * self.tolerance, 0.4 * largest),
            4 => " sum".into(),
            5 => format!(" sum {derivative}={error:?}"),
            _ => String::new(),
        }
    }

    fn config(&self, source: &[f64]) -> wavesplat::convert::ConvertConfig {
        let window = (1 << self.window) + usize::from(self.basis == Basis::Multi);
        let missing_value = if let Mask::Declared(value) = self.mask { Some(value) } else { None };
        let plain = settings(self.basis, window, self.tolerance);
        let (bound, block, keep) = (self.bound, Some(self.edge), self.keep(source));
        wavesplat::convert::ConvertConfig { bound, block, missing_value, keep, ..plain }
    }

    fn check(&self) -> usize {
        let Self { ty, kind, mask, frames, dims, seed, .. } = *self;
        self.trial(&volume(kind, ty, mask, dims.iter().product(), frames, seed)).check()
    }

    /// Converts these samples and extracts them again.
    pub(crate) fn trial(&self, bytes: &[u8]) -> Trial {
        let ty = self.ty;
        let mut memory = Memory::new(Grid::unit(self.dims), ty, bytes.to_vec());
        let source = numbers(ty, bytes);
        let config = self.config(&source);
        let stored: Stored = stored(&mut memory, &config);
        let file = stored.open();
        let back = extracted(&file);
        let report = verify(&file, Some(&mut memory), 64 << 20, &Silent).unwrap().against.unwrap();
        assert_eq!((report.series_outside, report.not_kept), (0, 0), "by verify: {self:?} {report:?}");
        let missing: Vec<bool> = source.iter().map(|v| !v.is_finite() || Some(*v) == config.missing_value).collect();
        assert_eq!(report.missing, missing.iter().filter(|m| **m).count() as u64);
        for (i, (a, b)) in bytes.chunks(ty.size()).zip(back.chunks(ty.size())).enumerate() {
            assert!(a == b || self.tolerance > 0.0 && !missing[i], "sample {i}: the bits {b:?} for {a:?}");
        }
        let found = numbers(ty, &back);
        for (i, v) in found.iter().enumerate() {
            assert!(
                missing[i] || v.is_finite() && Some(*v) != config.missing_value,
                "{v}, so missing, for {}",
                source[i]
            );
        }
        Trial { case: self.clone(), file, source, missing, found }
    }
}

impl Trial {
    /// Compares all samples. Returns the number of series; a series is a voxel in a window.
    pub(crate) fn check(&self) -> usize {
        (0..self.file.metadata().windows.len() as u32).map(|w| self.window(w)).sum()
    }

    fn window(&self, window: u32) -> usize {
        let frames = self.file.window_range(window);
        let voxels = self.file.grid.whole().voxels();
        let Some(limit) = self.limit(window) else { return voxels }; // all samples so far are missing
        let record = &self.file.metadata().windows[window as usize];
        assert!(limit.holds(record.delta, 0.0), "delta {} for {limit:?}", record.delta);
        assert!(!self.of_samples() || record.reached <= record.delta);
        assert!(record.share > 0.0 || record.reached == 0.0, "errors that use no share of the bound");
        for voxel in 0..voxels {
            let places: Vec<usize> = frames.clone().map(|t| t * voxels + voxel).collect();
            self.series(&limit, record.share, &places, &self.found, "extracted");
            for i in places.into_iter().filter(|i| !self.missing[*i]) {
                assert!(Limit::of(record.reached).holds(self.found[i], self.source[i]), "sample {i}: beyond reached");
            }
        }
        self.keeps_sides(frames.clone(), &self.found);
        self.keeps_range(frames.clone());
        self.keeps_shares(frames.clone(), &self.found);
        self.keeps_derivatives(frames);
        self.splatted(window, &limit);
        voxels
    }

    /// The samples of some frames that are not missing.
    fn present(&self, frames: Range<usize>) -> impl Iterator<Item = usize> + Clone {
        let voxels = self.file.grid.whole().voxels();
        (frames.start * voxels..frames.end * voxels).filter(|i| !self.missing[*i])
    }

    /// Whether the bound applies to every single sample.
    fn of_samples(&self) -> bool {
        matches!(self.case.bound, Bound::Pointwise | Bound::Relative { .. })
    }

    /// The largest delta that the window may have; none if all samples so far are missing. It is the tolerance times
    /// the range of all samples up to the window's end, or times the window's own largest magnitude. For a sampled
    /// bound it is the estimated number, which another test compares with its definition.
    fn limit(&self, window: u32) -> Option<Limit> {
        let (frames, voxels) = (self.file.window_range(window), self.file.grid.whole().voxels());
        let present =
            |from: usize| (from * voxels..frames.end * voxels).filter(|i| !self.missing[*i]).map(|i| self.source[i]);
        let tolerance = self.case.tolerance;
        match self.case.bound {
            Bound::Relative { floor } => {
                let largest = present(frames.start).map(f64::abs).fold(0.0, f64::max);
                Some(Limit::relative(tolerance, floor, largest))
            }
            Bound::Sampled { .. } => Some(Limit::of(self.file.metadata().windows[window as usize].delta)),
            Bound::Pointwise | Bound::Rms => {
                let (lo, hi) = (present(0).reduce(f64::min)?, present(0).reduce(f64::max)?);
                Some(Limit::range(tolerance, lo, hi))
            }
        }
    }

    /// `found` has a value for every sample of the archive. `places` are the samples of the series, which may use a
    /// `share` of its bound.
    fn series(&self, limit: &Limit, share: f64, places: &[usize], found: &[f64], what: &str) {
        let present = places.iter().filter(|i| !self.missing[**i]);
        let pairs: Vec<(f64, f64)> = present.map(|i| (found[*i], self.source[*i])).collect();
        let tolerance = self.case.tolerance;
        let holds = match self.case.bound {
            Bound::Pointwise => pairs.iter().all(|(a, b)| limit.used(share).holds(*a, *b)),
            Bound::Relative { floor } => {
                pairs.iter().all(|(a, b)| Limit::relative(tolerance, floor, *b).used(share).holds(*a, *b))
            }
            Bound::Rms | Bound::Sampled { .. } => limit.used(share).holds_rms(&pairs, pairs.len()),
        };
        assert!(holds, "{what}, sample {}: outside {share} of {limit:?}: (found, source) {pairs:?}", places[0]);
    }

    /// The values that the renderer splats: decoded coefficients before rounding to the sample type, with outliers and
    /// missing samples in place.
    fn splatted(&self, window: u32, limit: &Limit) {
        let codec = self.file.codec(window).unwrap();
        let mut found = self.found.clone(); // right for missing and exact samples
        for leaf in self.file.leaves(window) {
            for entry in self.file.leaf(leaf).unwrap().into_iter().filter(|entry| entry.id.tier == 0) {
                let places = self.places(&codec, window, entry.id.block);
                assert!(!self.of_samples() || entry.stats.reached <= codec.bound.delta);
                let block = self.file.block(&codec, &entry, &vec![true; codec.basis.coefficients()]).unwrap();
                if block.exact.is_some() {
                    assert!(places.iter().all(|i| self.missing[*i] || self.found[*i] == self.source[*i]));
                    continue;
                }
                block.for_each_run(&codec, &WantedFrames::all(&codec), |at, values| {
                    places[at..].iter().zip(values).for_each(|(i, v)| found[*i] = *v);
                });
                let outliers = numbers(codec.sample, &block.outliers.samples);
                for (place, value) in block.outliers.positions.iter().zip(outliers) {
                    found[places[*place as usize]] = value;
                    assert_eq!(value, self.source[places[*place as usize]]);
                }
                for (place, value) in block.moved(&codec, &block.field(&codec), &WantedFrames::all(&codec)) {
                    found[places[place]] = value;
                }
                self.keeps_sums(&codec, &places);
                let reached = Limit::of(entry.stats.reached);
                let present = || places.iter().filter(|i| !self.missing[**i]);
                assert!(present().all(|i| reached.holds(found[*i], self.source[*i])), "beyond the block's reached");
                assert!(present().all(|i| (entry.stats.min..=entry.stats.max).contains(&self.found[*i])));
            }
        }
        self.keeps_sides(self.file.window_range(window), &found);
        self.keeps_shares(self.file.window_range(window), &found);
        let voxels = self.file.grid.whole().voxels();
        for voxel in 0..voxels {
            let places: Vec<usize> = self.file.window_range(window).map(|t| t * voxels + voxel).collect();
            let share = self.file.metadata().windows[window as usize].share;
            self.series(limit, share, &places, &found, "splatted");
        }
    }

    /// Positions of a block's samples in the archive.
    fn places(&self, codec: &WindowCodec, window: u32, block: u32) -> Vec<usize> {
        let (whole, region) = (self.file.grid.whole(), self.file.blocks.region(block as usize));
        let first = self.file.window_range(window).start;
        let frame = |t: usize| region.iter().map(move |v| (first + t) * whole.voxels() + whole.index(v));
        (0..codec.frames()).flat_map(frame).collect()
    }
}

pub(crate) const TOLERANCES: [f64; 12] = [0.0, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 4e-3, 0.02, 0.1, 0.3, 0.5];

/// Every kind of bound.
pub(crate) const BOUNDS: [Bound; 6] = [
    Bound::Pointwise,
    Bound::Rms,
    Bound::Relative { floor: 0.0 },
    Bound::Relative { floor: 1e-9 },
    Bound::Relative { floor: 0.7 },
    Bound::Sampled { samples: 5, seed: 9 },
];

fn random_cases() -> impl Strategy<Value = Case> {
    let data = (0..TYPES.len(), 0..KINDS.len(), 0..8_usize, any::<u64>());
    let coding = (0..BASES.len(), 0..BOUNDS.len(), 0..TOLERANCES.len(), 0.5..1.0, 1..=6_u32);
    let shape = (1..=70_usize, 1..=9_usize, 0..4_usize);
    (data, coding, shape).prop_map(
        |((ty, kind, mask, seed), (basis, bound, tolerance, share, window), (frames, edge, dims))| {
            let ty = TYPES[ty];
            let mask = match mask {
                0 | 1 if ty.is_float() => Mask::Special,
                2 if ty.is_float() => Mask::Most,
                4 if ty.is_float() => Mask::NearlyAll,
                3 => Mask::Declared(if ty == SampleType::U8 { 0.0 } else { 7.0 }),
                _ => Mask::None,
            };
            Case {
                ty,
                kind: KINDS[kind],
                mask,
                basis: BASES[basis],
                bound: BOUNDS[bound],
                tolerance: TOLERANCES[tolerance] * share, // a tolerance with all digits in use
                frames,
                window,
                edge,
                dims: [[16, 16, 1], [13, 7, 3], [1, 1, 200], [9, 5, 5]][dims],
                seed,
            }
        },
    )
}

/// Runs `check`, which returns a number of series, on some of `all` random `values`: see [`cases`]. Returns the sum.
pub(crate) fn search<S: Strategy>(all: usize, values: S, check: impl Fn(S::Value) -> usize) -> usize {
    let series = Cell::new(0);
    let cases = cases(all) as u32;
    let config = Config { cases, failure_persistence: None, max_shrink_iters: 1000, ..Config::default() };
    let mut runner = TestRunner::new_with_rng(config, TestRng::deterministic_rng(RngAlgorithm::ChaCha));
    let found = runner.run(&values, |case| {
        series.set(series.get() + check(case));
        Ok(())
    });
    found.unwrap();
    series.get()
}

#[test]
fn no_series_breaks_its_bound() {
    let started = Instant::now();
    tried(search(900, random_cases(), |case| case.check()), cases(1_200_000), started);
}

#[test]
fn sums_sides_and_ranges_hold_together() {
    let (started, mut series) = (Instant::now(), 0);
    for n in 0..cases(240) as u64 {
        let seed = ERRORS_KEPT * n.wrapping_mul(0x9E37_79B9) + 4;
        let pick = |of: usize, by: u64| (n / by) as usize % of;
        series += Case {
            ty: TYPES[pick(TYPES.len(), 1)],
            kind: KINDS[pick(KINDS.len(), 3)],
            mask: if n % 9 == 0 && TYPES[pick(TYPES.len(), 1)].is_float() { Mask::Special } else { Mask::None },
            basis: BASES[pick(BASES.len(), 2)],
            bound: Bound::Pointwise,
            tolerance: [0.05, 0.2, 0.01, 0.1][pick(4, 5)],
            frames: 12,
            window: [3, 2][pick(2, 7)],
            edge: [8, 4][pick(2, 4)],
            dims: [[8, 8, 8], [5, 6, 7]][pick(2, 6)],
            seed: if n % 2 == 0 { seed } else { seed.wrapping_add(2 * ERRORS_KEPT) },
        }
        .check();
    }
    tried(series, cases(100_000), started);
}

#[test]
fn a_missing_sample_does_not_make_sums_expensive() {
    let (ty, dims, frames) = (SampleType::F32, [16, 16, 8], 16);
    let smooth = |i: usize| ((i % 2048) as f64 * 0.01 + (i / 2048) as f64 * 0.1).sin();
    let values: Vec<f64> = (0..2048 * frames).map(|i| if i % 2048 == 77 { f64::NAN } else { smooth(i) }).collect();
    let mut bytes = vec![0; values.len() * ty.size()];
    wavesplat::base::sample::store(ty, &values, &mut bytes);
    let of = |keep: &str| {
        let config = wavesplat::convert::ConvertConfig {
            keep: Keep::parse(keep).unwrap(),
            ..settings(Basis::Learned, frames, 0.01)
        };
        let mut memory = Memory::new(Grid::unit(dims), ty, bytes.clone());
        stored(&mut memory, &config).bytes().len()
    };
    let [plain, kept] = ["", "sum"].map(of);
    assert!(kept < plain + 2000, "{kept} bytes, {plain} without sums");
}

#[test]
fn no_kind_of_series_breaks_its_bound_for_any_type() {
    let (started, mut series) = (Instant::now(), 0);
    let rounds = (0..times()).flat_map(|round| TYPES.into_iter().enumerate().map(move |(n, ty)| (round, n, ty)));
    for (round, n, ty) in rounds {
        for (m, kind) in KINDS.into_iter().enumerate() {
            let bases = |bound| BASES.map(|basis| (basis, bound));
            let cases = BOUNDS.into_iter().flat_map(bases).enumerate();
            for (k, (basis, bound)) in cases.filter(|(k, _)| is_taken(k + k / 4 + m + n, 4)) {
                let seed = (round * 10_000 + n * 1000 + m * 30 + k) as u64;
                let tolerance = TOLERANCES[2 + (n + 3 * m + 5 * k) % 10];
                let (frames, window) = (33 + 9 * (k % 4), [5, 4, 3, 5][k % 4]);
                let (edge, dims) = (8, [16, 8, 2]);
                let mask = Mask::None;
                series += Case { ty, kind, mask, basis, bound, tolerance, frames, window, edge, dims, seed }.check();
            }
        }
    }
    tried(series, if is_taken(1, 4) { 1_450_000 * times() } else { 362_500 }, started);
}

/// The mean of a series is over its present samples alone: errors of 0 of the missing ones would leave room for large ones.
#[test]
fn missing_samples_do_not_count_in_the_mean_of_a_series() {
    let (started, mut series) = (Instant::now(), 0);
    for (n, ty) in (0..times()).flat_map(|_| TYPES).filter(|ty| ty.is_float()).enumerate() {
        for (m, kind) in KINDS.into_iter().enumerate() {
            for (k, mask) in [Mask::NearlyAll, Mask::Most, Mask::Special].into_iter().enumerate() {
                for bound in [Bound::Rms, Bound::Sampled { samples: 9, seed: 1 }] {
                    let (basis, tolerance, window) = (BASES[(n + m + k) % 4], [3e-3, 0.02, 0.2][m % 3], 5);
                    let (frames, edge, dims, seed) = (64, 8, [8, 8, 1], (n * 100 + m) as u64);
                    series +=
                        Case { ty, kind, mask, basis, bound, tolerance, frames, window, edge, dims, seed }.check();
                }
            }
        }
    }
    tried(series, 10_000 * times(), started);
}

#[test]
fn a_flash_in_any_frame_of_any_window_is_kept() {
    for frames in 1..=70 {
        let basis = BASES[frames % 4];
        for bound in [Bound::Pointwise, Bound::Relative { floor: 1e-3 }] {
            let (ty, kind, mask) = (SampleType::F32, Kind::Flash, Mask::None);
            let (window, edge, dims, seed) = (6, 4, [frames, 2, 1], frames as u64);
            Case { ty, kind, mask, basis, bound, tolerance: 0.01, frames, window, edge, dims, seed }.check();
        }
    }
}
