//! From the cells of the lattice to pixels, once per frame: four by four cells with the weights of
//! [Catmull](wavesplat_core::bibliography) and Rom.

use super::GROUP;
use super::row::Blend;
use super::view::SlicedView;
use crate::render::batches::Units;
use rayon::prelude::*;

/// Cells without anything around the lattice.
const RIM: usize = 2;

/// The cells of a lattice, row by row, with a rim.
struct Cells<C> {
    width: usize,
    all: Vec<C>,
}

/// Bytes of the cells of a view.
pub(super) fn bytes<B: Blend>(view: &SlicedView) -> usize {
    let [width, height] = view.extent.map(|n| n * view.cells + 2 * RIM);
    width * height * size_of::<B::Cell>()
}

/// Computes a picture from the groups of all cells.
pub(super) fn finish<B: Blend>(view: &SlicedView, units: &Units, groups: &[B::Group], picture: &mut [f32]) {
    let cells = cells::<B>(view, groups);
    let width = view.camera.size[0] * B::NUMBERS;
    picture.par_chunks_exact_mut(width).enumerate().for_each(|(y, row)| {
        let [from, to] = [0.5, 1.5].map(|x| view.cell_of([x, y as f64 + 0.5]));
        let step = [to[0] - from[0], to[1] - from[1]];
        for (x, pixel) in row.chunks_exact_mut(B::NUMBERS).enumerate() {
            let at = [0, 1].map(|i| from[i] + x as f64 * step[i] + RIM as f64);
            match cells.around(at) {
                Some((cells, weights)) => B::pixel(units, cells, weights, pixel),
                None => B::background(pixel),
            }
        }
    });
}

/// Puts the phases of all rows side by side.
fn cells<B: Blend>(view: &SlicedView, groups: &[B::Group]) -> Cells<B::Cell> {
    let [width, height] = view.extent.map(|n| n * view.cells + 2 * RIM);
    let mut all = vec![B::NOTHING; width * height];
    let of_row = view.cells * view.extent[0] / GROUP;
    let rows = all.par_chunks_exact_mut(width.max(1)).skip(RIM);
    rows.zip(groups.par_chunks_exact(of_row.max(1))).for_each(|(row, groups)| {
        for (phase, groups) in groups.chunks_exact(of_row / view.cells).enumerate() {
            let of_groups = row[RIM + phase..].chunks_mut(GROUP * view.cells);
            for (cells, group) in of_groups.zip(groups) {
                cells.iter_mut().step_by(view.cells).zip(B::cells(group)).for_each(|(to, from)| *to = from);
            }
        }
    });
    Cells { width, all }
}

/// Four by four cells, and the weights of their columns and rows.
type Around<'a, C> = ([&'a [C; 4]; 4], [[f32; 4]; 2]);

impl<C> Cells<C> {
    /// The cells around a point, and their weights; `None` beyond the rim.
    fn around(&self, at: [f64; 2]) -> Option<Around<'_, C>> {
        let [column, row] = at.map(|at| (at.max(1.0) as usize) - 1);
        let inside = at.iter().all(|at| *at >= 1.0) && column.saturating_add(4) <= self.width;
        let rows = row.saturating_add(4).saturating_mul(self.width) <= self.all.len();
        let of_row =
            |n: usize| self.all[(row + n) * self.width + column..].first_chunk().unwrap_or_else(|| self.none());
        let weights = |i: usize, first: usize| weights((at[i] - (first + 1) as f64) as f32);
        (inside && rows).then(|| (std::array::from_fn(of_row), [weights(0, column), weights(1, row)]))
    }

    /// The first four cells, which are empty.
    fn none(&self) -> &[C; 4] {
        self.all.first_chunk().unwrap_or_else(|| unreachable!("a lattice has a rim"))
    }
}

/// The weights of four numbers in a row for a point between the second and the third.
fn weights(x: f32) -> [f32; 4] {
    let (square, cube) = (x * x, x * x * x);
    [
        -0.5 * x + square - 0.5 * cube,
        1.0 - 2.5 * square + 1.5 * cube,
        0.5 * x + 2.0 * square - 1.5 * cube,
        -0.5 * square + 0.5 * cube,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_reproduce_parabolas() {
        for x in [0.0_f32, 0.2, 0.5, 0.9] {
            let terms = |of: fn(f32) -> f32| weights(x).into_iter().zip([-1.0, 0.0, 1.0, 2.0].map(of));
            let found = |of: fn(f32) -> f32| terms(of).map(|(weight, value)| weight * value).sum::<f32>();
            let off = |of: fn(f32) -> f32| -> f32 { f32::abs(found(of) - of(x)) };
            assert!(off(|_| 1.0) < 1e-6 && off(|x| x) < 1e-6 && off(|x| x * x) < 1e-6);
        }
    }
}
