//! Certified pictures: a bound on the error of every pixel (method.md section 5).
//!
//! With w_i the weights of the uncut kernel and c_i those that are splatted, the true pictures are I = sum w_i v_i and
//! g = I / sum w_i; the rendered ones have c_i for w_i and v^_i for v_i. Let r_i bound |v^_i - v_i|, let C = sum c_i,
//! T = sum (w_i - c_i) be what lies beyond the cut, and V hold |v_i|. Then
//!
//! ```text
//! |I^ - I| <= sum c_i r_i + T max |V|
//! |g^ - g| <= sum c_i r_i / C + T / (C + T) (max V - min V)
//! ```
//!
//! since the mean over the cut and that beyond it are both means of values in V. Rounding comes on top: a sum of N
//! terms is off by N units in the last place of the sum of their absolute values, and a weight by what
//! [`weight_rounding`] says.

use super::scene::FrameErrors;
use super::weights::PixelWeight;
use super::{Eye, Quantity};

/// The rounding of the inverse transform, as a share of the sum of absolute terms: at most ten levels of up to seven
/// products each, whose intermediate sums are at most a few hundred times larger.
const INVERSE: f64 = 1.0 / (1u64 << 36) as f64;

/// The bounds of all pixels of a view.
#[derive(Debug, Clone, Copy)]
pub(super) struct Certificate {
    pub(super) quantity: Quantity,
    /// How far rounding moves a sum over voxels, as a share of the sum of its absolute terms.
    pub(super) rounding: f64,
}

impl Certificate {
    pub(super) fn new(eye: &Eye, quantity: Quantity) -> Self {
        Self { quantity, rounding: sum_rounding(eye) + INVERSE }
    }

    /// The error of a pixel that holds `value`: `errors` is sum c_i r_i, `absent` the weights that are missing.
    pub(super) fn error(&self, frame: &FrameErrors, weight: &PixelWeight, absent: f64, errors: f64, value: f64) -> f32 {
        let errors = errors * (1.0 + self.rounding);
        let bound = match self.quantity {
            Quantity::Emission => self.emission(frame, weight, errors),
            Quantity::Mean => self.mean(frame, weight, absent, errors),
        };
        let stored = (f64::from(value as f32) - value).abs();
        // Up by a unit of a single, so by far more than the few roundings of this formula.
        if bound.is_nan() || value.is_nan() { f32::NAN } else { ((bound + stored) as f32).next_up() }
    }

    fn emission(&self, frame: &FrameErrors, weight: &PixelWeight, errors: f64) -> f64 {
        errors + weight.beyond * magnitude(frame.range) + self.rounding * weight.sum * frame.terms
    }

    fn mean(&self, frame: &FrameErrors, weight: &PixelWeight, absent: f64, errors: f64) -> f64 {
        let present = weight.sum - absent;
        let own = (errors / present).min(frame.largest); // a mean of errors
        let span = (frame.range.1 - frame.range.0).max(0.0);
        let cut = weight.beyond / (present + weight.beyond) * span;
        own + cut + 2.0 * self.rounding * (weight.sum / present) * (frame.terms + magnitude(frame.range))
    }
}

/// How far rounding moves a sum of weights, as a share of it.
pub(super) fn sum_rounding(eye: &Eye) -> f64 {
    weight_rounding(eye) + (eye.clip.voxels() as f64 + 64.0) * f64::EPSILON
}

/// How far rounding moves a single weight, as a share of it: in the position, the depth and the exponentials.
fn weight_rounding(eye: &Eye) -> f64 {
    eye.footprint.rounding(eye.camera.rounding(&eye.grid), eye.camera.depth(&eye.grid))
}

/// The largest absolute value in a range; 0 if it is empty.
pub(super) fn magnitude((lo, hi): (f64, f64)) -> f64 {
    if lo <= hi { (-lo).max(hi) } else { 0.0 }
}
