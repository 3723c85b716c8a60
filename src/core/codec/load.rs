//! Loads the samples of a block, a few series at a time. Finds missing samples and fills them.
//!
//! A block's samples stay bytes. Finding, loading and checking turn a few of them into numbers at a time, which takes less
//! memory than eight bytes for every sample.

use super::WindowCodec;
use super::box_samples::BoxSamples;
use super::error_weights::QuantizerSetup;
use super::group::Group;
use crate::base::sample;
use crate::wavelet::{LANES, Lane};

/// Which samples of a block are missing, and the largest of the others.
pub(super) struct Missing {
    /// For each sample; empty if none is missing.
    mask: Vec<bool>,
    /// The number of samples.
    pub(super) all: usize,
    pub(super) count: u64,
    pub(super) magnitude: f64,
}

impl Missing {
    /// Those of an array.
    pub(super) fn find(codec: &WindowCodec, samples: &[u8]) -> Self {
        let all = samples.len() / codec.sample.size();
        let (mut mask, mut count) = (Vec::new(), 0);
        let (lo, hi) = sample::range_of_present(codec.sample, samples, codec.missing_value, |i| {
            mask.resize(all, false);
            mask[i] = true;
            count += 1;
        });
        Self { mask, all, count, magnitude: 0.0_f64.max(-lo).max(hi) }
    }

    /// The missing samples of a box. `around` describes those of the whole array.
    pub(super) fn within(codec: &WindowCodec, samples: &BoxSamples<'_>, around: &Self) -> Self {
        match around.count {
            0 => {
                let magnitude = if samples.is_whole() { around.magnitude } else { samples.magnitude() };
                Self { mask: Vec::new(), all: samples.len(), count: 0, magnitude }
            }
            _ => Self::find(codec, &samples.contiguous()),
        }
    }

    /// Whether a sample is missing.
    pub(super) fn has(&self, sample: usize) -> bool {
        self.count > 0 && self.mask[sample]
    }

    /// Whether each sample is missing. Empty if none is.
    pub(super) fn mask(&self) -> &[bool] {
        &self.mask
    }

    /// The bytes of the missing samples, in order.
    pub(super) fn samples(&self, samples: &BoxSamples<'_>) -> Vec<u8> {
        let missing = self.mask.iter().enumerate().filter(|(_, missing)| **missing);
        missing.flat_map(|(index, _)| samples.sample(index)).copied().collect()
    }
}

/// The samples of a block, and the codec for them.
#[derive(Clone, Copy)]
pub(super) struct Source<'a> {
    pub(super) codec: &'a WindowCodec,
    pub(super) samples: BoxSamples<'a>,
    pub(super) missing: &'a Missing,
}

impl Source<'_> {
    /// The number of voxels.
    pub(super) fn voxels(&self) -> usize {
        self.samples.voxels()
    }
}

/// Loads the series of a group of voxels. Missing samples are filled with the last present one, else the next, else
/// zero.
pub(super) fn load_group(
    codec: &WindowCodec,
    weighing: &QuantizerSetup,
    samples: &BoxSamples<'_>,
    missing: &Missing,
    first: usize,
    count: usize,
    group: &mut Group,
) {
    let voxels = missing.all / codec.frames();
    samples.load_lanes(first, count, &mut group.source);
    group.common_weight = weighing.common().filter(|_| missing.count == 0 && count == LANES);
    if let Some(weight) = group.common_weight {
        return group.weight.fill([weight; LANES]);
    }
    for (frame, (source, weight)) in group.source.iter().zip(&mut group.weight).enumerate() {
        let (at, weights) = (frame * voxels + first, weighing.weights(source));
        *weight = std::array::from_fn(|l| if l < count && !missing.has(at + l) { weights[l] } else { 0.0 });
    }
    if missing.count > 0 {
        (0..count).for_each(|lane| fill(&mut group.source, &group.weight, lane));
    }
}

/// Loads the samples of `count` of a block's `voxels` voxels, beginning with `first`: one lane for each frame. Unused
/// elements of lanes are zero.
pub fn load_lanes(codec: &WindowCodec, samples: &[u8], first: usize, count: usize, voxels: usize, out: &mut [Lane]) {
    BoxSamples::whole(codec.sample, samples, [voxels, 1, 1]).load_lanes(first, count, out);
}

fn fill(source: &mut [Lane], weight: &[Lane], lane: usize) {
    let present = (0..source.len()).find(|t| weight[*t][lane] > 0.0);
    let mut last = present.map_or(0.0, |t| source[t][lane]);
    for (value, weight) in source.iter_mut().zip(weight) {
        if weight[lane] > 0.0 {
            last = value[lane];
        } else {
            value[lane] = last;
        }
    }
}
