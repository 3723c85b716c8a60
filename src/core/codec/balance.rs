//! Finds what keeps the sum of the samples of each block and frame (eq 48), by decoding the block as a reader does.
//!
//! Samples that would leave their bound stay as they are, and the others are shifted by a little more. What is splatted is not shifted.

use super::WindowCodec;
use super::block_with_ghosts::SampleBytes;
use super::bound;
use super::check::{RowStats, Tally};
use super::field::Field;
use super::load::Source;
use super::refine::Coded;
use super::shifts::{CompensatedSum, FrameRun, RUN, allowed_sum, shift_and_clip, shift_singles, spacing};
use super::sides::SidesOf;
use crate::base::sample::{self, SampleType, join_ranges};
use crate::base::vectors::dispatch;
use crate::wavelet::LANES;
use wavesplat_format::{SumCodes, most_unshifted};

/// A block whose sums are to be kept, as it is decoded without that.
struct Unbalanced<'a> {
    of: &'a Source<'a>,
    source: SampleBytes<'a>,
    decoded: Vec<u8>,
    /// Whether each sample is missing or stored exactly.
    fixed: Vec<bool>,
    sides: SidesOf,
    unit: f64,
}

/// The samples of a frame of the block.
struct Frame<'a> {
    source: Vec<f64>,
    decoded: &'a [u8],
    /// The decoded samples as numbers, if they are singles without sides.
    singles: Vec<f64>,
    fixed: &'a [bool],
    /// The voxels whose samples are fixed.
    fixed_voxels: Vec<u32>,
    /// Statistics of rows of the samples that were last compared with their bounds.
    stats: Vec<RowStats>,
    /// As a reader returns them.
    samples: Vec<f64>,
    /// The range of the samples before they go to their sides, if some may: readers clamp to the range of the window's.
    unsided: (f64, f64),
    codes: SumCodes,
}

/// A code for a frame's sum, and the sum of the errors that remain.
#[derive(Debug, Clone, Copy)]
struct Tried {
    code: i64,
    sum: f64,
}

impl Source<'_> {
    /// Codes what keeps the sums of the block's frames, and brings the tally up to date. `field` are the block's decoded coefficients. None
    /// if the block must be stored exactly.
    pub(super) fn keep_sums(&self, coded: &mut Coded, field: &Field<'_>) -> Option<SumCodes> {
        let block = Unbalanced::new(self, coded, field);
        let (mut all, mut tally) = (SumCodes { unit: block.unit, ..SumCodes::default() }, Tally::new());
        let mut frame = block.empty_frame();
        for number in 0..self.codec.frames() {
            block.load(number, &mut frame); // the code of the frame before is the first guess
            block.balance(&mut frame)?;
            let first = (number * frame.source.len()) as u32;
            all.frames.push(frame.codes.frames[0]);
            all.unshifted.extend(frame.codes.unshifted.iter().map(|voxel| first + voxel));
            frame.tally(self, number, &mut tally);
        }
        coded.tally = tally.with_splatted(&coded.tally);
        if self.codec.scheme.pyramid.is_some() {
            coded.dropped = coded.tally.squared_error; // what is not coded is the error
        }
        let is_possible = all.is_valid() && all.unshifted.len() <= most_unshifted(self.samples.len());
        is_possible.then_some(all)
    }
}

impl<'a> Unbalanced<'a> {
    fn new(of: &'a Source<'a>, coded: &Coded, field: &Field<'_>) -> Self {
        let (codec, source, decoded) = (of.codec, of.samples.contiguous(), of.decoded(field));
        let mut fixed = of.missing.mask().to_vec();
        fixed.resize(of.samples.len(), false);
        coded.outliers.positions.iter().for_each(|position| fixed[*position as usize] = true);
        let largest = (of.missing.magnitude + codec.bound.delta).min(f64::MAX);
        let unit = (spacing(codec.sample, largest) / 2.0).max(f64::MIN_POSITIVE);
        Self { of, source, decoded, fixed, sides: SidesOf::new(codec), unit }
    }

    fn empty_frame(&self) -> Frame<'_> {
        let numbers = vec![0.0; self.of.voxels()];
        let codes = SumCodes { unit: self.unit, frames: vec![0], unshifted: Vec::new() };
        let singles = if self.is_of_singles() { numbers.clone() } else { Vec::new() };
        Frame {
            source: numbers.clone(),
            decoded: &[],
            singles,
            fixed: &[],
            fixed_voxels: Vec::new(),
            stats: Vec::new(),
            samples: numbers,
            unsided: NOTHING,
            codes,
        }
    }

    /// Whether sums are found with numbers instead of bytes.
    fn is_of_singles(&self) -> bool {
        self.of.codec.sample == SampleType::F32 && self.of.codec.sides.is_empty()
    }

    fn load<'b>(&'b self, number: usize, frame: &mut Frame<'b>) {
        let (voxels, each) = (frame.source.len(), frame.source.len() * self.of.codec.sample.size());
        sample::load(self.of.codec.sample, &self.source[number * each..][..each], &mut frame.source);
        let missing = frame.source.iter_mut().enumerate().filter(|(at, _)| self.of.missing.has(number * voxels + at));
        missing.for_each(|(_, source)| *source = 0.0);
        (frame.decoded, frame.fixed) =
            (&self.decoded[number * each..][..each], &self.fixed[number * voxels..][..voxels]);
        let fixed = (0..).zip(frame.fixed).filter(|(_, fixed)| **fixed);
        frame.fixed_voxels.clear();
        frame.fixed_voxels.extend(fixed.map(|(voxel, _)| voxel));
        if self.is_of_singles() {
            sample::load(SampleType::F32, frame.decoded, &mut frame.singles);
        }
        frame.codes.unshifted.clear();
    }

    /// Finds the code of a frame, and the samples that stay as they are. None if its sum cannot be kept.
    fn balance(&self, frame: &mut Frame<'_>) -> Option<()> {
        for _ in 0..TRIES {
            self.find_code(frame)?;
            let beyond = frame.beyond(self.of.codec);
            if beyond.is_empty() {
                return Some(());
            }
            if self.of.codec.sample.is_float() {
                frame.add_to_others(beyond.len())?;
            }
            frame.codes.unshifted.extend(beyond);
            frame.codes.unshifted.sort_unstable();
            frame.codes.unshifted.dedup();
        }
        None
    }

    /// Finds the code that keeps the sum of a frame, by false position and bisection: the sum never decreases with the code. Writes the
    /// frame's samples.
    fn find_code(&self, frame: &mut Frame<'_>) -> Option<()> {
        let (codec, voxels) = (self.of.codec, frame.source.len());
        let free = voxels - frame.fixed_voxels.len();
        let allowed = allowed_sum(codec.sample, self.of.missing.magnitude, codec.bound.delta, free) / 2.0; // readers add in another order
        let shifted = free.saturating_sub(frame.codes.unshifted.len()).max(1) as f64;
        let per_code = if codec.sample.is_float() { shifted * self.unit } else { shifted / voxels as f64 };
        let (mut small, mut large) = (None::<Tried>, None::<Tried>);
        let mut code = frame.codes.frames[0];
        for tries in 0..CODES_TRIED {
            frame.codes.frames[0] = code;
            let sum = self.sum(frame);
            let tried = Some(Tried { code, sum });
            if sum.abs() <= allowed {
                return Some(());
            } else if sum < 0.0 {
                small = tried;
            } else if sum > 0.0 {
                large = tried;
            } else {
                return None; // NaN
            }
            let step = (-sum / per_code).abs().max(1.0) * f64::from(1 << (tries / 2).min(30)); // clamped samples do not move
            code = match (small, large) {
                (Some(small), Some(large)) => between(small, large, tries % 3 == 2)?,
                _ => code.checked_add(whole(step.copysign(-sum))?)?,
            };
        }
        None
    }

    /// The sum of a frame's errors with its code. Writes the frame's samples.
    fn sum(&self, frame: &mut Frame<'_>) -> f64 {
        if self.is_of_singles() { frame.sum_of_singles(self.of.codec) } else { self.sum_of_any(frame) }
    }

    /// The same for all types, as readers do it.
    fn sum_of_any(&self, frame: &mut Frame<'_>) -> f64 {
        let (codec, voxels, mut sum) = (self.of.codec, frame.source.len(), CompensatedSum::default());
        let (ty, mut bytes) = (codec.sample, [0; RUN * size_of::<f64>()]);
        frame.unsided = NOTHING;
        for first in (0..voxels).step_by(RUN) {
            let count = RUN.min(voxels - first);
            let bytes = &mut bytes[..count * ty.size()];
            bytes.copy_from_slice(&frame.decoded[first * ty.size()..][..count * ty.size()]);
            shift_and_clip(codec, Some(&frame.codes), FrameRun { frame: 0, first, voxels }, bytes);
            let (samples, source) = (&mut frame.samples[first..][..count], &frame.source[first..][..count]);
            sample::load(ty, bytes, samples);
            if !codec.sides.is_empty() {
                let unsided = samples.iter().zip(&frame.fixed[first..]).filter(|(_, fixed)| !**fixed);
                frame.unsided =
                    unsided.fold(frame.unsided, |range, (sample, _)| join_ranges(range, (*sample, *sample)));
                self.sides.place(source, samples);
            }
            let fixed = frame.fixed[first..][..count].iter().enumerate().filter(|(_, fixed)| **fixed);
            fixed.for_each(|(at, _)| samples[at] = source[at]);
            if ty == SampleType::F64 {
                samples.iter().zip(source).for_each(|(sample, source)| sum.add(sample - source));
            } else {
                sum.add(dispatch!(sum_of_errors(&*samples, source))); // the rounding of so few is far below what is allowed
            }
        }
        sum.total()
    }
}

#[inline(always)]
fn sum_of_errors(samples: &[f64], source: &[f64]) -> f64 {
    let mut sums = [0.0; LANES];
    let (some, last) = samples.as_chunks::<LANES>();
    let (of_some, of_last) = source.as_chunks::<LANES>();
    for (samples, source) in some.iter().zip(of_some) {
        for l in 0..LANES {
            sums[l] += samples[l] - source[l];
        }
    }
    sums.iter().sum::<f64>() + last.iter().zip(of_last).map(|(sample, source)| sample - source).sum::<f64>()
}

/// The range of all samples.
const EVERYTHING: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);

/// The range of no samples.
const NOTHING: (f64, f64) = (f64::INFINITY, f64::NEG_INFINITY);

/// Rounds in which samples of a frame turn out to leave their bound.
const TRIES: usize = 30;

/// Codes that are tried for a frame. The first estimate nearly always fits.
const CODES_TRIED: usize = 100;

impl Frame<'_> {
    /// [`Unbalanced::sum`] of singles without sides.
    fn sum_of_singles(&mut self, codec: &WindowCodec) -> f64 {
        let (by, clip) = (self.codes.frames[0] as f64 * self.codes.unit, codec.clip.unwrap_or(EVERYTHING));
        let (mut unshifted, mut fixed) = (self.codes.unshifted.iter().peekable(), self.fixed_voxels.iter().peekable());
        let mut sum = CompensatedSum::default();
        let runs = self.samples.chunks_mut(RUN).zip(self.source.chunks(RUN)).zip(self.singles.chunks(RUN));
        for (first, ((samples, source), singles)) in (0..).step_by(RUN).zip(runs) {
            dispatch!(shift_singles(singles, by, clip, &mut *samples));
            while let Some(voxel) = unshifted.next_if(|voxel| (**voxel as usize) < first + samples.len()) {
                let at = *voxel as usize - first;
                shift_singles(&singles[at..=at], 0.0, clip, &mut samples[at..=at]);
            }
            while let Some(voxel) = fixed.next_if(|voxel| (**voxel as usize) < first + samples.len()) {
                let at = *voxel as usize - first;
                samples[at] = source[at];
            }
            sum.add(dispatch!(sum_of_errors(&*samples, source))); // the rounding of so few is far below what is allowed
        }
        sum.total()
    }

    /// Adds to the code what some samples will not be shifted by, spread over the others.
    fn add_to_others(&mut self, count: usize) -> Option<()> {
        let others = (self.source.len() - self.codes.unshifted.len()).saturating_sub(count).max(1);
        let code = &mut self.codes.frames[0];
        *code = code.checked_add(whole(*code as f64 * count as f64 / others as f64)?)?;
        Some(())
    }

    /// The voxels whose samples are beyond their bound. Keeps the statistics of all rows.
    fn beyond(&mut self, codec: &WindowCodec) -> Vec<u32> {
        let (mut found, mut stats) = (Vec::new(), std::mem::take(&mut self.stats));
        stats.clear();
        stats.extend(self.rows().map(|(_, [samples, source])| row_stats(samples, source)));
        // Samples that are off by no more are within their bound.
        let clear = if codec.bound.is_same() && codec.missing_value.is_none() { codec.bound.delta } else { -1.0 };
        let unclear = self.rows().zip(&stats).filter(|(_, stats)| !is_clear(codec, stats));
        for ((first, [samples, sources]), _) in unclear {
            for (at, (sample, source)) in samples.iter().zip(sources).enumerate() {
                if (sample - source).abs().next_up() <= clear {
                    continue;
                }
                let is_within = codec.error(*sample, *sample, *source) <= codec.bound.allowed(*source);
                found.extend((!is_within && !self.fixed[first + at]).then_some((first + at) as u32));
            }
        }
        self.stats = stats;
        found
    }

    /// Adds the samples of the frame to a tally.
    fn tally(&self, of: &Source<'_>, number: usize, tally: &mut Tally) {
        let (codec, place) = (of.codec, number * self.source.len());
        (tally.min, tally.max) = join_ranges((tally.min, tally.max), self.unsided);
        for ((first, [samples, sources]), stats) in self.rows().zip(&self.stats) {
            if of.missing.count == 0 && is_clear(codec, stats) {
                tally.add_row(stats, codec.bound.largest_share(&[stats.largest], 1));
                continue;
            }
            for (at, (sample, source)) in samples.iter().zip(sources).enumerate() {
                if !of.missing.has(place + first + at) {
                    let error = if self.fixed[first + at] { 0.0 } else { codec.error(*sample, *sample, *source) };
                    tally.add(*sample, error);
                    tally.add_share(bound::share(error, codec.bound.allowed(*source)));
                }
            }
        }
    }

    /// The samples, and those of the source, in rows with the number of their first voxel.
    fn rows(&self) -> impl Iterator<Item = (usize, [&[f64]; 2])> {
        let rows = self.samples.chunks(RUN).zip(self.source.chunks(RUN)).map(|(samples, source)| [samples, source]);
        (0..).step_by(RUN).zip(rows)
    }
}

/// Whether all samples of a row are clearly within a bound that is the same for all, and none equals the declared missing value.
fn is_clear(codec: &WindowCodec, row: &RowStats) -> bool {
    let is_within = codec.bound.is_same() && row.largest.next_up() <= codec.bound.delta;
    is_within && codec.missing_value.is_none_or(|missing| missing < row.min || row.max < missing)
}

fn row_stats(samples: &[f64], source: &[f64]) -> RowStats {
    dispatch!(stats_of_row(samples, source))
}

/// The statistics of a row in [`LANES`] parts: part l covers the samples l, l + LANES, l + 2 LANES and so on.
struct Lanes {
    min: [f64; LANES],
    max: [f64; LANES],
    largest: [f64; LANES],
    squares: [f64; LANES],
}

impl Lanes {
    #[inline(always)]
    fn add(&mut self, l: usize, sample: f64, source: f64) {
        let error = (sample - source).abs();
        self.largest[l] = if error > self.largest[l] { error } else { self.largest[l] };
        self.squares[l] += error * error;
        self.min[l] = if sample < self.min[l] { sample } else { self.min[l] };
        self.max[l] = if sample > self.max[l] { sample } else { self.max[l] };
    }
}

#[inline(always)]
fn stats_of_row(samples: &[f64], source: &[f64]) -> RowStats {
    let mut lanes = Lanes {
        min: [f64::INFINITY; LANES],
        max: [f64::NEG_INFINITY; LANES],
        largest: [0.0; LANES],
        squares: [0.0; LANES],
    };
    let (some, last) = samples.as_chunks::<LANES>();
    let (of_some, of_last) = source.as_chunks::<LANES>();
    for (samples, source) in some.iter().zip(of_some) {
        for l in 0..LANES {
            lanes.add(l, samples[l], source[l]);
        }
    }
    last.iter().zip(of_last).enumerate().for_each(|(l, (sample, source))| lanes.add(l, *sample, *source));
    let squares: f64 = lanes.squares.iter().sum();
    let largest = if squares.is_nan() { f64::NAN } else { lanes.largest.into_iter().fold(0.0, f64::max) };
    let (min, max) =
        (lanes.min.into_iter().fold(f64::INFINITY, f64::min), lanes.max.into_iter().fold(f64::NEG_INFINITY, f64::max));
    RowStats { min, max, largest, squares }
}

/// A code between two, by bisection or false position.
fn between(small: Tried, large: Tried, is_middle: bool) -> Option<i64> {
    let (width, share) = (large.code.checked_sub(small.code)?, -small.sum / (large.sum - small.sum));
    let step = whole(width as f64 * if is_middle { 0.5 } else { share })?.clamp(1, (width - 1).max(1));
    (width > 1).then(|| small.code + step)
}

/// Rounds to the nearest integer; none for NaN and from 2^53 on.
fn whole(number: f64) -> Option<i64> {
    (number.abs() < 2f64.powi(53)).then(|| number.round() as i64)
}
