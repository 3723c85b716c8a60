//! From cells to pixels: the Gaussian footprint of the view, in cells.
//!
//! Filtered cells ([`super::prefilter`]) hold each voxel as a narrow bump with the mass 1. So a pixel is the sum of the
//! cells around it times the Gaussian itself:
//!
//! ```text
//! w(p) = sum over cells c of G(p - c) T(c)        G(d) = exp(-(uu du^2 + 2 uv du dv + vv dv^2) / 2)        (eq 37)
//! ```
//!
//! with T the filtered weights of a voxel, and uu, uv, vv the inverse of the footprint's covariance in cells. For a pixel
//! at (s, t) after a cell, the weight of the cell (m, n) beside it is a product of one factor for each column, one for
//! each row, one for the pixel, and one that is the same for all pixels:
//!
//! ```text
//! G(s - m, t - n) = exp(-uu (s - m)^2 / 2 + uv m t) exp(-vv (t - n)^2 / 2 + uv n s) exp(-uv s t) exp(-uv m n)
//! ```

use super::axis::{Cut, Phases, VECTOR, half, interpolated, split};
use super::shear::Shear;
use std::ops::Range;
use wavesplat_core::base::vectors::dispatch;

/// The kernel of a view.
#[derive(Debug, Clone)]
pub(super) struct Kernel {
    /// The inverse of its covariance in cells: uu, uv, vv.
    inverse: [f64; 3],
    /// The kernel is cut at this number of standard deviations or beyond.
    radius: f64,
    /// Cells to each side with a weight, along u and v.
    half: [usize; 2],
    /// The factors of columns and of rows: a Gaussian, and exp(uv m t).
    columns: [Phases; 2],
    rows: [Phases; 2],
    /// exp(-uv m n) for each row n.
    cross: Vec<f32>,
    /// The cells of each row with a weight.
    spans: Vec<Range<usize>>,
}

impl Kernel {
    /// The kernel for a Gaussian with a standard deviation of `sigma` pixels. `None` if it is too large, or too narrow for
    /// numbers.
    pub(super) fn new(shear: &Shear, sigma: f64, Cut { radius, phases }: Cut) -> Option<Self> {
        let q = shear.fineness as f64;
        let [b, c] = shear.pixels.map(|step| step.map(|pixels| pixels / (q * sigma)));
        let inverse = [b[0] * b[0] + b[1] * b[1], b[0] * c[0] + b[1] * c[1], c[0] * c[0] + c[1] * c[1]];
        let [uu, uv, vv] = inverse;
        let [u, v] = sigmas(inverse);
        let half = [half(u, radius)?, half(v, radius)?];
        if uv.abs() * (half[0] * half[1]) as f64 > MOST_EXPONENT {
            return None;
        }
        let gaussian = |i: f64| move |t: f64, n: isize| libm::exp(-0.5 * i * (t - n as f64) * (t - n as f64));
        let tilt = |t: f64, n: isize| libm::exp(uv * n as f64 * t);
        let columns = [Phases::new(half[0], phases, gaussian(uu)), Phases::new(half[0], phases, tilt)];
        let rows = [Phases::new(half[1], phases, gaussian(vv)), Phases::new(half[1], phases, tilt)];
        let number = |i: usize, n: usize| n as f64 + 1.0 - half[i] as f64;
        let cross = |n: usize| (0..columns[0].padded).map(move |m| libm::exp(-uv * number(0, m) * number(1, n)) as f32);
        let cross = (0..2 * half[1]).flat_map(cross).collect();
        let spans = (0..2 * half[1]).map(|n| span(inverse, radius, half[0], number(1, n))).collect();
        Some(Self { inverse, radius, half, columns, rows, cross, spans })
    }

    /// The standard deviations along u and along v, in cells.
    pub(super) fn sigmas(&self) -> [f64; 2] {
        sigmas(self.inverse)
    }

    /// The standard deviations along u at a fixed v, and along v at a fixed u, in cells.
    pub(super) fn conditional_sigmas(&self) -> [f64; 2] {
        conditional_sigmas(self.inverse)
    }

    /// The largest share of the kernel's sum over all cells that its weights leave out or get wrong: the mass beyond the
    /// cut at a few positions of the pixel, with a margin, and the interpolation between phases.
    pub(super) fn cut(&self) -> f64 {
        let places = || (0..PLACES).map(|n| n as f64 / (PLACES - 1) as f64);
        let left_out = |u: f64| places().map(move |v| self.left_out([u, v])).fold(0.0, f64::max);
        let phases = self.columns[0].phases;
        let ([u, v], uv) = (self.sigmas(), self.inverse[1].abs() / phases as f64);
        // exp(uv m t) is off by (uv m / phases)^2 / 8; m is off the pixel by the deviation along its axis.
        let tilts: f64 = [u, v].map(|sigma| uv * uv * (sigma * sigma + 1.0) / 8.0).iter().sum();
        let gaussians: f64 = self.conditional_sigmas().map(|sigma| interpolated(sigma, phases)).iter().sum();
        MARGIN * places().map(left_out).fold(0.0, f64::max) + gaussians + tilts
    }

    /// The share of the kernel's sum over all cells that its spans leave out, at a position after a cell.
    fn left_out(&self, position: [f64; 2]) -> f64 {
        let (mut all, mut held) = (0.0, 0.0);
        let [across, down] = self.half.map(|half| half as isize + 4);
        for n in 1 - down..=down {
            let row = usize::try_from(n - 1 + self.half[1] as isize).ok().and_then(|n| self.spans.get(n));
            for m in 1 - across..=across {
                let weight = gaussian(self.inverse, [position[0] - m as f64, position[1] - n as f64]);
                let cell = usize::try_from(m - 1 + self.half[0] as isize).ok();
                let is_held = row.zip(cell).is_some_and(|(span, m)| span.contains(&m));
                (all, held) = (all + weight, if is_held { held + weight } else { held });
            }
        }
        1.0 - held / all
    }

    /// Number of cells with a weight.
    pub(super) fn cells(&self) -> usize {
        self.spans.iter().map(ExactSizeIterator::len).sum()
    }

    /// An upper bound of the distance from a pixel to any cell with a weight, along u and v.
    pub(super) fn half(&self) -> [f64; 2] {
        self.half.map(|half| half as f64)
    }

    /// An upper bound of the distance in pixels, along x or y, from a pixel to any cell with a weight: within the cut for
    /// some position of the pixel between two cells.
    pub(super) fn reach(&self, shear: &Shear, sigma: f64) -> f64 {
        let cell = |i: usize| shear.pixels.iter().map(|step| (step[i] / shear.fineness as f64).abs()).sum::<f64>();
        self.radius * sigma + cell(0).max(cell(1))
    }

    /// G at an offset (eq 37).
    #[cfg(test)]
    pub(super) fn gaussian(&self, offset: [f64; 2]) -> f64 {
        gaussian(self.inverse, offset)
    }

    /// Computes the weights of a pixel at `position` (eq 37).
    pub(super) fn weights(&self, position: [f64; 2], out: &mut Weights) {
        dispatch!(fill(self, position, out));
    }
}

/// exp of this, squared, is far from the limits of f32.
const MOST_EXPONENT: f64 = 40.0;
/// Positions of a pixel between two cells, along each axis, at which the cut is measured, and the margin for others.
const PLACES: usize = 5;
const MARGIN: f64 = 1.1;

/// G at an offset (eq 37).
fn gaussian([uu, uv, vv]: [f64; 3], [u, v]: [f64; 2]) -> f64 {
    libm::exp(-0.5 * ((uu * u + 2.0 * uv * v) * u + vv * v * v))
}

/// The cells of row `n` that are within the cut for some position of the pixel after a cell.
fn span([uu, uv, vv]: [f64; 3], radius: f64, half: usize, n: f64) -> Range<usize> {
    // The middle of the row, and half its width, for rows at a distance of n - t.
    let (slant, rest) = (uv / uu, vv - uv * uv / uu);
    let mut ends = [f64::INFINITY, f64::NEG_INFINITY];
    for step in 0..=STEPS {
        let v = step as f64 / STEPS as f64 - n;
        let squared = (radius * radius - rest * v * v) / uu;
        if squared >= 0.0 {
            let (middle, width) = (slant * v, squared.sqrt());
            ends = [ends[0].min(middle - width), ends[1].max(middle + width + 1.0)];
        }
    }
    let cell = |end: f64| (end + half as f64 - 1.0).clamp(0.0, 2.0 * half as f64) as usize;
    if ends[0] > ends[1] { 0..0 } else { cell(ends[0].ceil())..cell(ends[1].floor() + 1.0) }
}

/// Positions between two rows that give the cells of a row.
const STEPS: usize = 8;

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
    /// The first column and row of cells.
    first: [isize; 2],
    /// The cells of each row with a weight.
    spans: Vec<Range<usize>>,
    /// The weights of all rows, padded.
    rows: Vec<f32>,
    /// The factors of columns and of rows, and room for others.
    columns: [Vec<f32>; 2],
    across: [Vec<f32>; 2],
}

impl Weights {
    /// Allocates the weights for a kernel.
    pub(super) fn new(kernel: &Kernel) -> Self {
        let (width, height) = (kernel.columns[0].padded, kernel.rows[0].padded);
        let (columns, across) = ([0, 1].map(|_| vec![0.0; width]), [0, 1].map(|_| vec![0.0; height]));
        let (rows, spans) = (vec![0.0; width * kernel.spans.len()], kernel.spans.clone());
        Self { first: [0; 2], spans, rows, columns, across }
    }

    /// For each row: v, u of its first cell, and the weights from there on.
    #[inline(always)]
    pub(super) fn rows(&self) -> impl Iterator<Item = (isize, isize, &[f32])> {
        let rows = self.rows.chunks_exact(self.columns[0].len()).zip(&self.spans);
        let [u, v] = self.first;
        (v..).zip(rows).map(move |(v, (row, span))| (v, u + span.start as isize, &row[span.clone()]))
    }
}

#[inline(always)]
fn fill(kernel: &Kernel, [u, v]: [f64; 2], out: &mut Weights) {
    let ((u, s), (v, t)) = (split(u), split(v));
    out.first = [u + 1 - kernel.half[0] as isize, v + 1 - kernel.half[1] as isize];
    product(&kernel.columns, [s, t], &mut out.columns);
    product(&kernel.rows, [t, s], &mut out.across);
    let scale = exp(-kernel.inverse[1] * s * t);
    let ([columns, _], [across, _]) = (&out.columns, &out.across);
    let rows = out.rows.chunks_exact_mut(columns.len()).zip(kernel.cross.chunks_exact(columns.len()));
    for ((row, cross), across) in rows.zip(across) {
        let factor = across * scale;
        let vectors = row.as_chunks_mut::<VECTOR>().0.iter_mut().zip(cross.as_chunks::<VECTOR>().0);
        for ((to, cross), column) in vectors.zip(columns.as_chunks::<VECTOR>().0) {
            let mut weights = [0.0; VECTOR];
            for l in 0..VECTOR {
                weights[l] = cross[l] * column[l] * factor;
            }
            *to = weights;
        }
    }
}

/// The product of two functions, at one position each, in the first of `out`.
#[inline(always)]
fn product([one, other]: &[Phases; 2], positions: [f64; 2], [out, more]: &mut [Vec<f32>; 2]) {
    one.fill(positions[0], out);
    other.fill(positions[1], more);
    for (to, factor) in out.as_chunks_mut::<VECTOR>().0.iter_mut().zip(more.as_chunks::<VECTOR>().0) {
        let mut products = *to;
        for l in 0..VECTOR {
            products[l] *= factor[l];
        }
        *to = products;
    }
}

/// exp(x), to 1e-7: a ratio of polynomials if x is small.
#[inline(always)]
fn exp(x: f64) -> f32 {
    if x.abs() > 0.5 {
        return libm::exp(x) as f32;
    }
    let (even, odd) = (120.0 + 12.0 * x * x, x * (60.0 + x * x));
    ((even + odd) / (even - odd)) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_core::base::grid::Grid;
    use wavesplat_core::view::camera::{Camera, View};

    fn cut(radius: f64) -> Cut {
        Cut { radius, phases: 256 }
    }

    #[test]
    fn kernels_beyond_numbers_are_refused() {
        let grid = Grid::unit([128; 3]);
        let view = View { azimuth: 30.0, elevation: 30.0, roll: 10.0, size: [512; 2], scale: Some(2.3), center: None };
        let shear = Shear::new(&Camera::new(&view, &grid).expect("a valid view"), &grid, 1);
        for sigma in [1e-3, 0.03, 0.1, 0.3, 1.0, 3.0] {
            let Some(kernel) = Kernel::new(&shear, sigma * 2.3, cut(3.5)) else { continue };
            let mut weights = Weights::new(&kernel);
            for position in [[0.0, 0.0], [0.4, 0.9], [0.99, 0.01]] {
                kernel.weights(position, &mut weights);
                let finite = |row: &[f32]| row.iter().all(|weight| weight.is_finite());
                assert!(weights.rows().all(|(_, _, row)| finite(row)), "{sigma}");
            }
        }
        assert!(
            Kernel::new(&shear, 0.03 * 2.3, cut(3.5)).is_none() && Kernel::new(&shear, 0.75 * 2.3, cut(3.5)).is_some()
        );
    }

    #[test]
    fn weights_are_the_gaussian_at_every_cell() {
        let grid = Grid::unit([9, 9, 9]);
        for (azimuth, elevation, sigma) in [(0.0, 0.0, 3.0), (31.0, 40.0, 9.0), (45.0, 0.0, 3.0), (20.0, 70.0, 4.0)] {
            let view = View { azimuth, elevation, roll: 7.0, size: [50, 50], scale: Some(4.0), center: None };
            let camera = Camera::new(&view, &grid).expect("a valid view");
            let shear = Shear::new(&camera, &grid, 2);
            let kernel = Kernel::new(&shear, sigma, cut(4.5)).expect("a wide kernel");
            let mut weights = Weights::new(&kernel);
            let (half, reach) = (kernel.half(), kernel.reach(&shear, sigma));
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
