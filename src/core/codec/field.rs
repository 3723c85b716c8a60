//! The decoded coefficients of a block, for every scheme.

use super::WindowCodec;
use super::buffer::Buffer;
use super::codes::{Codes, PooledCodes};
use super::pyramid::{Nodes, PARTS, PredictionPasses};
use super::real::Real;
use super::rows::{self, Change};
use crate::base::grid::Region;
use crate::base::vectors::dispatch;
use crate::wavelet::{LANES, Lane, TimeBasis};
use std::ops::Range;
use wavesplat_format::{EncodedBlock, Pyramid, SparseCodes};

/// The decoded coefficients of a block.
#[derive(Debug)]
pub struct Field<'a> {
    values: Values<'a>,
    /// Whether each k may have coefficients that are not zero. The values of others are arbitrary: writing zeros would touch fresh memory.
    marked: Vec<bool>,
}

/// `k * voxels + voxel`
#[derive(Debug)]
enum Values<'a> {
    /// All are zero.
    Zero,
    /// Codes times a step.
    Codes {
        /// A coefficient is its code times this.
        step: f64,
        /// `k * voxels + voxel`.
        codes: &'a [i32],
    },
    /// Decoded by a pyramid in 32-bit floats.
    Single(Buffer<f32>),
    /// Decoded by a pyramid in 64-bit floats.
    Double(Buffer<f64>),
}

/// The decoded nodes that a block begins with: those of the block above that lie in it.
#[derive(Debug)]
pub struct Above {
    nodes: Field<'static>,
    /// Their number along x, y, z.
    size: [usize; 3],
}

impl Above {
    /// Copies the nodes `whole` out of the block above, which has `outer` nodes along x, y, z. Outside of `part`, counted from their
    /// first, nodes are arbitrary.
    pub fn new(above: &Field<'_>, outer: [usize; 3], whole: &Region, part: &Region) -> Self {
        Self { nodes: above.cut(outer, whole, part), size: whole.dims() }
    }

    /// Bytes of memory that they take.
    pub(super) fn held_bytes(&self) -> usize {
        self.nodes.held_bytes()
    }

    /// The nodes of a block that is coded in 32-bit floats.
    pub(super) fn singles(&self) -> Nodes<'_, f32> {
        Nodes { values: self.nodes.singles().unwrap_or_default(), size: self.size, marked: Some(&self.nodes.marked) }
    }

    /// The nodes of a block that is coded in 64-bit floats.
    pub(super) fn doubles(&self) -> Nodes<'_, f64> {
        Nodes { values: self.nodes.doubles().unwrap_or_default(), size: self.size, marked: Some(&self.nodes.marked) }
    }
}

/// What a block's coefficients are decoded from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stored<'a> {
    /// The voxels that the block covers along x, y, z.
    pub(super) size: [usize; 3],
    pub(super) step: f64,
    pub(super) codes: &'a Codes,
    pub(super) above: Option<&'a Above>,
    /// The nodes that are decoded; others are arbitrary. All if `None`.
    pub(super) part: Option<&'a Region>,
}

/// The coefficients of one k of a block, x fastest.
#[derive(Debug, Clone, Copy)]
pub enum Plane<'a> {
    /// All are zero.
    Zero,
    /// 32-bit floats.
    Single(&'a [f32]),
    /// 64-bit floats.
    Double(&'a [f64]),
}

impl<'a> Plane<'a> {
    /// Decodes one k of a block. Each k must be coded by itself.
    pub(super) fn decode(
        codec: &WindowCodec,
        of: Stored<'a>,
        k: usize,
        single: &'a mut Vec<f32>,
        double: &'a mut Vec<f64>,
    ) -> Self {
        let Stored { size, step, codes, above, .. } = of;
        let Some(pyramid) = &codec.scheme.pyramid else {
            let voxels: usize = codec.decoded_size(size).iter().product();
            return Self::scaled(step, codes.dense().get(k * voxels..(k + 1) * voxels).unwrap_or_default(), double);
        };
        if codec.is_all_above() {
            let nodes = codec.decoded_size(size).iter().product();
            return above.map_or(Self::Zero, |above| above.nodes.plane(k, nodes, double));
        }
        let (passes, codes) = (codec.passes(pyramid, size), codes.sparse());
        match pyramid.single {
            true if passes.decode_one(k, step, codes, above.map(Above::singles), single) => Self::Single(single),
            false if passes.decode_one(k, step, codes, above.map(Above::doubles), double) => Self::Double(double),
            _ => Self::Zero,
        }
    }

    fn scaled(step: f64, codes: &[i32], scratch: &'a mut Vec<f64>) -> Self {
        if rows::all_zero(codes) {
            return Self::Zero;
        }
        scratch.resize(codes.len(), 0.0);
        dispatch!(scale(step, codes, &mut scratch[..]));
        Self::Double(scratch)
    }
}

impl Field<'static> {
    /// Decodes the codes of a block that a pyramid refines, of every k that `wanted` marks.
    pub(super) fn refined(codec: &WindowCodec, of: Stored<'_>, wanted: &[bool]) -> Self {
        let above = of.above;
        if let Some(above) = above.filter(|_| codec.is_all_above()) {
            let whole = Region { start: [0; 3], end: above.size };
            return above.nodes.cut(above.size, &whole, of.part.unwrap_or(&whole));
        }
        let of = Refined { codec, of, wanted };
        let (values, marked) = match &codec.scheme.pyramid {
            Some(pyramid) if pyramid.single => of.values(pyramid, above.map(Above::singles), Values::Single),
            Some(pyramid) => of.values(pyramid, above.map(Above::doubles), Values::Double),
            None => (Values::Zero, vec![false; codec.basis.coefficients()]),
        };
        Self { values, marked }
    }

    /// Decodes the nodes of a block of a tier above 0 that is not yet stored, and covers `size` voxels.
    ///
    /// # Errors
    /// Its parts cannot be unpacked.
    pub fn from_encoded(
        codec: &WindowCodec,
        block: &EncodedBlock,
        size: [usize; 3],
        above: Option<&Above>,
    ) -> wavesplat_format::Result<Self> {
        let codes =
            codec.scheme.pyramid.as_ref().map(|pyramid| codec.passes(pyramid, size).unpack(block)).transpose()?;
        let codes = Codes::Sparse(codes.unwrap_or_else(PooledCodes::new));
        let of = Stored { size, step: block.stats.step, codes: &codes, above, part: None };
        Ok(Self::refined(codec, of, &vec![true; codec.basis.coefficients()]))
    }

    /// The decoded nodes of a block, as its encoder has them, and whether each k may have some that are not zero.
    pub(super) fn single(nodes: Buffer<f32>, marked: Vec<bool>) -> Self {
        Self { values: Values::Single(nodes), marked }
    }

    /// Coefficients that are all zero.
    pub(super) fn zero(codec: &WindowCodec) -> Self {
        Self { values: Values::Zero, marked: vec![false; codec.basis.coefficients()] }
    }

    /// As [`Self::single`], in 64-bit floats.
    pub(super) fn double(nodes: Buffer<f64>, marked: Vec<bool>) -> Self {
        Self { values: Values::Double(nodes), marked }
    }
}

impl Field<'_> {
    /// Copies a region of `outer` nodes along x, y, z. Outside of `part`, counted from its first node, the copy is arbitrary.
    fn cut(&self, outer: [usize; 3], region: &Region, part: &Region) -> Field<'static> {
        fn copy<R: Real>(nodes: Nodes<'_, R>, region: &Region, part: &Region, ks: usize) -> Buffer<R> {
            let (len, is_part) = (region.voxels() * ks, part.voxels() < region.voxels());
            let mut copy = if is_part { Buffer::for_part(len) } else { Buffer::with_len(len) };
            nodes.copy(region, part, &mut copy);
            copy
        }
        let (marked, ks) = (Some(&self.marked[..]), self.marked.len());
        let values = match &self.values {
            Values::Single(values) => Values::Single(copy(Nodes { values, size: outer, marked }, region, part, ks)),
            Values::Double(values) => Values::Double(copy(Nodes { values, size: outer, marked }, region, part, ks)),
            Values::Zero | Values::Codes { .. } => Values::Zero,
        };
        Field { values, marked: self.marked.clone() }
    }

    /// Bytes of memory that the coefficients take.
    pub fn held_bytes(&self) -> usize {
        match &self.values {
            Values::Zero | Values::Codes { .. } => 0,
            Values::Single(values) => values.held_bytes(),
            Values::Double(values) => values.held_bytes(),
        }
    }
}

impl<'a> Field<'a> {
    /// Codes times a step.
    pub(super) fn scaled(codec: &WindowCodec, step: f64, codes: &'a [i32]) -> Self {
        Self { values: Values::Codes { step, codes }, marked: vec![true; codec.basis.coefficients()] }
    }

    /// Decodes all codes of a block. Without codes, all coefficients are zero.
    pub(super) fn decode(codec: &WindowCodec, of: Stored<'a>) -> Self {
        let all = vec![true; codec.basis.coefficients()];
        match of.codes {
            Codes::Dense(codes) if !codes.is_empty() => {
                Self { values: Values::Codes { step: of.step, codes }, marked: all }
            }
            _ => Field::refined(codec, of, &all),
        }
    }

    /// The coefficient at `k * voxels + voxel`.
    pub fn at(&self, index: usize) -> f64 {
        let (all, value) = match &self.values {
            Values::Zero => return 0.0,
            Values::Codes { step, codes } => (codes.len(), f64::from(codes[index]) * step),
            Values::Single(values) => (values.len(), values[index].into()),
            Values::Double(values) => (values.len(), values[index]),
        };
        let k = index / (all / self.marked.len());
        if self.marked[k] { value } else { 0.0 }
    }

    /// All coefficients, if they are 32-bit floats. Those of k that are not marked are arbitrary.
    fn singles(&self) -> Option<&[f32]> {
        if let Values::Single(values) = &self.values { Some(values) } else { None }
    }

    /// The same in 64-bit floats.
    fn doubles(&self) -> Option<&[f64]> {
        if let Values::Double(values) = &self.values { Some(values) } else { None }
    }

    /// Whether all coefficients are 32-bit floats.
    pub(super) fn is_single(&self) -> bool {
        matches!(self.values, Values::Single(_))
    }

    /// The change from leaving out each level part of a pyramid that has codes, and all finer ones, of the pyramids with a k in
    /// `marked`. The field has all k.
    pub(super) fn changes(
        &self,
        passes: &PredictionPasses<'_>,
        step: f64,
        codes: &SparseCodes,
        above: Option<&Above>,
        marked: &[bool],
    ) -> Vec<Change> {
        let counts = passes.counts(codes);
        match &self.values {
            Values::Single(values) => {
                passes.changes(&counts, step, codes, above.map(Above::singles), passes.field(values, marked))
            }
            Values::Double(values) => {
                passes.changes(&counts, step, codes, above.map(Above::doubles), passes.field(values, marked))
            }
            Values::Zero | Values::Codes { .. } => vec![Change::default(); PARTS],
        }
    }

    /// Whether each k may have coefficients that are not zero.
    pub(super) fn marked(&self) -> &[bool] {
        &self.marked
    }

    /// Whether each k has coefficients that are not zero.
    pub(super) fn nonzero(&self, passes: &PredictionPasses<'_>) -> Vec<bool> {
        fn of<R: Real>(nodes: Nodes<'_, R>, ks: usize) -> Vec<bool> {
            (0..ks).map(|k| !nodes.is_zero(k..k + 1)).collect()
        }
        match &self.values {
            Values::Single(values) => of(passes.field(values, &self.marked), self.marked.len()),
            Values::Double(values) => of(passes.field(values, &self.marked), self.marked.len()),
            Values::Zero | Values::Codes { .. } => self.marked.clone(),
        }
    }

    /// Copies coefficients of one k from voxel `voxel` on.
    fn load(&self, k: usize, voxels: usize, voxel: usize, out: &mut [f64]) {
        let first = k * voxels + voxel;
        match &self.values {
            _ if !self.marked[k] => out.fill(0.0),
            Values::Zero => out.fill(0.0),
            Values::Codes { step, codes } => dispatch!(scale(*step, &codes[first..], out)),
            Values::Single(values) => dispatch!(widen(&values[first..], out)),
            Values::Double(values) => out.copy_from_slice(&values[first..first + out.len()]),
        }
    }

    /// Calls `visit(index of the first, values)` for the decoded samples of some frames in runs of voxels, each of at most [`RUN`].
    pub(super) fn for_each_run(
        &self,
        basis: &dyn TimeBasis,
        voxels: usize,
        frames: &[usize],
        runs: impl Iterator<Item = Range<usize>>,
        mut visit: impl FnMut(usize, &[f64]),
    ) {
        let used = Used::new(basis, &self.marked);
        let (all, some) = (used.basis(basis), used.basis(basis).only_frames(frames));
        let basis = some.as_deref().unwrap_or(all);
        let places: Vec<usize> = if some.is_some() { (0..frames.len()).collect() } else { frames.to_vec() };
        let mut run = Run::new(basis, &used.ks);
        for Range { start: first, end } in runs {
            let count = end - first;
            run.load(self, voxels, first, count);
            run.invert(basis, count.div_ceil(LANES));
            for (frame, place) in frames.iter().zip(&places) {
                visit(frame * voxels + first, run.frame(*place, count));
            }
        }
    }

    /// As [`Self::for_each_run`], if the coefficients are the samples. Runs have at most [`LONG_RUN`] voxels.
    pub(super) fn for_each_run_of_samples(
        &self,
        voxels: usize,
        frames: &[usize],
        runs: &(impl Iterator<Item = Range<usize>> + Clone),
        mut visit: impl FnMut(usize, &[f64]),
    ) {
        let mut values = [0.0; LONG_RUN];
        for (frame, run) in frames.iter().flat_map(|frame| runs.clone().map(move |run| (frame, run))) {
            let values = &mut values[..run.len()];
            self.load(*frame, voxels, run.start, values);
            visit(frame * voxels + run.start, values);
        }
    }

    /// The coefficients of one k, converted into `scratch` if needed.
    pub fn plane<'p>(&'p self, k: usize, voxels: usize, scratch: &'p mut Vec<f64>) -> Plane<'p> {
        let range = k * voxels..(k + 1) * voxels;
        match &self.values {
            _ if !self.marked[k] => Plane::Zero,
            Values::Zero => Plane::Zero,
            Values::Codes { step, codes } => Plane::scaled(*step, &codes[range], scratch),
            Values::Single(values) => Plane::Single(&values[range]),
            Values::Double(values) => Plane::Double(&values[range]),
        }
    }

    /// The decoded series of a voxel.
    pub(super) fn series(&self, basis: &dyn TimeBasis, voxels: usize, voxel: usize) -> Vec<f64> {
        let mut work = vec![Lane::default(); basis.coefficients()];
        let mut series = vec![Lane::default(); basis.frames()];
        work.iter_mut().enumerate().for_each(|(k, lane)| self.load(k, voxels, voxel, &mut lane[..1]));
        basis.inverse(&mut work, &mut series);
        series.iter().map(|lane| lane[0]).collect()
    }
}

/// The coefficients that a block uses, and the basis restricted to them.
pub(super) struct Used {
    pub(super) ks: Vec<usize>,
    basis: Option<Box<dyn TimeBasis>>,
}

impl Used {
    /// Creates it from marks. All coefficients of unmarked k count as zero.
    pub(super) fn new(basis: &dyn TimeBasis, marked: &[bool]) -> Self {
        let basis = basis.only(marked);
        let ks = (0..marked.len()).filter(|k| basis.is_none() || marked[*k]).collect();
        Self { ks, basis }
    }

    pub(super) fn basis<'a>(&'a self, all: &'a dyn TimeBasis) -> &'a dyn TimeBasis {
        self.basis.as_deref().unwrap_or(all)
    }
}

/// The number of voxels decoded together. Their part of each plane fills whole cache lines.
pub(super) const RUN: usize = 128;

/// The largest number of voxels that are loaded together, if coefficients are samples.
pub(super) const LONG_RUN: usize = 8 * RUN;

/// The series of a run of voxels, in groups of [`LANES`].
struct Run<'a> {
    /// The coefficients used.
    ks: &'a [usize],
    /// `[voxels / LANES][index in ks]`
    coefficients: Vec<Lane>,
    /// `[voxels / LANES][frame]`
    series: Vec<Lane>,
    /// The values of one k or one frame.
    row: [f64; RUN],
}

impl<'a> Run<'a> {
    fn new(basis: &dyn TimeBasis, ks: &'a [usize]) -> Self {
        let lanes = |each: usize| vec![Lane::default(); RUN / LANES * each];
        Self { coefficients: lanes(ks.len()), series: lanes(basis.frames()), row: [0.0; RUN], ks }
    }

    fn load(&mut self, field: &Field<'_>, voxels: usize, first: usize, count: usize) {
        for (i, k) in self.ks.iter().enumerate() {
            field.load(*k, voxels, first, &mut self.row[..count]);
            let of_k = self.coefficients[i..].iter_mut().step_by(self.ks.len());
            let rows = self.row.as_chunks::<LANES>().0.iter().take(count.div_ceil(LANES));
            of_k.zip(rows).for_each(|(lane, row)| *lane = *row);
        }
    }

    fn invert(&mut self, basis: &dyn TimeBasis, lanes: usize) {
        let each = self.ks.len();
        for (i, series) in self.series.chunks_exact_mut(basis.frames()).enumerate().take(lanes) {
            basis.inverse(&mut self.coefficients[i * each..][..each], series);
        }
    }

    fn frame(&mut self, frame: usize, count: usize) -> &[f64] {
        let each = self.series.len() / (RUN / LANES);
        let of_frame = self.series[frame..].iter().step_by(each).take(count.div_ceil(LANES));
        self.row.as_chunks_mut::<LANES>().0.iter_mut().zip(of_frame).for_each(|(row, lane)| *row = *lane);
        &self.row[..count]
    }
}

#[inline(always)]
fn scale(step: f64, codes: &[i32], out: &mut [f64]) {
    out.iter_mut().zip(codes).for_each(|(v, code)| *v = f64::from(*code) * step);
}

#[inline(always)]
fn widen(values: &[f32], out: &mut [f64]) {
    out.iter_mut().zip(values).for_each(|(v, c)| *v = f64::from(*c));
}

/// Codes of a block to decode by a pyramid.
struct Refined<'a> {
    codec: &'a WindowCodec,
    of: Stored<'a>,
    wanted: &'a [bool],
}

impl Refined<'_> {
    /// The coefficients of every k that is wanted, and for each k whether some are not zero.
    fn values<'v, R: Real>(
        &self,
        pyramid: &Pyramid,
        known: Option<Nodes<'_, R>>,
        values: fn(Buffer<R>) -> Values<'v>,
    ) -> (Values<'v>, Vec<bool>) {
        let &Self { codec, of: Stored { size, step, codes, part, .. }, wanted } = self;
        let (ks, nodes, codes) = (codec.basis.coefficients(), codec.decoded_size(size), codes.sparse());
        if codes.count() == 0 && known.is_none() {
            return (Values::Zero, vec![false; ks]);
        }
        let (passes, len) = (codec.passes(pyramid, size), nodes.iter().product::<usize>() * ks);
        let (passes, mut field) = match part {
            Some(part) => (passes.within(part), Buffer::for_part(len)),
            None => (passes, Buffer::with_len(len)),
        };
        let marked = passes.decode_some(wanted, step, codes, known, &mut field);
        (if marked.contains(&true) { values(field) } else { Values::Zero }, marked)
    }
}
