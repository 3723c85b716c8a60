//! The samples of a block that is being encoded, as a reader decodes them.

use super::derived::{Computed, DerivedErrors, FramePair};
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

    /// How far results that are computed from the block's samples are off; all are exact if it has no coefficients.
    pub(super) fn derived(&self, of: &Computed, coded: Option<(&Coded, &Field<'_>)>) -> DerivedErrors {
        let (source, size, ty) = (self.samples.contiguous(), self.samples.size(), self.codec.sample);
        let decoded = coded.map_or_else(|| source.to_vec(), |(coded, field)| self.restored(coded, field));
        let numbers = |bytes: &[u8], place: usize| {
            let mut numbers = vec![0.0; bytes.len() / ty.size()];
            sample::load(ty, bytes, &mut numbers);
            let missing = numbers.iter_mut().enumerate().filter(|(at, _)| self.missing.has(place + at));
            missing.for_each(|(_, number)| *number = f64::NAN);
            numbers
        };
        let (each, mut found) = (self.voxels() * ty.size(), DerivedErrors::default());
        let pair = |frame: usize| {
            [&source[..], &decoded[..]].map(|samples| numbers(&samples[frame * each..][..each], frame * self.voxels()))
        };
        let frames = self.codec.frames();
        for frame in (0..frames).rev().step_by(frames.div_ceil(FRAMES_MEASURED)) {
            let (now, before) = (pair(frame), frame.checked_sub(1).map(pair));
            let before = before.as_ref().map(|[source, decoded]| FramePair { source, decoded });
            found.add_frame(of, size, FramePair { source: &now[0], decoded: &now[1] }, before);
        }
        found
    }

    /// All samples in their type; those that miss the bound are those of the source.
    fn restored(&self, coded: &Coded, field: &Field<'_>) -> Vec<u8> {
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

/// The most frames of a block in which results are compared.
const FRAMES_MEASURED: usize = 8;
