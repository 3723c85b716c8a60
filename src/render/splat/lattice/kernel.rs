//! From cells to pixels: the kernel G that, applied to values spread by B-splines, gives the Gaussian footprint.
//!
//! On the lattice the footprint is a Gaussian F of covariance S, in cells. A B-spline of degree n has the spectrum B(w)
//! = exp(-(n + 1) (w^2 / 24 + w^4 / 2880 + w^6 / 181440 + ...)) along each axis. So the kernel with the spectrum F / B
//! is, to first order in the terms of fourth and sixth degree,
//!
//! ```text
//! G = (1 + (n+1) (D^4/2880 - D^6/181440)) Gaussian of covariance S - (n+1)/12                             (eq 36)
//! ```
//!
//! with D a derivative along u, and the same along v. The spectrum of a spline repeats beyond half a cell's frequency,
//! where F is small. That, and the terms left out, is the error of the lattice. `Kernel::error` states it so that for
//! any voxels and any pixel
//!
//! ```text
//! sum of |w~_i - w_i| <= stated error * largest sum of w_i                                                (eq 37)
//! ```
//!
//! where w~ are the weights of the lattice. Let |w~ - w| at a distance d be at most the sum over j of c_j w(d - t_j),
//! for some shifts t_j. Then the error of all voxels together is at most the sum over j of c_j times their weights at
//! positions moved by t_j, and so at most the sum of the c_j times the largest sum of weights.
//!
//! The weights of a pixel's cells take three exponentials, since the Gaussian factors over whole cells: the fast
//! Gaussian gridding of [Greengard](crate::bibliography).

use super::shear::Shear;
use super::spline::spread;
use crate::codec::real::Real;
use std::ops::Range;

/// The kernel of a view.
#[derive(Debug, Clone)]
pub(super) struct Kernel {
    degree: usize,
    /// The inverse of its Gaussian's covariance: uu, uv, vv.
    inverse: [f64; 3],
    /// The peak of its Gaussian.
    peak: f64,
    /// The corrections along u and along v: polynomials of squares, constants first.
    bends: [[f64; 4]; 2],
    /// From the cell nearest to a pixel, the first cell along u and v that counts.
    first: [isize; 2],
    /// The Gaussian at whole cells, in units of its peak. All rows have the same number of runs, which include cells
    /// that do not count.
    table: Vec<Run>,
    /// For each row, the cells that count.
    spans: Vec<Range<usize>>,
}

/// Numbers of neighbouring cells. f32 is precise enough: a mean divides two sums with the same rounded weights.
type Run = [f32; RUN];
const RUN: usize = 16;

impl Kernel {
    /// The kernel for a Gaussian with a standard deviation of `sigma` pixels, cut at `radius` deviations. `None` if the
    /// spline is too wide for it, or the cells are too small.
    pub(super) fn new(shear: &Shear, sigma: f64, degree: usize, radius: f64) -> Option<Self> {
        let q = shear.fineness as f64;
        let [b, c] = shear.pixels.map(|step| step.map(|pixels| pixels / (q * sigma)));
        // The inverse of S, then S minus the covariance of the spline.
        let [uu, uv, vv] = [b[0] * b[0] + b[1] * b[1], b[0] * c[0] + b[1] * c[1], c[0] * c[0] + c[1] * c[1]];
        let det = uu * vv - uv * uv;
        let spline = (degree + 1) as f64 / 12.0;
        let [suu, suv, svv] = [vv / det - spline, -uv / det, uu / det - spline];
        let left = suu * svv - suv * suv;
        let half = [suu, svv].map(|s| (radius * s.sqrt() + NEARER).floor());
        let usable = suu > 0.0 && svv > 0.0 && left > LEAST_LEFT / det && half.iter().all(|n| *n <= MOST_HALF);
        let (peak, inverse) = ((1.0 / (det * left)).sqrt(), [svv / left, -suv / left, suu / left]);
        // The exponents in `weights` must fit in f32.
        let exponent = |i: usize| 0.5 * half[i] * (inverse[2 * i].abs() + inverse[1].abs());
        let usable = usable && exponent(0) < MOST_EXPONENT && exponent(1) < MOST_EXPONENT;
        let bends = [inverse[0], inverse[2]].map(|i| bend((degree + 1) as f64, i));
        let kernel = Self { degree, inverse, peak, bends, first: [0; 2], table: Vec::new(), spans: Vec::new() };
        usable.then(|| kernel.with_table(half.map(|n| n as isize), radius))
    }

    fn with_table(mut self, half: [isize; 2], radius: f64) -> Self {
        self.first = half.map(|n| -n);
        let runs = (2 * half[0] as usize + 1).div_ceil(RUN);
        for j in -half[1]..=half[1] {
            let at = |i: usize| [(i as isize - half[0]) as f64, j as f64];
            let run = |r: usize| std::array::from_fn(|i| libm::exp(-0.5 * self.square(at(r * RUN + i))) as f32);
            let row: Vec<Run> = (0..runs).map(run).collect();
            let counts = |i: &usize| {
                let [u, v] = at(*i);
                let near = [[-NEARER, -NEARER], [-NEARER, NEARER], [NEARER, -NEARER], [NEARER, NEARER]];
                near.iter().any(|n| self.square([u + n[0], v + n[1]]) <= radius * radius)
            };
            let counted: Vec<usize> = (0..2 * half[0] as usize + 1).filter(counts).collect();
            self.table.extend(row);
            self.spans.push(counted.first().map_or(0..0, |first| *first..first + counted.len()));
        }
        self
    }

    /// Runs of a row of weights.
    fn runs(&self) -> usize {
        self.table.len() / self.spans.len()
    }

    /// An upper bound of the distance from a pixel to any cell that counts, along u and v.
    pub(super) fn half(&self) -> [f64; 2] {
        self.first.map(|n| 0.5 - n as f64)
    }

    /// The squared distance in units of the covariance.
    fn square(&self, [u, v]: [f64; 2]) -> f64 {
        let [uu, uv, vv] = self.inverse;
        (uu * u + 2.0 * uv * v) * u + vv * v * v
    }

    /// The weights of a pixel at `position` (eq 36), row by row, and the first cell of the first row.
    ///
    /// With du, dv from the nearest cell to the pixel, and i, j from that to another one, the Gaussian is
    ///
    /// ```text
    /// G(du - i, dv - j) = G(du, dv) exp(uu du + uv dv)^i exp(uv du + vv dv)^j G(i, j)        G(0, 0) = 1
    /// ```
    pub(super) fn weights(&self, position: [f64; 2], out: &mut Weights) -> [isize; 2] {
        let near = position.map(|p| (p + 0.5).floor());
        let [du, dv] = [position[0] - near[0], position[1] - near[1]];
        let [uu, uv, vv] = self.inverse;
        let along = out.along.as_flattened_mut().iter_mut().zip(powers(uu * du + uv * dv, self.first[0]));
        along.for_each(|(to, power)| *to = power as f32);
        out.across.iter_mut().zip(powers(uv * du + vv * dv, self.first[1])).for_each(|(to, power)| *to = power);
        let peak = self.peak * libm::exp(-0.5 * self.square([du, dv]));
        weigh(self, peak, [du - self.first[0] as f64, dv - self.first[1] as f64], out);
        std::array::from_fn(|i| near[i] as isize + self.first[i])
    }

    /// The kernel at an offset.
    #[cfg(test)]
    fn at(&self, du: f64, dv: f64) -> f64 {
        self.peak * libm::exp(-0.5 * self.square([du, dv])) * self.correction(du, dv)
    }

    /// The kernel divided by its Gaussian.
    fn correction(&self, du: f64, dv: f64) -> f64 {
        correction(&self.inverse, &self.bends, du, dv)
    }

    /// The weight at `to` of a value at `from`, both in cells.
    fn weight(&self, from: [f64; 2], to: [f64; 2]) -> f64 {
        let [(u, along), (v, across)] = from.map(|position| spread(self.degree, position));
        let near = to.map(|p| (p + 0.5).floor());
        let [i, j] = [u - near[0] as isize - self.first[0], v - near[1] as isize - self.first[1]];
        let mut sum = 0.0;
        for (n, w) in (0..).zip(&across[..=self.degree]) {
            let Some(span) = usize::try_from(j + n).ok().and_then(|j| self.spans.get(j)) else { continue };
            let (mut du, dv) = (to[0] - u as f64, to[1] - (v + n) as f64);
            let mut last = None;
            for (n, x) in (0..).zip(&along[..=self.degree]) {
                if usize::try_from(i + n).is_ok_and(|i| span.contains(&i)) {
                    let next = |[gaussian, quotient, bend]: [f64; 3]| [gaussian * quotient, quotient * bend, bend];
                    let here = last.map_or_else(|| self.gaussian(du, dv), next);
                    sum += w * x * here[0] * self.correction(du, dv);
                    last = Some(here);
                }
                du -= 1.0;
            }
        }
        sum
    }

    /// The Gaussian at an offset, its quotient with the next cell, and the quotient of neighbouring quotients.
    fn gaussian(&self, du: f64, dv: f64) -> [f64; 3] {
        let [uu, uv, _] = self.inverse;
        let weight = self.peak * libm::exp(-0.5 * self.square([du, dv]));
        [weight, libm::exp(uu * (du - 0.5) + uv * dv), libm::exp(-uu)]
    }

    /// The stated error of eq 37, for footprints w = exp(-d^2 / (2 sigma^2)). Returns infinity as soon as it is known
    /// to exceed `most`.
    pub(super) fn error(&self, shear: &Shear, sigma: f64, most: f64) -> f64 {
        let mut off = vec![0.0; SIDE * SIDE];
        // From the middle outwards; the other half is symmetric.
        for i in (0..=SIDE * SIDE / 2).rev() {
            let here = self.off(shear, sigma, [i % SIDE, i / SIDE].map(offset));
            if MARGIN * here > most {
                return f64::INFINITY; // the c_j sum to no less
            }
            (off[i], off[SIDE * SIDE - 1 - i]) = (here, here);
        }
        let least = LEAST * off.iter().copied().fold(0.0, f64::max);
        let off: Vec<f64> = off.into_iter().map(|off| off.max(least)).collect();
        let mut c = off.clone();
        let mut best = f64::INFINITY;
        for _ in 0..ROUNDS {
            let quotients: Vec<f64> = off.iter().zip(blurred(&c)).map(|(off, sum)| off / sum).collect();
            let most = quotients.iter().copied().fold(0.0, f64::max);
            best = best.min(most * c.iter().sum::<f64>());
            c.iter_mut().zip(blurred(&quotients)).for_each(|(c, q)| *c *= q);
        }
        MARGIN * best + BEYOND + SINGLES
    }

    /// The largest difference of both weights at an offset in units of sigma, over all phases of the lattice.
    fn off(&self, shear: &Shear, sigma: f64, position: [f64; 2]) -> f64 {
        let exact = libm::exp(-0.5 * (position[0] * position[0] + position[1] * position[1]));
        let [du, dv] = shear.cells(position.map(|p| p * sigma));
        let phases = (0..PHASES * PHASES).map(|i| [i % PHASES, i / PHASES].map(|n| n as f64 / PHASES as f64));
        phases.map(|[u, v]| (self.weight([u, v], [u + du, v + dv]) - exact).abs()).fold(0.0, f64::max)
    }

    /// Number of cells of a pixel.
    pub(super) fn cells(&self) -> usize {
        self.spans.iter().map(Range::len).sum()
    }
}

/// The weights of the cells of a pixel. All rows have the same number of runs; the cells in the span of a row count.
#[derive(Debug)]
pub(super) struct Weights {
    rows: Vec<[f64; RUN]>,
    spans: Vec<Range<usize>>,
    /// The factors of the Gaussian along u and along v.
    along: Vec<Run>,
    across: Vec<f64>,
}

impl Weights {
    /// Allocates the weights for a kernel.
    pub(super) fn of(kernel: &Kernel) -> Self {
        let (along, across) = (vec![[0.0; RUN]; kernel.runs()], vec![0.0; kernel.spans.len()]);
        Self { rows: vec![[0.0; RUN]; kernel.table.len()], spans: kernel.spans.clone(), along, across }
    }

    /// The weights that count, row by row: the index of the row, the index of its first cell that counts, and the
    /// weights from there on.
    #[inline(always)]
    pub(super) fn rows(&self) -> impl Iterator<Item = (usize, usize, &[f64])> {
        let rows = self.rows.chunks_exact(self.along.len()).zip(&self.spans);
        rows.enumerate().map(|(n, (row, span))| (n, span.start, &row.as_flattened()[span.clone()]))
    }
}

/// exp(x n) for whole n from `first` on.
fn powers(x: f64, first: isize) -> impl Iterator<Item = f64> {
    let up = libm::exp(x);
    let lowest = (first..0).fold(1.0, |power, _| power * (1.0 / up));
    std::iter::successors(Some(lowest), move |power| Some(power * up))
}

/// (n + 1) (D^4 / 2880 - D^6 / 181440) of exp(-i x^2 / 2), in units of that, as a polynomial of (i x)^2 (eq 36).
fn bend(splines: f64, i: f64) -> [f64; 4] {
    let (fourth, sixth) = (splines / 2880.0, splines / 181_440.0);
    let constant = (3.0 * fourth + 15.0 * sixth * i) * i * i;
    [constant, (-6.0 * fourth - 45.0 * sixth * i) * i, fourth + 15.0 * sixth * i, -sixth]
}

/// 1 plus both polynomials.
#[inline(always)]
fn correction<R: Real>([uu, uv, vv]: &[R; 3], bends: &[[R; 4]; 2], du: R, dv: R) -> R {
    let (su, sv) = (*uu * du + *uv * dv, *uv * du + *vv * dv);
    let bend = |[a, b, c, d]: [R; 4], x: R| a + (b + (c + d * x) * x) * x;
    R::of(1.0) + bend(bends[0], su * su) + bend(bends[1], sv * sv)
}

/// Computes the weights of all rows. `[du, dv]` is the offset of the pixel from the first cell of the first row.
#[cfg_attr(not(feature = "portable"), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn weigh(kernel: &Kernel, peak: f64, [du, dv]: [f64; 2], out: &mut Weights) {
    let (inverse, bends) = (kernel.inverse.map(|n| n as f32), kernel.bends.map(|bend| bend.map(|n| n as f32)));
    let runs = out.along.len();
    let rows = out.rows.chunks_exact_mut(runs).zip(kernel.table.chunks_exact(runs));
    for (n, ((row, table), across)) in rows.zip(&out.across).enumerate() {
        let (scale, dv) = ((peak * across) as f32, dv as f32 - n as f32);
        for (r, ((row, table), along)) in row.iter_mut().zip(table).zip(&out.along).enumerate() {
            for i in 0..RUN {
                let du = du as f32 - (r * RUN + i) as f32;
                row[i] = f64::from(table[i] * along[i] * scale * correction(&inverse, &bends, du, dv));
            }
        }
    }
}

/// A cell counts if it would be within the cut for a pixel that is nearer by this share of a cell along both axes.
const NEARER: f64 = 0.25;
/// The largest number of cells to one side of a kernel.
const MOST_HALF: f64 = 100.0;
/// The largest exponent: the exponential and its factors must fit in f32.
const MOST_EXPONENT: f64 = 40.0;
/// The least share of the covariance's determinant that must remain after the spline.
const LEAST_LEFT: f64 = 0.02;
/// Number of sampled offsets along an axis, centred, and their spacing in sigma.
const SIDE: usize = 47;
const APART: f64 = 0.3;
/// Number of sampled phases of the lattice along each axis.
const PHASES: usize = 6;
/// Differences below this share of the largest one are raised to it.
const LEAST: f64 = 3e-3;
/// Iterations of fitting the c_j.
const ROUNDS: usize = 12;
/// Margin for differences between sampled offsets and phases: several times the change counted with finer sampling.
const MARGIN: f64 = 1.25;
/// Bound for the rounding of weights to f32.
pub(super) const SINGLES: f64 = 1e-6;
/// Bound for weights beyond all sampled offsets: 4 exp(-R^2 / 2), as for a cut footprint.
const BEYOND: f64 = 3e-10;

fn offset(n: usize) -> f64 {
    (n as f64 - (SIDE / 2) as f64) * APART
}

/// The sum over all j of c_j w(d - t_j), at every sampled offset d.
fn blurred(c: &[f64]) -> Vec<f64> {
    let gaussian: Vec<f64> = (0..SIDE).map(|n| libm::exp(-0.5 * (n as f64 * APART) * (n as f64 * APART))).collect();
    let mut turned = vec![0.0; c.len()];
    blur_and_turn(&gaussian, c, &mut turned);
    let mut out = vec![0.0; c.len()];
    blur_and_turn(&gaussian, &turned, &mut out);
    out
}

/// Blurs the columns and transposes.
#[cfg_attr(not(feature = "portable"), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn blur_and_turn(gaussian: &[f64], c: &[f64], out: &mut [f64]) {
    for to in 0..SIDE {
        let mut sums = [0.0; SIDE];
        for (from, row) in c.chunks_exact(SIDE).enumerate() {
            let weight = gaussian[to.abs_diff(from)];
            sums.iter_mut().zip(row).for_each(|(sum, c)| *sum += weight * c);
        }
        out[to..].iter_mut().step_by(SIDE).zip(sums).for_each(|(out, sum)| *out = sum);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::grid::Grid;
    use crate::view::camera::{Camera, View};

    #[test]
    fn weights_are_the_kernel_at_every_cell() {
        let grid = Grid::unit([9, 9, 9]);
        for (azimuth, elevation, sigma, degree) in [(0.0, 0.0, 3.0, 3), (31.0, 40.0, 9.0, 7), (45.0, 0.0, 3.0, 5)] {
            let view = View { azimuth, elevation, roll: 7.0, size: [50, 50], scale: Some(4.0), center: None };
            let camera = Camera::new(&view, &grid).expect("a valid view");
            let kernel = Kernel::new(&Shear::new(&camera, &grid, 2), sigma, degree, 5.0).expect("a wide kernel");
            let mut weights = Weights::of(&kernel);
            for position in [[0.0, 0.0], [-3.5, 12.5], [100.1, -7.77], [0.49, 0.51]] {
                let [u, v] = kernel.weights(position, &mut weights);
                let runs = kernel.runs();
                for (j, row) in weights.rows.chunks_exact(runs).enumerate() {
                    for (i, weight) in row.as_flattened().iter().enumerate() {
                        let [du, dv] = [position[0] - (u + i as isize) as f64, position[1] - (v + j as isize) as f64];
                        let expected = kernel.at(du, dv);
                        assert!(
                            (weight - expected).abs() < 1e-5 * kernel.peak,
                            "{position:?}: {weight} for {expected}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn finer_cells_and_higher_degrees_are_nearer() {
        let grid = Grid::unit([20, 20, 20]);
        for (azimuth, elevation) in [(0.0, 0.0), (30.0, 30.0), (45.0, 35.26)] {
            let view = View { azimuth, elevation, roll: 0.0, size: [100, 100], scale: Some(4.0), center: None };
            let camera = Camera::new(&view, &grid).expect("a valid view");
            for (fineness, degree, most) in [(2, 3, 1.4e-2), (2, 5, 2.1e-3), (3, 5, 1.2e-4), (4, 5, 6e-5)] {
                let shear = Shear::new(&camera, &grid, fineness);
                let kernel = Kernel::new(&shear, 3.0, degree, 5.0).expect("a wide kernel");
                let error = kernel.error(&shear, 3.0, 1.0);
                assert!(error < most && error > most / 10.0, "{fineness} {degree} at {azimuth}: {error:e}");
            }
        }
    }

    #[test]
    fn weights_are_off_by_no_more_than_stated() {
        let grid = Grid { dims: [7, 6, 5], spacing: [1.0, 0.8, 1.2], origin: [0.0; 3] };
        for (n, (azimuth, elevation)) in [(0.0, 0.0), (30.0, 30.0), (100.0, -70.0)].into_iter().enumerate() {
            let view = View { azimuth, elevation, roll: 20.0, size: [60, 60], scale: Some(4.0), center: None };
            let camera = Camera::new(&view, &grid).expect("a valid view");
            let shear = Shear::new(&camera, &grid, 1 + n);
            let sigma = if n == 0 { 8.0 } else { 3.6 };
            for (degree, radius) in [(3, 4.0), (5, 5.0)] {
                let kernel = Kernel::new(&shear, sigma, degree, radius).expect("a wide kernel");
                let stated = kernel.error(&shear, sigma, 1.0);
                for size in [[1, 1, 1], [7, 1, 1], [1, 6, 5], [7, 6, 5]] {
                    let (off, most) = sums(&shear, &kernel, sigma, size);
                    assert!(off <= stated * most, "{size:?}: {off} of {most}, stated {stated}");
                    assert!(size != [7, 6, 5] || off > 0.02 * stated * most, "{off} of {most}, stated {stated}");
                }
            }
        }
    }

    /// The largest sums of |w~ - w| and of w of a box of voxels.
    fn sums(shear: &Shear, kernel: &Kernel, sigma: f64, size: [usize; 3]) -> (f64, f64) {
        let voxels: Vec<[f64; 2]> = Grid::unit(size).whole().iter().map(|v| shear.position(v)).collect();
        let (mut off, mut most) = (0.0_f64, 0.0_f64);
        for pixel in (0..60 * 60).map(|i| [(i % 60) as f64 + 0.5, (i / 60) as f64 + 0.5]) {
            let position = shear.cells([0, 1].map(|i| pixel[i] - shear.origin[i]));
            let exact = |v: &[f64; 2]| {
                let at = shear.pixel(*v);
                (-((pixel[0] - at[0]).powi(2) + (pixel[1] - at[1]).powi(2)) / (2.0 * sigma * sigma)).exp()
            };
            off = off.max(voxels.iter().map(|v| (kernel.weight(*v, position) - exact(v)).abs()).sum());
            most = most.max(voxels.iter().map(exact).sum());
        }
        (off, most)
    }
}
