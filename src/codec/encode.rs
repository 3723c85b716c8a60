//! Samples of one block to a coded block that keeps its promise.

use super::truncate::Group;
use super::weigh::Weighing;
use super::{WindowCodec, lane_groups};
use crate::sample;
use crate::wavelet::{LANES, Lane};
use wavesplat_format::{BlockId, BlockStats, Compressor, EncodedBlock, EncodedPart, PartKind, PartStats};
use wavesplat_format::{pack_codes, pack_exact, pack_missing, pack_outliers};

/// One worker's encoder: scratch that is reused from block to block.
#[derive(Debug)]
pub struct Encoder {
    compressor: Compressor,
    codes: Vec<i32>,
    raw: Vec<u8>,
}

/// A coded block, and what the window's record adds up.
#[derive(Debug)]
pub struct Encoded {
    /// What the file stores.
    pub block: EncodedBlock,
    /// The largest share of its bound that a series uses, rounded up.
    pub share: f64,
    /// Nonzero coefficients.
    pub coded: u64,
    /// Samples stored exactly because they missed the bound.
    pub outliers: u64,
    /// Missing samples.
    pub missing: u64,
}

/// What is known about a block after its series have been coded.
struct Coded {
    step: f64,
    dropped: f64,
    outliers: wavesplat_format::Outliers,
    tally: Tally,
}

/// Errors and range of what the decoder gives back.
#[derive(Debug, Clone, Copy)]
struct Tally {
    min: f64,
    max: f64,
    reached: f64,
    squared_error: f64,
    /// The largest share of its bound that a series uses.
    share: f64,
}

impl Tally {
    const NONE: Self =
        Self { min: f64::INFINITY, max: f64::NEG_INFINITY, reached: 0.0, squared_error: 0.0, share: 0.0 };

    fn add(&mut self, decoded: f64, error: f64) {
        self.min = self.min.min(decoded);
        self.max = self.max.max(decoded);
        self.reached = self.reached.max(error);
        self.squared_error += error * error;
    }

    /// Adds a group of present samples whose errors are clearly within the bound, by vector code and with one
    /// rounding up at the end. False if they are not, so that each must be looked at; nothing is added then.
    fn add_clearly_within(&mut self, codec: &WindowCodec, group: &Group) -> bool {
        let (mut all, mut largest, mut squares) = ((self.min, self.max), Lane::default(), Lane::default());
        let mut sums = Lane::default();
        for (decoded, source) in group.decoded.iter().zip(&group.source) {
            let (rounded, mut errors) = (sample::round_all(codec.sample, decoded), Lane::default());
            for l in 0..LANES {
                let (a, b) = ((decoded[l] - source[l]).abs(), (rounded[l] - source[l]).abs());
                let e = if a > b { a } else { b };
                largest[l] = if e > largest[l] { e } else { largest[l] };
                squares[l] += e * e;
                errors[l] = e;
            }
            codec.promise.add(&errors, source, &mut sums);
            match sample::range_unless_missing(&rounded, codec.missing_value) {
                Some(range) => all = (all.0.min(range.0), all.1.max(range.1)),
                None => return false,
            }
        }
        let share = codec.promise.largest_share(&sums, codec.frames());
        if share > 1.0 {
            return false;
        }
        let largest = largest.into_iter().fold(0.0, f64::max);
        let largest = if largest > 0.0 { largest.next_up() } else { largest };
        self.reached = self.reached.max(largest);
        self.share = self.share.max(share);
        self.squared_error += squares.iter().sum::<f64>();
        (self.min, self.max) = all;
        true
    }
}

impl Encoder {
    /// With a zstd level.
    pub fn new(level: i32) -> wavesplat_format::Result<Self> {
        Ok(Self { compressor: Compressor::new(level)?, codes: Vec::new(), raw: Vec::new() })
    }

    /// Codes a block from its little-endian samples, frame by frame: `frames * voxels * sample size` bytes.
    pub fn block(&mut self, codec: &WindowCodec, id: BlockId, samples: &[u8]) -> wavesplat_format::Result<Encoded> {
        let missing = Missing::find(codec, samples);
        let coded = self.series(codec, samples, &missing);
        let coded = match coded {
            Some(coded) => self.coded_parts(codec, &coded)?,
            None => self.exact_parts(codec, samples, &missing)?,
        };
        let Parts { stats, share, mut parts } = self.smaller(codec, samples, &missing, coded)?;
        if missing.count > 0 {
            pack_missing(&missing.mask, &missing.samples(codec, samples), codec.sample.size(), clear(&mut self.raw));
            let stats = PartStats { count: missing.count, energy: 0.0, largest: 0.0 };
            parts.push(self.compressor.part(PartKind::Missing, stats, &self.raw)?);
            parts.sort_by_key(|part| part.kind); // an exact part stands after it
        }
        Ok(Encoded::new(EncodedBlock { id, stats, parts }, share, missing.count))
    }

    /// Codes every series. None if the block must be stored exactly.
    fn series(&mut self, codec: &WindowCodec, samples: &[u8], missing: &Missing) -> Option<Coded> {
        let voxels = samples.len() / codec.sample.size() / codec.frames();
        let weighing = Weighing::of(codec, samples, missing.magnitude)?;
        let step = weighing.step;
        clear(&mut self.codes).resize(codec.basis.coefficients() * voxels, 0);
        let mut group = Group::new(codec);
        let mut coded = Coded { step, dropped: 0.0, outliers: Default::default(), tally: Tally::NONE };
        let mut places = Vec::new();
        for (first, count) in lane_groups(voxels) {
            load_group(codec, &weighing, samples, missing, first, count, &mut group);
            if !group.quantise(codec, step) {
                return None;
            }
            group.truncate(codec, step);
            coded.dropped += self.keep_codes(&group, step, voxels, first, count);
            if count < LANES || missing.count > 0 || !coded.tally.add_clearly_within(codec, &group) {
                check_group(codec, &group, voxels, first, count, &mut coded.tally, &mut places);
            }
            if places.len() > samples.len() / codec.sample.size() / MOST_OUTLIERS {
                return None;
            }
        }
        coded.outliers = gather_outliers(codec, samples, places);
        Some(coded)
    }

    /// Writes a group's kept codes, k-major, and returns the energy that dropping and rounding cost.
    fn keep_codes(&mut self, group: &Group, step: f64, voxels: usize, first: usize, count: usize) -> f64 {
        let mut lost = 0.0;
        for (k, coefficients) in group.coefficients.iter().enumerate() {
            let codes = group.kept(k);
            self.codes[k * voxels + first..][..count].copy_from_slice(&codes[..count]);
            for (c, code) in coefficients.iter().zip(codes).take(count) {
                let error = c - f64::from(code) * step;
                lost += error * error;
            }
        }
        lost
    }

    /// The parts of a block coded by coefficients.
    fn coded_parts(&mut self, codec: &WindowCodec, coded: &Coded) -> wavesplat_format::Result<Parts> {
        let voxels = self.codes.len() / codec.basis.coefficients();
        let mut parts = Vec::new();
        for (level, range) in codec.parts.iter().enumerate() {
            let codes = &self.codes[range.start * voxels..range.end * voxels];
            let stats = code_stats(codes, coded.step);
            if stats.count > 0 {
                pack_codes(codes, clear(&mut self.raw));
                parts.push(self.compressor.part(PartKind::Level(level as u8), stats, &self.raw)?);
            }
        }
        let count = coded.outliers.positions.len() as u64;
        if count > 0 {
            pack_outliers(&coded.outliers, codec.sample.size(), clear(&mut self.raw));
            let stats = PartStats { count, energy: 0.0, largest: 0.0 };
            parts.push(self.compressor.part(PartKind::Outliers, stats, &self.raw)?);
        }
        Ok(Parts::new(coded.tally, coded.step, coded.dropped, parts))
    }

    /// The parts of a block stored exactly.
    fn exact_parts(
        &mut self,
        codec: &WindowCodec,
        samples: &[u8],
        missing: &Missing,
    ) -> wavesplat_format::Result<Parts> {
        let mut tally = Tally::NONE;
        sample::for_each_run(codec.sample, samples, |first, values| {
            let present = values.iter().zip(&missing.mask[first..]).filter(|(_, missing)| !**missing);
            present.for_each(|(value, _)| tally.add(*value, 0.0));
        });
        pack_exact(samples, codec.sample.size(), clear(&mut self.raw));
        let count = (samples.len() / codec.sample.size()) as u64;
        let stats = PartStats { count, energy: 0.0, largest: 0.0 };
        let part = self.compressor.part(PartKind::Exact, stats, &self.raw)?;
        Ok(Parts::new(tally, 0.0, 0.0, vec![part]))
    }

    /// The block as coded, or stored exactly if it hardly shrank and that is smaller.
    fn smaller(
        &mut self,
        codec: &WindowCodec,
        samples: &[u8],
        missing: &Missing,
        coded: Parts,
    ) -> wavesplat_format::Result<Parts> {
        let size = |coded: &Parts| coded.parts.iter().map(|p| p.stored.len()).sum::<usize>();
        if size(&coded) < samples.len() / 2 || coded.parts.iter().any(|p| p.kind == PartKind::Exact) {
            return Ok(coded);
        }
        let exact = self.exact_parts(codec, samples, missing)?;
        Ok(if size(&exact) < size(&coded) { exact } else { coded })
    }
}

/// The parts of a block, and what the directory and the window's record say of them.
struct Parts {
    stats: BlockStats,
    share: f64,
    parts: Vec<EncodedPart>,
}

impl Parts {
    fn new(tally: Tally, step: f64, dropped: f64, parts: Vec<EncodedPart>) -> Self {
        let Tally { min, max, reached, squared_error, share } = tally;
        Self { stats: BlockStats { step, min, max, reached, squared_error, dropped }, share, parts }
    }
}

/// A block in which more than one sample in this many misses the bound is stored exactly: an outlier costs more bytes.
const MOST_OUTLIERS: usize = 8;

impl Encoded {
    fn new(block: EncodedBlock, share: f64, missing: u64) -> Self {
        let count =
            |wanted: fn(PartKind) -> bool| block.parts.iter().filter(|p| wanted(p.kind)).map(|p| p.stats.count).sum();
        let coded = count(|kind| matches!(kind, PartKind::Level(_)));
        let outliers = count(|kind| kind == PartKind::Outliers);
        Self { block, share, coded, outliers, missing }
    }
}

fn clear<T>(buffer: &mut Vec<T>) -> &mut Vec<T> {
    buffer.clear();
    buffer
}

fn code_stats(codes: &[i32], step: f64) -> PartStats {
    let mut stats = PartStats { count: 0, energy: 0.0, largest: 0.0 };
    for code in codes.iter().filter(|c| **c != 0) {
        let c = f64::from(*code) * step;
        stats.count += 1;
        stats.energy += c * c;
        stats.largest = stats.largest.max(c.abs());
    }
    stats
}

/// Which samples of a block are missing, and the largest of the others.
struct Missing {
    mask: Vec<bool>,
    count: u64,
    magnitude: f64,
}

impl Missing {
    fn find(codec: &WindowCodec, samples: &[u8]) -> Self {
        let mut found = Self { mask: vec![false; samples.len() / codec.sample.size()], count: 0, magnitude: 0.0 };
        sample::for_each_run(codec.sample, samples, |first, values| {
            if let Some((lo, hi)) = sample::range_unless_missing(values, codec.missing_value) {
                found.magnitude = found.magnitude.max(-lo).max(hi);
                return;
            }
            for (i, value) in values.iter().enumerate() {
                found.mask[first + i] = codec.is_missing(*value);
                found.count += u64::from(found.mask[first + i]);
                found.magnitude =
                    if found.mask[first + i] { found.magnitude } else { found.magnitude.max(value.abs()) };
            }
        });
        found
    }

    /// The very bytes of the missing samples.
    fn samples(&self, codec: &WindowCodec, samples: &[u8]) -> Vec<u8> {
        let each = samples.chunks_exact(codec.sample.size());
        each.zip(&self.mask).filter(|(_, missing)| **missing).flat_map(|(bytes, _)| bytes).copied().collect()
    }
}

/// Loads the series of a group of voxels, missing samples filled with the last present one (or the next, or zero).
fn load_group(
    codec: &WindowCodec,
    weighing: &Weighing,
    samples: &[u8],
    missing: &Missing,
    first: usize,
    count: usize,
    group: &mut Group,
) {
    let voxels = missing.mask.len() / codec.frames();
    let size = codec.sample.size();
    for (frame, (source, weight)) in group.source.iter_mut().zip(&mut group.weight).enumerate() {
        let at = frame * voxels + first;
        *source = Lane::default();
        sample::load(codec.sample, &samples[at * size..(at + count) * size], &mut source[..count]);
        let weights = weighing.weights(source);
        *weight = std::array::from_fn(|l| if l < count && !missing.mask[at + l] { weights[l] } else { 0.0 });
    }
    if missing.count > 0 {
        (0..count).for_each(|lane| fill(&mut group.source, &group.weight, lane));
    }
}

fn fill(source: &mut [Lane], weight: &[Lane], lane: usize) {
    let present = (0..source.len()).find(|t| weight[*t][lane] > 0.0);
    let mut last = present.map_or(0.0, |t| source[t][lane]);
    for (value, weight) in source.iter_mut().zip(weight) {
        if weight[lane] > 0.0 {
            last = value[lane];
        } else {
            value[lane] = last;
        }
    }
}

/// Compares what the decoder gives with the source, sample by sample, and notes the places of those that miss the bound.
fn check_group(
    codec: &WindowCodec,
    group: &Group,
    voxels: usize,
    first: usize,
    count: usize,
    tally: &mut Tally,
    places: &mut Vec<u32>,
) {
    let mut errors = vec![(0.0, 0.0); codec.frames()]; // each with what is allowed
    for lane in 0..count {
        let present = |t: usize| group.weight[t][lane] > 0.0;
        for (t, error) in errors.iter_mut().enumerate() {
            let (decoded, source) = (group.decoded[t][lane], group.source[t][lane]);
            let rounded = sample::round_to(codec.sample, decoded);
            let found = if present(t) { codec.error(decoded, rounded, source) } else { 0.0 };
            *error = (found, codec.promise.allowed(source));
        }
        let holds = codec.promise.holds(errors.iter().copied());
        for (t, (error, allowed)) in errors.iter_mut().enumerate().filter(|(t, _)| present(*t)) {
            if holds || *error <= *allowed {
                tally.add(sample::round_to(codec.sample, group.decoded[t][lane]), *error);
            } else {
                *error = 0.0;
                tally.add(group.source[t][lane], 0.0);
                places.push((t * voxels + first + lane) as u32);
            }
        }
        let share = codec.promise.share(errors.iter().copied());
        tally.share = tally.share.max(share.min(1.0)); // rounded up beyond what holds
    }
}

fn gather_outliers(codec: &WindowCodec, samples: &[u8], mut positions: Vec<u32>) -> wavesplat_format::Outliers {
    let size = codec.sample.size();
    positions.sort_unstable();
    let bytes = |p: &u32| &samples[*p as usize * size..(*p as usize + 1) * size];
    let samples = positions.iter().flat_map(bytes).copied().collect();
    wavesplat_format::Outliers { positions, samples }
}
