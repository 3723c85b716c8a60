//! The sums of weights, the divisors of weighted means, and the background.
//!
//! ```text
//! g = sum of v_i w_i / sum of w_i                                                                         (eq 12)
//! background: sum of w_i < 1 % of the largest sum in the view                                             (eq 16)
//! ```
//!
//! Both sums of eq 12 are splatted in the same way, so g is a mean even if splatting leaves out weights. Eq 16 uses
//! uncut weights, except for a quick look, so that the background does not depend on the splat method. Missing samples have no weight: their
//! weights are subtracted.

use crate::render::batches::ViewWeights;
use crate::render::config::{BACKGROUND, Quantity, RenderConfig};
use crate::render::splat::reference_weights::ReferenceWeights;
use crate::render::splat::{FilteredCells, Ones, ViewSetup};
use rayon::prelude::*;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Region;
use wavesplat_core::view::footprint::Method;

/// The least share of a pixel's weights that must be present.
const LEAST_PRESENT: f64 = 1e-6;

/// The sums of weights of all voxels of a view.
#[derive(Debug)]
pub(in crate::render) struct WeightSums<'a> {
    pub(super) setup: &'a ViewSetup,
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

impl<'a> WeightSums<'a> {
    /// Sums without a background.
    pub(in crate::render) fn new(setup: &'a ViewSetup, sums: Vec<f64>, cells: Option<FilteredCells>) -> Self {
        Self { setup, sums, cells, reference: Vec::new(), beyond: Vec::new(), threshold: 0.0 }
    }

    /// The same with the background of a view of the voxels in `boxes`.
    ///
    /// # Errors
    /// A kernel whose weights are no numbers.
    pub(in crate::render) fn with_background(mut self, config: &RenderConfig, boxes: &[Region]) -> Result<Self> {
        let setup = self.setup;
        self.threshold = BACKGROUND * self.sums.iter().copied().fold(0.0, f64::max);
        if config.quantity == Quantity::Mean && setup.method != Method::EXACT {
            let reference = |clip: &Region| ReferenceWeights::new(&setup.camera, &setup.grid, *clip, config.kernel);
            let boxes = boxes.iter().map(reference).collect::<Result<Vec<_>>>()?;
            let uncut = |pixel: [usize; 2]| boxes.iter().map(|voxels| voxels.at(pixel)).sum();
            // The error of a quick look is an estimate for samples of any kind; weights vary less.
            let near =
                if setup.is_quick_look(config) { 0.0 } else { setup.stated_error * reference(&setup.clip)?.most() };
            self.judge_background(&uncut, near);
        }
        Ok(self)
    }

    /// Makes the background the same for every splat method: replaces sums by uncut sums wherever the difference may decide
    /// whether a pixel is background.
    ///
    /// The error of a sum is at most `near`. So this computes the largest sum of the view again, without a cut, and then all
    /// sums near the threshold that follows from it. `uncut` gives the sum of a pixel without a cut.
    fn judge_background(&mut self, uncut: &(dyn Fn([usize; 2]) -> f64 + Sync), near: f64) {
        let width = self.setup.camera.size[0];
        let pixel = |at: usize| [at % width, at / width];
        let brighter = |best: usize, at: usize| if self.sums[at] > self.sums[best] { at } else { best };
        let largest = uncut(pixel((0..self.sums.len()).fold(0, brighter)));
        let threshold = BACKGROUND * largest;
        let mut sums = self.sums.clone();
        sums.par_iter_mut().enumerate().for_each(|(at, sum)| {
            if (*sum - threshold).abs() <= near {
                *sum = uncut(pixel(at));
            }
        });
        (self.threshold, self.reference) = (threshold, sums);
    }

    /// The image of the value 1 at all voxels, if the backend is a lattice.
    pub(super) fn ones(&self) -> Option<Ones<'_>> {
        self.cells.as_ref().map(|cells| Ones { cells, sums: &self.sums, width: self.setup.camera.size[0] })
    }

    /// What expected errors depend on.
    pub(super) fn view(&self) -> ViewWeights<'_> {
        let ViewSetup { camera, footprint, grid, clip, .. } = self.setup;
        ViewWeights { camera, footprint, grid, clip: *clip, sums: &self.sums, threshold: self.threshold }
    }

    /// The weights of the pixel in a column and a row.
    pub(super) fn at(&self, [x, y]: [usize; 2]) -> PixelWeight {
        let at = y * self.setup.camera.size[0] + x;
        let sum = self.sums[at];
        let reference = self.reference.get(at).copied().unwrap_or(sum);
        PixelWeight { sum, reference, beyond: self.beyond.get(at).copied().unwrap_or(0.0), threshold: self.threshold }
    }
}
