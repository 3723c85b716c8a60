//! Compares decoded samples with the source: errors, range, and the samples that miss the bound.

use super::WindowCodec;
use super::box_samples::BoxSamples;
use super::load::Missing;
use crate::base::sample::{self, SampleType};
use crate::base::vectors::dispatch;
use crate::codec::bound::{Measure, share};
use crate::wavelet::{LANES, Lane};
use wavesplat_format::Outliers;

/// The compared samples of [`LANES`] series; one lane for each frame.
#[derive(Debug)]
pub(super) struct Compared<'a> {
    /// The source samples, with missing ones filled.
    pub(super) source: &'a [Lane],
    /// The decoded samples.
    pub(super) decoded: &'a [Lane],
}

impl Compared<'_> {
    fn sample(&self, codec: &WindowCodec, t: usize, lane: usize) -> ComparedSample {
        let (decoded, source) = (self.decoded[t][lane], self.source[t][lane]);
        let extracted = sample::round_to(codec.sample, decoded);
        let error = codec.error(decoded, extracted, source);
        ComparedSample { source, extracted, error, allowed: codec.bound.allowed(source) }
    }
}

/// A sample, what is extracted of it, and its error, rounded up.
struct ComparedSample {
    source: f64,
    extracted: f64,
    error: f64,
    allowed: f64,
}

/// The errors and the range of decoded samples, and those that miss the bound.
#[derive(Debug, Clone)]
pub(super) struct Tally {
    pub(super) min: f64,
    pub(super) max: f64,
    pub(super) reached: f64,
    pub(super) squared_error: f64,
    /// The largest share of a series.
    pub(super) share: f64,
    /// The indices of samples that must be stored exactly.
    pub(super) outliers: Vec<u32>,
    /// Scratch: for each sample of some series, NaN if it may miss the bound, else 0.
    unclear: Vec<Lane>,
}

/// What holds for some series without missing samples.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ranges {
    /// No error is larger.
    pub(super) largest: f64,
    /// Decoded samples are neither less nor more.
    pub(super) lo: f64,
    pub(super) hi: f64,
    /// About the sum of squared errors.
    pub(super) squares: f64,
}

/// What some samples show.
pub(super) struct RowStats {
    pub(super) min: f64,
    pub(super) max: f64,
    /// The largest error, not rounded up; NaN if any error is NaN.
    pub(super) largest: f64,
    pub(super) squares: f64,
}

impl Tally {
    pub(super) fn new() -> Self {
        let (min, max) = (f64::INFINITY, f64::NEG_INFINITY);
        Self { min, max, reached: 0.0, squared_error: 0.0, share: 0.0, outliers: Vec::new(), unclear: Vec::new() }
    }

    /// The tally of samples that are all decoded to zero, within a bound of single samples.
    pub(super) fn of_zeros(codec: &WindowCodec, samples: &BoxSamples<'_>, missing: &Missing) -> Self {
        let mut tally = Self::new();
        if missing.count < missing.all as u64 {
            (tally.min, tally.max, tally.reached) = (0.0, 0.0, missing.magnitude);
            tally.add_share(share(missing.magnitude, codec.bound.allowed(missing.magnitude)));
        }
        samples.for_each_run(|first, values| {
            let present = |at: usize| !missing.has(first + at);
            tally.squared_error += match missing.count {
                0 => dispatch!(sum_of_squares(values)),
                _ => values.iter().enumerate().filter(|(at, _)| present(*at)).map(|(_, v)| v * v).sum(),
            };
        });
        tally
    }

    pub(super) fn add(&mut self, decoded: f64, error: f64) {
        self.min = self.min.min(decoded);
        self.max = self.max.max(decoded);
        self.reached = self.reached.max(error);
        self.squared_error += error * error;
    }

    /// Adds series if they change only the sum of squared errors: their errors and samples lie in the ranges of those before. Returns
    /// whether it did.
    pub(super) fn add_within(&mut self, series: &Ranges, declared: Option<f64>) -> bool {
        let Ranges { largest, lo, hi, squares } = *series;
        let may_be_missing = declared.is_some_and(|v| lo <= v && v <= hi);
        let changes_nothing = largest <= self.reached && self.min <= lo && hi <= self.max && !may_be_missing;
        if changes_nothing {
            self.squared_error += squares;
        }
        changes_nothing
    }

    /// Adds `count` series; `whole` means that none of their samples is missing. `index(frame, lane)` is the index of a
    /// sample in the block, or none if it is missing.
    pub(super) fn add_series(
        &mut self,
        codec: &WindowCodec,
        compared: &Compared<'_>,
        count: usize,
        whole: bool,
        index: impl Fn(usize, usize) -> Option<usize>,
    ) {
        if whole && codec.bound.is_same() {
            return self.add_by_sample(codec, compared, count, index);
        }
        let clear = if whole { self.add_clearly_within(codec, compared, count) } else { [false; LANES] };
        let unclear = (0..count).filter(|l| !clear[*l]);
        unclear.for_each(|lane| self.add_one(codec, compared, lane, |t| index(t, lane)));
    }

    /// Adds `count` series without missing samples under a bound that is the same for all samples. Vector code adds samples that are clearly
    /// within it, and rounds their errors up once at the end.
    fn add_by_sample(
        &mut self,
        codec: &WindowCodec,
        compared: &Compared<'_>,
        count: usize,
        index: impl Fn(usize, usize) -> Option<usize>,
    ) {
        let mut unclear = std::mem::take(&mut self.unclear);
        unclear.resize(compared.source.len(), Lane::default());
        let stats = LaneStats::of_clear_samples(codec, compared, &mut unclear);
        for lane in 0..count {
            let share = codec.bound.largest_share(&[stats.sums[lane]], compared.source.len());
            self.add_lane(&stats, lane, share);
            if stats.missing[lane].is_nan() {
                let present = (0..unclear.len())
                    .filter(|t| unclear[*t][lane].is_nan())
                    .filter_map(|t| Some((t, index(t, lane)?)));
                present.for_each(|(t, index)| self.add_sample(index, &compared.sample(codec, t, lane)));
            }
        }
        self.unclear = unclear;
    }

    /// As [`Self::add_row`], of one series.
    fn add_lane(&mut self, stats: &LaneStats, lane: usize, share: f64) {
        let (min, max) = (stats.lo[lane], stats.hi[lane]);
        let row = RowStats { min, max, largest: stats.largest[lane], squares: stats.squares[lane] };
        self.add_row(&row, share);
    }

    /// Adds those of the first `count` series that are clearly within the bound and have no missing sample. This is
    /// vector code that rounds up once at the end. Returns which series were added; the others need a check of each
    /// sample.
    fn add_clearly_within(&mut self, codec: &WindowCodec, compared: &Compared<'_>, count: usize) -> [bool; LANES] {
        let stats = LaneStats::new(codec, compared);
        std::array::from_fn(|l| {
            let share = codec.bound.largest_share(&[stats.sums[l]], compared.source.len());
            let clear = l < count && share <= 1.0 && !stats.missing[l].is_nan();
            if clear {
                self.add_lane(&stats, l, share);
            }
            clear
        })
    }

    /// Adds one series, sample by sample, and notes the outliers.
    fn add_one(
        &mut self,
        codec: &WindowCodec,
        compared: &Compared<'_>,
        lane: usize,
        index: impl Fn(usize) -> Option<usize>,
    ) {
        let present = (0..compared.source.len()).filter_map(|t| Some((index(t)?, compared.sample(codec, t, lane))));
        if codec.bound.measure() == Measure::Largest {
            return present.for_each(|(index, of)| self.add_sample(index, &of));
        }
        let mut present: Vec<_> = present.collect();
        let holds = codec.bound.holds(present.iter().map(|(_, of)| (of.error, of.allowed)));
        for (index, of) in &mut present {
            if !self.add_unless_outlier(*index, of, holds) {
                of.error = 0.0;
            }
        }
        self.add_share(codec.bound.share(present.iter().map(|(_, of)| (of.error, of.allowed))));
    }

    /// Adds a sample under a bound of single samples, or notes an outlier.
    fn add_sample(&mut self, index: usize, of: &ComparedSample) {
        if self.add_unless_outlier(index, of, false) {
            self.add_share(share(of.error, of.allowed));
        }
    }

    /// Adds the share of samples that are within the bound: rounding up may exceed 1.
    pub(super) fn add_share(&mut self, share: f64) {
        self.share = self.share.max(share.min(1.0));
    }

    /// Adds a sample of a series whose bound `holds`, or that is within the bound itself; or notes an outlier. Returns whether it is none.
    fn add_unless_outlier(&mut self, index: usize, of: &ComparedSample, holds: bool) -> bool {
        let is_within = holds || of.error <= of.allowed;
        if is_within {
            self.add(of.extracted, of.error);
        } else {
            self.add(of.source, 0.0);
            self.outliers.push(index as u32);
        }
        is_within
    }

    /// Adds the statistics of samples that are clearly within the bound, and their share.
    pub(super) fn add_row(&mut self, row: &RowStats, share: f64) {
        let largest = if row.largest > 0.0 { row.largest.next_up() } else { 0.0 };
        self.reached = self.reached.max(largest);
        self.share = self.share.max(share);
        self.squared_error += row.squares;
        (self.min, self.max) = (self.min.min(row.min), self.max.max(row.max));
    }

    /// The tally of samples that changed since `splatted` compared them; what is splatted is as before.
    pub(super) fn with_splatted(self, splatted: &Self) -> Self {
        let (min, max) = (self.min.min(splatted.min), self.max.max(splatted.max));
        let (reached, share) = (self.reached.max(splatted.reached), self.share.max(splatted.share));
        let squared_error = self.squared_error.max(splatted.squared_error);
        Self { min, max, reached, share, squared_error, ..self }
    }

    /// Takes the samples that must be stored exactly.
    pub(super) fn take_outliers(&mut self, samples: &BoxSamples<'_>) -> Outliers {
        let mut positions = std::mem::take(&mut self.outliers);
        positions.sort_unstable();
        let mut bytes = Vec::new();
        positions.iter().for_each(|position| bytes.extend_from_slice(samples.sample(*position as usize)));
        Outliers { positions, samples: bytes }
    }
}

/// What a sample that is clearly within the bound keeps to.
#[derive(Debug, Clone, Copy)]
struct Limits {
    /// Its error is no larger.
    error: f64,
    /// It does not equal this value; NaN if none is declared.
    declared: f64,
}

/// Statistics of [`LANES`] series, one entry for each.
struct LaneStats {
    /// The range of the extracted samples.
    lo: Lane,
    hi: Lane,
    /// NaN in lanes with a value that would be read as missing, or that was not added.
    missing: Lane,
    largest: Lane,
    squares: Lane,
    /// Sums of [`crate::codec::bound::ErrorBound::add`].
    sums: Lane,
}

impl LaneStats {
    /// Those of the samples that are clearly within a bound that is the same for all. Others make [`Self::missing`] and their element of
    /// `unclear` NaN.
    fn of_clear_samples(codec: &WindowCodec, compared: &Compared<'_>, unclear: &mut [Lane]) -> Self {
        let mut stats = Self::empty();
        let error = codec.bound.delta.next_down().next_down();
        let limits = Limits { error, declared: codec.missing_value.unwrap_or(f64::NAN) };
        match codec.sample {
            SampleType::F32 => dispatch!(compare_singles(&mut stats, compared, limits, unclear)),
            SampleType::F64 => dispatch!(compare_doubles(&mut stats, compared, limits, unclear)),
            ty => {
                for ((decoded, source), unclear) in compared.decoded.iter().zip(compared.source).zip(unclear) {
                    stats.add_clear(decoded, &sample::round_all(ty, decoded), source, limits, unclear);
                }
            }
        }
        stats.sums = stats.largest;
        stats
    }

    /// Those of all samples under any bound.
    fn new(codec: &WindowCodec, compared: &Compared<'_>) -> Self {
        let (mut stats, declared) = (Self::empty(), codec.missing_value.unwrap_or(f64::NAN)); // NaN equals no value
        for (decoded, source) in compared.decoded.iter().zip(compared.source) {
            let errors = stats.add(decoded, &sample::round_all(codec.sample, decoded), source, declared);
            codec.bound.add(&errors, source, &mut stats.sums);
        }
        stats
    }

    fn empty() -> Self {
        let zero = Lane::default();
        let (lo, hi) = ([f64::INFINITY; LANES], [f64::NEG_INFINITY; LANES]);
        Self { lo, hi, missing: zero, largest: zero, squares: zero, sums: zero }
    }

    /// Adds the samples of a frame that keep to the limits.
    #[inline(always)]
    fn add_clear(&mut self, decoded: &Lane, rounded: &Lane, source: &Lane, limits: Limits, unclear: &mut Lane) {
        for l in 0..LANES {
            let (a, b, v) = ((decoded[l] - source[l]).abs(), (rounded[l] - source[l]).abs(), rounded[l]);
            let e = if a > b { a } else { b };
            let clear = (a <= limits.error) & (b <= limits.error) & (v.abs() < f64::INFINITY) & (v != limits.declared);
            let (e, lo, hi) = if clear { (e, v, v) } else { (0.0, f64::INFINITY, f64::NEG_INFINITY) };
            self.largest[l] = if e > self.largest[l] { e } else { self.largest[l] };
            self.squares[l] += e * e;
            self.lo[l] = if lo < self.lo[l] { lo } else { self.lo[l] };
            self.hi[l] = if hi > self.hi[l] { hi } else { self.hi[l] };
            unclear[l] = if clear { 0.0 } else { f64::NAN };
            self.missing[l] += unclear[l];
        }
    }

    /// Adds a frame; returns its errors.
    #[inline(always)]
    fn add(&mut self, decoded: &Lane, rounded: &Lane, source: &Lane, declared: f64) -> Lane {
        let mut errors = Lane::default();
        for l in 0..LANES {
            let (a, b, v) = ((decoded[l] - source[l]).abs(), (rounded[l] - source[l]).abs(), rounded[l]);
            let e = if a > b { a } else { b };
            self.largest[l] = if e > self.largest[l] { e } else { self.largest[l] };
            self.squares[l] += e * e;
            self.lo[l] = if v < self.lo[l] { v } else { self.lo[l] };
            self.hi[l] = if v > self.hi[l] { v } else { self.hi[l] };
            self.missing[l] = if (v.abs() < f64::INFINITY) & (v != declared) { self.missing[l] } else { f64::NAN };
            errors[l] = e;
        }
        errors
    }
}

#[inline(always)]
fn sum_of_squares(values: &[f64]) -> f64 {
    let (some, last) = values.as_chunks::<LANES>();
    let mut lanes = Lane::default();
    for values in some {
        for l in 0..LANES {
            lanes[l] += values[l] * values[l];
        }
    }
    lanes.iter().sum::<f64>() + last.iter().map(|v| v * v).sum::<f64>()
}

#[inline(always)]
fn compare_singles(stats: &mut LaneStats, compared: &Compared<'_>, limits: Limits, unclear: &mut [Lane]) {
    for ((decoded, source), unclear) in compared.decoded.iter().zip(compared.source).zip(unclear) {
        let rounded = std::array::from_fn(|l| f64::from(decoded[l] as f32));
        stats.add_clear(decoded, &rounded, source, limits, unclear);
    }
}

#[inline(always)]
fn compare_doubles(stats: &mut LaneStats, compared: &Compared<'_>, limits: Limits, unclear: &mut [Lane]) {
    for ((decoded, source), unclear) in compared.decoded.iter().zip(compared.source).zip(unclear) {
        stats.add_clear(decoded, decoded, source, limits, unclear);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::bound::{Bound, ErrorBound};
    use crate::codec::scheme::Scheme;
    use crate::wavelet::Basis;

    #[test]
    fn zeros_are_tallied_like_other_decoded_samples() {
        let (frames, voxels) = (3, 29);
        let values: Vec<f64> = (0..frames * voxels).map(|i| ((i * 7919) % 101) as f64 / 50.0 - 1.0).collect();
        let mut bytes = vec![0; values.len() * 4];
        sample::store(SampleType::F32, &values, &mut bytes);
        for (bound, delta) in [(Bound::Pointwise, 1.5), (Bound::Relative { floor: 3.0 }, 1.5)] {
            let bound = ErrorBound::new(bound, 0.5, delta);
            let mut codec = WindowCodec::new(Scheme::along_time(Basis::Samples), frames, SampleType::F32, bound, 8);
            for declared in [None, Some(f64::from(values[40] as f32))] {
                codec.missing_value = declared;
                let (samples, missing) =
                    (BoxSamples::whole(SampleType::F32, &bytes, [voxels, 1, 1]), Missing::find(&codec, &bytes));
                assert_eq!(missing.count > 0, declared.is_some());
                let mut slow = Tally::new();
                samples.for_each_run(|first, values| {
                    let present = values.iter().enumerate().filter(|(at, _)| !missing.has(first + at));
                    present.for_each(|(_, v)| {
                        slow.add(0.0, v.abs());
                        slow.share = slow.share.max(share(v.abs(), codec.bound.allowed(*v)));
                    });
                });
                let fast = Tally::of_zeros(&codec, &samples, &missing);
                assert_eq!((fast.min, fast.max, fast.reached, fast.share), (0.0, 0.0, slow.reached, slow.share));
                assert!((fast.squared_error - slow.squared_error).abs() <= 1e-12 * slow.squared_error);
            }
        }
    }

    #[test]
    fn vector_code_agrees_with_samples_one_by_one() {
        let frames = 40_usize;
        let delta = 3.0_f64;
        let number = |i: usize| ((i * 7919) % 1013) as f64 / 7.0 - 50.0;
        let lanes =
            |first: usize| (0..frames).map(|t| std::array::from_fn(|l| number(first + t * LANES + l))).collect();
        let source: Vec<Lane> = lanes(0);
        let mut decoded = source.clone();
        for (i, v) in decoded.iter_mut().flatten().enumerate() {
            let errors = [0.1, delta.next_down(), delta, delta.next_up(), 2.9, 40.0];
            *v += errors[i % 61 % 6] * if i % 3 == 0 { -1.0 } else { 1.0 };
        }
        (decoded[3][1], decoded[9][4], decoded[20][6]) = (f64::NAN, -9.5, f64::INFINITY);
        let bound = ErrorBound::new(Bound::Pointwise, 0.1, delta);
        for (ty, count) in [(SampleType::F32, LANES), (SampleType::F64, 7), (SampleType::I16, LANES)] {
            let mut codec = WindowCodec::new(Scheme::along_time(Basis::Samples), frames, ty, bound, 8);
            codec.missing_value = Some(-9.5);
            let compared = Compared { source: &source, decoded: &decoded };
            let (mut fast, mut slow) = (Tally::new(), Tally::new());
            fast.add_series(&codec, &compared, count, true, |t, l| Some(t * LANES + l));
            (0..count).for_each(|l| slow.add_one(&codec, &compared, l, |t| Some(t * LANES + l)));
            assert!(slow.outliers.len() > frames && slow.outliers.contains(&(9 * LANES as u32 + 4)), "{ty}");
            assert_eq!((&fast.outliers, fast.min, fast.max), (&slow.outliers, slow.min, slow.max), "{ty}");
            assert_eq!((fast.reached, fast.share), (slow.reached, slow.share), "{ty}");
            assert!((fast.squared_error - slow.squared_error).abs() <= 1e-9 * slow.squared_error, "{ty}");
        }
    }
}
