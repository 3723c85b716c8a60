//! Operations on rows of nodes, inlined into every pass of a pyramid and compiled to vector code.

use super::real::Real;
use crate::wavelet::{LANES, Lane};
use wavesplat_format::PartStats;

/// p = w0 a + w1 b + 0: adding 0 turns -0 into 0.
#[inline(always)]
pub(super) fn sum2<R: Real>(rows: [&[R]; 2], w: [R; 2], out: &mut [R]) {
    let [a, b] = rows.map(|row| &row[..out.len()]);
    for (i, p) in out.iter_mut().enumerate() {
        *p = (w[0] * a[i] + w[1] * b[i]) + R::default();
    }
}

/// p = (w0 a + w1 b) + w2 c + 0
#[inline(always)]
pub(super) fn sum3<R: Real>(rows: [&[R]; 3], w: [R; 3], out: &mut [R]) {
    let [a, b, c] = rows.map(|row| &row[..out.len()]);
    for (i, p) in out.iter_mut().enumerate() {
        *p = ((w[0] * a[i] + w[1] * b[i]) + w[2] * c[i]) + R::default();
    }
}

/// p = ((w0 a + w1 b) + w2 c) + w3 d + 0
#[inline(always)]
pub(super) fn sum4<R: Real>(rows: [&[R]; 4], w: [R; 4], out: &mut [R]) {
    let [a, b, c, d] = rows.map(|row| &row[..out.len()]);
    for (i, p) in out.iter_mut().enumerate() {
        *p = (((w[0] * a[i] + w[1] * b[i]) + w[2] * c[i]) + w[3] * d[i]) + R::default();
    }
}

/// Computes the codes of v - p, 0 for NaN, and replaces p by the decoded value. False if a code does not fit.
#[inline(always)]
pub(super) fn encode<R: Real>(nodes: &[R], predicted: &mut [R], codes: &mut [i32], [step, inverse]: [R; 2]) -> bool {
    let least = R::default() - R::MOST_CODE;
    let mut fits = true;
    for ((v, p), code) in nodes.iter().zip(predicted).zip(codes) {
        let q = (*v - *p) * inverse;
        let small = (q < R::MOST_CODE) & (q > least);
        fits &= small | v.is_nan();
        let rounded = if small { q + R::BIG } else { R::BIG };
        *code = rounded.less_big();
        *p = *p + (rounded - R::BIG) * step;
    }
    fits
}

/// Whether all nodes are zero.
pub(super) fn is_zero<R: Real>(nodes: &[R]) -> bool {
    nodes.chunks(64).all(|some| some.iter().fold(true, |all, node| all & (*node == R::default())))
}

/// Whether all codes are zero.
pub(super) fn all_zero(codes: &[i32]) -> bool {
    codes.chunks(64).all(|some| some.iter().fold(0, |any, code| any | code) == 0)
}

/// The number of codes that are not zero.
#[inline(always)]
pub(super) fn count_nonzero(codes: &[i32]) -> usize {
    let of_run = |run: &[i32]| run.iter().map(|code| u32::from(*code != 0)).sum::<u32>() as usize;
    codes.chunks(1 << 16).map(of_run).sum()
}

/// The largest change and the sum of squared changes of some values.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Change {
    largest: Lane,
    squares: Lane,
}

impl Change {
    /// The largest change, rounded up; infinite if differences of the values overflow.
    pub(crate) fn largest(&self) -> f64 {
        if self.energy().is_nan() {
            return f64::INFINITY;
        }
        let largest = self.largest.into_iter().fold(0.0, f64::max);
        if largest > 0.0 { largest.next_up() } else { 0.0 }
    }

    /// The statistics of a level part with `count` nonzero codes. `self` must be the change from leaving out this part
    /// and all finer ones.
    pub(super) fn stats(&self, count: usize) -> PartStats {
        PartStats { count: count as u64, energy: self.energy(), largest: self.largest() }
    }

    #[inline(always)]
    fn add<R: Real>(&mut self, lane: usize, node: R, other: R) {
        let d = (node.to_f64() - other.to_f64()).abs();
        self.largest[lane] = if d > self.largest[lane] { d } else { self.largest[lane] };
        self.squares[lane] += d * d;
    }

    /// The sum of squares.
    pub(crate) fn energy(&self) -> f64 {
        self.squares.iter().sum()
    }
}

/// Adds the changes from `nodes` to `others`.
#[inline(always)]
pub(super) fn add_changes<R: Real>(change: &mut Change, nodes: &[R], others: &[R]) {
    let (nodes, last_nodes) = nodes.as_chunks::<LANES>();
    let (others, last_others) = others.as_chunks::<LANES>();
    for (a, b) in nodes.iter().zip(others) {
        for l in 0..LANES {
            change.add(l, a[l], b[l]);
        }
    }
    for (l, (a, b)) in last_nodes.iter().zip(last_others).enumerate() {
        change.add(l, *a, *b);
    }
}

/// Adds the changes from nodes to zeros.
#[inline(always)]
pub(super) fn add_changes_to_zero<R: Real>(change: &mut Change, nodes: &[R]) {
    let (nodes, last) = nodes.as_chunks::<LANES>();
    for a in nodes {
        for (l, node) in a.iter().enumerate() {
            change.add(l, *node, R::default());
        }
    }
    for (l, a) in last.iter().enumerate() {
        change.add(l, *a, R::default());
    }
}
