//! Kernels that refine a lattice by two along one axis. Arrays hold the nodes of one lattice side by
//! side, without gaps for finer nodes, so that all kernels work on contiguous rows.
//!
//! An axis divides an array into `outer` parts, each of `evens` or `kept + odds` rows of `inner` nodes. Refining copies
//! the rows of even nodes apart from each other, and predicts the odd rows between them (eq 33).

use super::corrections::Correction;
use super::stencil::{predict_line, taps};
use crate::codec::real::Real;
use wavesplat_format::Stencil;

/// The rows of a lattice along the refined axis.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Rows {
    pub(super) outer: usize,
    pub(super) inner: usize,
    pub(super) evens: usize,
    pub(super) odds: usize,
    /// The even rows that remain: all, or all but a last one that only predicts.
    pub(super) kept: usize,
}

impl Rows {
    /// The rows along `axis` of a lattice of `extents` nodes whose axis gains `odds` nodes and keeps some.
    pub(super) fn new(extents: [usize; 3], axis: usize, odds: usize, kept: usize) -> Self {
        let product = |extents: &[usize]| extents.iter().product();
        let (inner, outer) = (product(&extents[..axis]), product(&extents[axis + 1..]));
        Self { outer, inner, evens: extents[axis], odds, kept }
    }
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
    coarse: &[R],
    fine: &mut [R],
    added: AddedNodes,
    correction: &mut C,
) {
    let &Rows { outer, inner, evens, odds, kept } = rows;
    let apart = 1 + usize::from(odds > 0);
    for part in 0..outer {
        let from = &coarse[part * evens * inner..][..evens * inner];
        let to = &mut fine[part * (kept + odds) * inner..][..(kept + odds) * inner];
        for i in 0..kept {
            to[apart * i * inner..][..inner].copy_from_slice(&from[i * inner..][..inner]);
        }
        for i in 0..odds {
            let taps = taps(stencil, i, evens);
            let row = |t: usize| if t < taps.count { &from[(taps.first + t) * inner..][..inner] } else { &[] };
            let predicted = &mut to[(2 * i + 1) * inner..][..inner];
            taps.sum([row(0), row(1), row(2), row(3)], predicted);
            correction.correct(added.pass, added.first + (part * odds + i) * inner, predicted);
        }
    }
}

/// Refines along the fastest axis, and corrects the odd nodes of every line.
#[inline(always)]
pub(super) fn refine_lines<R: Real, C: Correction<R>>(
    stencil: Stencil,
    rows: &Rows,
    coarse: &[R],
    fine: &mut [R],
    added: AddedNodes,
    correction: &mut C,
) {
    let &Rows { outer, evens, odds, kept, .. } = rows;
    let mut odd = vec![R::default(); odds];
    for line in 0..outer {
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

/// Refines along time: predicts the odd slices of `slices` nodes each from the even ones, which are in place.
///
/// Only the slices that `wanted` marks are predicted. A few nodes of all slices at a time stay in the cache.
#[inline(always)]
pub(super) fn refine_slices<R: Real>(stencil: Stencil, slice: usize, wanted: &[bool], nodes: &mut [R]) {
    let evens = wanted.len().div_ceil(2);
    let mut predicted = [R::default(); NODES];
    for first in (0..slice).step_by(NODES) {
        let count = NODES.min(slice - first);
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

/// Copies every n-th node of a line.
#[inline(always)]
pub(super) fn gather<R: Real>(line: &[R], n: usize, out: &mut [R]) {
    if n == 2 && line.len() >= 2 * out.len() {
        for (to, pair) in out.iter_mut().zip(line.as_chunks::<2>().0) {
            *to = pair[0];
        }
    } else {
        for (i, to) in out.iter_mut().enumerate() {
            *to = line[i * n];
        }
    }
}
