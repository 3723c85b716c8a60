//! What a file keeps of results that scientists compute, as a limit to the error of each sample.
//!
//! A derivative by differences is a sum of samples times coefficients c_i. Its error is at most E, across the faces of blocks and the
//! ends of windows too, if every sample is within
//!
//! ```text
//! |v^ - v| <= E / sum over i of |c_i|                                                                         (eq 47)
//! ```
//!
//! h_a is the spacing along an axis a of at least three voxels:
//!
//! ```text
//! derivative   by differences                                           sum of |c_i|
//! difference   v(t + 1) - v(t)                                          2
//! gradient     (v(a + 1) - v(a - 1)) / 2 h_a for each a                 max over a of 1 / h_a
//! curl         dw/dy - dv/dz, and the two others                        the sum of the two largest 1 / h_a
//! divergence   du/dx + dv/dy + dw/dz                                    the sum of all 1 / h_a
//! laplacian    sum over a of (v(a - 1) - 2 v + v(a + 1)) / h_a^2        the sum of all 4 / h_a^2
//! ```

use wavesplat_format::{Derivative, DerivativeBound, Keep, RelativeBound};

/// The largest errors that a file allows to single samples besides its bound.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleLimits {
    /// To every sample.
    pub largest: f64,
    /// To samples of some magnitude, as a share.
    pub relative: Option<RelativeBound>,
}

impl SampleLimits {
    /// Those that keep what a file of a grid keeps; `None` if single samples have none. With `sum`, a bound of the mean holds for each
    /// sample: no error exceeds delta.
    pub fn new(keep: &Keep, dims: [usize; 3], spacing: [f64; 3]) -> Option<Self> {
        let largest = keep.derivatives.iter().map(|of| largest_error(*of, dims, spacing)).fold(f64::INFINITY, f64::min);
        keep.limits_samples().then_some(Self { largest, relative: keep.relative })
    }

    /// The share of a sample that its error may be, if one applies to it.
    pub(super) fn share_at(&self, value: f64) -> Option<f64> {
        self.relative.filter(|of| value.abs() >= of.floor).map(|of| of.share)
    }
}

/// The largest error of each sample that keeps a derivative's (eq 47), rounded down; infinite if the grid has too few voxels for it.
fn largest_error(of: DerivativeBound, dims: [usize; 3], spacing: [f64; 3]) -> f64 {
    let mut steps: Vec<f64> = (0..3).filter(|a| dims[*a] >= 3).map(|a| 1.0 / spacing[a]).collect();
    steps.sort_by(|a, b| b.total_cmp(a));
    let sum: f64 = match of.derivative {
        Derivative::Difference => 2.0,
        Derivative::Gradient => steps.first().copied().unwrap_or(0.0),
        Derivative::Curl => steps.iter().take(2).sum(),
        Derivative::Divergence => steps.iter().sum(),
        Derivative::Laplacian => steps.iter().map(|step| 4.0 * step * step).sum(),
    };
    match sum > 0.0 || of.error == 0.0 && !steps.is_empty() {
        true => (of.error / sum * DOWN).max(0.0), // not NaN
        false => f64::INFINITY,
    }
}

/// A factor that covers the rounding of a few operations.
const DOWN: f64 = 1.0 - 16.0 * f64::EPSILON;

#[cfg(test)]
mod tests {
    use super::*;

    /// The coefficients of each component of a derivative.
    fn coefficients(derivative: Derivative, spacing: [f64; 3]) -> Vec<Vec<f64>> {
        let first = |a: usize| vec![-0.5 / spacing[a], 0.5 / spacing[a]];
        let second = |a: usize| [1.0, -2.0, 1.0].map(|c| c / (spacing[a] * spacing[a])).to_vec();
        match derivative {
            Derivative::Difference => vec![vec![1.0, -1.0]],
            Derivative::Gradient => (0..3).map(first).collect(),
            Derivative::Curl => [[1, 2], [2, 0], [0, 1]].map(|axes| axes.map(first).concat()).to_vec(),
            Derivative::Divergence => vec![(0..3).flat_map(first).collect()],
            Derivative::Laplacian => vec![(0..3).flat_map(second).collect()],
        }
    }

    #[test]
    fn the_worst_errors_of_samples_are_the_promised_errors_of_derivatives() {
        let spacings = [[1.0; 3], [0.1, 0.3, 7.0], [1e-3, 2.0, 1.1e-3], [5.0, 1e9, 1e-9]];
        for (derivative, spacing) in
            Derivative::ALL.into_iter().flat_map(|derivative| spacings.map(|s| (derivative, s)))
        {
            let keep = Keep { derivatives: vec![DerivativeBound { derivative, error: 0.7 }], ..Keep::default() };
            let limit = SampleLimits::new(&keep, [9, 3, 4], spacing).expect("a limit").largest;
            let worst = |of: &Vec<f64>| of.iter().map(|c| c.abs() * limit).sum::<f64>();
            let worst = coefficients(derivative, spacing).iter().map(worst).fold(0.0, f64::max);
            assert!(worst <= 0.7 && worst > 0.7 * (1.0 - 1e-14), "{derivative:?} {spacing:?}: {worst}");
        }
    }

    #[test]
    fn axes_without_neighbours_do_not_limit() {
        let keep = Keep::parse("gradient=1 laplacian=1").expect("words");
        assert_eq!(SampleLimits::new(&keep, [2, 1, 2], [1.0; 3]).expect("a limit").largest, f64::INFINITY);
        let limit = SampleLimits::new(&keep, [2, 8, 1], [1e-6, 2.0, 1.0]).expect("a limit").largest;
        assert!((0.999..=1.0).contains(&limit), "{limit}: 4 / 2^2 of the second derivative along y");
        assert_eq!(SampleLimits::new(&Keep::parse("range sign").expect("words"), [8; 3], [1.0; 3]), None);
    }
}
