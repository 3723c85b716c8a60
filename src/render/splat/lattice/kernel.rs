//! From cells to pixels: the Gaussian footprint of the view, in cells.
//!
//! Filtered cells ([`super::prefilter`]) hold each voxel as a narrow bump with the mass 1. So a pixel is the sum of the
//! cells around it times the Gaussian itself:
//!
//! ```text
//! w(p) = sum over cells c of G(p - c) T(c)        G(d) = exp(-(uu du^2 + 2 uv du dv + vv dv^2) / 2)        (eq 37)
//! ```
//!
//! with T the filtered splines of a voxel, and uu, uv, vv the inverse of the footprint's covariance in cells. In a row
//! of cells G is a Gaussian along u, whose middle moves by uv / uu from row to row, times one across the rows:
//!
//! ```text
//! uu du^2 + 2 uv du dv + vv dv^2 = uu (du + dv uv / uu)^2 + (vv - uv^2 / uu) dv^2
//! ```

use super::axis::{AxisKernel, VECTOR};
use super::shear::Shear;

/// The kernel of a view.
#[derive(Debug, Clone)]
pub(super) struct Kernel {
    /// The inverse of its covariance in cells: uu, uv, vv.
    inverse: [f64; 3],
    /// Along a row of cells.
    along: AxisKernel,
    /// Across the rows.
    across: AxisKernel,
}

impl Kernel {
    /// The kernel for a Gaussian with a standard deviation of `sigma` pixels, cut at `radius` deviations or beyond.
    /// `None` if it is too large, or too narrow for numbers.
    pub(super) fn new(shear: &Shear, sigma: f64, radius: f64) -> Option<Self> {
        let q = shear.fineness as f64;
        let [b, c] = shear.pixels.map(|step| step.map(|pixels| pixels / (q * sigma)));
        let inverse = [b[0] * b[0] + b[1] * b[1], b[0] * c[0] + b[1] * c[1], c[0] * c[0] + c[1] * c[1]];
        let [conditional, marginal] = [conditional_sigmas(inverse)[0], sigmas(inverse)[1]];
        let [along, across] = [AxisKernel::new(conditional, radius)?, AxisKernel::new(marginal, radius)?];
        Some(Self { inverse, along, across })
    }

    /// The standard deviations along u and along v, in cells.
    pub(super) fn sigmas(&self) -> [f64; 2] {
        sigmas(self.inverse)
    }

    /// The standard deviations along u at a fixed v, and along v at a fixed u, in cells.
    pub(super) fn conditional_sigmas(&self) -> [f64; 2] {
        conditional_sigmas(self.inverse)
    }

    /// The largest share of the kernel's sum over all cells that its weights leave out or get wrong.
    pub(super) fn cut(&self) -> f64 {
        self.along.cut + self.across.cut
    }

    /// Number of cells with a weight.
    pub(super) fn cells(&self) -> usize {
        self.along.cells * self.across.cells
    }

    /// Cells by which the middle of a row moves along u, for each row towards the pixel.
    fn slant(&self) -> f64 {
        self.inverse[1] / self.inverse[0]
    }

    /// An upper bound of the distance from a pixel to any cell with a weight, along u and v.
    pub(super) fn half(&self) -> [f64; 2] {
        let [along, across] = [&self.along, &self.across].map(|axis| (axis.cells / 2) as f64);
        [along + self.slant().abs() * across, across]
    }

    /// The largest distance in pixels, along x or y, from a pixel to any cell with a weight.
    pub(super) fn reach(&self, shear: &Shear) -> f64 {
        let [along, across] = [&self.along, &self.across].map(|axis| (axis.cells / 2) as f64);
        let [b, c] = shear.pixels.map(|step| step.map(|pixels| pixels / shear.fineness as f64));
        let corner = |along: f64| {
            let u = along - self.slant() * across;
            (u * b[0] + across * c[0]).abs().max((u * b[1] + across * c[1]).abs())
        };
        corner(along).max(corner(-along))
    }

    /// G at an offset (eq 37).
    #[cfg(test)]
    pub(super) fn gaussian(&self, [u, v]: [f64; 2]) -> f64 {
        let [uu, uv, vv] = self.inverse;
        (-0.5 * ((uu * u + 2.0 * uv * v) * u + vv * v * v)).exp()
    }

    /// Computes the weights of a pixel at `position` (eq 37).
    pub(super) fn weights(&self, position: [f64; 2], out: &mut Weights) {
        fill(self, position, out);
    }
}

fn sigmas([uu, uv, vv]: [f64; 3]) -> [f64; 2] {
    let det = uu * vv - uv * uv;
    [vv / det, uu / det].map(f64::sqrt)
}

fn conditional_sigmas([uu, _, vv]: [f64; 3]) -> [f64; 2] {
    [uu, vv].map(|i| 1.0 / i.sqrt())
}

/// The weights of the cells of a pixel, row by row.
#[derive(Debug)]
pub(super) struct Weights {
    /// The first row of cells.
    top: isize,
    /// The first cell of each row.
    first: Vec<isize>,
    /// The weights of all rows, padded, and the number of cells in a row.
    rows: Vec<f32>,
    cells: usize,
    across: Vec<f32>,
}

impl Weights {
    /// Allocates the weights for a kernel.
    pub(super) fn of(kernel: &Kernel) -> Self {
        let (width, height) = (kernel.along.padded, kernel.across.cells);
        let across = vec![0.0; kernel.across.padded];
        Self { top: 0, first: vec![0; height], rows: vec![0.0; width * height], cells: kernel.along.cells, across }
    }

    /// For each row: v, u of its first cell, and the weights from there on.
    #[inline(always)]
    pub(super) fn rows(&self) -> impl Iterator<Item = (isize, isize, &[f32])> {
        let rows = self.rows.chunks_exact(self.rows.len() / self.first.len());
        (self.top..).zip(&self.first).zip(rows).map(|((v, u), weights)| (v, *u, &weights[..self.cells]))
    }
}

#[cfg_attr(not(feature = "portable"), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn fill(kernel: &Kernel, [u, v]: [f64; 2], out: &mut Weights) {
    out.top = kernel.across.weights(v, &mut out.across);
    let slant = kernel.slant();
    let rows = out.rows.chunks_exact_mut(kernel.along.padded).zip(&mut out.first).zip(&out.across);
    for (n, ((row, first), across)) in rows.enumerate() {
        *first = kernel.along.weights(u + slant * (v - (out.top + n as isize) as f64), row);
        for vector in row.as_chunks_mut::<VECTOR>().0 {
            let mut weights = *vector;
            for weight in &mut weights {
                *weight *= across;
            }
            *vector = weights;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::grid::Grid;
    use crate::view::camera::{Camera, View};

    #[test]
    fn weights_are_the_gaussian_at_every_cell() {
        let grid = Grid::unit([9, 9, 9]);
        for (azimuth, elevation, sigma) in [(0.0, 0.0, 3.0), (31.0, 40.0, 9.0), (45.0, 0.0, 3.0), (20.0, 70.0, 4.0)] {
            let view = View { azimuth, elevation, roll: 7.0, size: [50, 50], scale: Some(4.0), center: None };
            let camera = Camera::new(&view, &grid).expect("a valid view");
            let shear = Shear::new(&camera, &grid, 2);
            let kernel = Kernel::new(&shear, sigma, 4.5).expect("a wide kernel");
            let mut weights = Weights::of(&kernel);
            let (half, reach) = (kernel.half(), kernel.reach(&shear));
            for position in [[0.0, 0.0], [-3.5, 12.5], [100.1, -7.77], [0.49, 0.51]] {
                kernel.weights(position, &mut weights);
                let mut held = 0.0;
                for (v, u, row) in weights.rows() {
                    for (u, weight) in (u..).zip(row) {
                        let cell = [u as f64, v as f64];
                        let [pixel, at] = [position, cell].map(|p| shear.pixel(p));
                        let off = [pixel[0] - at[0], pixel[1] - at[1]];
                        let expected = (-(off[0].powi(2) + off[1].powi(2)) / (2.0 * sigma * sigma)).exp();
                        assert!((f64::from(*weight) - expected).abs() < 4e-6, "{position:?}: {weight} for {expected}");
                        assert!(
                            (0..2).all(|i| (cell[i] - position[i]).abs() <= half[i] + 1e-9)
                                && off[0].abs() <= reach + 1e-9
                        );
                        held += expected;
                    }
                }
                let every = (-60..=60).flat_map(|i| (-60..=60).map(move |j| [i, j]));
                let near = position.map(f64::round);
                let offset = |i: usize, n: i32| position[i] - near[i] - f64::from(n);
                let all: f64 = every.map(|[i, j]| kernel.gaussian([offset(0, i), offset(1, j)])).sum();
                assert!((all - held) / all <= kernel.cut(), "{azimuth}: {held} of {all}");
            }
        }
    }
}
