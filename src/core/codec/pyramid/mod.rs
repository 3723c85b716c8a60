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
//! A block is coded by itself, so its last nodes may have a neighbour on one side only. If their number along an axis is even,
//! the coarse lattices have a ghost node behind the last voxel, with codes of its own, so that the last voxel is interpolated
//! and not extrapolated. The finest passes drop it again.
//!
//! With tiers, coarse lattices are coded in wider blocks of their own. A block then begins with the decoded nodes of the block above:
//!
//! ```text
//! v^_tier = U_z U_y U_x v^_(tier+1) + step q                                                              (eq 44)
//! ```
//!
//! Every pass is linear in its codes: the decoded field is q_0 + U_0 (q_1 + U_1 (q_2 + ...)), times their steps. So one
//! k can be decoded and splatted without the others.

mod corrections;
mod detail;
mod encode;
mod known;
mod refine;
mod stages;
mod stencil;
mod within;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tier_tests;

use super::codes::PooledCodes;
use super::real::Real;
use super::rows::{self, Change, add_changes, add_changes_to_zero, count_nonzero};
use crate::base::grid::Region;
use crate::base::vectors::dispatch;
use crate::wavelet;
use corrections::Decoding;
use known::KnownNodes;
pub(crate) use known::Nodes;
use stages::{Stages, Step};
use std::ops::Range;
use wavesplat_format::{
    Axis, BlockEntry, CodeBox, DenseCodes, EncodedBlock, PartKind, Pass, PassBox, Places, Pyramid, Reader,
};
use wavesplat_format::{SparseCodes, Storage};
use within::Within;

/// The number of level parts of a block.
pub(crate) const PARTS: usize = Pyramid::PARTS as usize;

/// The number of codes that are not zero in each level part.
pub(crate) type Counts = [usize; PARTS];

/// The passes over one block's field of `[x, y, z, k]` nodes, x fastest.
#[derive(Debug)]
pub(crate) struct PredictionPasses<'a> {
    pyramid: &'a Pyramid,
    /// The nodes of one pyramid: all nodes, or those of one k if k is not refined.
    shape: [usize; 4],
    /// The number of pyramids.
    pyramids: usize,
    passes: Vec<Pass>,
    /// The passes as the lattices that they refine.
    steps: Vec<Step>,
    /// The boxes of a block's codes, part after part.
    boxes: Vec<PlacedBox>,
    stages: Stages,
}

/// A box of codes, and the nodes that they become.
#[derive(Debug)]
struct PlacedBox {
    /// The pass that adds its nodes, and the selection of nodes; `None` if the level of detail has none of its nodes.
    of: Option<PassBox>,
    part: u8,
    /// Where its codes lie in the slices of the pass.
    at: CodeBox,
    /// Takes every n-th code along x, y, z, which then lie contiguously.
    every: [usize; 3],
}

impl<'a> PredictionPasses<'a> {
    /// The passes over a block of a tier that covers `size` voxels with `k` coefficients each.
    pub(crate) fn new(pyramid: &'a Pyramid, size: [usize; 3], k: usize, tier: u8) -> Self {
        let (own, pyramids) = if pyramid.order.contains(&Axis::T) { (k, 1) } else { (1, k) };
        let [x, y, z] = pyramid.nodes(size, tier);
        let passes = pyramid.passes(size, own, tier);
        let steps: Vec<Step> = passes.iter().map(Step::from).collect();
        let stages = Stages::new(pyramid.stencil, &steps);
        let mut new = Self { pyramid, shape: [x, y, z, own], pyramids, passes, steps, boxes: Vec::new(), stages };
        let place = |of: &PassBox| PlacedBox { of: Some(*of), part: of.part, at: new.placed(of), every: [1; 3] };
        new.boxes = pyramid.boxes(&new.passes).iter().map(place).collect();
        new
    }

    /// The same passes; only the nodes of a region, which is not empty, are decoded, from the codes that these need. Others are
    /// arbitrary.
    pub(crate) fn within(mut self, region: &Region) -> Self {
        self.stages.narrow(region);
        let within: Vec<&Within> = self.stages.within().collect();
        for of in self.boxes.iter_mut().filter(|of| of.every == [1; 3]) {
            if let Some(PassBox { pass, .. }) = of.of {
                let Range { start, end } = within[pass].places;
                of.at.needed = Places { start, end };
            }
        }
        self
    }

    /// A box around the known nodes that the decoded ones depend on.
    pub(crate) fn needed_above(&self) -> Region {
        known::needed(&self.passes, self.stages.within())
    }

    /// The number of nodes along x, y, z and k.
    pub(crate) fn nodes(&self) -> [usize; 4] {
        let [x, y, z, k] = self.shape;
        [x, y, z, k * self.pyramids]
    }

    /// The boxes of a level part, as a reader needs them.
    fn placed_boxes(&self, part: u8) -> Vec<CodeBox> {
        self.boxes.iter().filter(|of| of.part == part).map(|of| of.at).collect()
    }

    /// The boxes of a level part, each of nodes that a pass adds.
    fn boxes_of(&self, part: u8) -> impl Iterator<Item = &PassBox> {
        self.boxes.iter().filter(move |of| of.part == part).filter_map(|of| of.of.as_ref())
    }

    fn placed(&self, of: &PassBox) -> CodeBox {
        let (first, strides) = self.stages.places(of.pass);
        of.placed(self.extent(of.pass), first, strides)
    }

    /// The codes that a pass adds to all pyramids along x, y, z, k.
    fn extent(&self, pass: usize) -> [usize; 4] {
        let [x, y, z, k] = self.steps[pass].added;
        [x, y, z, k * self.pyramids]
    }

    /// The codes of a level part, from all codes, pass after pass.
    pub(crate) fn part_of<'c>(&self, part: u8, codes: &'c [i32]) -> Vec<DenseCodes<'c>> {
        let mut start = 0;
        let of_pass = |pass: &Pass| {
            let first = start;
            start += self.pyramids * pass.codes();
            &codes[first..start]
        };
        let of_passes: Vec<&[i32]> = self.passes.iter().map(of_pass).collect();
        let of_box = |of: &PassBox| {
            let [x, y, z, k] = self.extent(of.pass);
            let at = of.placed([x, y, z, k], 0, [1, x, x * y]);
            DenseCodes { codes: of_passes[of.pass], slice: x * y * z, at }
        };
        self.boxes_of(part).map(of_box).collect()
    }

    /// Lists the codes that are not zero, from all codes, pass after pass.
    pub(crate) fn list(&self, codes: &[i32]) -> PooledCodes {
        self.list_parts(codes, Pyramid::PARTS)
    }

    /// Lists the codes on which the [changes](Self::changes) of level parts depend: those of all parts but the finest, which has most.
    /// Returns the [counts](Self::counts), too.
    pub(crate) fn list_coarse(&self, codes: &[i32]) -> (PooledCodes, Vec<Counts>) {
        let finest = self.boxes.iter().map(|of| of.part).max().unwrap_or(0);
        let listed = self.list_parts(codes, finest);
        let mut counts = self.counts(&listed);
        for (number, counts) in counts.iter_mut().enumerate() {
            let all: usize = self.code_ranges(number).into_iter().map(|of| dispatch!(count_nonzero(&codes[of]))).sum();
            counts[usize::from(finest)] = all - counts.iter().sum::<usize>();
        }
        (listed, counts)
    }

    /// As [`Self::list`], without the codes of parts from `end` on.
    fn list_parts(&self, codes: &[i32], end: u8) -> PooledCodes {
        let mut listed = PooledCodes::new();
        for part in 0..Pyramid::PARTS {
            let places = self.placed_boxes(part);
            if part < end {
                self.part_of(part, codes).iter().zip(&places).for_each(|(of, places)| listed.list(of, places));
            } else {
                listed.skip(&places);
            }
        }
        listed
    }

    /// All codes, pass after pass, from those that are not zero: the opposite of [`Self::list`].
    pub(crate) fn dense(&self, codes: &SparseCodes) -> Vec<i32> {
        let mut all = vec![0; self.codes()];
        let starts =
            wavelet::ranges(&(0..self.passes.len()).map(|n| self.extent(n).iter().product()).collect::<Vec<_>>());
        for (of, runs) in self.boxes.iter().filter_map(|of| of.of).zip(self.runs()) {
            let [x, y, z, _] = self.extent(of.pass);
            for (slice, run) in runs.enumerate() {
                let (places, values) = codes.run(run);
                for (place, value) in places.iter().zip(values) {
                    let number = self.stages.number(of.pass, *place as usize);
                    all[starts[of.pass].start + slice * x * y * z + number] = *value;
                }
            }
        }
        all
    }

    /// The number of codes of a level part that are not zero.
    pub(crate) fn count(&self, part: u8, codes: &SparseCodes) -> usize {
        let runs = self.runs();
        let of_part = self.boxes.iter().zip(&runs).filter(|(of, _)| of.part == part);
        of_part.flat_map(|(_, runs)| runs.clone()).map(|run| codes.run(run).1.len()).sum()
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
        self.thin(&mut codes);
        Ok(codes)
    }

    /// The codes of a block that is not yet stored.
    pub(crate) fn unpack(&self, block: &EncodedBlock) -> wavesplat_format::Result<PooledCodes> {
        let mut codes = PooledCodes::new();
        for part in 0..Pyramid::PARTS {
            let boxes = self.placed_boxes(part);
            match block.parts.iter().find(|found| found.kind == PartKind::Level(part)) {
                Some(found) => {
                    let unpacked = self.pyramid.packing.unpack(&found.payload()?, &boxes, &mut codes);
                    unpacked.map_err(wavesplat_format::Error::Invalid)?;
                }
                None => codes.skip(&boxes),
            }
        }
        Ok(codes)
    }

    /// Decodes every k that `wanted` marks into the field. `codes` are all codes of the block, as [`Self::placed_boxes`] places them.
    /// Returns which k were decoded: those wanted with a node that may not be zero. Leaves the nodes of other k as they are; if k is
    /// refined, with arbitrary values.
    pub(crate) fn decode_some<R: Real>(
        &self,
        wanted: &[bool],
        step: f64,
        codes: &SparseCodes,
        known: Option<Nodes<'_, R>>,
        field: &mut [R],
    ) -> Vec<bool> {
        let mut marked = self.marked(codes, known);
        let pyramids = field.chunks_exact_mut(self.pyramid_nodes());
        for ((number, nodes), wanted) in pyramids.enumerate().zip(wanted.chunks_exact(self.shape[3])) {
            if marked[number * self.shape[3]] && wanted.contains(&true) {
                self.stages.refine(wanted, nodes, &mut self.sparse(number, step, codes, known, PARTS));
            }
        }
        marked.iter_mut().zip(wanted).for_each(|(marked, wanted)| *marked &= *wanted);
        marked
    }

    /// For each k, whether some code or known node is not zero; if k is refined, the same for all of them.
    pub(crate) fn marked<R: Real>(&self, codes: &SparseCodes, known: Option<Nodes<'_, R>>) -> Vec<bool> {
        let runs = self.runs();
        let some = (0..self.pyramids).map(|number| self.is_marked(number, codes, &runs, known));
        some.flat_map(|some| std::iter::repeat_n(some, self.shape[3])).collect()
    }

    /// The k of the pyramid with this number.
    fn ks(&self, number: usize) -> Range<usize> {
        number * self.shape[3]..(number + 1) * self.shape[3]
    }

    /// Whether some code or known node of the pyramid with this number is not zero. `runs` are all runs of codes.
    fn is_marked<R: Real>(
        &self,
        number: usize,
        codes: &SparseCodes,
        runs: &[Range<usize>],
        known: Option<Nodes<'_, R>>,
    ) -> bool {
        let has_codes = |runs: &Range<usize>| {
            let each = runs.len() / self.pyramids;
            (0..each).any(|n| !codes.run(runs.start + number * each + n).1.is_empty())
        };
        let mut runs_of_passes = self.boxes.iter().zip(runs).filter(|(of, _)| of.of.is_some()).map(|(_, runs)| runs);
        runs_of_passes.any(has_codes) || known.is_some_and(|known| !known.is_zero(self.ks(number)))
    }

    /// As [`Self::marked`], from all codes, pass after pass.
    pub(crate) fn marked_codes<R: Real>(&self, codes: &[i32], known: Option<Nodes<'_, R>>) -> Vec<bool> {
        let has_codes = |number| self.code_ranges(number).into_iter().any(|range| !rows::all_zero(&codes[range]));
        let has_known = |number| known.is_some_and(|known| !known.is_zero(self.ks(number)));
        let some = (0..self.pyramids).map(|number| has_codes(number) || has_known(number));
        some.flat_map(|some| std::iter::repeat_n(some, self.shape[3])).collect()
    }

    /// As [`Self::decode_some`], for one k that is not refined with others. False if all its nodes are zero.
    pub(crate) fn decode_one<R: Real>(
        &self,
        k: usize,
        step: f64,
        codes: &SparseCodes,
        known: Option<Nodes<'_, R>>,
        nodes: &mut Vec<R>,
    ) -> bool {
        let some = self.is_marked(k, codes, &self.runs(), known);
        if some {
            nodes.resize(self.pyramid_nodes(), R::default());
            self.stages.refine(&[true], nodes, &mut self.sparse(k, step, codes, known, PARTS));
        }
        some
    }

    /// The nodes of a field: `marked` are the k that may have some that are not zero.
    pub(crate) fn field<'n, R: Real>(&self, values: &'n [R], marked: &'n [bool]) -> Nodes<'n, R> {
        let [x, y, z, _] = self.nodes();
        Nodes { values, size: [x, y, z], marked: Some(marked) }
    }

    /// The number of codes of a block.
    pub(crate) fn codes(&self) -> usize {
        self.pyramids * self.passes.iter().map(Pass::codes).sum::<usize>()
    }

    /// How many codes of each pyramid and level part are not zero.
    pub(crate) fn counts(&self, codes: &SparseCodes) -> Vec<Counts> {
        let (runs, mut counts) = (self.runs(), vec![Counts::default(); self.pyramids]);
        for (of, runs) in self.boxes.iter().zip(runs) {
            for (n, run) in runs.clone().enumerate() {
                counts[n * self.pyramids / runs.len()][usize::from(of.part)] += codes.run(run).1.len();
            }
        }
        counts
    }

    /// The changes of a field from leaving out each part with codes and all finer ones. All k of the field are decoded; those that it
    /// does not mark are zero.
    pub(crate) fn changes<R: Real>(
        &self,
        counts: &[Counts],
        step: f64,
        codes: &SparseCodes,
        known: Option<Nodes<'_, R>>,
        field: Nodes<'_, R>,
    ) -> Vec<Change> {
        let mut changes = vec![Change::default(); PARTS];
        let coded: [bool; PARTS] = std::array::from_fn(|part| counts.iter().any(|counts| counts[part] > 0));
        let pyramids = field.values.chunks_exact(self.pyramid_nodes()).zip(counts).enumerate();
        for (number, (nodes, counts)) in pyramids.filter(|(number, _)| self.ks(*number).any(|k| field.has(k))) {
            // The directory lists only parts with codes. A pyramid without codes from a part on does not change.
            let is_changed = |part: usize| coded[part] && counts[part..].iter().any(|count| *count > 0);
            for (part, change) in changes.iter_mut().enumerate().filter(|(part, _)| is_changed(*part)) {
                if part == 0 && !self.has_known() {
                    dispatch!(add_changes_to_zero(change, nodes));
                } else {
                    let mut decoding = self.sparse(number, step, codes, known, part);
                    self.stages.for_each_slice(&mut decoding, |n, rest| {
                        dispatch!(add_changes(&mut *change, &nodes[n * rest.len()..][..rest.len()], rest));
                    });
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
        known: Option<Nodes<'c, R>>,
        parts: usize,
    ) -> Decoding<'c, R> {
        let steps = self.passes.iter().map(|pass| (self.step(step, pass), Vec::new()));
        let mut passes: Vec<(R, Vec<usize>)> = steps.collect();
        for (of, runs) in self.boxes.iter().zip(self.runs()).filter(|(of, _)| usize::from(of.part) < parts) {
            if let Some(PassBox { pass, .. }) = of.of {
                passes[pass].1.push(runs.start + number * (runs.len() / self.pyramids));
            }
        }
        Decoding { codes, passes, known: known.map(|known| self.known(number, known)) }
    }

    /// The known nodes of the pyramid with this number.
    fn known<'c, R: Real>(&self, number: usize, known: Nodes<'c, R>) -> KnownNodes<'c, R> {
        KnownNodes::new(known, number * self.shape[3], &self.passes)
    }

    /// Whether the block begins with nodes of the block above.
    fn has_known(&self) -> bool {
        self.passes[0].is_known
    }

    fn step<R: Real>(&self, step: f64, pass: &Pass) -> R {
        R::from_f64(self.pyramid.step(step, pass.level))
    }

    /// The number of nodes in a pyramid.
    fn pyramid_nodes(&self) -> usize {
        self.shape.iter().product()
    }

    /// The range of codes of each pass of a pyramid.
    fn code_ranges(&self, number: usize) -> Vec<Range<usize>> {
        let mut start = 0;
        let of_pass = |pass: &Pass| {
            let codes = pass.codes();
            let first = start + number * codes;
            start += self.pyramids * codes;
            first..first + codes
        };
        self.passes.iter().map(of_pass).collect()
    }

    /// The runs of codes of each box, for every pyramid and each of its slices along time.
    fn runs(&self) -> Vec<Range<usize>> {
        wavelet::ranges(&self.boxes.iter().map(|of| of.at.extents[3]).collect::<Vec<_>>())
    }
}
