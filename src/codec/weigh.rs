//! How much the errors of a block's samples weigh while its coefficients are chosen, and the step that suits them.
//!
//! The error of each sample is divided by what it is allowed (eq 21-23), so that every bound reads "the measure is at
//! most 1". The step follows from eq 25. Under a relative bound, a step for the smallest samples would be too fine for
//! codes of 32 bits, so it is chosen for all but a few of them.
//!
//! These weights only guide the choice. Rounding to the samples' type comes later, and the decoded samples decide.

use super::WindowCodec;
use crate::base::sample::{self, SampleType};
use crate::codec::bound::{self, Bound, ErrorBound};
use crate::wavelet::{LANES, Lane};

/// The weights of a block's errors, and its step.
#[derive(Debug)]
pub(super) struct QuantizerSetup {
    promise: ErrorBound,
    sample: SampleType,
    /// Smaller samples weigh as this one: those that then miss a relative bound are few, and stored exactly.
    floor: f64,
    /// The weight of every error; none if each has its own.
    common: Option<f64>,
    /// The quantisation step.
    pub(super) step: f64,
}

impl QuantizerSetup {
    /// Of a block whose largest sample is `magnitude`. None if no error is left, so that the block must be stored exactly.
    pub(super) fn of(codec: &WindowCodec, samples: &[u8], magnitude: f64) -> Option<Self> {
        let found = match codec.promise.bound {
            Bound::Relative { floor } => Self::relative(codec, magnitude, floor.max(usual_magnitude(codec, samples))),
            _ => Self::same(codec, magnitude),
        };
        (codec.promise.delta > 0.0 && found.step.is_normal()).then_some(found)
    }

    /// Every sample is allowed the same.
    fn same(codec: &WindowCodec, magnitude: f64) -> Self {
        let error = bound::before_rounding(codec.sample, codec.promise.delta, magnitude);
        let step = codec.promise.step(error.max(0.0), codec.gain);
        Self { promise: codec.promise, sample: codec.sample, floor: 0.0, common: Some(reciprocal(error)), step }
    }

    /// The step is fine enough for all but the smallest samples, as far as codes can be for the largest.
    fn relative(codec: &WindowCodec, magnitude: f64, floor: f64) -> Self {
        let mut found = Self { promise: codec.promise, sample: codec.sample, floor, common: None, step: 1.0 };
        let smallest = found.error(0.0);
        if smallest > 0.0 {
            let finest = magnitude * (codec.basis.coefficients() as f64).sqrt() * FINEST;
            found.step = codec.promise.step(smallest, codec.gain).max(finest);
        } else if magnitude > 0.0 {
            found.step = 0.0; // the type is too coarse for what is allowed
        }
        found // where all samples are 0, any step will do
    }

    /// The weight of every error; none if each has its own.
    pub(super) fn common(&self) -> Option<f64> {
        self.common
    }

    /// The weights of the errors of some samples.
    pub(super) fn weights(&self, samples: &Lane) -> Lane {
        self.common.map_or_else(|| samples.map(|v| reciprocal(self.error(v))), |w| [w; LANES])
    }

    /// The error that a sample under a relative bound should have before it is rounded; 0 or less if none.
    fn error(&self, value: f64) -> f64 {
        let magnitude = value.abs().max(self.floor);
        bound::before_rounding(self.sample, self.promise.tolerance * magnitude, magnitude)
    }
}

/// Share of a coefficient's largest size at which codes of 32 bits still fit, with room for what a basis adds to it.
const FINEST: f64 = 1.0 / (1u64 << 29) as f64;

fn reciprocal(error: f64) -> f64 {
    if error > 0.0 { (1.0 / error).min(f64::MAX) } else { f64::MAX }
}

/// A power of two below which is no more than one in [`MOST_SMALL`] of the samples that are neither 0 nor missing; 0
/// without any such samples.
fn usual_magnitude(codec: &WindowCodec, samples: &[u8]) -> f64 {
    let mut counts = vec![0_usize; EXPONENTS]; // by exponent; of 0 and subnormal numbers together first
    sample::for_each_run(codec.sample, samples, |_, values| {
        for v in values.iter().filter(|v| **v != 0.0 && !codec.is_missing(**v)) {
            counts[(v.abs().to_bits() >> MANTISSA) as usize] += 1;
        }
    });
    let few = counts.iter().sum::<usize>() / MOST_SMALL;
    let mut up_to = 0;
    let more_than_few = |n: &usize| {
        up_to += n;
        up_to > few
    };
    f64::from_bits((counts.iter().position(more_than_few).unwrap_or(0) as u64) << MANTISSA)
}

/// One sample in this many may be too small to choose the step for. Measured: fewer make larger files, and twice as many
/// could miss a relative bound before the block is stored exactly.
const MOST_SMALL: usize = 16;

/// Bits of a number's mantissa, and how many exponents there are.
const MANTISSA: u32 = 52;
const EXPONENTS: usize = 2047;
