//! The samples of a block that is being encoded, as a reader decodes them.

use super::field::{Field, LONG_RUN, RUN};
use super::load::Source;
use super::refine::Coded;
use crate::base::sample;
use std::ops::Range;
use wavesplat_format::Basis;

impl Source<'_> {
    /// Calls `visit(index of the first, values)` for the decoded samples of all frames in some ranges of voxels, before they are rounded.
    pub(super) fn for_each_run(
        &self,
        field: &Field<'_>,
        ranges: impl Iterator<Item = Range<usize>> + Clone,
        visit: impl FnMut(usize, &[f64]),
    ) {
        let (codec, voxels, run) = (self.codec, self.voxels(), self.run());
        let frames: Vec<usize> = (0..codec.frames()).collect();
        let of_range = |all: Range<usize>| all.clone().step_by(run).map(move |first| first..all.end.min(first + run));
        let runs = ranges.flat_map(of_range);
        if codec.scheme.basis == Basis::Samples {
            field.for_each_run_of_samples(voxels, &frames, &runs, visit);
        } else {
            field.for_each_run(codec.basis.as_ref(), voxels, &frames, runs, visit);
        }
    }

    /// The most voxels that are decoded together.
    pub(super) fn run(&self) -> usize {
        if self.codec.scheme.basis == Basis::Samples { LONG_RUN } else { RUN }
    }

    /// All samples in their type; those that miss the bound are those of the source.
    pub(super) fn restored(&self, coded: &Coded, field: &Field<'_>) -> Vec<u8> {
        let (mut samples, size) = (self.decoded(field), self.codec.sample.size());
        for (at, bytes) in coded.outliers.positions.iter().zip(coded.outliers.samples.chunks_exact(size)) {
            samples[*at as usize * size..][..size].copy_from_slice(bytes);
        }
        samples
    }

    /// All samples in their type, as coefficients give them.
    pub(super) fn decoded(&self, field: &Field<'_>) -> Vec<u8> {
        let size = self.codec.sample.size();
        let mut decoded = vec![0; self.samples.len() * size];
        self.for_each_run(field, std::iter::once(0..self.voxels()), |first, values| {
            sample::store(self.codec.sample, values, &mut decoded[first * size..][..values.len() * size]);
        });
        decoded
    }
}
