//! From cells to pixels: the kernel g that gives the Gaussian footprint once amounts are spread by B-splines.
//!
//! On the lattice the footprint is a Gaussian F of covariance S, in cells, and a B-spline of degree n has the spectrum
//! B(w) = prod over both axes of exp(-(n + 1) (w^2 / 24 + w^4 / 2880 + w^6 / 181440 + ...)). So F / B is
//!
//! ```text
//! g = (1 + (n + 1) (d^4 / 2880 - d^6 / 181440)) Gaussian of covariance S - (n + 1) / 12        d along u, and along v
//! ```
//!
//! What is left is how B repeats itself beyond half a cell's frequency, where F is small; [`Kernel::error`] measures it.

use super::shear::Shear;
use super::spline::spread;
use multiversion::multiversion;
use std::ops::Range;

/// The kernel of a view.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kernel {
    degree: usize,
    /// The inverse of its Gaussian's covariance: uu, uv, vv.
    inverse: [f64; 3],
    /// Of its Gaussian.
    peak: f64,
    /// exp(-uu): the second quotient of Gaussians at neighbouring cells.
    bend: f64,
    /// From its centre to its cut, squared and in units of that covariance.
    cut: f64,
    /// Half the cells along u and v that it reaches.
    pub(super) half: [f64; 2],
}

impl Kernel {
    /// For a Gaussian of standard deviation `sigma` pixels, cut `radius` deviations from its centre. None if the spline is
    /// too wide for it.
    pub(super) fn new(shear: &Shear, sigma: f64, degree: usize, radius: f64) -> Option<Self> {
        let q = shear.fineness as f64;
        let [b, c] = shear.pixels.map(|step| step.map(|pixels| pixels / (q * sigma)));
        // The inverse of S, S, and what the spline leaves of it.
        let [uu, uv, vv] = [b[0] * b[0] + b[1] * b[1], b[0] * c[0] + b[1] * c[1], c[0] * c[0] + c[1] * c[1]];
        let det = uu * vv - uv * uv;
        let spline = (degree + 1) as f64 / 12.0;
        let [suu, suv, svv] = [vv / det - spline, -uv / det, uu / det - spline];
        let left = suu * svv - suv * suv;
        let usable = suu > 0.0 && svv > 0.0 && left > LEAST_LEFT / det;
        let half = [radius * suu.sqrt(), radius * svv.sqrt()];
        let (peak, inverse) = ((1.0 / (det * left)).sqrt(), [svv / left, -suv / left, suu / left]);
        usable.then(|| Self { degree, inverse, peak, bend: libm::exp(-inverse[0]), cut: radius * radius, half })
    }

    /// The rows of cells that a pixel at `v` reaches.
    pub(super) fn rows(&self, v: f64) -> Range<isize> {
        (v - self.half[1]).ceil() as isize..(v + self.half[1]).floor() as isize + 1
    }

    /// The cells of row `row` that a pixel at `place` reaches, and their weights.
    pub(super) fn row(&self, place: [f64; 2], row: isize, weights: &mut Vec<f64>) -> isize {
        weights.clear();
        let [uu, uv, vv] = self.inverse;
        let dv = place[1] - row as f64;
        // uu du^2 + 2 uv du dv + vv dv^2 <= cut
        let middle = -uv / uu * dv;
        let room = (self.cut - (vv - uv * uv / uu) * dv * dv) / uu;
        if room < 0.0 {
            return 0;
        }
        let reach = room.sqrt();
        let (first, last) = (place[0] - middle - reach, place[0] - middle + reach);
        let first = first.ceil() as isize;
        self.gaussians(place[0] - first as f64, dv, first..last.floor() as isize + 1, weights);
        correct(self, weights, place[0] - first as f64, dv);
        first
    }

    /// The Gaussian at places one cell apart: each is the one before times a quotient that changes by a constant factor.
    fn gaussians(&self, du: f64, dv: f64, cells: Range<isize>, out: &mut Vec<f64>) {
        let [uu, uv, vv] = self.inverse;
        let mut weight = self.peak * libm::exp(-0.5 * ((uu * du + 2.0 * uv * dv) * du + vv * dv * dv));
        let mut quotient = libm::exp(uu * (du - 0.5) + uv * dv);
        for _ in cells {
            out.push(weight);
            weight *= quotient;
            quotient *= self.bend;
        }
    }

    /// The kernel at a place.
    fn at(&self, du: f64, dv: f64) -> f64 {
        let [uu, uv, vv] = self.inverse;
        let gaussian = self.peak * libm::exp(-0.5 * ((uu * du + 2.0 * uv * dv) * du + vv * dv * dv));
        gaussian * self.correction(du, dv)
    }

    /// What the kernel is in units of its Gaussian.
    #[inline(always)]
    fn correction(&self, du: f64, dv: f64) -> f64 {
        let [uu, uv, vv] = self.inverse;
        let (su, sv) = (uu * du + uv * dv, uv * du + vv * dv);
        let splines = (self.degree + 1) as f64;
        let correction = |s: f64, i: f64| {
            let (x, i2) = (s * s, i * i);
            let fourth = (x - 6.0 * i) * x + 3.0 * i2;
            let sixth = ((x - 15.0 * i) * x + 45.0 * i2) * x - 15.0 * i2 * i;
            splines * (fourth / 2880.0 - sixth / 181_440.0)
        };
        1.0 + correction(su, uu) + correction(sv, vv)
    }

    /// The weight at `to` of an amount at `from`, both in cells.
    fn weight(&self, from: [f64; 2], to: [f64; 2]) -> f64 {
        let [(u, along), (v, across)] = from.map(|place| spread(self.degree, place));
        let mut sum = 0.0;
        for (row, w) in (v..).zip(&across[..=self.degree]) {
            let dv = to[1] - row as f64;
            for (cell, x) in (u..).zip(&along[..=self.degree]) {
                let du = to[0] - cell as f64;
                let [uu, uv, vv] = self.inverse;
                let within = uu * du * du + 2.0 * uv * du * dv + vv * dv * dv <= self.cut;
                sum += if within { w * x * self.at(du, dv) } else { 0.0 };
            }
        }
        sum
    }

    /// How far weights w~ are from those of the footprint, w = exp(-d^2 / (2 sigma^2)): for any voxels and any place,
    /// sum |w~ - w| is at most this times the largest sum of w of any place.
    ///
    /// For if |w~ - w| <= sum over j of c_j w(d - t_j) for all places d, then all voxels are off by at most the sum of c_j
    /// times what they weigh at places moved by t_j.
    pub(super) fn error(&self, shear: &Shear, sigma: f64) -> f64 {
        let off: Vec<f64> =
            (0..SIDE * SIDE).map(|i| self.off(shear, sigma, [i % SIDE, i / SIDE].map(offset))).collect();
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
        MARGIN * best + BEYOND
    }

    /// The largest difference of both weights at a place, in sigma, whatever the phase of the lattice.
    fn off(&self, shear: &Shear, sigma: f64, place: [f64; 2]) -> f64 {
        let exact = libm::exp(-0.5 * (place[0] * place[0] + place[1] * place[1]));
        let [du, dv] = shear.cells(place.map(|p| p * sigma));
        let phases = (0..PHASES * PHASES).map(|i| [i % PHASES, i / PHASES].map(|n| n as f64 / PHASES as f64));
        phases.map(|[u, v]| (self.weight([u, v], [u + du, v + dv]) - exact).abs()).fold(0.0, f64::max)
    }

    /// Cells that a pixel reaches, about.
    pub(super) fn cells(&self) -> f64 {
        let [uu, uv, vv] = self.inverse;
        std::f64::consts::PI * self.cut / (uu * vv - uv * uv).sqrt()
    }
}

/// Turns Gaussians at places one cell apart into the kernel.
#[multiversion(targets("x86_64+avx512f", "x86_64+avx2"))]
fn correct(kernel: &Kernel, weights: &mut [f64], du: f64, dv: f64) {
    for (w, n) in weights.iter_mut().zip(0_i32..) {
        *w *= kernel.correction(du - f64::from(n), dv);
    }
}

/// The share of the covariance's determinant that a spline must leave.
const LEAST_LEFT: f64 = 0.02;
/// Places along an axis at which differences are looked at, centred, and the distance of neighbours in sigma.
const SIDE: usize = 47;
const APART: f64 = 0.3;
/// Phases of the lattice along each axis that are looked at.
const PHASES: usize = 6;
/// Differences below this share of the largest one are taken for that.
const LEAST: f64 = 3e-3;
/// Times that the c_j are made to fit better.
const ROUNDS: usize = 12;
/// For what lies between places and between phases.
const MARGIN: f64 = 1.25;
/// For what lies beyond all places: 4 exp(-R^2 / 2), as of a cut footprint.
const BEYOND: f64 = 3e-10;

fn offset(n: usize) -> f64 {
    (n as f64 - (SIDE / 2) as f64) * APART
}

/// At every place the sum over all places j of c_j w(d - t_j).
fn blurred(c: &[f64]) -> Vec<f64> {
    let gaussian: Vec<f64> = (0..SIDE).map(|n| libm::exp(-0.5 * (n as f64 * APART) * (n as f64 * APART))).collect();
    let along = |c: &[f64], step: usize, line: usize| {
        let mut out = vec![0.0; c.len()];
        for start in (0..SIDE).map(|n| n * line) {
            for to in 0..SIDE {
                let of = |from: usize| gaussian[to.abs_diff(from)] * c[start + from * step];
                out[start + to * step] = (0..SIDE).map(of).sum();
            }
        }
        out
    };
    along(&along(c, 1, SIDE), SIDE, 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{Camera, View};
    use crate::volume::Grid;

    #[test]
    fn finer_cells_and_higher_degrees_are_nearer() {
        let grid = Grid::unit([20, 20, 20]);
        for (azimuth, elevation) in [(0.0, 0.0), (30.0, 30.0), (45.0, 35.26)] {
            let view = View { azimuth, elevation, roll: 0.0, size: [100, 100], scale: Some(4.0), center: None };
            let camera = Camera::new(&view, &grid).expect("a valid view");
            for (fineness, degree, most) in [(2, 3, 1.4e-2), (2, 5, 2.1e-3), (3, 5, 1.1e-4), (4, 5, 4e-5)] {
                let shear = Shear::new(&camera, &grid, fineness);
                let kernel = Kernel::new(&shear, 3.0, degree, 5.0).expect("a wide kernel");
                let error = kernel.error(&shear, 3.0);
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
            let shear = Shear::new(&camera, &grid, 2 + n % 2);
            let sigma = 3.6;
            for (degree, radius) in [(3, 4.0), (5, 5.0)] {
                let kernel = Kernel::new(&shear, sigma, degree, radius).expect("a wide kernel");
                let stated = kernel.error(&shear, sigma);
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
        let voxels: Vec<[f64; 2]> = Grid::unit(size).whole().iter().map(|v| shear.place(v)).collect();
        let (mut off, mut most) = (0.0_f64, 0.0_f64);
        for pixel in (0..60 * 60).map(|i| [(i % 60) as f64 + 0.5, (i / 60) as f64 + 0.5]) {
            let place = shear.cells([0, 1].map(|i| pixel[i] - shear.origin[i]));
            let exact = |v: &[f64; 2]| {
                let at = shear.pixel(*v);
                (-((pixel[0] - at[0]).powi(2) + (pixel[1] - at[1]).powi(2)) / (2.0 * sigma * sigma)).exp()
            };
            off = off.max(voxels.iter().map(|v| (kernel.weight(*v, place) - exact(v)).abs()).sum());
            most = most.max(voxels.iter().map(exact).sum());
        }
        (off, most)
    }
}
