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

use super::real::Real;
use super::rows::{self, Change};
use crate::wavelet;
use std::ops::Range;
use wavesplat_format::{Axis, Pass, Pyramid, Stencil};

/// The number of level parts of a block.
const PARTS: usize = Pyramid::PARTS as usize;

/// The passes over one block's field of `[x, y, z, k]` nodes, x fastest.
#[derive(Debug)]
pub(crate) struct PredictionPasses<'a> {
    pyramid: &'a Pyramid,
    /// The nodes of one slice, refined together: all nodes, or those of one k if k is not refined.
    shape: [usize; 4],
    /// The number of slices.
    slices: usize,
    passes: Vec<Pass>,
    /// For each k of a slice, true.
    every: Vec<bool>,
}

impl<'a> PredictionPasses<'a> {
    pub(crate) fn new(pyramid: &'a Pyramid, [x, y, z, k]: [usize; 4]) -> Self {
        let apart = !pyramid.order.contains(&Axis::T);
        let (shape, slices) = if apart { ([x, y, z, 1], k) } else { ([x, y, z, k], 1) };
        Self { pyramid, shape, slices, passes: pyramid.passes(shape), every: vec![true; shape[3]] }
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
        [x, y, z, k * self.slices]
    }

    /// The number of codes in each level part.
    pub(crate) fn part_lengths(&self) -> Vec<usize> {
        let of_slice = |part| self.passes.iter().filter(|p| p.part == part).map(|p| p.codes(self.shape)).sum::<usize>();
        (0..Pyramid::PARTS).map(|part| self.slices * of_slice(part)).collect()
    }

    /// The nodes that the passes of a level part add.
    pub(crate) fn boxes(&self, part: u8) -> Vec<[usize; 4]> {
        let of_all = |[x, y, z, k]: [usize; 4]| [x, y, z, k * self.slices];
        self.passes.iter().filter(|p| p.part == part).map(|p| of_all(p.extent(self.shape))).collect()
    }

    /// Decodes codes to the field; `codes` are all codes of the block, pass after pass. Returns for each k whether some
    /// node is not zero; where k is refined, true for all or none.
    pub(crate) fn decode<R: Real>(&self, step: f64, codes: &[i32], field: &mut [R]) -> Vec<bool> {
        self.decode_some(&vec![true; self.nodes()[3]], step, codes, field)
    }

    /// As [`Self::decode`], of every k that `wanted` marks. The nodes of others have any value of a decoded block, or 0.
    pub(crate) fn decode_some<R: Real>(&self, wanted: &[bool], step: f64, codes: &[i32], field: &mut [R]) -> Vec<bool> {
        let marked = self.marked(codes);
        for ((slice, nodes), wanted) in self.slices(field).enumerate().zip(wanted.chunks_exact(self.shape[3])) {
            let is_empty = !marked[slice] || !wanted.contains(&true);
            if is_empty || wanted.contains(&false) {
                nodes.fill(R::default());
            }
            if !is_empty {
                self.decode_slice((slice, wanted), step, codes, nodes);
            }
        }
        marked
    }

    /// For each pass, every k of a slice whose nodes of this pass have an effect on those that `wanted` marks.
    fn needed_in_passes(&self, wanted: &[bool]) -> Vec<Vec<bool>> {
        let mut needed: Vec<Vec<bool>> = Vec::new();
        for n in (0..self.passes.len()).rev() {
            let mut of_pass = needed.last().map_or(wanted, Vec::as_slice).to_vec();
            if let Some(later) = self.passes.get(n + 1).filter(|later| later.axis == Some(Axis::T)) {
                let (first, distance) = later.nodes(Axis::T.index());
                let evens = self.shape[3].div_ceil(distance);
                for k in (first..self.shape[3]).step_by(distance).filter(|k| needed[needed.len() - 1][*k]) {
                    let taps = taps(self.pyramid.stencil, k / distance, evens);
                    (0..taps.count).for_each(|tap| of_pass[(taps.first + tap) * distance] = true);
                }
            }
            needed.push(of_pass);
        }
        needed.reverse();
        needed
    }

    /// For each k, whether some code is not zero; if k is refined, the same for all of them.
    pub(crate) fn marked(&self, codes: &[i32]) -> Vec<bool> {
        let some = |slice| self.of_slice(slice).any(|(_, range)| !rows::all_zero(&codes[range]));
        (0..self.slices).flat_map(|slice| std::iter::repeat_n(some(slice), self.shape[3])).collect()
    }

    /// As [`Self::decode`], for one k that is not refined with others. False if all its nodes are zero.
    pub(crate) fn decode_one<R: Real>(&self, k: usize, step: f64, codes: &[i32], nodes: &mut Vec<R>) -> bool {
        let some = self.of_slice(k).any(|(_, range)| !rows::all_zero(&codes[range]));
        if some {
            nodes.resize(self.slice(), R::default());
            self.decode_slice((k, &self.every), step, codes, nodes);
        }
        some
    }

    fn decode_slice<R: Real>(&self, (slice, wanted): (usize, &[bool]), step: f64, codes: &[i32], nodes: &mut [R]) {
        let needed = self.needed_in_passes(wanted);
        for ((refined, range), needed) in self.of_slice(slice).zip(&needed) {
            let refined = Refined { needed, ..refined };
            let step = R::of(self.pyramid.step(step, refined.pass.level));
            decode_pass(&refined, step, &codes[range], nodes);
        }
    }

    /// Encodes the field and replaces it by the decoded field. NaN nodes get the code 0. False if a code does not fit.
    pub(crate) fn encode<R: Real>(&self, step: f64, field: &mut [R], codes: &mut [i32]) -> bool {
        let mut fits = true;
        for (slice, nodes) in self.slices(field).enumerate() {
            for (refined, range) in self.of_slice(slice) {
                let step = self.pyramid.step(step, refined.pass.level);
                fits &= encode_pass(&refined, [R::of(step), R::of(1.0 / step)], &mut codes[range], nodes);
            }
        }
        fits
    }

    /// The change of a decoded field from leaving out each level part and all finer ones; `rest` is scratch.
    pub(crate) fn changes<R: Real>(&self, field: &[R], rest: &mut Vec<R>) -> Vec<Change> {
        self.changes_of(&[true; PARTS], field, rest)
    }

    /// As [`Self::changes`], only for parts with a code that is not zero; the directory does not list others.
    pub(crate) fn changes_of_coded<R: Real>(&self, codes: &[i32], field: &[R], rest: &mut Vec<R>) -> Vec<Change> {
        let ranges = wavelet::ranges(&self.part_lengths());
        let coded: Vec<bool> = ranges.into_iter().map(|range| !rows::all_zero(&codes[range])).collect();
        self.changes_of(&coded, field, rest)
    }

    fn changes_of<R: Real>(&self, wanted: &[bool], field: &[R], rest: &mut Vec<R>) -> Vec<Change> {
        let mut changes = vec![Change::default(); PARTS];
        for nodes in field.chunks_exact(self.slice()).filter(|nodes| !rows::is_zero(nodes)) {
            for (part, change) in changes.iter_mut().enumerate().filter(|(part, _)| wanted[*part]) {
                self.leave_out(part, nodes, rest, change);
            }
        }
        changes
    }

    /// Adds the change of a slice from leaving out a level part and all finer ones.
    fn leave_out<R: Real>(&self, part: usize, nodes: &[R], rest: &mut Vec<R>, change: &mut Change) {
        if part == 0 {
            return rows::add_changes_to_zero(change, nodes);
        }
        rest.clear();
        rest.extend_from_slice(nodes);
        let finer = self.of_slice(0).filter(|(refined, _)| usize::from(refined.pass.part) >= part);
        finer.for_each(|(refined, _)| leave_out_pass(&refined, change, rest));
    }

    /// The number of nodes in a slice.
    fn slice(&self) -> usize {
        self.shape.iter().product()
    }

    fn slices<'f, R>(&self, field: &'f mut [R]) -> impl Iterator<Item = &'f mut [R]> + use<'f, R> {
        field.chunks_exact_mut(self.slice())
    }

    /// The passes over a slice, each with the range of its codes in the block.
    fn of_slice(&self, slice: usize) -> impl Iterator<Item = (Refined<'_>, Range<usize>)> {
        let mut start = 0;
        self.passes.iter().map(move |pass| {
            let codes = pass.codes(self.shape);
            let first = start + slice * codes;
            start += self.slices * codes;
            let (stencil, shape, needed) = (self.pyramid.stencil, self.shape, &self.every);
            (Refined { stencil, shape, pass, needed }, first..first + codes)
        })
    }
}

/// One pass over a slice.
struct Refined<'a> {
    stencil: Stencil,
    shape: [usize; 4],
    pass: &'a Pass,
    /// For each k, whether its nodes are needed.
    needed: &'a [bool],
}

/// Computes eq 32 for all nodes of a pass.
#[cfg_attr(not(feature = "portable"), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn decode_pass<R: Real>(refined: &Refined<'_>, step: R, codes: &[i32], field: &mut [R]) {
    refined.for_each_row(field, |first, nodes, predicted| rows::decode(nodes, predicted, &codes[first..], step));
}

/// Computes the codes of a pass, and replaces its nodes by their decoded values (eq 32).
#[cfg_attr(not(feature = "portable"), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn encode_pass<R: Real>(refined: &Refined<'_>, [step, inverse]: [R; 2], codes: &mut [i32], field: &mut [R]) -> bool {
    let mut fits = true;
    refined.for_each_row(field, |first, nodes, predicted| {
        fits &= rows::encode(nodes, predicted, &mut codes[first..], step, inverse);
    });
    fits
}

/// Adds the change from leaving out the pass. Replaces the nodes in `field` by their predictions.
#[cfg_attr(not(feature = "portable"), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn leave_out_pass<R: Real>(refined: &Refined<'_>, change: &mut Change, field: &mut [R]) {
    refined.for_each_row(field, |_, nodes, predicted| {
        rows::replace(change, nodes, predicted);
    });
}

impl Refined<'_> {
    /// Calls `visit(index of its first code, nodes, predicted)` for every row of nodes along x that the pass adds.
    #[inline(always)]
    fn for_each_row<R: Real>(&self, field: &mut [R], mut visit: impl FnMut(usize, &mut [R], &[R])) {
        let (first, distance) = self.pass.nodes(0);
        let shape = self.side_by_side();
        let count = self.pass.extent(shape)[0];
        let mut scratch = Scratch::new(self.shape[0].max(count));
        let Scratch { predicted, apart, gathered } = &mut scratch;
        let predicted = &mut predicted[..count];
        for at in Rows::new(self.pass, shape).filter(|at| self.needed[at.index[3]]) {
            match self.pass.axis {
                None => predicted.fill(R::default()),
                Some(Axis::X) => self.predict_along(&field[at.start..], &mut gathered[0], predicted),
                Some(axis) => self.predict_across((axis.index(), shape), &at, field, gathered, predicted),
            }
            let nodes = &mut field[at.start + first..at.start + shape[0]];
            if distance == 1 {
                visit(at.codes, nodes, predicted);
            } else {
                rows::gather(nodes, distance, &mut apart[..count]);
                visit(at.codes, &mut apart[..count], predicted);
                nodes.iter_mut().step_by(distance).zip(&*apart).for_each(|(node, v)| *node = *v);
            }
        }
    }

    /// Predicts a row of nodes from rows before and behind it along another axis.
    #[inline(always)]
    fn predict_across<R: Real>(
        &self,
        (axis, shape): (usize, [usize; 4]),
        at: &RowAt,
        field: &[R],
        gathered: &mut [Vec<R>; 4],
        predicted: &mut [R],
    ) {
        let (_, distance) = self.pass.nodes(axis);
        let stride: usize = shape[..axis].iter().product();
        let start = at.start - at.index[axis] * stride;
        let taps = taps(self.stencil, at.index[axis] / distance, shape[axis].div_ceil(distance));
        let row = |tap: usize| &field[start + (taps.first + tap) * distance * stride..][..shape[0]];
        let apart = self.pass.nodes(0).1;
        if apart == 1 {
            taps.sum(std::array::from_fn(|t| if t < taps.count { row(t) } else { &[] }), predicted);
        } else {
            (0..taps.count).for_each(|t| rows::gather(row(t), apart, &mut gathered[t][..predicted.len()]));
            taps.sum(gathered.each_ref().map(|row| &row[..]), predicted);
        }
    }

    /// Predicts the odd nodes of a row from its even ones.
    #[inline(always)]
    fn predict_along<R: Real>(&self, row: &[R], evens: &mut [R], predicted: &mut [R]) {
        let (_, distance) = self.pass.nodes(0);
        let count = self.shape[0].div_ceil(distance);
        rows::gather(&row[..self.shape[0]], distance, &mut evens[..count]);
        let mut i = 0;
        while i < predicted.len() {
            let taps = taps(self.stencil, i, count);
            // All nodes between the faces have the same taps, each shifted by one.
            let run = if taps.count == INNER { (count - 2 - i).min(predicted.len() - i) } else { 1 };
            let from = |t: usize| if t < taps.count { &evens[taps.first + t..] } else { &[] };
            taps.sum(std::array::from_fn(from), &mut predicted[i..i + run]);
            i += run;
        }
    }

    /// The shape with the longest rows: a row is a whole plane if the pass adds or keeps all nodes of planes.
    fn side_by_side(&self) -> [usize; 4] {
        let [x, y, z, k] = self.shape;
        let across = matches!(self.pass.axis, Some(Axis::Z | Axis::T));
        let all = [0, 1].map(|axis| self.pass.nodes(axis)) == [(0, 1); 2];
        if across && all { [x * y, 1, z, k] } else { self.shape }
    }
}

/// The number of taps of a cubic stencil between the faces.
const INNER: usize = 4;

/// Scratch rows of a pass.
struct Scratch<R> {
    predicted: Vec<R>,
    apart: Vec<R>,
    gathered: [Vec<R>; 4],
}

impl<R: Real> Scratch<R> {
    fn new(longest: usize) -> Self {
        let row = || vec![R::default(); longest];
        Self { predicted: row(), apart: row(), gathered: std::array::from_fn(|_| row()) }
    }
}

/// The location of a row: the offset of its node at x = 0, its `[x, y, z, k]`, and the index of its first code.
struct RowAt {
    start: usize,
    index: [usize; 4],
    codes: usize,
}

/// The rows along x of a pass, ordered so that the rows that predict them are near in memory.
struct Rows {
    shape: [usize; 4],
    extent: [usize; 4],
    nodes: [(usize, usize); 4],
    /// The axes of the outermost and of the next loop; y is the innermost.
    loops: [usize; 2],
    next: usize,
}

impl Rows {
    fn new(pass: &Pass, shape: [usize; 4]) -> Self {
        let nodes = std::array::from_fn(|axis| pass.nodes(axis));
        let loops = if pass.axis == Some(Axis::T) { [2, 3] } else { [3, 2] };
        Self { shape, extent: pass.extent(shape), nodes, loops, next: 0 }
    }
}

impl Iterator for Rows {
    type Item = RowAt;

    fn next(&mut self) -> Option<RowAt> {
        let [nx, ny, nz, nk] = self.extent;
        if nx == 0 || self.next >= ny * nz * nk {
            return None;
        }
        let (inner, mut number) = (self.extent[self.loops[1]], [0, self.next % ny, 0, 0]);
        (number[self.loops[0]], number[self.loops[1]]) = (self.next / ny / inner, self.next / ny % inner);
        self.next += 1;
        let index = std::array::from_fn(|a| if a == 0 { 0 } else { self.nodes[a].0 + number[a] * self.nodes[a].1 });
        let flat = |[_, y, z, k]: [usize; 4], [x, ys, zs, _]: [usize; 4]| x * (y + ys * (z + zs * k));
        Some(RowAt { start: flat(index, self.shape), codes: flat(number, self.extent), index })
    }
}

/// The weights of `count` consecutive even nodes, from number `first` on.
#[derive(Debug, Clone, Copy)]
struct Taps {
    first: usize,
    weights: [f64; 4],
    count: usize,
}

impl Taps {
    /// Computes the weighted sum of rows, one for each tap, from the first tap to the last.
    #[inline(always)]
    fn sum<R: Real>(&self, [a, b, c, d]: [&[R]; 4], out: &mut [R]) {
        let [w, x, y, z] = self.weights.map(R::of);
        match self.count {
            4 => rows::sum4([a, b, c, d], [w, x, y, z], out),
            3 => rows::sum3([a, b, c], [w, x, y], out),
            2 => rows::sum2([a, b], [w, x], out),
            _ => out.copy_from_slice(&a[..out.len()]),
        }
    }
}

/// The stencil for odd node `i`, between the even nodes i and i + 1 of `evens` (eq 33). Sums go from the first tap to
/// the last.
///
/// The polynomial through the nearest nodes: cubic through four, quadratic through three next to a face, and a straight
/// line (-1, 3)/2 beyond the last even node.
fn taps(stencil: Stencil, i: usize, evens: usize) -> Taps {
    let (last, cubic) = (i + 1 >= evens, stencil == Stencil::Cubic);
    let (first, weights, count) = match () {
        () if last && evens == 1 => (i, [1.0, 0.0, 0.0, 0.0], 1),
        () if last => (i - 1, [-0.5, 1.5, 0.0, 0.0], 2),
        () if cubic && i >= 1 && i + 2 < evens => (i - 1, [-0.0625, 0.5625, 0.5625, -0.0625], 4),
        () if cubic && evens >= 3 && i == 0 => (i, [0.375, 0.75, -0.125, 0.0], 3),
        () if cubic && evens >= 3 => (i - 1, [-0.125, 0.75, 0.375, 0.0], 3),
        () => (i, [0.5, 0.5, 0.0, 0.0], 2),
    };
    Taps { first, weights, count }
}
