//! The prefilter of the cells: a short symmetric filter along each axis that undoes the blur of spreading.
//!
//! Pixels gather from the cells with the Gaussian itself, whose spectrum is g(k) = exp(-2 pi^2 sigma^2 k^2), with k in
//! cycles per cell. If voxels were spread by a bump with the spectrum phi, the filter F would have to be near 1 / phi
//! where g is large, and small where phi repeats. Its taps minimize
//!
//! ```text
//! integral over k of ((1 - F(k) phi(k))^2 + F(k)^2 (phi(k - 1)^2 + phi(k + 1)^2)) g(k)^2 / k^4            (eq 36)
//! F(k) = sum of f_j cos(2 pi j k)                 phi(k) = sinh(r) / r, r^2 = b^2 - (pi n k)^2, phi(0) = 1
//! ```
//!
//! phi is the spectrum of the Kaiser-Bessel bump of n cells, which is nearly the best for spreading
//! ([Barnett](wavesplat_core::bibliography)). The factor 1 / k^4 makes constants and slopes nearly exact. The weights
//! that spread a voxel are then fitted to the filter ([`super::fit`]).

use std::f64::consts::PI;

/// Cells to each side of a filtered cell.
pub(super) const HALF: usize = 7;

/// The taps of the filter: of the cell itself, of its neighbours, of the next ones, ...
pub(super) type Taps = [f64; HALF + 1];

/// The filter for voxels spread to `width` cells that are gathered by a Gaussian with a standard deviation of `sigma`
/// cells (eq 36).
pub(super) fn taps(width: usize, sigma: f64) -> Taps {
    let (mut matrix, mut right) = ([[0.0; HALF + 1]; HALF + 1], Taps::default());
    for n in 0..SAMPLES {
        let k = (n as f64 + 0.5) / (2 * SAMPLES) as f64;
        let (cosines, [here, repeated]) = (cosines(k), bump(width, k));
        let weight = weight(k, sigma);
        for i in 0..=HALF {
            right[i] += weight * cosines[i] * here;
            for j in 0..=HALF {
                matrix[i][j] += weight * cosines[i] * cosines[j] * (here * here + repeated);
            }
        }
    }
    let taps = solve(matrix, right);
    let total = total(&taps);
    taps.map(|tap| f64::from((tap / total) as f32))
}

/// The sum of all taps.
pub(super) fn total(taps: &Taps) -> f64 {
    taps[0] + 2.0 * taps[1..].iter().sum::<f64>()
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

/// The spectra of the cell's own tap and of each pair of taps.
fn cosines(k: f64) -> Taps {
    let first = 2.0 * libm::cos(2.0 * PI * k);
    let mut spectra = [first; HALF + 1];
    let mut last = 2.0;
    for j in 2..=HALF {
        spectra[j] = first * spectra[j - 1] - last;
        last = spectra[j - 1];
    }
    spectra[0] = 1.0;
    spectra
}

/// g^2 / k^4, limited at both ends.
fn weight(k: f64, sigma: f64) -> f64 {
    let gaussian = libm::exp(-2.0 * (PI * k * sigma).powi(2));
    (gaussian * gaussian + LEAST) / ((k * k + 1e-4) * (k * k + 1e-3))
}

/// Samples of the integral.
const SAMPLES: usize = 400;
/// The least weight of high frequencies, so that no tap is arbitrary.
const LEAST: f64 = 1e-7;

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

    #[test]
    fn filtered_bumps_pass_what_a_gaussian_passes() {
        for (width, sigma, most) in [(4, 1.5, 4e-4), (5, 1.5, 2e-4), (5, 2.25, 2e-5), (6, 2.25, 1e-5), (6, 3.0, 5e-6)] {
            let taps = taps(width, sigma);
            assert!((total(&taps) - 1.0).abs() < 1e-6);
            for k in [0.0, 0.02, 0.05, 0.1, 0.2, 0.3] {
                let filter = cosines(k).iter().zip(taps).map(|(cosine, tap)| cosine * tap).sum::<f64>();
                let gaussian = (-2.0 * (PI * k * sigma).powi(2)).exp();
                let off = (filter * bump(width, k)[0] - 1.0).abs() * gaussian;
                assert!(off < most, "width {width}, sigma {sigma}, k {k}: {off:e}");
            }
        }
    }

    #[test]
    fn equations_are_solved() {
        let found = solve([[4.0, 1.0], [1.0, 3.0]], [1.0, 2.0]);
        assert!((found[0] - 1.0 / 11.0).abs() < 1e-15 && (found[1] - 7.0 / 11.0).abs() < 1e-15);
    }
}
