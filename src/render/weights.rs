//! The sums of weights, the divisors of weighted means, and the background.
//!
//! ```text
//! g = sum of v_i w_i / sum of w_i                                                                         (eq 12)
//! background: sum of w_i < 1 % of the largest sum in the view                                             (eq 16)
//! ```
//!
//! Both sums of eq 12 are splatted in the same way, so g is a mean even if splatting leaves out weights. Eq 16 uses
//! uncut weights, so that the background does not depend on the splat method. Missing samples have no weight: their
//! weights are subtracted.

use super::splat::{FilteredCells, Ones, ViewSetup};

/// The least share of a pixel's weights that must be present.
const LEAST_PRESENT: f64 = 1e-6;

/// The sums of weights of all voxels of a view.
#[derive(Debug, Default)]
pub(super) struct Weights {
    pub(super) size: [usize; 2],
    /// Sums of weights, splatted in the same way as values, so that the quotient is a mean.
    pub(super) sums: Vec<f64>,
    /// The cells of a lattice that gave `sums`.
    pub(super) cells: Option<FilteredCells>,
    /// Sums of uncut footprints, so that the background is the same for every splat method. If empty, `sums` serves
    /// instead.
    pub(super) reference: Vec<f64>,
    /// Upper bounds of the weights beyond the cut. Empty unless pictures are certified.
    pub(super) beyond: Vec<f64>,
    /// Pixels with a smaller sum are background.
    pub(super) threshold: f64,
}

/// A view with its sums of weights.
#[derive(Debug)]
pub(super) struct WeightedView<'a> {
    pub(super) setup: &'a ViewSetup,
    pub(super) weights: Weights,
}

/// The weights of one pixel.
#[derive(Debug, Clone, Copy)]
pub(super) struct PixelWeight {
    /// W', the sum of weights, splatted in the same way as values.
    pub(super) sum: f64,
    reference: f64,
    /// B, the sum of weights beyond the cut (eq 26).
    pub(super) beyond: f64,
    threshold: f64,
}

impl PixelWeight {
    /// The sum of weights of the samples that are present (eq 12). NaN in the background (eq 16), and if so many
    /// samples are missing that rounding errors would dominate.
    pub(super) fn present(&self, absent: f64) -> f64 {
        let present = self.sum - absent;
        let enough = self.reference - absent >= self.threshold && present > LEAST_PRESENT * self.sum;
        if enough { present } else { f64::NAN }
    }
}

impl Weights {
    /// The image of the value 1 at all voxels, if the backend is a lattice.
    pub(super) fn ones(&self) -> Option<Ones<'_>> {
        self.cells.as_ref().map(|cells| Ones { cells, sums: &self.sums, width: self.size[0] })
    }

    /// The sums of the pixels that are not background.
    pub(super) fn shown(&self) -> impl Iterator<Item = f64> {
        self.sums.iter().copied().filter(|sum| *sum >= self.threshold)
    }

    /// The sum at a point of the picture, or of the nearest pixel for points up to `reach` pixels outside; at least the
    /// background threshold. `None` for other points.
    pub(super) fn near(&self, point: [f64; 2], reach: f64) -> Option<f64> {
        let within = |a: usize| point[a] >= -reach && point[a] < self.size[a] as f64 + reach;
        let pixel = |a: usize| (point[a].max(0.0) as usize).min(self.size[a] - 1);
        let is_visible = within(0) && within(1) && self.threshold > 0.0;
        is_visible.then(|| self.sums[pixel(1) * self.size[0] + pixel(0)].max(self.threshold))
    }

    /// The weights of the pixel in a column and a row.
    pub(super) fn at(&self, [x, y]: [usize; 2]) -> PixelWeight {
        let at = y * self.size[0] + x;
        let sum = self.sums[at];
        let reference = self.reference.get(at).copied().unwrap_or(sum);
        PixelWeight { sum, reference, beyond: self.beyond.get(at).copied().unwrap_or(0.0), threshold: self.threshold }
    }
}
