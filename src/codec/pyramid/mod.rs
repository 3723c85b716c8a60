//! The pyramid of a block: nodes are predicted from coarser ones, and codes store the difference.
//!
//! Interpolation on nested lattices, with quantised corrections in a closed loop, is the principle of
//! [SZ3](crate::bibliography) and [Zhao](crate::bibliography). Pass j refines one axis by two. Even nodes keep their
//! value. U_j predicts odd nodes along that axis, and a code q times the step of its level l is added:
//!
//! ```text
//! v^_j = U_j v^_{j+1} + step_l q_j                                                                        (eq 32)
//! linear (1, 1)/2        cubic (-1, 9, 9, -1)/16        near a face (3, 6, -1)/8                          (eq 33)
//! step_l = step / min(growth^l, most)        |v^ - v| <= step_l / 2                                       (eq 34)
//! ```
//!
//! The encoder predicts from decoded nodes. So errors do not add up from pass to pass: a node's only error is the
//! rounding of its own code, at most half a step of its level. If nodes are samples, gain is 1 and step = 2 delta (eq
//! 25). If nodes are coefficients of a transform along time, each k has its own pyramid in space, and eq 25 gives the
//! step.
//!
//! Every pass is linear in its codes: the decoded field is q_0 + U_0 (q_1 + U_1 (q_2 + ...)), times their steps. So one
//! k can be decoded and splatted without the others.

mod refine;
mod stages;
mod stencil;
#[cfg(test)]
mod tests;

use super::buffer::Buffer;
use super::codes::PooledCodes;
use super::real::Real;
use super::rows::{self, Change};
use crate::wavelet;
use stages::Stages;
use std::ops::Range;
use wavesplat_format::{Axis, BlockEntry, CodeBox, Pass, Pyramid, Reader, SparseCodes, Storage};

/// The number of level parts of a block.
const PARTS: usize = Pyramid::PARTS as usize;

/// The passes over one block's field of `[x, y, z, k]` nodes, x fastest.
#[derive(Debug)]
pub(crate) struct PredictionPasses<'a> {
    pyramid: &'a Pyramid,
    /// The nodes of one pyramid: all nodes, or those of one k if k is not refined.
    shape: [usize; 4],
    /// The number of pyramids.
    pyramids: usize,
    passes: Vec<Pass>,
    stages: Stages,
}

impl<'a> PredictionPasses<'a> {
    pub(crate) fn new(pyramid: &'a Pyramid, [x, y, z, k]: [usize; 4]) -> Self {
        let apart = !pyramid.order.contains(&Axis::T);
        let (shape, pyramids) = if apart { ([x, y, z, 1], k) } else { ([x, y, z, k], 1) };
        let passes = pyramid.passes(shape);
        let stages = Stages::new(pyramid.stencil, &passes, shape);
        Self { pyramid, shape, pyramids, passes, stages }
    }

    /// The passes down to a level, over its nodes alone: those at multiples of `2^level` along refined axes. Their codes
    /// are the first of the block.
    pub(crate) fn down_to(pyramid: &'a Pyramid, shape: [usize; 4], level: u32) -> Self {
        let of_axis = |axis: Axis| if pyramid.order.contains(&axis) { level } else { 0 };
        let apart = [Axis::X, Axis::Y, Axis::Z, Axis::T].map(of_axis);
        let coarsest = pyramid.passes(shape).first().map_or(0, |first| first.level);
        let mut coarse = Self::new(pyramid, std::array::from_fn(|a| shape[a].div_ceil(1 << apart[a])));
        coarse.passes.iter_mut().for_each(|pass| pass.level = (pass.level + level).min(coarsest));
        coarse
    }

    /// The number of nodes along x, y, z and k.
    pub(crate) fn nodes(&self) -> [usize; 4] {
        let [x, y, z, k] = self.shape;
        [x, y, z, k * self.pyramids]
    }

    /// The number of codes in each level part.
    pub(crate) fn part_lengths(&self) -> Vec<usize> {
        let of_one = |part| self.passes.iter().filter(|p| p.part == part).map(|p| p.codes(self.shape)).sum::<usize>();
        (0..Pyramid::PARTS).map(|part| self.pyramids * of_one(part)).collect()
    }

    /// The nodes that the passes of a level part add.
    pub(crate) fn boxes(&self, part: u8) -> Vec<[usize; 4]> {
        let of_all = |[x, y, z, k]: [usize; 4]| [x, y, z, k * self.pyramids];
        self.passes.iter().filter(|p| p.part == part).map(|p| of_all(p.extent(self.shape))).collect()
    }

    /// As [`Self::boxes`], with the places of their codes in the slices that the passes refine.
    fn placed_boxes(&self, part: u8) -> Vec<CodeBox> {
        let passes = (0..self.passes.len()).filter(|n| self.passes[*n].part == part);
        passes.zip(self.boxes(part)).map(|(n, extents)| self.stages.placed(n, extents)).collect()
    }

    /// Reads the codes of a block's level parts that `needed` chooses; those of others are zero.
    pub(crate) fn read<S: Storage>(
        &self,
        reader: &Reader<S>,
        entry: &BlockEntry,
        needed: impl Fn(u8) -> bool,
    ) -> wavesplat_format::Result<PooledCodes> {
        let mut codes = PooledCodes::new();
        for part in 0..Pyramid::PARTS {
            let boxes = self.placed_boxes(part);
            if needed(part) {
                reader.sparse_codes(entry, part, &boxes, &mut codes)?;
            } else {
                codes.skip(&boxes);
            }
        }
        Ok(codes)
    }

    /// Decodes codes to the field; `codes` are all codes of the block, as [`Self::placed_boxes`] places them. Returns for
    /// each k whether some node is not zero; where k is refined, true for all or none.
    pub(crate) fn decode<R: Real>(&self, step: f64, codes: &SparseCodes, field: &mut [R]) -> Vec<bool> {
        self.decode_some(&vec![true; self.nodes()[3]], step, codes, field)
    }

    /// As [`Self::decode`], of every k that `wanted` marks. The nodes of others are 0 or unspecified.
    pub(crate) fn decode_some<R: Real>(
        &self,
        wanted: &[bool],
        step: f64,
        codes: &SparseCodes,
        field: &mut [R],
    ) -> Vec<bool> {
        let marked = self.marked(codes);
        let pyramids = field.chunks_exact_mut(self.pyramid_nodes());
        for ((number, nodes), wanted) in pyramids.enumerate().zip(wanted.chunks_exact(self.shape[3])) {
            if marked[number * self.shape[3]] && wanted.contains(&true) {
                self.stages.refine(wanted, nodes, &mut self.sparse(number, step, codes, PARTS));
            } else {
                nodes.fill(R::default());
            }
        }
        marked
    }

    /// For each k, whether some code is not zero; if k is refined, the same for all of them.
    pub(crate) fn marked(&self, codes: &SparseCodes) -> Vec<bool> {
        let some = |number| self.runs(number).any(|run| !codes.run(run).1.is_empty());
        (0..self.pyramids).flat_map(|number| std::iter::repeat_n(some(number), self.shape[3])).collect()
    }

    /// As [`Self::marked`], from all codes, pass after pass.
    pub(crate) fn marked_of(&self, codes: &[i32]) -> Vec<bool> {
        let some = |number| self.code_ranges(number).into_iter().any(|range| !rows::all_zero(&codes[range]));
        (0..self.pyramids).flat_map(|number| std::iter::repeat_n(some(number), self.shape[3])).collect()
    }

    /// As [`Self::decode`], for one k that is not refined with others. False if all its nodes are zero.
    pub(crate) fn decode_one<R: Real>(&self, k: usize, step: f64, codes: &SparseCodes, nodes: &mut Vec<R>) -> bool {
        let some = self.runs(k).any(|run| !codes.run(run).1.is_empty());
        if some {
            nodes.resize(self.pyramid_nodes(), R::default());
            self.stages.refine(&[true], nodes, &mut self.sparse(k, step, codes, PARTS));
        }
        some
    }

    /// Encodes the field and replaces it by the decoded field; `split` is scratch. NaN nodes get the code 0. False if a
    /// code does not fit. `codes` are in order, pass after pass.
    pub(crate) fn encode<R: Real>(&self, step: f64, field: &mut [R], split: &mut Vec<R>, codes: &mut [i32]) -> bool {
        let mut fits = true;
        split.resize(self.pyramid_nodes(), R::default());
        let ranges: Vec<_> = (0..self.pyramids).map(|number| self.code_ranges(number)).collect();
        for (nodes, ranges) in field.chunks_exact_mut(self.pyramid_nodes()).zip(&ranges) {
            self.stages.split(nodes, split);
            let codes = apart(codes, ranges);
            let mut encoding = Encoding { split, codes, passes: self.inverses(step), fits: true };
            self.stages.refine(&vec![true; self.shape[3]], nodes, &mut encoding);
            fits &= encoding.fits;
        }
        fits
    }

    /// The change of a decoded field from leaving out each level part and all finer ones.
    pub(crate) fn changes<R: Real>(&self, step: f64, codes: &SparseCodes, field: &[R]) -> Vec<Change> {
        self.changes_without(&[true; PARTS], field, |number, parts| self.sparse(number, step, codes, parts))
    }

    /// As [`Self::changes`], from all codes, pass after pass, and only for parts with a code that is not zero: the
    /// directory does not list others.
    pub(crate) fn changes_of_coded<R: Real>(&self, step: f64, codes: &[i32], field: &[R]) -> Vec<Change> {
        let ranges = wavelet::ranges(&self.part_lengths());
        let coded = std::array::from_fn(|part| !rows::all_zero(&codes[ranges[part].clone()]));
        self.changes_without(&coded, field, |number, parts| self.dense(number, step, codes, parts))
    }

    /// The changes from leaving out each part that `wanted` marks and all finer ones. `decoding(number, parts)` decodes a
    /// pyramid from its first parts alone.
    fn changes_without<R: Real, C: Correction<R>>(
        &self,
        wanted: &[bool; PARTS],
        field: &[R],
        decoding: impl Fn(usize, usize) -> C,
    ) -> Vec<Change> {
        let mut changes = vec![Change::default(); PARTS];
        let mut rest = Buffer::of(self.pyramid_nodes());
        let pyramids = field.chunks_exact(self.pyramid_nodes()).enumerate();
        for (number, nodes) in pyramids.filter(|(_, nodes)| !rows::is_zero(nodes)) {
            for (part, change) in changes.iter_mut().enumerate().filter(|(part, _)| wanted[*part]) {
                if part == 0 {
                    rows::add_changes_to_zero(change, nodes);
                } else {
                    self.stages.refine(&vec![true; self.shape[3]], &mut rest, &mut decoding(number, part));
                    rows::add_changes(change, nodes, &rest);
                }
            }
        }
        changes
    }

    /// Decodes a pyramid from its first parts.
    fn sparse<'c, R: Real>(
        &self,
        number: usize,
        step: f64,
        codes: &'c SparseCodes,
        parts: usize,
    ) -> SparseDecoding<'c, R> {
        let of_pass = |(n, pass): (usize, &Pass)| {
            (usize::from(pass.part) < parts).then(|| (self.runs_of(n, number).start, self.step(step, pass)))
        };
        SparseDecoding { codes, passes: self.passes.iter().enumerate().map(of_pass).collect() }
    }

    fn dense<'c, R: Real>(&self, number: usize, step: f64, codes: &'c [i32], parts: usize) -> DenseDecoding<'c, R> {
        let of_pass = |(pass, range): (&Pass, Range<usize>)| {
            (usize::from(pass.part) < parts).then(|| (&codes[range], self.step(step, pass)))
        };
        DenseDecoding { passes: self.passes.iter().zip(self.code_ranges(number)).map(of_pass).collect() }
    }

    fn step<R: Real>(&self, step: f64, pass: &Pass) -> R {
        R::of(self.pyramid.step(step, pass.level))
    }

    /// The number of nodes in a pyramid.
    fn pyramid_nodes(&self) -> usize {
        self.shape.iter().product()
    }

    /// For each pass its first node in a pyramid's nodes pass after pass, its step and the inverse of that.
    fn inverses<R: Real>(&self, step: f64) -> Vec<(usize, [R; 2])> {
        let mut start = 0;
        let of_pass = |pass: &Pass| {
            let step = self.pyramid.step(step, pass.level);
            let first = start;
            start += pass.codes(self.shape);
            (first, [R::of(step), R::of(1.0 / step)])
        };
        self.passes.iter().map(of_pass).collect()
    }

    /// The range of codes of each pass of a pyramid.
    fn code_ranges(&self, number: usize) -> Vec<Range<usize>> {
        let mut start = 0;
        let of_pass = |pass: &Pass| {
            let codes = pass.codes(self.shape);
            let first = start + number * codes;
            start += self.pyramids * codes;
            first..first + codes
        };
        self.passes.iter().map(of_pass).collect()
    }

    /// The runs of a pyramid's codes.
    fn runs(&self, number: usize) -> impl Iterator<Item = usize> {
        (0..self.passes.len()).flat_map(move |pass| self.runs_of(pass, number))
    }

    /// The runs of the codes of a pass of one pyramid, one for each slice along time.
    fn runs_of(&self, pass: usize, number: usize) -> Range<usize> {
        let slices = |pass: &Pass| pass.extent(self.shape)[3];
        let before: usize = self.passes[..pass].iter().map(slices).sum();
        let own = slices(&self.passes[pass]);
        let first = self.pyramids * before + number * own;
        first..first + own
    }
}

/// The parts of a slice at ascending ranges.
fn apart<'a>(codes: &'a mut [i32], ranges: &[Range<usize>]) -> Vec<&'a mut [i32]> {
    let (mut rest, mut start) = (codes, 0);
    let part = |range: &Range<usize>| {
        let (part, after) = std::mem::take(&mut rest)[range.start - start..].split_at_mut(range.len());
        (rest, start) = (after, range.end);
        part
    };
    ranges.iter().map(part).collect()
}

/// What becomes of predicted nodes: codes are added, or computed.
trait Correction<R> {
    /// Corrects consecutive nodes that a pass adds, from number `first` of them on.
    fn correct(&mut self, pass: usize, first: usize, predicted: &mut [R]);

    /// Completes a slice of the lattice after a pass: the `slice`-th of those that it adds nodes to.
    fn complete(&mut self, pass: usize, slice: usize, nodes: &mut [R]);
}

/// Adds the codes of a pyramid to complete slices, times the step of their level (eq 32).
struct SparseDecoding<'a, R> {
    codes: &'a SparseCodes,
    /// The first run and the step of each pass; none if its codes are left out.
    passes: Vec<Option<(usize, R)>>,
}

impl<R: Real> Correction<R> for SparseDecoding<'_, R> {
    #[inline(always)]
    fn correct(&mut self, _: usize, _: usize, _: &mut [R]) {}

    fn complete(&mut self, pass: usize, slice: usize, nodes: &mut [R]) {
        if let Some((run, step)) = self.passes[pass] {
            let (places, values) = self.codes.run(run + slice);
            for (place, code) in places.iter().zip(values) {
                let node = &mut nodes[*place as usize];
                *node = *node + R::of_code(*code) * step;
            }
        }
    }
}

/// Adds the codes of a pyramid to predicted rows, times the step of their level (eq 32).
struct DenseDecoding<'a, R> {
    /// The codes and the step of each pass; none if they are left out.
    passes: Vec<Option<(&'a [i32], R)>>,
}

impl<R: Real> Correction<R> for DenseDecoding<'_, R> {
    #[inline(always)]
    fn correct(&mut self, pass: usize, first: usize, predicted: &mut [R]) {
        if let Some((codes, step)) = self.passes[pass] {
            rows::decode(predicted, &codes[first..], step);
        }
    }

    fn complete(&mut self, _: usize, _: usize, _: &mut [R]) {}
}

/// Computes the codes of a pyramid, and turns predictions into decoded nodes (eq 32).
struct Encoding<'a, R> {
    /// The source's nodes, pass after pass.
    split: &'a [R],
    /// The codes of each pass.
    codes: Vec<&'a mut [i32]>,
    /// For each pass its first node in `split`, its step and the inverse of that.
    passes: Vec<(usize, [R; 2])>,
    /// Whether all codes fit.
    fits: bool,
}

impl<R: Real> Correction<R> for Encoding<'_, R> {
    #[inline(always)]
    fn correct(&mut self, pass: usize, first: usize, predicted: &mut [R]) {
        let (start, steps) = self.passes[pass];
        self.fits &= rows::encode(&self.split[start + first..], predicted, &mut self.codes[pass][first..], steps);
    }

    fn complete(&mut self, _: usize, _: usize, _: &mut [R]) {}
}
