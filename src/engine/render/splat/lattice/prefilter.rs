//! The prefilter of the cells: a short symmetric filter along each axis that undoes the blur of the B-splines.
//!
//! A B-spline of degree n has the spectrum sinc(k)^(n + 1), with k in cycles per cell. The pixels gather from the cells
//! with the Gaussian itself, whose spectrum is g(k) = exp(-2 pi^2 sigma^2 k^2). So the filter must be near 1 / sinc^(n +
//! 1) where g is large. Its taps minimize
//!
//! ```text
//! integral over k of (sum of f_j cos(2 pi j k) - sinc(k)^-(n+1))^2 g(k)^2 / k^4                           (eq 36)
//! ```
//!
//! The factor 1 / k^4 makes constants and slopes nearly exact. Least squares without it would leave an error of 0.5 %
//! in a constant field. Prefilters of B-splines are described by [Unser](wavesplat_core::bibliography).

/// Cells to each side of a filtered cell.
pub(super) const HALF: usize = 6;

/// The taps of the filter: of the cell itself, of its neighbours, of the next ones, ...
pub(super) type Taps = [f64; HALF + 1];

/// The filter for splines of `degree` that are gathered by a Gaussian with a standard deviation of `sigma` cells
/// (eq 36).
pub(super) fn taps(degree: usize, sigma: f64) -> Taps {
    let (mut matrix, mut right) = ([[0.0; HALF + 1]; HALF + 1], Taps::default());
    for n in 0..SAMPLES {
        let x = std::f64::consts::PI * (n as f64 + 0.5) / (2 * SAMPLES) as f64;
        let cosines = cosines(x);
        let ratio = x / libm::sin(x);
        let wanted: f64 = std::iter::repeat_n(ratio, degree + 1).product();
        let weight = weight(x, sigma);
        for i in 0..=HALF {
            right[i] += weight * cosines[i] * wanted;
            for j in 0..=HALF {
                matrix[i][j] += weight * cosines[i] * cosines[j];
            }
        }
    }
    solve(matrix, right).map(|tap| f64::from(tap as f32))
}

/// The spectra of the cell's own tap and of each pair of taps, at pi k = `x`.
fn cosines(x: f64) -> Taps {
    let first = 2.0 * libm::cos(2.0 * x);
    let mut spectra = [first; HALF + 1];
    let mut last = 2.0;
    for j in 2..=HALF {
        spectra[j] = first * spectra[j - 1] - last;
        last = spectra[j - 1];
    }
    spectra[0] = 1.0;
    spectra
}

/// g^2 / k^4 at pi k = `x`, limited at both ends.
fn weight(x: f64, sigma: f64) -> f64 {
    let (k, gaussian) = (x / std::f64::consts::PI, libm::exp(-2.0 * x * x * sigma * sigma));
    (gaussian * gaussian + LEAST) / ((k * k + 1e-4) * (k * k + 1e-3))
}

/// Samples of the integral.
const SAMPLES: usize = 400;
/// The least weight of high frequencies, so that no tap is arbitrary.
const LEAST: f64 = 1e-7;

/// Solves symmetric positive definite equations by elimination.
fn solve(mut matrix: [[f64; HALF + 1]; HALF + 1], mut right: Taps) -> Taps {
    for i in 0..=HALF {
        for j in i + 1..=HALF {
            let factor = matrix[j][i] / matrix[i][i];
            let pivot = matrix[i];
            matrix[j].iter_mut().zip(pivot).skip(i).for_each(|(to, from)| *to -= factor * from);
            right[j] -= factor * right[i];
        }
    }
    for i in (0..=HALF).rev() {
        let known: f64 = (i + 1..=HALF).map(|k| matrix[i][k] * right[k]).sum();
        right[i] = (right[i] - known) / matrix[i][i];
    }
    right
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn filtered_splines_pass_what_a_gaussian_passes() {
        for (degree, sigma) in [(3, 1.5), (4, 1.5), (5, 1.5), (4, 2.1), (5, 3.0)] {
            let taps = taps(degree, sigma);
            for k in [0.0, 0.02, 0.05, 0.1, 0.2, 0.3] {
                let x = std::f64::consts::PI * k;
                let spline = if k == 0.0 { 1.0 } else { (x.sin() / x).powi(degree as i32 + 1) };
                let filter: f64 = (1..=HALF).map(|j| 2.0 * taps[j] * (2.0 * x * j as f64).cos()).sum::<f64>() + taps[0];
                let gaussian = (-2.0 * x * x * sigma * sigma).exp();
                let off = (filter * spline - 1.0).abs() * gaussian;
                assert!(off < 2e-4, "degree {degree}, sigma {sigma}, k {k}: {off:e}");
            }
        }
    }
}
