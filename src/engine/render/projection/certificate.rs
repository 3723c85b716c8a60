//! Certified pictures: a bound on the error of every pixel.
//!
//! Let w_i be the weights of the uncut kernel and w'_i those that are splatted. The true pictures are I = sum of w_i
//! v_i and g = I / sum of w_i. The rendered ones have w'_i for w_i and v^_i for v_i. Let r_i bound |v^_i - v_i|, W' =
//! sum of w'_i, B = sum of (w_i - w'_i), what lies beyond the cut (eq 15), and let the range V hold every v_i. Then
//!
//! ```text
//! |I^ - I| <= sum of w'_i r_i + B max |V|                                                                 (eq 26)
//! |g^ - g| <= sum of w'_i r_i / W' + B / (W' + B) (max V - min V)
//! ```
//!
//! The first line is the triangle inequality. For the second, g is a mean of two means, of the voxels as cut and of
//! what lies beyond, with weights W' and B; both are within V. Where samples are missing, W' counts the weights that
//! are present. B may count all weights, since B / (W' + B) grows with B.
//!
//! The directory of a file stores the r_i block by block. They are splatted like samples, into error planes. Rounding
//! comes on top: a sum of N terms is off by N units in the last place of the sum of their absolute values, a weight by
//! `weight_rounding`, and the inverse transform by `INVERSE`. A mean is off by the rounding of its emission, and by
//! the rounding of its weights times itself.

use super::weight_sums::PixelWeight;
use crate::render::batches::{FrameBounds, INVERSE};
use crate::render::config::Quantity;
use crate::render::splat::ViewSetup;
use wavesplat_core::base::sample::magnitude;
use wavesplat_core::view::footprint::Method;

/// Computes the error bounds of a view's pixels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Certificate {
    pub(super) quantity: Quantity,
    /// The rounding error of a sum over voxels, as a share of the sum of its absolute terms.
    pub(super) rounding: f64,
}

impl Certificate {
    pub(super) fn new(setup: &ViewSetup, quantity: Quantity) -> Self {
        Self { quantity, rounding: sum_rounding(setup) + INVERSE }
    }

    /// The error bound of a pixel with this `value` (eq 26). `errors` is the sum of w'_i r_i, and `absent` is the sum
    /// of the missing weights.
    pub(super) fn error(&self, frame: &FrameBounds, weight: &PixelWeight, absent: f64, errors: f64, value: f64) -> f32 {
        let errors = errors * (1.0 + self.rounding);
        let bound = match self.quantity {
            Quantity::Emission => self.emission(frame, weight, errors),
            Quantity::Mean => self.mean(frame, weight, absent, errors),
        };
        let stored = (f64::from(value as f32) - value).abs();
        match bound + stored {
            _ if value.is_nan() => f32::NAN,
            error if error.is_nan() => f32::INFINITY, // the numbers overflow
            error => (error as f32).next_up(),        // far more than the few roundings of this formula
        }
    }

    /// The first line of eq 26, and rounding.
    fn emission(&self, frame: &FrameBounds, weight: &PixelWeight, errors: f64) -> f64 {
        errors + weight.beyond * magnitude(frame.range) + self.rounding * weight.sum * frame.absolute_sum
    }

    /// The second line of eq 26, and rounding.
    fn mean(&self, frame: &FrameBounds, weight: &PixelWeight, absent: f64, errors: f64) -> f64 {
        let present = weight.sum - absent; // more than 0, or the pixel is background
        let own = (errors / present).min(frame.error); // a mean of errors
        let span = (frame.range.1 - frame.range.0).max(0.0);
        let cut = weight.beyond / (present + weight.beyond) * span;
        own + cut + 2.0 * self.rounding * (weight.sum / present) * (frame.absolute_sum + magnitude(frame.range))
    }
}

/// The kernel that cuts are compared with; only weights are splatted with it.
pub(super) const WHOLE: Method = Method { name: "whole", radius: 8.0, stated_error: 5.07e-14 };
/// exp(-R^2 / 2) at its cut: an upper bound of the weight of voxels beyond the cut, as a share of the peak.
const BEYOND_WHOLE: f64 = 1.27e-14;

/// Replaces the sums of weights of the whole kernel (`setup`, `whole`) by upper bounds of the weights beyond a cut.
/// `cut` holds the sums of weights of the cut kernel.
pub(super) fn leave_beyond(setup: &ViewSetup, cut: &[f64], whole: &mut [f64]) {
    let rounding = sum_rounding(setup);
    let further = setup.clip.voxels() as f64 * setup.footprint.at_depth(0.0) * BEYOND_WHOLE * (1.0 + rounding);
    let left = |cut: f64, whole: f64| (whole - cut).max(0.0) + 2.0 * rounding * whole + further;
    whole.iter_mut().zip(cut).for_each(|(whole, cut)| *whole = left(*cut, *whole));
}

/// The relative rounding error of a sum of weights.
fn sum_rounding(setup: &ViewSetup) -> f64 {
    weight_rounding(setup) + (setup.clip.voxels() as f64 + 64.0) * f64::EPSILON
}

/// The relative rounding error of one weight: of its position, its depth and its exponentials.
fn weight_rounding(setup: &ViewSetup) -> f64 {
    setup.footprint.rounding(setup.camera.rounding(&setup.grid), setup.camera.depth(&setup.grid))
}
