//! One block: samples to a coded block under a bound, and back. Pure functions over slices; no I/O, no threads.
//!
//! [`encode`] transforms, truncates, quantises, decodes again and stores exactly what missed the bound. [`decode`] is
//! the one decoder that the encoder checks with, and that `extract`, `verify` and the renderer use. A scheme beyond a
//! transform along time replaces this folder's use of [`crate::wavelet`] and nothing else.

pub(crate) mod bound;
pub(crate) mod buffer;
mod check;
pub(crate) mod decode;
pub(crate) mod encode;
pub(crate) mod field;
mod gain;
mod load;
pub(crate) mod pyramid;
pub(crate) mod real;
mod refine;
mod rows;
pub(crate) mod scheme;
pub(crate) mod trial;
mod truncate;
mod weigh;

use crate::base::sample::{self, SampleType};
use crate::codec::bound::{ErrorBound, difference_up};
use crate::wavelet::{self, LANES, TimeBasis};
use pyramid::PredictionPasses;
use scheme::Scheme;
use std::ops::Range;
use wavesplat_format::{Metadata, Pyramid, Window};

/// Everything that coding and decoding the blocks of one window share.
#[derive(Debug)]
pub struct WindowCodec {
    /// How blocks are coded.
    pub scheme: Scheme,
    /// The temporal basis.
    pub basis: Box<dyn TimeBasis>,
    /// The basis as numbers: `synthesis[k][t]` is u_k(t).
    pub synthesis: Vec<Vec<f64>>,
    /// The largest sum over k of |u_k(t)| (eq 25).
    pub gain: f64,
    /// The type of the samples.
    pub sample: SampleType,
    /// What is promised.
    pub promise: ErrorBound,
    /// The sample that stands for "missing" besides NaN and infinities.
    pub missing_value: Option<f64>,
    /// Without a pyramid: the coefficients in each level part of a block, coarse to fine.
    pub levels: Vec<Range<usize>>,
}

impl WindowCodec {
    /// The codec of a window of `frames` frames whose blocks are at most `edge` voxels a side.
    pub fn new(scheme: Scheme, frames: usize, sample: SampleType, promise: ErrorBound, edge: usize) -> Self {
        let basis = scheme.time_basis(frames);
        let levels = if scheme.pyramid.is_some() { Vec::new() } else { join_levels(&basis.levels(), edge) };
        Self::with_levels(scheme, basis, sample, promise, &levels)
    }

    fn with_levels(
        scheme: Scheme,
        basis: Box<dyn TimeBasis>,
        sample: SampleType,
        promise: ErrorBound,
        levels: &[usize],
    ) -> Self {
        let synthesis = wavelet::synthesis(basis.as_ref());
        let gain = wavelet::gain(&synthesis);
        let levels = wavelet::ranges(levels);
        Self { scheme, basis, synthesis, gain, sample, promise, missing_value: None, levels }
    }

    /// The codec of a window as a coefficient file describes it; says what contradicts the basis.
    pub fn of_file(file: &Metadata, window: &Window) -> std::result::Result<Self, wavesplat_format::Error> {
        let scheme = Scheme::of_window(window);
        let basis = scheme.time_basis(window.frames as usize);
        if basis.coefficients() != window.coefficients as usize {
            let what =
                format!("{} coefficients for {} frames of {:?}", window.coefficients, window.frames, window.basis);
            return Err(wavesplat_format::Error::Invalid(what));
        }
        let levels: Vec<usize> = window.levels.iter().map(|n| *n as usize).collect();
        let promise = ErrorBound { bound: file.bound, tolerance: file.tolerance, delta: window.delta };
        let codec = Self::with_levels(scheme, basis, file.sample, promise, &levels);
        Ok(Self { missing_value: file.missing_value, ..codec })
    }

    /// The number of level parts that a block can have.
    pub(crate) fn parts(&self) -> usize {
        if self.scheme.pyramid.is_some() { usize::from(Pyramid::PARTS) } else { self.levels.len() }
    }

    /// Whether a level part says anything about the coefficients that `wanted` marks.
    pub(crate) fn needs_part(&self, part: usize, wanted: &[bool]) -> bool {
        match &self.scheme.pyramid {
            None => wanted[self.levels[part].clone()].contains(&true),
            // Along time, the last pass adds the odd frames alone.
            Some(_) if part == ODD_FRAMES => wanted.iter().skip(1).step_by(2).any(|w| *w),
            Some(_) => true,
        }
    }

    /// Nodes of a block of `size` voxels along x, y, z and k.
    pub(crate) fn shape(&self, [x, y, z]: [usize; 3]) -> [usize; 4] {
        [x, y, z, self.basis.coefficients()]
    }

    /// The codes of each level part of a block of `size` voxels.
    fn part_ranges(&self, size: [usize; 3]) -> Vec<Range<usize>> {
        let voxels: usize = size.iter().product();
        match &self.scheme.pyramid {
            Some(pyramid) => wavelet::ranges(&PredictionPasses::new(pyramid, self.shape(size)).part_lengths()),
            None => self.levels.iter().map(|k| k.start * voxels..k.end * voxels).collect(),
        }
    }

    /// Frames of the window.
    pub fn frames(&self) -> usize {
        self.basis.frames()
    }

    /// Whether a sample is missing: not finite, or the declared value.
    pub(crate) fn is_missing(&self, value: f64) -> bool {
        sample::is_missing(value, self.missing_value)
    }

    /// The larger error of a decoded value as it is splatted and as it is extracted; rounded up. Infinite if it would be
    /// taken for a missing one.
    pub(crate) fn error(&self, splatted: f64, extracted: f64, source: f64) -> f64 {
        let (a, b) = (difference_up(splatted, source), difference_up(extracted, source));
        let lost = a.is_nan() || b.is_nan() || self.is_missing(extracted);
        if lost { f64::INFINITY } else { a.max(b) }
    }
}

/// The level part of a pyramid that holds the last pass along time.
const ODD_FRAMES: usize = Pyramid::PARTS as usize - 1;

/// Joins the small coarse levels, so that a part of a whole block holds at least this many coefficients.
const PART_COEFFICIENTS: usize = 1 << 17;

fn join_levels(levels: &[usize], edge: usize) -> Vec<usize> {
    let mut parts = Vec::new();
    let mut open = 0;
    for level in levels {
        open += level;
        if open * edge * edge * edge >= PART_COEFFICIENTS {
            parts.push(std::mem::take(&mut open));
        }
    }
    match parts.last_mut() {
        Some(last) if open > 0 => *last += open,
        None => parts.push(open),
        _ => {}
    }
    parts
}

/// Voxels in groups of [`LANES`]: (first voxel, number in the group).
fn lane_groups(voxels: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..voxels).step_by(LANES).map(move |first| (first, LANES.min(voxels - first)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_levels_are_joined() {
        assert_eq!(join_levels(&[1, 1, 2, 4, 8, 16], 32), [4, 4, 8, 16]);
        assert_eq!(join_levels(&[1, 1, 2, 4, 8, 16], 4), [32]);
        assert_eq!(join_levels(&[1], 64), [1]);
    }
}
