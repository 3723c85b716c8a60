//! The prefilter of the cells: a short filter along each axis that undoes the blur of spreading.
//!
//! Pixels gather from the cells with the Gaussian itself, whose spectrum is g(k) = exp(-2 pi^2 sigma^2 k^2), with k in
//! cycles per cell. If voxels were spread by a bump with the spectrum phi, the filter F would have to be near 1 / phi
//! where g is large, and small where phi repeats. Rows of cells may have to move by a share d of a cell, at most a half,
//! for columns to be upright ([`super::upright`]). The same filter moves them: its taps minimize
//!
//! ```text
//! integral over k of (|e^(-2 pi i d k) - F(k) phi(k)|^2 + |F(k)|^2 (phi(k - 1)^2 + phi(k + 1)^2)) g(k)^1.5 / k^4  (eq 36)
//! F(k) = sum of f_j e^(-2 pi i j k)               phi(k) = sinh(r) / r, r^2 = b^2 - (pi n k)^2, phi(0) = 1
//! ```
//!
//! phi is the spectrum of the Kaiser-Bessel bump of n cells, which is nearly the best for spreading
//! ([Barnett](wavesplat_core::bibliography)). The factor 1 / k^4 makes constants and slopes nearly exact. The weights
//! that spread a voxel are then fitted to the filter that moves nothing ([`super::fit`]).

use std::f64::consts::PI;

/// Cells to each side of a filtered cell. Filters that move cells by half of one fall off slowly.
pub(super) const HALF: usize = 8;

/// The number of taps of a filter.
pub(super) const TAPS: usize = 2 * HALF + 1;

/// The taps of a filter, from [`HALF`] cells before the filtered cell on.
pub(super) type Taps = [f64; TAPS];

/// The filters along an axis.
#[derive(Debug, Clone)]
pub(super) struct Prefilter {
    /// The equations of eq 36, the same for all d.
    matrix: [Taps; TAPS],
    /// phi(k) times the weight of k, for the samples of the integral.
    wanted: Vec<f64>,
}

impl Prefilter {
    /// The filters for voxels spread to `width` cells that are gathered by a Gaussian with a standard deviation of `sigma`
    /// cells.
    pub(super) fn new(width: usize, sigma: f64) -> Self {
        let (mut passed, mut wanted) = (Vec::with_capacity(SAMPLES), Vec::with_capacity(SAMPLES));
        for n in 0..SAMPLES {
            let k = (n as f64 + 0.5) * SPACING;
            let ([here, repeated], weight) = (bump(width, k), weight(k, sigma));
            passed.push(weight * (here * here + repeated));
            wanted.push(weight * here);
        }
        let products: Taps = transformed(&passed, 0.0);
        Self { matrix: std::array::from_fn(|i| std::array::from_fn(|j| products[i.abs_diff(j)])), wanted }
    }

    /// The filter that moves cells by `shift` cells, 0.5 at most (eq 36). Its sum is 1, but for a rounding.
    pub(super) fn taps(&self, shift: f64) -> Taps {
        let taps = solve(self.matrix, transformed(&self.wanted, shift + HALF as f64));
        let total: f64 = taps.iter().sum();
        // As f32 holds them, so that sums in f32 and in f64 are filtered alike.
        let single = |number: f64| f64::from(number as f32);
        let mut taps = taps.map(|tap| single(tap / total));
        taps[HALF] = single(taps[HALF] + 1.0 - taps.iter().sum::<f64>());
        taps
    }
}

/// phi(k), and the square of its repetitions, both relative to phi(0).
fn bump(width: usize, k: f64) -> [f64; 2] {
    let beta = width as f64 * if width <= 5 { 2.2 } else { 2.6 }; // the smallest errors, by trials
    let phi = |k: f64| {
        let squared = beta * beta - (PI * width as f64 * k).powi(2);
        let r = squared.abs().sqrt();
        let value = if squared < 0.0 { libm::sin(r) / r } else { libm::sinh(r) / r };
        value * beta / libm::sinh(beta)
    };
    [phi(k), phi(k - 1.0).powi(2) + phi(k + 1.0).powi(2)]
}

/// The sum over all samples k of `numbers` times cos(2 pi k (j - start)), for j = 0, 1, ...
fn transformed(numbers: &[f64], start: f64) -> Taps {
    let steps: Taps = std::array::from_fn(|j| 2.0 * PI * SPACING * (j as f64 - start));
    let twice = steps.map(|step| 2.0 * libm::cos(step));
    // The samples before the first one and the first one lie at -1/2 and 1/2 steps.
    let mut before = steps.map(|step| libm::cos(0.5 * step));
    let (mut waves, mut sums) = (before, [0.0; TAPS]);
    for number in numbers {
        for j in 0..TAPS {
            sums[j] += number * waves[j];
            (before[j], waves[j]) = (waves[j], twice[j] * waves[j] - before[j]);
        }
    }
    sums
}

/// g^1.5 / k^4, limited at both ends. The power gives the smallest errors, by trials.
fn weight(k: f64, sigma: f64) -> f64 {
    let power = libm::exp(-3.0 * (PI * k * sigma).powi(2));
    (power + LEAST) / ((k * k + 1e-4) * (k * k + 1e-3))
}

/// Samples of the integral, and the distance between them in cycles a cell.
const SAMPLES: usize = 400;
const SPACING: f64 = 0.5 / SAMPLES as f64;
/// The least weight of high frequencies, so that no tap is arbitrary.
const LEAST: f64 = 1e-8;

/// Solves symmetric positive definite equations by elimination.
pub(super) fn solve<const N: usize>(mut matrix: [[f64; N]; N], mut right: [f64; N]) -> [f64; N] {
    for i in 0..N {
        for j in i + 1..N {
            let factor = matrix[j][i] / matrix[i][i];
            let pivot = matrix[i];
            matrix[j].iter_mut().zip(pivot).skip(i).for_each(|(to, from)| *to -= factor * from);
            right[j] -= factor * right[i];
        }
    }
    for i in (0..N).rev() {
        let known: f64 = (i + 1..N).map(|k| matrix[i][k] * right[k]).sum();
        right[i] = (right[i] - known) / matrix[i][i];
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By how much a wave of k cycles a cell is off that passes a bump, a filter of these taps, and a Gaussian.
    fn off(taps: &Taps, [shift, k, bump, sigma]: [f64; 4]) -> f64 {
        let sum = |wave: fn(f64) -> f64| {
            let at = |j: usize| wave(2.0 * PI * k * (j as f64 - HALF as f64 - shift));
            taps.iter().enumerate().map(|(j, tap)| tap * at(j)).sum::<f64>()
        };
        (sum(f64::cos) * bump - 1.0).hypot(sum(f64::sin) * bump) * (-2.0 * (PI * k * sigma).powi(2)).exp()
    }

    #[test]
    fn filtered_bumps_pass_what_a_gaussian_passes() {
        for (width, sigma, most) in [(4, 1.5, 4e-4), (5, 1.5, 2e-4), (5, 2.25, 2e-5), (6, 2.25, 1e-5), (6, 3.0, 5e-6)] {
            let filter = Prefilter::new(width, sigma);
            for k in [0.0, 0.02, 0.05, 0.1, 0.2, 0.3] {
                let bump = bump(width, k)[0];
                let what = format!("width {width}, sigma {sigma}, k {k}");
                for shift in [-0.5, -0.31, 0.0, 0.07, 0.4] {
                    let taps = filter.taps(shift);
                    assert!(off(&taps, [shift, k, bump, sigma]) < most, "{what}, {shift}");
                    assert!((taps.iter().sum::<f64>() - 1.0).abs() < 1e-6);
                }
            }
        }
    }

    #[test]
    fn equations_are_solved() {
        let found = solve([[4.0, 1.0], [1.0, 3.0]], [1.0, 2.0]);
        assert!((found[0] - 1.0 / 11.0).abs() < 1e-15 && (found[1] - 7.0 / 11.0).abs() < 1e-15);
    }
}
