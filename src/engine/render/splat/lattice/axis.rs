//! Functions along one axis of the lattice, tabulated for positions between cells.

/// The values of a function at the cells around a position, for positions between two cells.
#[derive(Debug, Clone)]
pub(super) struct Phases {
    /// Values, padded with zeros to whole vectors.
    pub(super) padded: usize,
    /// Positions between two cells in the table. Between these, values are interpolated.
    pub(super) phases: usize,
    /// The values at positions 0, 1 / `phases`, ... 1 after a cell.
    table: Vec<f32>,
}

/// How far a kernel reaches, and how finely it is tabulated.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cut {
    /// It is cut at this number of standard deviations or beyond.
    pub(super) radius: f64,
    /// Positions between two cells in its tables.
    pub(super) phases: usize,
}

/// Values that are computed together.
pub(super) const VECTOR: usize = 8;

impl Phases {
    /// Tabulates `value(t, n)` at the cells n = 1 - `half`, ... `half`, for `phases` positions t after cell 0.
    pub(super) fn new(half: usize, phases: usize, value: impl Fn(f64, isize) -> f64) -> Self {
        let (cells, value) = (2 * half, &value);
        let padded = cells.next_multiple_of(VECTOR);
        let at = |t: f64, n: usize| if n < cells { value(t, n as isize + 1 - half as isize) as f32 } else { 0.0 };
        let phase = |phase: usize| (0..padded).map(move |n| at(phase as f64 / phases as f64, n));
        Self { padded, phases, table: (0..=phases).flat_map(phase).collect() }
    }

    /// The values at a position from 0 to 1 after a cell.
    #[inline(always)]
    pub(super) fn fill(&self, position: f64, out: &mut [f32]) {
        let at = position * self.phases as f64;
        let phase = (at as usize).min(self.phases - 1);
        let share = (at - phase as f64) as f32;
        let (low, high) = self.table[phase * self.padded..][..2 * self.padded].split_at(self.padded);
        let vectors = out.as_chunks_mut::<VECTOR>().0.iter_mut();
        for ((to, low), high) in vectors.zip(low.as_chunks::<VECTOR>().0).zip(high.as_chunks::<VECTOR>().0) {
            let mut values = [0.0; VECTOR]; // its own memory: compiled to vector code
            for l in 0..VECTOR {
                values[l] = low[l] + share * (high[l] - low[l]);
            }
            *to = values;
        }
    }
}

/// The cell before a position, and how far the position is towards the next one. Without a call, as `floor` is one.
#[inline(always)]
pub(super) fn split(position: f64) -> (isize, f64) {
    let below = position as isize;
    let cell = if position < below as f64 { below - 1 } else { below };
    (cell, position - cell as f64)
}

/// The number of cells to one side that a Gaussian with a standard deviation of `sigma` cells reaches, if it is cut at
/// `radius` deviations or beyond; `None` if there are too many.
pub(super) fn half(sigma: f64, radius: f64) -> Option<usize> {
    let half = (radius * sigma).ceil();
    (1.0..=MOST_HALF).contains(&half).then_some(half as usize)
}

/// The largest number of cells to one side.
const MOST_HALF: f64 = 100.0;

/// A Gaussian along one axis: the weights of the cells around a position.
#[derive(Debug, Clone)]
pub(super) struct AxisKernel {
    /// Cells with a weight.
    pub(super) cells: usize,
    phases: Phases,
    /// The largest share of the Gaussian's sum over all cells that the weights leave out or get wrong.
    pub(super) cut: f64,
}

/// The largest share of the sum of a Gaussian that interpolation between phases gets wrong, for `sigma` cells.
pub(super) fn interpolated(sigma: f64, phases: usize) -> f64 {
    1.0 / (8.0 * (phases as f64 * sigma).powi(2))
}

impl AxisKernel {
    /// The kernel with a standard deviation of `sigma` cells; `None` if it has too many cells.
    pub(super) fn new(sigma: f64, Cut { radius, phases }: Cut) -> Option<Self> {
        let half = half(sigma, radius)?;
        let gaussian = |distance: f64| libm::exp(-0.5 * (distance / sigma) * (distance / sigma));
        // At a position between two cells, the cells left out begin `half` or more away on either side.
        let beyond = |n: usize| gaussian((half + n) as f64) + gaussian((half + 1 + n) as f64);
        let left_out: f64 = (0..2 * half + 8).map(beyond).sum();
        let all: f64 = (0..2 * half).map(|n| gaussian(half as f64 - 0.5 - n as f64)).sum();
        let cut = left_out / all + interpolated(sigma, phases);
        let phases = Phases::new(half, phases, |t, n| gaussian(t - n as f64));
        Some(Self { cells: 2 * half, phases, cut })
    }

    /// The cells with a weight, padded to whole vectors.
    pub(super) fn padded(&self) -> usize {
        self.phases.padded
    }

    /// The first cell with a weight at a position, and the weights of the cells from there on, padded with zeros.
    #[inline(always)]
    pub(super) fn weights(&self, position: f64, out: &mut [f32]) -> isize {
        let (cell, rest) = split(position);
        self.phases.fill(rest, out);
        cell + 1 - (self.cells / 2) as isize
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_the_gaussian() {
        for (sigma, radius, phases) in [(1.5, 4.5, 256), (0.7, 3.0, 256), (6.0, 5.0, 1024)] {
            let kernel = AxisKernel::new(sigma, Cut { radius, phases }).expect("a kernel");
            let mut weights = vec![0.0; kernel.padded()];
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
        let cut = Cut { radius: 5.0, phases: 256 };
        assert!(AxisKernel::new(30.0, cut).is_none() && AxisKernel::new(f64::NAN, cut).is_none());
    }
}
