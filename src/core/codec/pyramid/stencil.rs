//! The weights that predict a node from its neighbours along an axis (eq 33).

use crate::codec::real::Real;
use crate::codec::rows;
use wavesplat_format::Stencil;

/// The weights of `count` consecutive even nodes, from number `first` on.
#[derive(Debug, Clone, Copy)]
pub(super) struct Taps {
    pub(super) first: usize,
    weights: [f64; 4],
    pub(super) count: usize,
}

impl Taps {
    /// Computes the weighted sum of rows, one for each tap, from the first tap to the last.
    #[inline(always)]
    pub(super) fn sum<R: Real>(&self, [a, b, c, d]: [&[R]; 4], out: &mut [R]) {
        let [w, x, y, z] = self.weights.map(R::from_f64);
        match self.count {
            4 => rows::sum4([a, b, c, d], [w, x, y, z], out),
            3 => rows::sum3([a, b, c], [w, x, y], out),
            2 => rows::sum2([a, b], [w, x], out),
            _ => out.copy_from_slice(&a[..out.len()]),
        }
    }
}

/// The number of taps of a cubic stencil between the faces.
const INNER: usize = 4;

/// The stencil for odd node `i`, between the even nodes i and i + 1 of `evens` (eq 33). Sums go from the first tap to
/// the last.
///
/// The polynomial through the nearest nodes: cubic through four, quadratic through three next to a face, and a straight
/// line (-1, 3)/2 beyond the last even node.
pub(super) fn taps(stencil: Stencil, i: usize, evens: usize) -> Taps {
    let (last, cubic) = (i + 1 >= evens, stencil == Stencil::Cubic);
    let (first, weights, count) = match () {
        () if last && evens == 1 => (i, [1.0, 0.0, 0.0, 0.0], 1),
        () if last => (i - 1, [-0.5, 1.5, 0.0, 0.0], 2),
        () if cubic && i >= 1 && i + 2 < evens => (i - 1, [-0.0625, 0.5625, 0.5625, -0.0625], INNER),
        () if cubic && evens >= 3 && i == 0 => (i, [0.375, 0.75, -0.125, 0.0], 3),
        () if cubic && evens >= 3 => (i - 1, [-0.125, 0.75, 0.375, 0.0], 3),
        () => (i, [0.5, 0.5, 0.0, 0.0], 2),
    };
    Taps { first, weights, count }
}

/// Predicts consecutive odd nodes of a line from its even ones (eq 33).
#[inline(always)]
pub(super) fn predict_line<R: Real>(stencil: Stencil, evens: &[R], predicted: &mut [R]) {
    let (count, mut i) = (evens.len(), 0);
    while i < predicted.len() {
        let taps = taps(stencil, i, count);
        // All nodes between the faces have the same taps, each shifted by one.
        let run = if taps.count == INNER { (count - 2 - i).min(predicted.len() - i) } else { 1 };
        let from = |t: usize| if t < taps.count { &evens[taps.first + t..] } else { &[] };
        taps.sum([from(0), from(1), from(2), from(3)], &mut predicted[i..i + run]);
        i += run;
    }
}
