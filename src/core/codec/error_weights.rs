//! Error weights and the quantisation step of a block.
//!
//! The error of each sample is divided by its allowed error (eq 21-23), so every bound reads "the measure is at most
//! 1". Eq 25 gives the step. Under a relative bound, a step fine enough for the smallest samples would need codes of
//! more than 32 bits. So the step suits all but a few of the samples.
//!
//! These weights only guide the choice of coefficients. Rounding to the sample type comes later, and the decoded
//! samples decide.

use super::WindowCodec;
use super::box_samples::BoxSamples;
use crate::base::sample::SampleType;
use crate::codec::bound::{self, ErrorBound};
use crate::wavelet::{LANES, Lane};

/// The error weights and the quantisation step of a block.
#[derive(Debug)]
pub(super) struct QuantizerSetup {
    bound: ErrorBound,
    sample: SampleType,
    /// Samples below this magnitude get its weight. Few of them then miss a relative bound, and those are stored
    /// exactly.
    floor: f64,
    /// The weight that all errors share; none if each error has its own.
    common: Option<f64>,
    /// The quantisation step.
    pub(super) step: f64,
}

impl QuantizerSetup {
    /// The setup for a block whose largest sample is `magnitude`. None if no error is allowed, so that the block must
    /// be stored exactly.
    pub(super) fn new(codec: &WindowCodec, samples: &BoxSamples<'_>, magnitude: f64) -> Option<Self> {
        let found = if codec.bound.is_varying() {
            let least = codec.bound.floor().max(usual_magnitude(codec, samples));
            Self::varying(codec, magnitude, least.min(magnitude))
        } else {
            Self::same(codec, magnitude)
        };
        (codec.bound.delta > 0.0 && found.step.is_normal()).then_some(found)
    }

    /// The setup for an error bound that is the same for all samples.
    fn same(codec: &WindowCodec, magnitude: f64) -> Self {
        let error = bound::before_rounding(codec.sample, codec.bound.delta, magnitude);
        let step = codec.bound.step(error.max(0.0), codec.gain);
        Self { bound: codec.bound, sample: codec.sample, floor: 0.0, common: Some(reciprocal(error)), step }
    }

    /// The setup for a bound that varies with the samples. The step suits all but the smallest samples, if 32-bit codes of the
    /// largest permit.
    fn varying(codec: &WindowCodec, magnitude: f64, floor: f64) -> Self {
        let mut found = Self { bound: codec.bound, sample: codec.sample, floor, common: None, step: 1.0 };
        let smallest = found.error(0.0);
        if smallest > 0.0 {
            let finest = magnitude * (codec.basis.coefficients() as f64).sqrt() * FINEST;
            found.step = codec.bound.step(smallest, codec.gain).max(finest);
        } else if magnitude > 0.0 {
            found.step = 0.0; // the sample type is too coarse for the bound
        }
        found // if all samples are 0, any step suits
    }

    /// The weight that all errors share; none if each error has its own.
    pub(super) fn common(&self) -> Option<f64> {
        self.common
    }

    /// The error weights of some samples.
    pub(super) fn weights(&self, samples: &Lane) -> Lane {
        self.common.map_or_else(|| samples.map(|v| reciprocal(self.error(v))), |w| [w; LANES])
    }

    /// The error allowed to a sample under a bound that varies before rounding to the sample type; 0 or less if none.
    fn error(&self, value: f64) -> f64 {
        let magnitude = value.abs().max(self.floor);
        bound::before_rounding(self.sample, self.bound.allowed(magnitude), magnitude)
    }
}

/// The smallest step relative to the largest coefficient that keeps codes within 32 bits, with a margin for the gain of
/// a basis.
const FINEST: f64 = 1.0 / (1u64 << 29) as f64;

fn reciprocal(error: f64) -> f64 {
    if error > 0.0 { (1.0 / error).min(f64::MAX) } else { f64::MAX }
}

/// A power of two: at most one in [`MOST_SMALL`] of the samples that are neither 0 nor missing is smaller. 0 if there
/// are no such samples.
fn usual_magnitude(codec: &WindowCodec, samples: &BoxSamples<'_>) -> f64 {
    let mut counts = vec![0_usize; EXPONENTS]; // by exponent; the first counts 0 and subnormal numbers
    samples.for_each_run(|_, values| {
        for v in values.iter().filter(|v| **v != 0.0 && !codec.is_missing(**v)) {
            counts[(v.abs().to_bits() >> MANTISSA) as usize] += 1;
        }
    });
    let limit = counts.iter().sum::<usize>() / MOST_SMALL;
    let mut up_to = 0;
    let above_limit = |n: &usize| {
        up_to += n;
        up_to > limit
    };
    f64::from_bits((counts.iter().position(above_limit).unwrap_or(0) as u64) << MANTISSA)
}

/// The step may ignore one sample in this many as too small. Measured: ignoring fewer makes files larger; ignoring
/// twice as many may let so many samples miss a relative bound that the block is stored exactly.
const MOST_SMALL: usize = 16;

/// The number of mantissa bits, and of exponents, of an `f64`.
const MANTISSA: u32 = 52;
const EXPONENTS: usize = 2047;
