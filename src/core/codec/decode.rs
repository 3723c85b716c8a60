//! Decodes a block to samples: the only decoder of the project.
//!
//! A coefficient is its code times the step, refined by the pyramid if there is one (eq 32). The inverse transform of
//! each voxel's coefficients gives its series (eq 7). Then outliers and missing samples, stored exactly, replace
//! decoded samples.

use super::WindowCodec;
use super::buffer::Buffer;
use super::codes::Codes;
use super::field::{Above, Field, LONG_RUN, Plane, RUN, Stored};
use super::rows::Change;
use super::shifts::{self, FrameRun, shift_and_clip};
use crate::base::grid::Region;
use crate::base::sample::{self, SampleType};
use crate::wavelet;
use std::ops::Range;
use wavesplat_format::{
    Axis, Basis, BlockEntry, Outliers, PartEntry, PartKind, Reader, Result, SideCodes, Storage, SumCodes,
};

/// One block in memory, decompressed but not yet transformed.
#[derive(Debug)]
pub struct Block {
    /// The number of decoded voxels along x, y, z.
    pub size: [usize; 3],
    /// The number of decoded voxels.
    pub voxels: usize,
    /// All voxels of the block; more than are decoded if the codec leaves out detail.
    of: [usize; 3],
    /// The quantisation step.
    pub step: f64,
    /// The codes of the level parts that were read.
    pub codes: Codes,
    /// The nodes of the block above, if the codes need them.
    pub above: Option<Above>,
    /// Samples stored exactly because their decoded values miss the bound.
    pub outliers: Outliers,
    /// Which samples are missing (`frame * voxels + voxel`), and the bytes of those in order; empty if none is missing.
    pub missing: (Vec<bool>, Vec<u8>),
    /// All samples, if the block is stored exactly.
    pub exact: Option<Vec<u8>>,
    /// How samples get to their sides of each value that the file keeps; empty if all are there.
    pub sides: Vec<SideCodes>,
    /// What keeps the sums of frames; none if decoded samples have them.
    pub sums: Option<SumCodes>,
    /// The number of stored bytes read.
    pub bytes_read: u64,
}

/// Some frames of a window, and the coefficients that they need.
#[derive(Debug, Clone)]
pub struct WantedFrames {
    /// Their numbers in the window.
    pub frames: Vec<usize>,
    /// Which coefficients affect them.
    pub coefficients: Vec<bool>,
}

impl WantedFrames {
    /// These frames.
    pub fn new(codec: &WindowCodec, frames: Vec<usize>) -> Self {
        Self { coefficients: wavelet::needed(&codec.synthesis, &frames), frames }
    }

    /// All frames of the window.
    pub fn all(codec: &WindowCodec) -> Self {
        Self { frames: (0..codec.frames()).collect(), coefficients: vec![true; codec.basis.coefficients()] }
    }
}

impl Block {
    /// Reads a block: the level parts needed for the coefficients that `wanted` marks, of the nodes in `part` if there is one, and all
    /// exactly stored samples. `above` are the nodes of the block above, if the window has tiers.
    pub fn read<S: Storage>(
        reader: &Reader<S>,
        codec: &WindowCodec,
        entry: &BlockEntry,
        of: [usize; 3],
        wanted: &[bool],
        part: Option<&Region>,
        above: Option<Above>,
    ) -> Result<Self> {
        let size = codec.decoded_size(of);
        let mut block = Self {
            size,
            voxels: size.iter().product(),
            of,
            step: entry.stats.step,
            codes: Codes::default(),
            above,
            outliers: reader.outliers(entry)?,
            missing: reader.missing(entry)?.unwrap_or_default(),
            exact: reader.exact(entry)?,
            sides: Self::read_sides(reader, codec, entry)?,
            sums: if codec.lod == 0 { reader.sums(entry)? } else { None },
            bytes_read: 0,
        };
        block.thin_samples(codec);
        block.read_codes(reader, codec, entry, wanted, part)?;
        block.bytes_read += entry.parts.iter().filter(|p| !is_level(p)).map(|p| u64::from(p.stored_len)).sum::<u64>();
        Ok(block)
    }

    /// The parts that [`Self::read`] reads.
    pub fn parts<'a>(
        codec: &'a WindowCodec,
        entry: &'a BlockEntry,
        wanted: &'a [bool],
    ) -> impl Iterator<Item = &'a PartEntry> {
        let decodes_sides = codec.decodes_sides(entry);
        entry.parts.iter().filter(move |part| match part.kind {
            PartKind::Level(_) if decodes_sides => true,
            PartKind::Level(level) => codec.needs_part(level.into(), wanted),
            PartKind::Sides => decodes_sides,
            PartKind::Sums => codec.lod == 0,
            _ => true,
        })
    }

    /// A block with these codes, as [`Self::all_codes`] returns them.
    pub fn from_codes(codec: &WindowCodec, size: [usize; 3], step: f64, codes: &[i32]) -> Self {
        let mut block = Self { missing: Default::default(), step, ..Self::missing(codec, size) };
        block.set_codes(codec, codes);
        block
    }

    /// A block with every sample missing: NaN for float types, else the declared value, or 0 without one.
    pub fn missing(codec: &WindowCodec, of: [usize; 3]) -> Self {
        let size = codec.decoded_size(of);
        let voxels: usize = size.iter().product();
        let samples = codec.frames() * voxels;
        let number = if codec.sample.is_float() { f64::NAN } else { codec.missing_value.unwrap_or(0.0) };
        let mut bytes = vec![0; samples * codec.sample.size()];
        sample::store(codec.sample, &vec![number; samples], &mut bytes);
        let (outliers, missing) = (Outliers::default(), (vec![true; samples], bytes));
        Self {
            size,
            voxels,
            of,
            step: 0.0,
            codes: Codes::default(),
            above: None,
            outliers,
            missing,
            exact: None,
            sides: Vec::new(),
            sums: None,
            bytes_read: 0,
        }
    }

    /// Reads the level parts that exist and that `wanted` needs; the codes of others are zero.
    fn read_codes<S: Storage>(
        &mut self,
        reader: &Reader<S>,
        codec: &WindowCodec,
        entry: &BlockEntry,
        wanted: &[bool],
        part: Option<&Region>,
    ) -> Result<()> {
        let parts: Vec<&PartEntry> = Self::parts(codec, entry, wanted).filter(|part| is_level(part)).collect();
        if parts.is_empty() {
            return Ok(());
        }
        self.bytes_read += parts.iter().map(|part| u64::from(part.stored_len)).sum::<u64>();
        let needed = |level: u8| parts.iter().any(|part| part.kind == PartKind::Level(level));
        self.codes = match &codec.scheme.pyramid {
            Some(pyramid) => {
                let passes = codec.passes(pyramid, self.of);
                let passes = if let Some(part) = part { passes.within(part) } else { passes };
                Codes::Sparse(passes.read(reader, entry, needed)?)
            }
            None => Codes::Dense(self.read_dense(reader, codec, entry, needed)?),
        };
        Ok(())
    }

    fn read_dense<S: Storage>(
        &self,
        reader: &Reader<S>,
        codec: &WindowCodec,
        entry: &BlockEntry,
        needed: impl Fn(u8) -> bool,
    ) -> Result<Buffer<i32>> {
        let all: usize = self.of.iter().product();
        let mut codes = Buffer::with_len(codec.basis.coefficients() * all);
        for level in 0..codec.parts() as u8 {
            let range = codec.level_range(level, self.of);
            if needed(level) {
                reader.codes(entry, level, &mut codes[range])?;
            } else {
                codes[range].fill(0);
            }
        }
        if codec.lod == 0 {
            return Ok(codes);
        }
        let decoded = self.decoded_voxels(codec);
        let mut thinned = Buffer::with_len(codec.basis.coefficients() * decoded.len());
        let of_all = codes.chunks_exact(all).flat_map(|of_k| decoded.iter().map(|voxel| of_k[*voxel]));
        thinned.iter_mut().zip(of_all).for_each(|(to, code)| *to = code);
        Ok(thinned)
    }

    /// The numbers of the voxels that are decoded, among all.
    fn decoded_voxels(&self, codec: &WindowCodec) -> Vec<usize> {
        let [x, y, _] = self.of;
        let along = |a: usize| (0..self.of[a]).step_by(1 << codec.lod);
        along(2).flat_map(|z| along(1).flat_map(move |y_| along(0).map(move |x_| x_ + x * (y_ + y * z)))).collect()
    }

    /// Leaves out the stored samples of voxels that are not decoded.
    fn thin_samples(&mut self, codec: &WindowCodec) {
        if codec.lod == 0 || (self.exact.is_none() && !self.overrides()) {
            return;
        }
        let (all, size) = (self.of.iter().product::<usize>(), codec.sample.size());
        let decoded = self.decoded_voxels(codec);
        let samples = || (0..codec.frames()).flat_map(|frame| decoded.iter().map(move |voxel| frame * all + voxel));
        if let Some(exact) = &mut self.exact {
            let mut kept = Vec::with_capacity(codec.frames() * decoded.len() * size);
            samples().for_each(|at| kept.extend_from_slice(&exact[at * size..][..size]));
            *exact = kept;
        }
        let number = |at: usize| Some(at / all * decoded.len() + decoded.binary_search(&(at % all)).ok()?);
        let Outliers { positions, samples: bytes } = std::mem::take(&mut self.outliers);
        for (at, bytes) in positions.iter().zip(bytes.chunks_exact(size)) {
            if let Some(number) = number(*at as usize) {
                self.outliers.positions.push(number as u32);
                self.outliers.samples.extend(bytes);
            }
        }
        let (mask, bytes) = std::mem::take(&mut self.missing);
        let mut is_decoded = vec![false; all];
        decoded.iter().for_each(|voxel| is_decoded[*voxel] = true);
        let missing = (0..mask.len()).filter(|at| mask[*at]).zip(bytes.chunks_exact(size));
        self.missing.1 = missing.filter(|(at, _)| is_decoded[at % all]).flat_map(|(_, bytes)| bytes).copied().collect();
        if !self.missing.1.is_empty() {
            self.missing.0 = samples().map(|at| mask[at]).collect();
        }
    }

    /// All codes, including zeros: `codes[k * voxels + voxel]`, or with a pyramid pass after pass. Empty if no code is held.
    pub fn all_codes(&self, codec: &WindowCodec) -> Vec<i32> {
        match (&codec.scheme.pyramid, &self.codes) {
            (Some(pyramid), Codes::Sparse(codes)) => codec.passes(pyramid, self.of).dense(codes),
            _ => self.codes.dense().to_vec(),
        }
    }

    /// Replaces the codes; `codes` are all of them, as [`Self::all_codes`] returns them.
    pub fn set_codes(&mut self, codec: &WindowCodec, codes: &[i32]) {
        self.codes = match &codec.scheme.pyramid {
            Some(pyramid) => Codes::Sparse(codec.passes(pyramid, self.of).list(codes)),
            None => Codes::Dense(codes.into()),
        };
    }

    fn stored(&self) -> Stored<'_> {
        Stored { size: self.of, step: self.step, codes: &self.codes, above: self.above.as_ref(), part: None }
    }

    /// Decodes the codes to coefficients.
    pub fn field(&self, codec: &WindowCodec) -> Field<'_> {
        Field::decode(codec, self.stored())
    }

    /// Decodes every k that `wanted` marks of a pyramid, if that is needed at once: because one k cannot be decoded
    /// without others, or because some samples are overridden.
    pub fn field_at_once(&self, codec: &WindowCodec, wanted: &[bool]) -> Option<Field<'static>> {
        let pyramid = codec.scheme.pyramid.as_ref()?;
        let at_once = pyramid.order.contains(&Axis::T) || self.overrides();
        at_once.then(|| self.refined(codec, wanted))
    }

    /// Decodes every k that `wanted` marks of a block that a pyramid refines.
    pub fn refined(&self, codec: &WindowCodec, wanted: &[bool]) -> Field<'static> {
        Field::refined(codec, self.stored(), wanted)
    }

    /// The same for the voxels of a part of the block; the coefficients of others are arbitrary.
    pub fn refined_in(&self, codec: &WindowCodec, wanted: &[bool], part: &Region) -> Field<'static> {
        Field::refined(codec, Stored { part: Some(part), ..self.stored() }, wanted)
    }

    /// The block, to be kept for long: its list of codes takes no more memory than it needs.
    pub fn to_keep(mut self) -> Self {
        self.codes.keep();
        self
    }

    /// Bytes of memory that the block takes.
    pub fn held_bytes(&self) -> usize {
        let overrides = self.missing.0.len() + self.missing.1.len() + self.outliers.samples.len();
        let exact = self.exact.as_ref().map_or(0, Vec::len);
        let above = self.above.as_ref().map_or(0, Above::held_bytes);
        let sides: usize = self.sides.iter().map(|codes| codes.bits.len() + size_of::<SideCodes>()).sum();
        let sums =
            self.sums.as_ref().map_or(0, |sums| size_of_val(&sums.frames[..]) + size_of_val(&sums.unshifted[..]));
        above + sums + self.codes.held_bytes() + size_of_val(&self.outliers.positions[..]) + overrides + exact + sides
    }

    /// Whether all coefficients are zero.
    pub fn is_zero(&self) -> bool {
        self.codes.is_empty() && self.above.is_none()
    }

    /// Whether any sample is stored exactly, and overrides the coefficients.
    pub fn overrides(&self) -> bool {
        !(self.outliers.positions.is_empty() && self.missing.0.is_empty())
    }

    /// Decodes the codes of one k, into one of the two vectors.
    pub fn plane<'a>(
        &'a self,
        codec: &WindowCodec,
        k: usize,
        single: &'a mut Vec<f32>,
        double: &'a mut Vec<f64>,
    ) -> Plane<'a> {
        Plane::decode(codec, self.stored(), k, single, double)
    }

    /// The value that the directory must store for each level part with codes: its largest coefficient, or with a pyramid the largest
    /// change of the decoded `field` from leaving out this part and all finer ones.
    pub fn largest(&self, codec: &WindowCodec, field: &Field<'_>) -> Vec<f64> {
        let Some(pyramid) = &codec.scheme.pyramid else {
            let of_codes = |codes: &[i32]| codes.iter().fold(0.0, |m: f64, c| m.max((f64::from(*c) * self.step).abs()));
            let of_level = |level| self.codes.dense().get(codec.level_range(level, self.of)).map_or(0.0, of_codes);
            return (0..codec.parts() as u8).map(of_level).collect();
        };
        let passes = codec.passes(pyramid, self.of);
        // Earlier encoders counted no change of a k whose nodes are all zero, although a ghost and finer codes can cancel each other.
        let nonzero = field.nonzero(&passes);
        let changes = field.changes(&passes, self.step, self.codes.sparse(), self.above.as_ref(), &nonzero);
        changes.iter().map(Change::largest).collect()
    }

    /// Whether a sample is missing.
    pub fn is_missing(&self, index: usize) -> bool {
        self.missing.0.get(index).copied().unwrap_or(false)
    }

    /// Calls `visit(index of the first, values)` for the samples of some frames that are decoded from coefficients, a run of voxels
    /// at a time.
    /// Outliers and missing samples are not yet in place.
    pub fn for_each_run(&self, codec: &WindowCodec, wanted: &WantedFrames, visit: impl FnMut(usize, &[f64])) {
        self.for_each_run_of(codec, &self.field_of(codec, wanted), wanted, visit);
    }

    /// As [`Self::for_each_run`], for a block whose coefficients are decoded already.
    pub fn for_each_run_of(
        &self,
        codec: &WindowCodec,
        field: &Field<'_>,
        wanted: &WantedFrames,
        visit: impl FnMut(usize, &[f64]),
    ) {
        let (all, run) = (self.voxels, if codec.scheme.basis == Basis::Samples { LONG_RUN } else { RUN });
        let runs = (0..all).step_by(run).map(move |first| first..all.min(first + run));
        self.for_each_run_in(codec, field, &wanted.frames, runs, visit);
    }

    /// As [`Self::for_each_run_of`], in some runs of voxels.
    pub(super) fn for_each_run_in(
        &self,
        codec: &WindowCodec,
        field: &Field<'_>,
        frames: &[usize],
        runs: impl Iterator<Item = Range<usize>> + Clone,
        visit: impl FnMut(usize, &[f64]),
    ) {
        if codec.scheme.basis == Basis::Samples {
            field.for_each_run_of_samples(self.voxels, frames, &runs, visit);
        } else {
            field.for_each_run(codec.basis.as_ref(), self.voxels, frames, runs, visit);
        }
    }

    /// The coefficients that some frames need, and possibly others.
    fn field_of(&self, codec: &WindowCodec, wanted: &WantedFrames) -> Field<'_> {
        let is_refined = codec.scheme.pyramid.is_some();
        if is_refined { self.refined(codec, &wanted.coefficients) } else { self.field(codec) }
    }

    /// The series of one voxel, decoded from the coefficients.
    pub fn series(&self, codec: &WindowCodec, field: &Field<'_>, voxel: usize) -> Vec<f64> {
        field.series(codec.basis.as_ref(), self.voxels, voxel)
    }

    /// All samples of the block in their own type, little-endian, `frame * voxels + voxel`.
    pub fn samples(&self, codec: &WindowCodec) -> Buffer<u8> {
        self.samples_of(codec, &WantedFrames::all(codec))
    }

    /// As [`Self::samples`]; only some frames have their samples.
    pub fn samples_of(&self, codec: &WindowCodec, wanted: &WantedFrames) -> Buffer<u8> {
        if !self.sides.is_empty() {
            return self.decode(codec, &WantedFrames::all(codec), |_, _| {}); // sides depend on the samples before
        }
        let is_plain = self.exact.is_none() && self.sums.is_none();
        if (codec.sample, codec.scheme.basis) == (SampleType::F32, Basis::Samples) && is_plain {
            let field = self.field_of(codec, wanted);
            if field.is_single() {
                return self.stored_singles(codec, &field, &wanted.frames);
            }
        }
        self.decode(codec, wanted, |_, _| {})
    }

    /// Samples in the case that nodes are samples and already have the sample type.
    fn stored_singles(&self, codec: &WindowCodec, field: &Field<'_>, frames: &[usize]) -> Buffer<u8> {
        let mut out = Buffer::with_len(4 * codec.frames() * self.voxels);
        for frame in frames {
            let bytes = &mut out.as_chunks_mut().0[frame * self.voxels..(frame + 1) * self.voxels];
            match field.plane(*frame, self.voxels, &mut Vec::new()) {
                Plane::Single(values) => {
                    bytes.iter_mut().zip(values).for_each(|(bytes, value)| *bytes = value.to_le_bytes());
                }
                _ => bytes.fill([0; 4]),
            }
            let run = FrameRun::of(frame * self.voxels, self.voxels);
            shift_and_clip(codec, None, run, bytes.as_flattened_mut());
        }
        self.put_overrides(4, &mut out);
        out
    }

    /// As [`Self::samples`], with the values that are splatted, which are not rounded to the sample type.
    pub fn samples_and_values(&self, codec: &WindowCodec) -> (Buffer<u8>, Buffer<f64>) {
        let mut values = Buffer::with_len(codec.frames() * self.voxels);
        let samples =
            self.decode(codec, &WantedFrames::all(codec), |at, run| values[at..at + run.len()].copy_from_slice(run));
        if self.exact.is_some() {
            sample::load(codec.sample, &samples, &mut values);
        }
        let outliers = self.outliers.samples.chunks_exact(codec.sample.size());
        for (index, bytes) in self.outliers.positions.iter().map(|p| *p as usize).zip(outliers) {
            sample::load(codec.sample, bytes, &mut values[index..=index]);
        }
        self.put_moved(codec, &samples, &mut values);
        (samples, values)
    }

    /// Decodes the samples of some frames; `visit(index of the first, values)` gets values before they are rounded.
    fn decode(&self, codec: &WindowCodec, wanted: &WantedFrames, mut visit: impl FnMut(usize, &[f64])) -> Buffer<u8> {
        let size = codec.sample.size();
        let mut out = Buffer::with_len(codec.frames() * self.voxels * size);
        match &self.exact {
            Some(exact) => out.copy_from_slice(exact),
            None => {
                self.for_each_run(codec, wanted, |at, values| {
                    visit(at, values);
                    self.store(codec, at, values, &mut out[at * size..(at + values.len()) * size]);
                });
            }
        }
        self.put_overrides(size, &mut out);
        self.put_on_sides(codec, &mut out);
        out
    }

    /// Stores some voxels' samples of a frame, from the sample `at` on, before outliers and missing samples are in place.
    pub(super) fn store(&self, codec: &WindowCodec, at: usize, values: &[f64], out: &mut [u8]) {
        shifts::store(codec, self.sums.as_ref(), FrameRun::of(at, self.voxels), values, out);
    }

    /// Replaces samples by outliers and missing samples.
    fn put_overrides(&self, size: usize, out: &mut [u8]) {
        let outliers =
            self.outliers.positions.iter().map(|p| *p as usize).zip(self.outliers.samples.chunks_exact(size));
        let positions = self.missing.0.iter().enumerate().filter(|(_, missing)| **missing).map(|(i, _)| i);
        for (index, bytes) in outliers.chain(positions.zip(self.missing.1.chunks_exact(size))) {
            out[index * size..(index + 1) * size].copy_from_slice(bytes);
        }
    }
}

fn is_level(part: &PartEntry) -> bool {
    matches!(part.kind, PartKind::Level(_))
}
