//! The pyramid of a block: nodes predicted from coarser ones, and codes for what is missing (spacetime.md).
//!
//! v = U v' + r: even nodes keep their value, odd nodes are predicted along one axis, and a code times the step of its
//! level is added. The encoder predicts from what the decoder has, so that no error adds up: every node is within half a
//! step of its own level.

use super::real::Real;
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
            self.for_each_row(pass, field, |mut nodes, predicted| {
                let (row, rest) = codes.split_at(predicted.len());
                codes = rest;
                nodes.update(predicted, row, |_, p, code| p + R::of_code(*code) * step);
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
            self.for_each_row(pass, field, |mut nodes, predicted| {
                let (row, rest) = std::mem::take(&mut codes).split_at_mut(predicted.len());
                codes = rest;
                let mut all = true;
                nodes.update(predicted, row, |v, p, code| {
                    let q = (v - p) * inverse;
                    let small = q < R::MOST_CODE && q > R::of(0.0) - R::MOST_CODE;
                    all &= small | v.is_nan();
                    let q = if small { (q + R::BIG) - R::BIG } else { R::of(0.0) };
                    *code = q.to_code();
                    p + q * step
                });
                fits &= all;
            });
        }
        fits
    }

    /// Calls `visit` with every row of nodes along x that a pass adds, and what they are predicted to be.
    fn for_each_row<R: Real>(&self, pass: &Pass, field: &mut [R], mut visit: impl FnMut(Row<'_, R>, &[R])) {
        let extent = pass.extent(self.shape);
        let (first, distance) = pass.nodes(0);
        let mut predicted = vec![R::default(); extent[0]];
        for at in rows(pass, self.shape) {
            match pass.axis {
                None => predicted.fill(R::default()),
                Some(Axis::X) => self.predict_along(pass, &field[at.start..][..self.shape[0]], &mut predicted),
                Some(axis) => self.predict_across(pass, axis.index(), &at, field, &mut predicted),
            }
            visit(Row { nodes: &mut field[at.start + first..at.start + self.shape[0]], distance }, &predicted);
        }
    }

    /// Predicts a row of nodes from rows before and behind it along another axis.
    fn predict_across<R: Real>(&self, pass: &Pass, axis: usize, at: &RowAt, field: &[R], predicted: &mut [R]) {
        let (_, distance) = pass.nodes(axis);
        let stride: usize = self.shape[..axis].iter().product();
        let start = at.start - at.index[axis] * stride;
        let taps = taps(self.pyramid.stencil, at.index[axis] / distance, self.shape[axis].div_ceil(distance));
        let row = |even: usize| &field[start + even * distance * stride..][..self.shape[0]];
        let step = pass.nodes(0).1;
        match taps {
            Taps { first, weights: [w, x, y, z], count: 4 } => {
                let rows = [row(first), row(first + 1), row(first + 2), row(first + 3)];
                sum4(rows, [w, x, y, z].map(R::of), step, predicted);
            }
            Taps { first, weights: [w, x, y, _], count: 3 } => {
                sum3([row(first), row(first + 1), row(first + 2)], [w, x, y].map(R::of), step, predicted);
            }
            Taps { first, weights: [w, x, ..], count: 2 } => {
                sum2([row(first), row(first + 1)], [w, x].map(R::of), step, predicted);
            }
            Taps { first, .. } => {
                predicted.iter_mut().zip(row(first).iter().step_by(step)).for_each(|(p, v)| *p = *v);
            }
        }
    }

    /// Predicts the odd nodes of a row from its even ones.
    fn predict_along<R: Real>(&self, pass: &Pass, row: &[R], predicted: &mut [R]) {
        let (_, distance) = pass.nodes(0);
        let evens = row.len().div_ceil(distance);
        for (i, p) in predicted.iter_mut().enumerate() {
            let taps = taps(self.pyramid.stencil, i, evens);
            let term = |t: usize| R::of(taps.weights[t]) * row[(taps.first + t) * distance];
            *p = (1..taps.count).fold(term(0), |sum, t| sum + term(t));
        }
    }
}

/// A row of nodes, every `distance`-th of a slice.
struct Row<'a, R> {
    nodes: &'a mut [R],
    distance: usize,
}

impl<R: Real> Row<'_, R> {
    /// Sets every node to what `set` makes of it, of what was predicted, and of its code.
    fn update<C>(&mut self, predicted: &[R], codes: C, mut set: impl FnMut(R, R, C::Item) -> R)
    where
        C: IntoIterator,
    {
        let each = predicted.iter().zip(codes);
        if self.distance == 1 {
            self.nodes.iter_mut().zip(each).for_each(|(v, (p, code))| *v = set(*v, *p, code));
        } else {
            let nodes = self.nodes.iter_mut().step_by(self.distance);
            nodes.zip(each).for_each(|(v, (p, code))| *v = set(*v, *p, code));
        }
    }
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

fn sum2<R: Real>(rows: [&[R]; 2], w: [R; 2], step: usize, out: &mut [R]) {
    let [a, b] = rows;
    if step == 1 {
        let each = a.iter().zip(b);
        out.iter_mut().zip(each).for_each(|(p, (a, b))| *p = w[0] * *a + w[1] * *b);
    } else {
        let each = a.iter().step_by(step).zip(b.iter().step_by(step));
        out.iter_mut().zip(each).for_each(|(p, (a, b))| *p = w[0] * *a + w[1] * *b);
    }
}

fn sum3<R: Real>(rows: [&[R]; 3], w: [R; 3], step: usize, out: &mut [R]) {
    sum2([rows[0], rows[1]], [w[0], w[1]], step, out);
    add(rows[2], w[2], step, out);
}

fn sum4<R: Real>(rows: [&[R]; 4], w: [R; 4], step: usize, out: &mut [R]) {
    let [a, b, c, d] = rows;
    if step == 1 {
        let each = a.iter().zip(b).zip(c.iter().zip(d));
        let sum = |((a, b), (c, d)): ((&R, &R), (&R, &R))| ((w[0] * *a + w[1] * *b) + w[2] * *c) + w[3] * *d;
        out.iter_mut().zip(each).for_each(|(p, each)| *p = sum(each));
    } else {
        sum3([a, b, c], [w[0], w[1], w[2]], step, out);
        add(d, w[3], step, out);
    }
}

fn add<R: Real>(row: &[R], w: R, step: usize, out: &mut [R]) {
    out.iter_mut().zip(row.iter().step_by(step)).for_each(|(p, v)| *p = *p + w * *v);
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
