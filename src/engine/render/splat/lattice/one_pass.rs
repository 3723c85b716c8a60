//! Gathers pixels in one pass: each sums all cells around it (eq 37).

use super::bundle::{Bundle, weighted};
use super::cells::TOGETHER;
use super::kernel::{Kernel, Weights};
use super::picture::Lattice;
use wavesplat_core::base::vectors::dispatch;
use wavesplat_core::codec::real::Real;
use wavesplat_core::wavelet::LANES;

/// The weights of neighbouring pixels.
#[derive(Debug)]
pub(super) struct OnePass {
    weights: Vec<Weights>,
}

impl OnePass {
    pub(super) fn new(kernel: &Kernel) -> Self {
        Self { weights: (0..LANES).map(|_| Weights::new(kernel)).collect() }
    }

    /// Computes the weights of `count` pixels of a row.
    pub(super) fn weigh(&mut self, lattice: &Lattice, [x, y]: [usize; 2], count: usize) {
        for (l, weights) in self.weights[..count].iter_mut().enumerate() {
            lattice.kernel.weights(lattice.position([(x + l) as f64 + 0.5, y as f64 + 0.5]), weights);
        }
    }

    /// The sums of a bundle at the pixels.
    pub(super) fn sum<R: Real>(&self, bundle: &Bundle<'_, R>, sums: &mut [[R; TOGETHER]]) {
        match bundle.places {
            1 => dispatch!(add_pixels::<R, 1>(&self.weights[..], bundle, sums)),
            2 => dispatch!(add_pixels::<R, 2>(&self.weights[..], bundle, sums)),
            4 => dispatch!(add_pixels::<R, 4>(&self.weights[..], bundle, sums)),
            8 => dispatch!(add_pixels::<R, 8>(&self.weights[..], bundle, sums)),
            _ => dispatch!(add_pixels::<R, TOGETHER>(&self.weights[..], bundle, sums)),
        }
    }
}

/// The sums of `N` planes side by side, row by row, so that rounding grows with rows and not with cells.
#[inline(always)]
fn add_pixels<R: Real, const N: usize>(weights: &[Weights], bundle: &Bundle<'_, R>, sums: &mut [[R; TOGETHER]]) {
    let ([width, height], first) = (bundle.window.size.map(|n| n as isize), bundle.window.first);
    let cells = bundle.cells.as_chunks::<N>().0;
    for (weights, sums) in weights.iter().zip(sums) {
        let mut all = [R::default(); N];
        for (v, u, row) in weights.rows() {
            let (u, v) = (u - first[0], v - first[1]);
            let start = (-u).clamp(0, row.len() as isize);
            let end = (width - u).clamp(start, row.len() as isize);
            if !(0..height).contains(&v) || start == end {
                continue;
            }
            let from = v as usize * bundle.stride + (u + start) as usize;
            let of_row: [R; N] = weighted(&cells[from..], 1, &row[start as usize..end as usize]);
            for i in 0..N {
                all[i] = all[i] + of_row[i];
            }
        }
        sums[..N].copy_from_slice(&all);
    }
}
