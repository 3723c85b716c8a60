//! Encodes the samples of one block within its error bound.
//!
//! 1. Transform along time (eq 5).
//! 2. Without a pyramid, quantise, then drop the smallest coefficients of each series (eq 7). With a pyramid, code the
//!    field pass by pass (eq 32).
//! 3. Decode with the arithmetic of [`super::decode`], and compare with the source in the measure of the bound
//!    (eq 21-23). Series that surely change nothing but the sum of squared errors are compared in 32-bit floats (`screen`).
//! 4. Store the samples that miss the bound exactly. Store all samples exactly if too many miss it, or if that is
//!    smaller: their bytes, or if they have few values the places in a list of these.
//!
//! So the bound holds for any finite input and any basis, and includes rounding and quantisation errors. Missing
//! samples are stored without loss: a mask, and their own bytes.

use super::block_with_ghosts::{BlockWithGhosts, SampleBytes};
use super::box_samples::BoxSamples;
use super::buffer::{Buffer, clear};
use super::check::Tally;
use super::codes::Codes;
use super::derived::{Computed, DerivedErrors};
use super::error_weights::QuantizerSetup;
use super::field::{Above, Field, Stored};
use super::group::Group;
use super::listed::may_be_smaller;
use super::load::{Missing, Source, load_group};
use super::mend::Mended;
use super::refine::Coded;
use super::rows::count_nonzero;
use super::truncate::Truncation;
use super::{WindowCodec, lane_groups};
use crate::base::sample::join_ranges;
use crate::base::vectors::dispatch;
use crate::wavelet::{LANES, Lane};
use wavesplat_format::{BlockId, BlockStats, Compressor, EncodedBlock, EncodedPart, Listed, PartKind, PartStats};
use wavesplat_format::{pack_codes, pack_exact, pack_missing, pack_outliers, pack_sides, pack_sums};

/// The encoder of one worker.
#[derive(Debug)]
pub struct Encoder {
    level: i32,
    compressor: Compressor,
    codes: Buffer<i32>,
    raw: Vec<u8>,
    /// Results whose errors are measured.
    computed: Option<Computed>,
}

/// A coded block, and facts that its bytes do not contain.
#[derive(Debug)]
pub struct Encoded {
    /// The parts that the file stores.
    pub block: EncodedBlock,
    /// The largest share of a series, rounded up: its error divided by its bound.
    pub share: f64,
    /// Errors of what is computed from the decoded samples, if they are [measured](Encoder::measuring).
    pub derived: Option<DerivedErrors>,
}

impl Encoder {
    /// Creates an encoder with a zstd level.
    pub fn new(level: i32) -> wavesplat_format::Result<Self> {
        Ok(Self {
            level,
            compressor: Compressor::new(level)?,
            codes: Buffer::default(),
            raw: Vec::new(),
            computed: None,
        })
    }

    /// Its zstd level.
    pub fn level(&self) -> i32 {
        self.level
    }

    /// The encoder, which also measures the errors of what is computed.
    pub fn measuring(self, computed: Computed) -> Self {
        Self { computed: Some(computed), ..self }
    }

    /// Encodes a block of some voxels. `samples` are those of the known voxels, and may have room behind them for
    /// [`WindowCodec::outer_size`]; `above` is the block above, if there are tiers.
    pub fn block(
        &mut self,
        codec: &WindowCodec,
        id: BlockId,
        of: impl Into<BlockWithGhosts>,
        samples: Buffer<u8>,
        above: Option<&Above>,
    ) -> wavesplat_format::Result<Encoded> {
        let of: BlockWithGhosts = of.into();
        let (size, around) = (of.size, codec.outer_size(of.size));
        let extended = of.extended(codec, around, SampleBytes::Own(samples));
        let missing_around = Missing::find(codec, &extended);
        let outer = BoxSamples::whole(codec.sample, &extended, around);
        let outer = Source { codec, samples: outer, missing: &missing_around };
        let samples = &BoxSamples::new(codec.sample, &extended, around, size);
        let missing = Missing::within(codec, samples, &missing_around);
        let block = Source { codec, samples: *samples, missing: &missing };
        let (mut single, mut double) = (Buffer::default(), Buffer::default());
        let mut coded = match &codec.scheme.pyramid {
            None => self.series(&block),
            Some(pyramid) if pyramid.single => {
                block.refine(pyramid, size, &outer, above.map(Above::singles), &mut single, &mut self.codes)
            }
            Some(pyramid) => {
                block.refine(pyramid, size, &outer, above.map(Above::doubles), &mut double, &mut self.codes)
            }
        };
        let (mended, derived) = {
            let is_needed = codec.mends() || self.computed.is_some();
            // Without need, the buffers go here: packing takes memory.
            let field = coded.as_ref().filter(|_| is_needed).map(|coded| self.field(codec, coded, single, double));
            let derived = self.computed.as_ref().map(|of| match (&coded, &field) {
                (Some(coded), Some(field)) => of.errors_in(&block, &block.restored(coded, field)),
                _ => of.errors_in(&block, &block.samples.contiguous()),
            });
            let mended = coded.as_mut().zip(field.as_ref()).map(|(coded, field)| block.mend(coded, field));
            (mended.unwrap_or_else(|| Some(Mended::default())), derived)
        };
        let (coded, mended) = mended.map_or((None, Mended::default()), |mended| (coded, mended));
        let parts = match &coded {
            Some(coded) => self.coded_parts(codec, size, coded)?,
            None => self.exact_parts(codec, samples, &missing, None)?,
        };
        let mut parts = self.smaller(codec, samples, &missing, parts)?;
        if !parts.are_exact() {
            parts.add(&mut self.compressor, &mended, &mut self.raw)?;
        }
        let Parts { stats, share, mut parts } = parts;
        if missing.count > 0 {
            pack_missing(missing.mask(), &missing.samples(samples), codec.sample.size(), clear(&mut self.raw));
            let stats = PartStats { count: missing.count, energy: 0.0, largest: 0.0 };
            parts.push(self.compressor.part(PartKind::Missing, stats, &self.raw)?);
            parts.sort_by_key(|part| part.kind); // exact parts, sides and sums come after it
        }
        Ok(Encoded { block: EncodedBlock { id, stats, parts }, share, derived })
    }

    /// The decoded coefficients of a block; `single` or `double` are its nodes, if a pyramid refines it.
    fn field(&self, codec: &WindowCodec, coded: &Coded, single: Buffer<f32>, double: Buffer<f64>) -> Field<'_> {
        match &codec.scheme.pyramid {
            _ if coded.step == 0.0 => Field::zero(codec),
            None => Field::scaled(codec, coded.step, &self.codes),
            Some(pyramid) if pyramid.single => Field::single(single, coded.marked.clone()),
            Some(_) => Field::double(double, coded.marked.clone()),
        }
    }

    /// Encodes a block of a tier above 0 that covers `size` voxels, and returns its decoded nodes for the blocks below. `of` are its
    /// nodes, and `samples` those that `BlockWithGhosts::coarse` makes them from.
    pub fn coarse(
        &mut self,
        codec: &WindowCodec,
        id: BlockId,
        size: [usize; 3],
        of: BlockWithGhosts,
        samples: Buffer<u8>,
        above: Option<&Above>,
    ) -> wavesplat_format::Result<(EncodedBlock, Field<'static>)> {
        let samples = of.coarse(codec, samples);
        let missing = Missing::find(codec, &samples);
        let samples = BoxSamples::whole(codec.sample, &samples, of.size);
        let source = Source { codec, samples, missing: &missing };
        let Some(pyramid) = &codec.scheme.pyramid else { return Ok(self.uncoded(codec, id, size, above)) };
        let (mut single, mut double) = (Buffer::default(), Buffer::default());
        let coded = match pyramid.single {
            true => source.refine(pyramid, size, &source, above.map(Above::singles), &mut single, &mut self.codes),
            false => source.refine(pyramid, size, &source, above.map(Above::doubles), &mut double, &mut self.codes),
        };
        let Some(coded) = coded else { return Ok(self.uncoded(codec, id, size, above)) };
        let Parts { stats, parts, .. } = self.coded_parts(codec, size, &coded)?;
        let marked = coded.marked;
        let field = if pyramid.single { Field::single(single, marked) } else { Field::double(double, marked) };
        Ok((EncodedBlock { id, stats, parts }, field))
    }

    /// A block of a tier above 0 without codes.
    fn uncoded(
        &self,
        codec: &WindowCodec,
        id: BlockId,
        size: [usize; 3],
        above: Option<&Above>,
    ) -> (EncodedBlock, Field<'static>) {
        let Parts { stats, parts, .. } = Parts::new(&Tally::new(), 0.0, 0.0, Vec::new());
        let wanted = vec![true; codec.basis.coefficients()];
        let of = Stored { size, step: 0.0, codes: &Codes::default(), above, part: None };
        let field = Field::refined(codec, of, &wanted);
        (EncodedBlock { id, stats, parts }, field)
    }

    /// Encodes every series by itself. None if the block must be stored exactly.
    fn series(&mut self, block: &Source<'_>) -> Option<Coded> {
        let &Source { codec, ref samples, missing, .. } = block;
        let voxels = block.voxels();
        let weighing = QuantizerSetup::new(codec, samples, missing.magnitude)?;
        if let Some(zero) = block.zero_by_sample() {
            return Some(zero);
        }
        let step = weighing.step;
        self.codes.renew(codec.basis.coefficients() * voxels);
        let (mut group, mut truncation) = (Group::new(codec), Truncation::new(codec, step));
        let (mut dropped, mut tally) = (0.0, Tally::new());
        for (first, count) in lane_groups(voxels) {
            load_group(codec, &weighing, samples, missing, first, count, &mut group);
            if !truncation.code(&mut group) {
                return None;
            }
            dropped += self.keep_codes(&group, step, voxels, first, count);
            block.check(&group, first, count, &mut tally)?;
        }
        let marked = Vec::new();
        Some(Coded { step, marked, parts: None, dropped, outliers: tally.take_outliers(samples), tally })
    }

    /// Writes a group's codes, k-major. Returns the energy lost by dropping and rounding.
    fn keep_codes(&mut self, group: &Group, step: f64, voxels: usize, first: usize, count: usize) -> f64 {
        for (k, codes) in group.codes.iter().enumerate() {
            let kept = &mut self.codes[k * voxels + first..][..count];
            match kept.first_chunk_mut() {
                Some(kept) => *kept = *codes,
                None => kept.copy_from_slice(&codes[..count]),
            }
        }
        dispatch!(lost_energy(&group.coefficients[..], &group.codes[..], step))[..count].iter().sum()
    }

    /// The parts of a block coded by coefficients.
    fn coded_parts(&mut self, codec: &WindowCodec, size: [usize; 3], coded: &Coded) -> wavesplat_format::Result<Parts> {
        let pyramid = codec.scheme.pyramid.as_ref();
        let passes = pyramid.map(|p| (p.packing, codec.passes(p, size)));
        let mut parts = Vec::new();
        for level in 0..codec.parts() as u8 {
            clear(&mut self.raw);
            let known = coded.parts.as_ref().map(|parts| parts[usize::from(level)]);
            let stats = match (known, &passes) {
                (Some(stats), _) if stats.count == 0 => stats,
                (Some(stats), Some((packing, passes))) => {
                    packing.pack(&passes.part_of(level, &self.codes), &mut self.raw);
                    stats
                }
                _ => {
                    let codes = &self.codes[codec.level_range(level, size)];
                    pack_codes(codes, &mut self.raw);
                    code_stats(codes, coded.step)
                }
            };
            if stats.count > 0 {
                parts.push(self.compressor.part(PartKind::Level(level), stats, &self.raw)?);
            }
        }
        let count = coded.outliers.positions.len() as u64;
        if count > 0 {
            pack_outliers(&coded.outliers, codec.sample.size(), clear(&mut self.raw));
            let stats = PartStats { count, energy: 0.0, largest: 0.0 };
            parts.push(self.compressor.part(PartKind::Outliers, stats, &self.raw)?);
        }
        Ok(Parts::new(&coded.tally, coded.step, coded.dropped, parts).clipped(codec.clip))
    }

    /// The parts of a block stored exactly, by its bytes or by its list of values.
    fn exact_parts(
        &mut self,
        codec: &WindowCodec,
        samples: &BoxSamples<'_>,
        missing: &Missing,
        listed: Option<&Listed>,
    ) -> wavesplat_format::Result<Parts> {
        let mut tally = Tally::new();
        samples.for_each_run(|first, values| {
            let present = (first..).zip(values).filter(|(sample, _)| !missing.has(*sample));
            present.for_each(|(_, value)| tally.add(*value, 0.0));
        });
        let size = codec.sample.size();
        clear(&mut self.raw);
        let kind = match listed {
            Some(listed) => {
                listed.pack(&mut Vec::new(), &mut self.raw);
                PartKind::Listed
            }
            None => {
                pack_exact(&samples.contiguous(), size, &mut self.raw);
                PartKind::Exact
            }
        };
        let count = samples.len() as u64;
        let part = self.compressor.part(kind, PartStats { count, energy: 0.0, largest: 0.0 }, &self.raw)?;
        Ok(Parts::new(&tally, 0.0, 0.0, vec![part]))
    }

    /// The coded parts, or exact ones if those are smaller. Bytes are tried only if coding saved less than half, and a list only if
    /// it may pay.
    fn smaller(
        &mut self,
        codec: &WindowCodec,
        samples: &BoxSamples<'_>,
        missing: &Missing,
        coded: Parts,
    ) -> wavesplat_format::Result<Parts> {
        let mut best = coded;
        if best.bytes() >= samples.len() * codec.sample.size() / 2
            && best.parts.iter().all(|part| part.kind != PartKind::Exact)
        {
            best = best.or(self.exact_parts(codec, samples, missing, None)?);
        }
        if let Some(listed) = listed(codec, samples, best.bytes()) {
            best = best.or(self.exact_parts(codec, samples, missing, Some(&listed))?);
        }
        Ok(best)
    }
}

impl Encoder {
    /// Compresses the payload of a part.
    pub(super) fn part(
        &mut self,
        kind: PartKind,
        stats: PartStats,
        raw: &[u8],
    ) -> wavesplat_format::Result<EncodedPart> {
        self.compressor.part(kind, stats, raw)
    }
}

/// The parts of a block, with its statistics for the directory and the window's record.
struct Parts {
    stats: BlockStats,
    share: f64,
    parts: Vec<EncodedPart>,
}

/// So many values of a list take at least a byte.
const VALUES_OF_A_BYTE: usize = 8;

/// The samples of a block by their values, if the file may list them and that may take less than `bytes`.
pub(super) fn listed(codec: &WindowCodec, samples: &BoxSamples<'_>, bytes: usize) -> Option<Listed> {
    let [x, y, z] = samples.size();
    let may_pay = codec.lists && may_be_smaller(samples, bytes);
    let extents = [x, y, z, codec.frames()];
    let most = bytes.saturating_mul(VALUES_OF_A_BYTE);
    may_pay.then(|| Listed::new(samples.rows(), codec.sample.size(), extents, most)).flatten()
}

impl Parts {
    /// Bytes of the file that they take, without entries.
    fn bytes(&self) -> usize {
        self.parts.iter().map(|part| part.stored.len()).sum()
    }

    /// Whether all samples are stored exactly.
    fn are_exact(&self) -> bool {
        self.parts.iter().any(|part| part.kind.is_exact())
    }

    /// Adds what moves samples to what the file keeps.
    fn add(&mut self, compressor: &mut Compressor, mended: &Mended, raw: &mut Vec<u8>) -> wavesplat_format::Result<()> {
        let stats = |count: u64| PartStats { count, energy: 0.0, largest: 0.0 };
        if let Some(sides) = &mended.sides {
            pack_sides(&sides.codes, clear(raw));
            self.parts.push(compressor.part(PartKind::Sides, stats(sides.count), raw)?);
            (self.stats.min, self.stats.max) = join_ranges((self.stats.min, self.stats.max), sides.range);
        }
        if let Some(sums) = &mended.sums {
            pack_sums(sums, clear(raw));
            self.parts.push(compressor.part(PartKind::Sums, stats(sums.count()), raw)?);
        }
        Ok(())
    }

    /// These, or others that take less.
    fn or(self, other: Self) -> Self {
        if other.bytes() < self.bytes() { other } else { self }
    }

    /// The parts with the range that extracted samples are kept within.
    fn clipped(mut self, clip: Option<(f64, f64)>) -> Self {
        if let Some((lo, hi)) = clip.filter(|_| self.stats.min <= self.stats.max) {
            (self.stats.min, self.stats.max) = (self.stats.min.clamp(lo, hi), self.stats.max.clamp(lo, hi));
        }
        self
    }

    fn new(tally: &Tally, step: f64, dropped: f64, parts: Vec<EncodedPart>) -> Self {
        let &Tally { min, max, reached, squared_error, share, .. } = tally;
        Self { stats: BlockStats { step, min, max, reached, squared_error, dropped }, share, parts }
    }
}

/// The count, energy and largest of the coefficients that codes stand for.
fn code_stats(codes: &[i32], step: f64) -> PartStats {
    let energy = dispatch!(energy(codes, step));
    let largest = codes.iter().map(|code| code.unsigned_abs()).max().unwrap_or(0);
    PartStats { count: dispatch!(count_nonzero(codes)) as u64, energy, largest: f64::from(largest) * step }
}

/// The squared errors of coefficients, summed up for each lane.
#[inline(always)]
fn lost_energy(coefficients: &[Lane], codes: &[[i32; LANES]], step: f64) -> Lane {
    let mut lanes = Lane::default();
    for (coefficients, codes) in coefficients.iter().zip(codes) {
        for l in 0..LANES {
            let error = coefficients[l] - f64::from(codes[l]) * step;
            lanes[l] += error * error;
        }
    }
    lanes
}

/// The sum of squared coefficients.
#[inline(always)]
fn energy(codes: &[i32], step: f64) -> f64 {
    let (some, last) = codes.as_chunks::<LANES>();
    let mut lanes = Lane::default();
    for codes in some {
        for l in 0..LANES {
            let c = f64::from(codes[l]) * step;
            lanes[l] += c * c;
        }
    }
    let last = last.iter().map(|code| f64::from(*code) * step);
    lanes.iter().sum::<f64>() + last.map(|c| c * c).sum::<f64>()
}
