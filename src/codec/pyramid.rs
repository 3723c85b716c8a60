//! The pyramid of a block: nodes predicted from coarser ones, and codes for what is missing (spacetime.md).
//!
//! v = U v' + r: even nodes keep their value, odd nodes are predicted along one axis, and a code times the step of its
//! level is added. The encoder predicts from what the decoder has, so that no error adds up: every node is within half a
//! step of its own level.

use super::real::Real;
use super::rows::{self, Change};
use std::ops::Range;
use wavesplat_format::{Axis, Pass, Pyramid, Stencil};

/// The passes over one block's field of `[x, y, z, k]` nodes, x fastest.
#[derive(Debug)]
pub(crate) struct Passes<'a> {
    pyramid: &'a Pyramid,
    shape: [usize; 4],
    passes: Vec<Pass>,
}

impl<'a> Passes<'a> {
    pub(crate) fn new(pyramid: &'a Pyramid, shape: [usize; 4]) -> Self {
        Self { pyramid, shape, passes: pyramid.passes(shape) }
    }

    /// The number of codes in each level part.
    pub(crate) fn part_lengths(&self) -> Vec<usize> {
        let of_part = |part| self.passes.iter().filter(|p| p.part == part).map(|p| p.codes(self.shape)).sum();
        (0..Pyramid::PARTS).map(of_part).collect()
    }

    /// The nodes that the passes of a level part add.
    pub(crate) fn boxes(&self, part: u8) -> Vec<[usize; 4]> {
        self.passes.iter().filter(|p| p.part == part).map(|p| p.extent(self.shape)).collect()
    }

    /// Codes to the field; `codes` are all of the block's, pass after pass.
    pub(crate) fn decode<R: Real>(&self, step: f64, codes: &[i32], field: &mut [R]) {
        let mut codes = codes;
        for pass in &self.passes {
            let step = R::of(self.pyramid.step(step, pass.level));
            self.for_each_row(pass, field, |nodes, predicted| {
                let (row, rest) = codes.split_at(nodes.len());
                codes = rest;
                rows::decode(nodes, predicted, row, step);
            });
        }
    }

    /// Codes the field, in the place of which is then what the decoder makes of the codes. Nodes that are not a number get
    /// the code 0. False if a code does not fit.
    pub(crate) fn encode<R: Real>(&self, step: f64, field: &mut [R], codes: &mut [i32]) -> bool {
        let (mut codes, mut fits) = (codes, true);
        for pass in &self.passes {
            let exact = self.pyramid.step(step, pass.level);
            let (step, inverse) = (R::of(exact), R::of(1.0 / exact));
            self.for_each_row(pass, field, |nodes, predicted| {
                let (row, rest) = std::mem::take(&mut codes).split_at_mut(nodes.len());
                codes = rest;
                fits &= rows::encode(nodes, predicted, row, step, inverse);
            });
        }
        fits
    }

    /// What leaving out each level part and all finer ones changes in a decoded field; `rest` is scratch.
    pub(crate) fn changes<R: Real>(&self, field: &[R], rest: &mut Vec<R>) -> Vec<Change> {
        (0..Pyramid::PARTS).map(|part| self.change(part, field, rest)).collect()
    }

    /// As [`Self::changes`], for parts with a code that is not zero alone: the directory says nothing of the others.
    pub(crate) fn changes_of_coded<R: Real>(&self, codes: &[i32], field: &[R], rest: &mut Vec<R>) -> Vec<Change> {
        let ranges = crate::wavelet::ranges(&self.part_lengths());
        let coded = |range: Range<usize>| codes[range].iter().any(|code| *code != 0);
        let mut change = |(part, range)| if coded(range) { self.change(part, field, rest) } else { Change::default() };
        (0..).zip(ranges).map(&mut change).collect()
    }

    fn change<R: Real>(&self, part: u8, field: &[R], rest: &mut Vec<R>) -> Change {
        if part == 0 {
            return change_to_zero(field);
        }
        rest.clear();
        rest.extend_from_slice(field);
        self.leave_out(part, rest)
    }

    /// What leaving out a level part and all finer ones changes in a decoded field. Overwrites `field` by what is left.
    fn leave_out<R: Real>(&self, part: u8, field: &mut [R]) -> Change {
        let mut change = Change::default();
        for pass in self.passes.iter().filter(|pass| pass.part >= part) {
            self.for_each_row(pass, field, |nodes, predicted| rows::replace(&mut change, nodes, predicted));
        }
        change
    }

    /// Calls `visit` with every row of nodes along x that a pass adds, and what they are predicted to be.
    fn for_each_row<R: Real>(&self, pass: &Pass, field: &mut [R], mut visit: impl FnMut(&mut [R], &[R])) {
        let shape = side_by_side(pass, self.shape);
        let count = pass.extent(shape)[0];
        let (first, distance) = pass.nodes(0);
        let mut predicted = vec![R::default(); count];
        let mut apart = Vec::new();
        let mut gathered = [const { Vec::new() }; 4];
        for at in rows(pass, shape) {
            match pass.axis {
                None => predicted.fill(R::default()),
                Some(Axis::X) => self.predict_along(pass, &field[at.start..], &mut gathered[0], &mut predicted),
                Some(axis) => {
                    self.predict_across(pass, (axis.index(), shape), &at, field, &mut gathered, &mut predicted);
                }
            }
            let nodes = &mut field[at.start + first..at.start + shape[0]];
            if distance == 1 {
                visit(nodes, &predicted);
            } else {
                gather(nodes, distance, count, &mut apart);
                visit(&mut apart, &predicted);
                nodes.iter_mut().step_by(distance).zip(&apart).for_each(|(node, v)| *node = *v);
            }
        }
    }

    /// Predicts a row of nodes from rows before and behind it along another axis.
    fn predict_across<R: Real>(
        &self,
        pass: &Pass,
        (axis, shape): (usize, [usize; 4]),
        at: &RowAt,
        field: &[R],
        gathered: &mut [Vec<R>; 4],
        predicted: &mut [R],
    ) {
        let (_, distance) = pass.nodes(axis);
        let stride: usize = shape[..axis].iter().product();
        let start = at.start - at.index[axis] * stride;
        let taps = taps(self.pyramid.stencil, at.index[axis] / distance, shape[axis].div_ceil(distance));
        let row = |tap: usize| &field[start + (taps.first + tap) * distance * stride..][..shape[0]];
        let apart = pass.nodes(0).1;
        if apart == 1 {
            taps.sum(std::array::from_fn(|t| if t < taps.count { row(t) } else { &[] }), predicted);
        } else {
            (0..taps.count).for_each(|t| gather(row(t), apart, predicted.len(), &mut gathered[t]));
            taps.sum(gathered.each_ref().map(|row| &row[..]), predicted);
        }
    }

    /// Predicts the odd nodes of a row from its even ones.
    fn predict_along<R: Real>(&self, pass: &Pass, row: &[R], evens: &mut Vec<R>, predicted: &mut [R]) {
        let (_, distance) = pass.nodes(0);
        let count = self.shape[0].div_ceil(distance);
        gather(&row[..self.shape[0]], distance, count, evens);
        let mut i = 0;
        while i < predicted.len() {
            let taps = taps(self.pyramid.stencil, i, count);
            // All nodes between the faces have the same taps, one further each.
            let run = if taps.count == INNER { (count - 2 - i).min(predicted.len() - i) } else { 1 };
            let from = |t: usize| if t < taps.count { &evens[taps.first + t..] } else { &[] };
            taps.sum(std::array::from_fn(from), &mut predicted[i..i + run]);
            i += run;
        }
    }
}

/// What leaving out everything changes: all is then predicted to be zero.
fn change_to_zero<R: Real>(field: &[R]) -> Change {
    const RUN: usize = 4096;
    let (mut change, zeros) = (Change::default(), [R::default(); RUN]);
    field.chunks(RUN).for_each(|nodes| rows::add_changes(&mut change, nodes, &zeros[..nodes.len()]));
    change
}

/// The shape in which the rows of a pass are longest: all nodes of a plane, where it adds or keeps all of them.
fn side_by_side(pass: &Pass, shape: [usize; 4]) -> [usize; 4] {
    let [x, y, z, k] = shape;
    let across = matches!(pass.axis, Some(Axis::Z | Axis::T));
    if across && [0, 1].map(|axis| pass.nodes(axis)) == [(0, 1); 2] { [x * y, 1, z, k] } else { shape }
}

/// Taps of a cubic stencil between the faces.
const INNER: usize = 4;

/// Every `distance`-th of some nodes, `count` of them.
fn gather<R: Real>(nodes: &[R], distance: usize, count: usize, out: &mut Vec<R>) {
    out.clear();
    out.extend(nodes.iter().step_by(distance).take(count));
}

/// Where a row is: the offset of its node at x = 0, and its `[x, y, z, k]`.
struct RowAt {
    start: usize,
    index: [usize; 4],
}

/// The rows along x that a pass adds nodes to, in the order of codes.
fn rows(pass: &Pass, shape: [usize; 4]) -> impl Iterator<Item = RowAt> + use<> {
    let along = [1, 2, 3].map(|axis| {
        let (first, distance) = pass.nodes(axis);
        (first..shape[axis]).step_by(distance)
    });
    let empty = pass.extent(shape)[0] == 0;
    let [ys, zs, ks] = along;
    let rows = ks.flat_map(move |k| {
        let ys = ys.clone();
        zs.clone().flat_map(move |z| ys.clone().map(move |y| [0, y, z, k]))
    });
    let start = move |[_, y, z, k]: [usize; 4]| shape[0] * (y + shape[1] * (z + shape[2] * k));
    rows.filter(move |_| !empty).map(move |index| RowAt { start: start(index), index })
}

/// Weights of some even nodes, the first being number `first`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Taps {
    pub(crate) first: usize,
    pub(crate) weights: [f64; 4],
    pub(crate) count: usize,
}

impl Taps {
    /// The weighted sum of rows, one for each tap, from the first tap to the last.
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

/// What predicts odd node `i`, between the even nodes i and i + 1 of `evens`; all sums go from the first tap to the last.
///
/// Cubic polynomials through four nodes, quadratic ones through three next to a face, and straight lines beyond the last.
pub(crate) fn taps(stencil: Stencil, i: usize, evens: usize) -> Taps {
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

/// Fills a line, of which every `stride`-th node is given, by passes without codes.
pub(crate) fn refine_line(stencil: Stencil, stride: usize, line: &mut [f64]) {
    let mut distance = stride;
    while distance > 1 {
        let evens = line.len().div_ceil(distance);
        for (i, node) in (distance / 2..line.len()).step_by(distance).enumerate() {
            let taps = taps(stencil, i, evens);
            line[node] = (0..taps.count).map(|t| taps.weights[t] * line[(taps.first + t) * distance]).sum();
        }
        distance /= 2;
    }
}
