//! Measures the errors of what is computed from the samples of a block, as a reader decodes them.

use super::WindowCodec;
use super::derived::{Computed, DerivedErrors, FramePair};
use super::load::Source;
use crate::base::sample;

/// The most frames of a block that are compared.
const FRAMES_MEASURED: usize = 8;

impl Computed {
    /// The errors in some frames of a block of `size` voxels: the bytes of its samples in the source, and as they are decoded.
    pub fn errors(&self, codec: &WindowCodec, size: [usize; 3], [source, decoded]: [&[u8]; 2]) -> DerivedErrors {
        let each = size.iter().product::<usize>() * codec.sample.size();
        let pair = |frame: usize| {
            let [mut source, mut decoded] =
                [source, decoded].map(|samples| numbers(codec, &samples[frame * each..][..each]));
            for (source, decoded) in source.iter_mut().zip(&mut decoded).filter(|(s, _)| codec.is_missing(**s)) {
                [*source, *decoded] = [f64::NAN; 2];
            }
            [source, decoded]
        };
        let (frames, mut found) = (codec.frames(), DerivedErrors::default());
        for frame in (0..frames).rev().step_by(frames.div_ceil(FRAMES_MEASURED)) {
            let (now, before) = (pair(frame), frame.checked_sub(1).map(pair));
            let before = before.as_ref().map(|[source, decoded]| FramePair { source, decoded });
            found.add_frame(self, size, FramePair { source: &now[0], decoded: &now[1] }, before);
        }
        found
    }

    /// The same of a block in work.
    pub(super) fn errors_in(&self, block: &Source<'_>, decoded: &[u8]) -> DerivedErrors {
        self.errors(block.codec, block.samples.size(), [&block.samples.contiguous(), decoded])
    }
}

fn numbers(codec: &WindowCodec, samples: &[u8]) -> Vec<f64> {
    let mut numbers = vec![0.0; samples.len() / codec.sample.size()];
    sample::load(codec.sample, samples, &mut numbers);
    numbers
}
