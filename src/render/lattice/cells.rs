//! Planes of sums over cells: amounts are spread into them, and passes of a pyramid widen them.

use super::spline::Spread;
use multiversion::multiversion;
use std::ops::Range;

/// A rectangle of cells with some planes, one after another, each row by row.
#[derive(Debug)]
pub(in crate::render) struct Cells {
    /// The first cell along u and v.
    pub(super) first: [isize; 2],
    /// Cells along u and v.
    pub(super) size: [usize; 2],
    pub(super) sums: Vec<f64>,
}

impl Cells {
    /// With all planes at zero.
    pub(super) fn new(first: [isize; 2], size: [usize; 2], planes: usize) -> Self {
        Self { first, size, sums: vec![0.0; size[0] * size[1] * planes] }
    }

    /// Cells of a plane.
    pub(super) fn area(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// A plane.
    pub(super) fn plane(&self, plane: usize) -> &[f64] {
        &self.sums[plane * self.area()..][..self.area()]
    }

    fn plane_mut(&mut self, plane: usize) -> &mut [f64] {
        let area = self.area();
        &mut self.sums[plane * area..][..area]
    }

    /// Adds one amount, spread along both axes.
    pub(super) fn add(&mut self, plane: usize, amount: f64, places: [(isize, Spread); 2], degree: usize) {
        let [(u, along), (v, across)] = places;
        let (u, v, width) = ((u - self.first[0]) as usize, (v - self.first[1]) as usize, self.size[0]);
        let plane = self.plane_mut(plane);
        for (line, weight) in (v..).zip(&across[..=degree]) {
            let cells = &mut plane[line * width + u..][..=degree];
            cells.iter_mut().zip(&along).for_each(|(sum, w)| *sum += amount * weight * w);
        }
    }

    /// Adds a row of amounts along u, every `distance`-th cell one, spread along both axes.
    pub(super) fn add_row(&mut self, plane: usize, row: &Row<'_>, work: &mut Vec<f64>) {
        let length = (row.amounts.len() - 1) * row.distance + row.degree + 1;
        work.clear();
        work.resize(length, 0.0);
        for (o, weight) in row.along[..=row.degree].iter().enumerate() {
            add_spaced(&mut work[o..], row.distance, *weight, row.amounts);
        }
        let [u, v] = [0, 1].map(|i| (row.cell[i] - self.first[i]) as usize);
        let width = self.size[0];
        let plane = self.plane_mut(plane);
        for (line, weight) in (v..).zip(&row.across[..=row.degree]) {
            add_scaled(&mut plane[line * width + u..][..length], *weight, work);
        }
    }

    /// Adds the plane to itself, moved by whole cells: `sum += factor * (sum at the place less the offset)` for every
    /// (offset, factor), all of the plane as it was. What leaves the rectangle is lost.
    pub(super) fn widen(&mut self, plane: usize, moves: &[([isize; 2], f64)], work: &mut Vec<f64>) {
        let size = self.size;
        let sums = self.plane_mut(plane);
        work.clear();
        work.extend_from_slice(sums);
        for ([du, dv], factor) in moves {
            let (to_u, to_v) = (reached(size[0], *du), reached(size[1], *dv));
            if to_u.is_empty() {
                continue;
            }
            for v in to_v {
                let from = (v as isize - dv) as usize * size[0];
                let from = &work[from + (to_u.start as isize - du) as usize..][..to_u.len()];
                add_scaled(&mut sums[v * size[0] + to_u.start..][..to_u.len()], *factor, from);
            }
        }
    }

    /// Adds other planes, each times a weight, to a plane.
    pub(super) fn add_planes(&mut self, plane: usize, others: &[(usize, f64)]) {
        let area = self.area();
        for (other, weight) in others {
            let (low, high) = self.sums.split_at_mut(plane.max(*other) * area);
            let (here, there) = (plane.min(*other) * area, &mut high[..area]);
            let here = &mut low[here..][..area];
            if plane > *other { add_scaled(there, *weight, here) } else { add_scaled(here, *weight, there) }
        }
    }
}

/// Places that something moved by `by` still reaches.
fn reached(size: usize, by: isize) -> Range<usize> {
    let end = size.saturating_add_signed(by.min(0));
    (by.max(0) as usize).min(end)..end
}

/// Amounts at every `distance`-th cell along u.
#[derive(Debug)]
pub(super) struct Row<'a> {
    /// The first cell that is reached.
    pub(super) cell: [isize; 2],
    pub(super) distance: usize,
    pub(super) amounts: &'a [f64],
    pub(super) degree: usize,
    /// Weights along u.
    pub(super) along: &'a Spread,
    /// Weights along v.
    pub(super) across: &'a Spread,
}

#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
fn add_scaled(sums: &mut [f64], factor: f64, amounts: &[f64]) {
    for (sum, amount) in sums.iter_mut().zip(amounts) {
        *sum += factor * amount;
    }
}

fn add_spaced(sums: &mut [f64], distance: usize, factor: f64, amounts: &[f64]) {
    if distance == 1 {
        add_scaled(sums, factor, amounts);
    } else {
        sums.iter_mut().step_by(distance).zip(amounts).for_each(|(sum, amount)| *sum += factor * amount);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_added_to_itself_moved() {
        let mut cells = Cells::new([0, 0], [3, 2], 1);
        cells.sums = vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        cells.widen(0, &[([1, 0], 10.0), ([-2, 1], 100.0), ([5, 0], 7.0), ([0, -9], 7.0)], &mut Vec::new());
        assert_eq!(cells.sums, [1.0, 12.0, 23.0, 304.0, 45.0, 56.0]);
    }

    #[test]
    fn planes_are_added_from_either_side() {
        let mut cells = Cells::new([0, 0], [1, 1], 3);
        cells.sums = vec![1.0, 10.0, 100.0];
        cells.add_planes(1, &[(0, 2.0), (2, 3.0)]);
        assert_eq!(cells.sums, [1.0, 312.0, 100.0]);
    }
}
