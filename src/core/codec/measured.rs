//! Measures the errors of what is computed from the samples of a block, as a reader decodes them.

use super::derived::{Computed, DerivedErrors, FramePair};
use super::load::Source;
use crate::base::sample;

/// The most frames of a block that are compared.
const FRAMES_MEASURED: usize = 8;

impl Computed {
    /// The errors in some frames of a block with these decoded samples.
    pub(super) fn errors_in(&self, block: &Source<'_>, decoded: &[u8]) -> DerivedErrors {
        let source = block.samples.contiguous();
        let each = block.voxels() * block.codec.sample.size();
        let pair = |frame: usize| {
            [&source[..], decoded].map(|samples| numbers(block, &samples[frame * each..][..each], frame))
        };
        let (frames, mut found) = (block.codec.frames(), DerivedErrors::default());
        for frame in (0..frames).rev().step_by(frames.div_ceil(FRAMES_MEASURED)) {
            let (now, before) = (pair(frame), frame.checked_sub(1).map(pair));
            let before = before.as_ref().map(|[source, decoded]| FramePair { source, decoded });
            found.add_frame(self, block.samples.size(), FramePair { source: &now[0], decoded: &now[1] }, before);
        }
        found
    }
}

/// The samples of a frame as numbers; missing ones are NaN.
fn numbers(block: &Source<'_>, samples: &[u8], frame: usize) -> Vec<f64> {
    let (ty, first) = (block.codec.sample, frame * block.voxels());
    let mut numbers = vec![0.0; samples.len() / ty.size()];
    sample::load(ty, samples, &mut numbers);
    let missing = numbers.iter_mut().enumerate().filter(|(at, _)| block.missing.has(first + at));
    missing.for_each(|(_, number)| *number = f64::NAN);
    numbers
}
