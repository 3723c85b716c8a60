//! Compares decoded samples with the source: errors, range, and the samples that miss the bound.

use super::WindowCodec;
use super::box_samples::BoxSamples;
use super::buffer::clear;
use crate::base::sample::{self, SampleType};
use crate::base::vectors::dispatch;
use crate::codec::bound::Bound;
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
    /// The present samples of one series: frame and index.
    present: Vec<(usize, usize)>,
    /// Their errors, and those allowed.
    errors: Vec<(f64, f64)>,
}

impl Tally {
    pub(super) fn new() -> Self {
        let (min, max) = (f64::INFINITY, f64::NEG_INFINITY);
        let (outliers, present, errors) = Default::default();
        Self { min, max, reached: 0.0, squared_error: 0.0, share: 0.0, outliers, present, errors }
    }

    pub(super) fn add(&mut self, decoded: f64, error: f64) {
        self.min = self.min.min(decoded);
        self.max = self.max.max(decoded);
        self.reached = self.reached.max(error);
        self.squared_error += error * error;
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
        let clear = if whole { self.add_clearly_within(codec, compared, count) } else { [false; LANES] };
        let unclear = (0..count).filter(|l| !clear[*l]);
        unclear.for_each(|lane| self.add_one(codec, compared, lane, |t| index(t, lane)));
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
                let largest = if stats.largest[l] > 0.0 { stats.largest[l].next_up() } else { 0.0 };
                self.reached = self.reached.max(largest);
                self.share = self.share.max(share);
                self.squared_error += stats.squares[l];
                (self.min, self.max) = (self.min.min(stats.lo[l]), self.max.max(stats.hi[l]));
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
        let error = |t: usize| {
            let (decoded, source) = (compared.decoded[t][lane], compared.source[t][lane]);
            let rounded = sample::round_to(codec.sample, decoded);
            (codec.error(decoded, rounded, source), codec.bound.allowed(source))
        };
        let (mut present, mut errors) = (std::mem::take(&mut self.present), std::mem::take(&mut self.errors));
        clear(&mut present).extend((0..compared.source.len()).filter_map(|t| Some((t, index(t)?))));
        clear(&mut errors).extend(present.iter().map(|(t, _)| error(*t)));
        let holds = codec.bound.holds(errors.iter().copied());
        for ((t, index), (error, allowed)) in present.iter().zip(&mut errors) {
            if holds || *error <= *allowed {
                self.add(sample::round_to(codec.sample, compared.decoded[*t][lane]), *error);
            } else {
                *error = 0.0;
                self.add(compared.source[*t][lane], 0.0);
                self.outliers.push(*index as u32);
            }
        }
        let share = codec.bound.share(errors.iter().copied());
        self.share = self.share.max(share.min(1.0)); // rounding up may exceed 1 although the bound holds
        (self.present, self.errors) = (present, errors);
    }

    /// Takes the samples that must be stored exactly.
    pub(super) fn take_outliers(&mut self, samples: &BoxSamples<'_>) -> Outliers {
        let mut positions = std::mem::take(&mut self.outliers);
        positions.sort_unstable();
        let samples = positions.iter().flat_map(|position| samples.sample(*position as usize)).copied().collect();
        Outliers { positions, samples }
    }
}

/// Statistics of [`LANES`] series, one entry for each.
struct LaneStats {
    /// The range of the extracted samples.
    lo: Lane,
    hi: Lane,
    /// NaN in lanes with a value that would be read as missing.
    missing: Lane,
    largest: Lane,
    squares: Lane,
    /// Sums of [`crate::codec::bound::ErrorBound::add`].
    sums: Lane,
}

impl LaneStats {
    fn new(codec: &WindowCodec, compared: &Compared<'_>) -> Self {
        let mut stats = Self::empty();
        let declared = codec.missing_value.unwrap_or(f64::NAN); // NaN equals no value
        match (codec.sample, codec.bound.bound) {
            (SampleType::F32, Bound::Pointwise) => dispatch!(compare_singles(&mut stats, compared, declared)),
            (SampleType::F64, Bound::Pointwise) => dispatch!(compare_doubles(&mut stats, compared, declared)),
            _ => return Self::under_any_bound(codec, compared, declared),
        }
        stats.sums = stats.largest;
        stats
    }

    /// The general version for any type and bound; slower than the vector code for floats.
    fn under_any_bound(codec: &WindowCodec, compared: &Compared<'_>, declared: f64) -> Self {
        let mut stats = Self::empty();
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
fn compare_singles(stats: &mut LaneStats, compared: &Compared<'_>, declared: f64) {
    for (decoded, source) in compared.decoded.iter().zip(compared.source) {
        let rounded = std::array::from_fn(|l| f64::from(decoded[l] as f32));
        stats.add(decoded, &rounded, source, declared);
    }
}

#[inline(always)]
fn compare_doubles(stats: &mut LaneStats, compared: &Compared<'_>, declared: f64) {
    for (decoded, source) in compared.decoded.iter().zip(compared.source) {
        stats.add(decoded, decoded, source, declared);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::bound::ErrorBound;
    use crate::codec::scheme::Scheme;
    use crate::wavelet::Basis;

    #[test]
    fn vector_code_agrees_with_the_general_code() {
        let number = |i: usize| ((i * 7919) % 1013) as f64 / 7.0 - 50.0;
        let lanes = |first: usize| (0..40).map(|t| std::array::from_fn(|l| number(first + t * LANES + l))).collect();
        let (source, mut decoded): (Vec<Lane>, Vec<Lane>) = (lanes(0), lanes(5));
        (decoded[3][1], decoded[9][4], decoded[20][6]) = (f64::NAN, -9.5, f64::INFINITY);
        let bound = ErrorBound { bound: Bound::Pointwise, tolerance: 0.1, delta: 3.0 };
        for ty in [SampleType::F32, SampleType::F64] {
            let mut codec = WindowCodec::new(Scheme::along_time(Basis::Samples), 40, ty, bound, 8);
            codec.missing_value = Some(-9.5);
            let compared = Compared { source: &source, decoded: &decoded };
            let bit = |v: f64| if v.is_nan() { u64::MAX } else { v.to_bits() };
            let bits = |s: LaneStats| [s.lo, s.hi, s.missing, s.largest, s.squares, s.sums].map(|lane| lane.map(bit));
            let (fast, slow) = (LaneStats::new(&codec, &compared), LaneStats::under_any_bound(&codec, &compared, -9.5));
            assert!([1, 4, 6].into_iter().all(|l| fast.missing[l].is_nan()));
            assert_eq!(bits(fast), bits(slow), "{ty}");
        }
    }
}
