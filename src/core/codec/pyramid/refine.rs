//! Kernels that refine a lattice by two along one axis. Arrays hold the nodes of one lattice side by
//! side, without gaps for finer nodes, so that all kernels work on contiguous rows.
//!
//! An axis divides an array into `outer` parts, each of `evens` or `kept + odds` rows of `inner` nodes. Refining copies
//! the rows of even nodes apart from each other, and predicts the odd rows between them (eq 33).

use super::corrections::Correction;
use super::stencil::{predict_line, taps};
use super::within::around;
use crate::codec::real::{IntoNode, Real};
use std::ops::Range;
use wavesplat_format::{Pass, Stencil};

/// The rows of a lattice along the refined axis.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Rows {
    pub(super) inner: usize,
    pub(super) evens: usize,
    pub(super) odds: usize,
    /// The even rows that remain: all, or all but a last one that only predicts.
    pub(super) kept: usize,
}

impl Rows {
    /// The rows along `axis` of a lattice of `extents` nodes whose axis gains `odds` nodes and keeps some.
    pub(super) fn new(extents: [usize; 3], axis: usize, odds: usize, kept: usize) -> Self {
        Self { inner: extents[..axis].iter().product(), evens: extents[axis], odds, kept }
    }

    /// The even rows on which some of the refined rows depend.
    pub(super) fn needed_before(&self, stencil: Stencil, refined: Range<usize>) -> Range<usize> {
        if self.odds == 0 {
            return refined;
        }
        let needed = |row: usize| {
            let taps = taps(stencil, row / 2, self.evens);
            if row.is_multiple_of(2) { row / 2..row / 2 + 1 } else { taps.first..taps.first + taps.count }
        };
        around(refined.map(needed))
    }
}

/// What is computed of the rows of a lattice.
#[derive(Debug, Clone)]
pub(super) struct Reach {
    /// Parts.
    pub(super) outer: Range<usize>,
    /// Rows of a part, after refining.
    pub(super) rows: Range<usize>,
    /// Nodes of a row; along the fastest axis, lines of a part.
    pub(super) inner: Range<usize>,
    /// The lines of a part along the fastest axis, computed or not.
    pub(super) width: usize,
}

/// The nodes that a pass adds, from number `first` of them on.
#[derive(Debug, Clone, Copy)]
pub(super) struct AddedNodes {
    pub(super) pass: usize,
    pub(super) first: usize,
}

/// Refines along any axis but the fastest, and corrects every odd row. `added` are the nodes in these rows.
#[inline(always)]
pub(super) fn refine_across<R: Real, C: Correction<R>>(
    stencil: Stencil,
    rows: &Rows,
    reach: &Reach,
    coarse: &[R],
    fine: &mut [R],
    added: AddedNodes,
    correction: &mut C,
) {
    let &Rows { inner, evens, odds, kept, .. } = rows;
    let (apart, of_row, computed) = (1 + usize::from(odds > 0), &reach.inner, &reach.rows);
    for part in reach.outer.clone() {
        let from = &coarse[part * evens * inner..][..evens * inner];
        let to = &mut fine[part * (kept + odds) * inner..][..(kept + odds) * inner];
        for i in computed.start.div_ceil(apart)..computed.end.div_ceil(apart) {
            to[apart * i * inner..][of_row.clone()].copy_from_slice(&from[i * inner..][of_row.clone()]);
        }
        for i in computed.start / 2..odds.min(computed.end / 2) {
            let taps = taps(stencil, i, evens);
            let row = |t: usize| {
                if t < taps.count { &from[(taps.first + t) * inner..][of_row.clone()] } else { &[] }
            };
            let predicted = &mut to[(2 * i + 1) * inner..][of_row.clone()];
            taps.sum([row(0), row(1), row(2), row(3)], predicted);
            correction.correct(added.pass, added.first + (part * odds + i) * inner + of_row.start, predicted);
        }
    }
}

/// Refines along the fastest axis, and corrects the odd nodes of every line.
#[inline(always)]
pub(super) fn refine_lines<R: Real, C: Correction<R>>(
    stencil: Stencil,
    rows: &Rows,
    reach: &Reach,
    coarse: &[R],
    fine: &mut [R],
    added: AddedNodes,
    correction: &mut C,
) {
    let &Rows { evens, odds, kept, .. } = rows;
    let mut odd = vec![R::default(); odds];
    for line in reach.outer.clone().flat_map(|part| reach.inner.clone().map(move |n| part * reach.width + n)) {
        let even = &coarse[line * evens..][..evens];
        predict_line(stencil, even, &mut odd);
        correction.correct(added.pass, added.first + line * odds, &mut odd);
        let to = &mut fine[line * (kept + odds)..][..kept + odds];
        if odds == 0 {
            to.copy_from_slice(&even[..kept]);
            continue;
        }
        for (to, (even, odd)) in to.as_chunks_mut::<2>().0.iter_mut().zip(even.iter().zip(&odd)) {
            *to = [*even, *odd];
        }
        if kept > odds {
            to[2 * odds] = even[odds];
        }
    }
}

/// Refines along time: predicts some places in the odd slices of `slice` nodes each from the even ones, which are in place.
///
/// Only the slices that `wanted` marks are predicted. A few nodes of all slices at a time stay in the cache.
#[inline(always)]
pub(super) fn refine_slices<R: Real>(
    stencil: Stencil,
    slice: usize,
    places: &Range<usize>,
    wanted: &[bool],
    nodes: &mut [R],
) {
    let evens = wanted.len().div_ceil(2);
    let mut predicted = [R::default(); NODES];
    for first in places.clone().step_by(NODES) {
        let count = NODES.min(places.end - first);
        for odd in (1..wanted.len()).step_by(2) {
            if wanted[odd] {
                let taps = taps(stencil, odd / 2, evens);
                let row = |t: usize| {
                    if t < taps.count { &nodes[2 * (taps.first + t) * slice + first..][..count] } else { &[] }
                };
                taps.sum([row(0), row(1), row(2), row(3)], &mut predicted[..count]);
                nodes[odd * slice + first..][..count].copy_from_slice(&predicted[..count]);
            }
        }
    }
}

/// Nodes of a slice that are predicted together along time.
const NODES: usize = 1024;

/// Copies the nodes that a pass adds, x fastest, from those of a pyramid with `size` nodes along x, y, z.
#[inline(always)]
pub(super) fn gather<R: Real, V: IntoNode<R>>(source: &[V], [nx, ny, nz]: [usize; 3], pass: &Pass, added: &mut [R]) {
    let ([x, y, z, t], nodes) = (pass.extent(), [0, 1, 2, 3].map(|axis| pass.nodes(axis)));
    let at = |axis: usize, i: usize| nodes[axis].0 + nodes[axis].1 * i;
    let mut rows = added.chunks_exact_mut(x);
    for (t, z) in (0..t).flat_map(|t| (0..z).map(move |z| (t, z))) {
        let slice = &source[nx * ny * (at(2, z) + nz * at(3, t))..];
        for (y, row) in (0..y).zip(&mut rows) {
            gather_line(&slice[at(0, 0) + nx * at(1, y)..], nodes[0].1, row);
        }
    }
}

/// Copies every n-th node of a line.
#[inline(always)]
fn gather_line<R: Real, V: IntoNode<R>>(line: &[V], n: usize, out: &mut [R]) {
    if n == 2 && line.len() >= 2 * out.len() {
        for (to, pair) in out.iter_mut().zip(line.as_chunks::<2>().0) {
            *to = pair[0].node();
        }
    } else {
        for (i, to) in out.iter_mut().enumerate() {
            *to = line[i * n].node();
        }
    }
}
