//! A Gaussian along one axis of the lattice, tabulated for positions between cells.

/// The weights of the cells around a position.
#[derive(Debug, Clone)]
pub(super) struct AxisKernel {
    /// Cells with a weight.
    pub(super) cells: usize,
    /// The same, padded to whole vectors.
    pub(super) padded: usize,
    /// The weights at positions 0, 1 / [`PHASES`], ... 1 after a cell.
    table: Vec<f32>,
    /// The largest share of the Gaussian's sum over all cells that the weights leave out or get wrong.
    pub(super) cut: f64,
}

/// Positions between two cells in the table. Between these, weights are interpolated.
const PHASES: usize = 256;
/// Weights that are computed together.
pub(super) const VECTOR: usize = 8;
/// The largest number of cells to one side.
const MOST_HALF: f64 = 100.0;

impl AxisKernel {
    /// The kernel with a standard deviation of `sigma` cells, cut at `radius` deviations or beyond; `None` if it has
    /// too many cells.
    pub(super) fn new(sigma: f64, radius: f64) -> Option<Self> {
        let half = (radius * sigma).ceil();
        if !(1.0..=MOST_HALF).contains(&half) {
            return None;
        }
        let cells = 2 * half as usize;
        let gaussian = |distance: f64| libm::exp(-0.5 * (distance / sigma) * (distance / sigma));
        let weight = |phase: usize, n: usize| gaussian(phase as f64 / PHASES as f64 + half - 1.0 - n as f64);
        let padded = cells.next_multiple_of(VECTOR);
        let number = |phase: usize, n: usize| if n < cells { weight(phase, n) as f32 } else { 0.0 };
        let table = (0..=PHASES).flat_map(|phase| (0..padded).map(move |n| number(phase, n))).collect();
        // At a position between two cells, the cells left out begin `half` or more away on either side.
        let beyond = |n: usize| gaussian(half + n as f64) + gaussian(half + 1.0 + n as f64);
        let left_out: f64 = (0..cells + 8).map(beyond).sum();
        let all: f64 = (0..cells).map(|n| weight(PHASES / 2, n)).sum();
        let interpolated = 1.0 / (8.0 * (PHASES as f64 * sigma).powi(2));
        Some(Self { cells, padded, table, cut: left_out / all + interpolated })
    }

    /// The first cell with a weight at a position, and the weights of the cells from there on, padded with zeros.
    #[inline(always)]
    pub(super) fn weights(&self, position: f64, out: &mut [f32]) -> isize {
        let below = position as isize;
        let cell = if position < below as f64 { below - 1 } else { below }; // floor, without a call
        let at = (position - cell as f64) * PHASES as f64;
        let phase = (at as usize).min(PHASES - 1);
        let share = (at - phase as f64) as f32;
        let (low, high) = self.table[phase * self.padded..][..2 * self.padded].split_at(self.padded);
        let vectors = out.as_chunks_mut::<VECTOR>().0.iter_mut();
        for ((to, low), high) in vectors.zip(low.as_chunks::<VECTOR>().0).zip(high.as_chunks::<VECTOR>().0) {
            let mut weights = [0.0; VECTOR]; // its own memory: compiled to vector code
            for l in 0..VECTOR {
                weights[l] = low[l] + share * (high[l] - low[l]);
            }
            *to = weights;
        }
        cell + 1 - (self.cells / 2) as isize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_the_gaussian() {
        for (sigma, radius) in [(1.5, 4.5), (0.7, 3.0), (6.0, 5.0)] {
            let kernel = AxisKernel::new(sigma, radius).expect("a kernel");
            let mut weights = vec![0.0; kernel.padded];
            for position in [0.0, -3.25, 7.999, 0.503, -0.001] {
                let first = kernel.weights(position, &mut weights);
                let exact = |cell: isize| (-0.5 * ((position - cell as f64) / sigma).powi(2)).exp();
                let all: f64 = (-1000..1000).map(exact).sum();
                let (mut held, mut off) = (0.0, 0.0);
                for (cell, weight) in (first..).zip(&weights[..kernel.cells]) {
                    (held, off) = (held + exact(cell), off + (f64::from(*weight) - exact(cell)).abs());
                }
                assert!((all - held + off) / all <= kernel.cut + 1e-6, "{sigma} {position}");
            }
        }
        assert!(AxisKernel::new(30.0, 5.0).is_none() && AxisKernel::new(f64::NAN, 5.0).is_none());
    }
}
