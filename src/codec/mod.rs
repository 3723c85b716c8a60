//! One block: samples to a coded block under a bound, and back. Pure functions over slices; no I/O, no threads.
//!
//! [`encode`] transforms, truncates, quantises, decodes again and stores exactly what missed the bound. [`decode`] is
//! the one decoder that the encoder checks with, and that `extract`, `verify` and the renderer use. A scheme beyond a
//! transform along time replaces this folder's use of [`crate::wavelet`] and nothing else.

pub mod decode;
pub mod encode;
mod truncate;
mod weigh;

use crate::bound::{Promise, difference_up};
use crate::sample::{self, SampleType};
use crate::wavelet::{self, LANES, Lane, TimeBasis};
use std::ops::Range;
use wavesplat_format::{Metadata, Window};

/// Everything that coding and decoding the blocks of one window share.
#[derive(Debug)]
pub struct WindowCodec {
    /// The temporal basis.
    pub basis: Box<dyn TimeBasis>,
    /// The basis as numbers: `synthesis[k][t]` is u_k(t).
    pub synthesis: Vec<Vec<f64>>,
    /// The largest sum over k of |u_k(t)|.
    pub gain: f64,
    /// The type of the samples.
    pub sample: SampleType,
    /// What is promised.
    pub promise: Promise,
    /// The sample that stands for "missing" besides NaN and infinities.
    pub missing_value: Option<f64>,
    /// The coefficients in each level part of a block, coarse to fine.
    pub parts: Vec<Range<usize>>,
}

impl WindowCodec {
    /// The codec of a window whose blocks are at most `edge` voxels a side.
    pub fn new(basis: Box<dyn TimeBasis>, sample: SampleType, promise: Promise, edge: usize) -> Self {
        let synthesis = wavelet::synthesis(basis.as_ref());
        let parts = wavelet::ranges(&join_levels(&basis.levels(), edge));
        let gain = wavelet::gain(&synthesis);
        Self { basis, synthesis, gain, sample, promise, missing_value: None, parts }
    }

    /// The codec of a window as a coefficient file describes it; says what contradicts the basis.
    pub fn of_file(file: &Metadata, window: &Window) -> std::result::Result<Self, wavesplat_format::Error> {
        let basis = wavelet::basis(window.basis, window.frames as usize);
        if basis.coefficients() != window.coefficients as usize {
            let what =
                format!("{} coefficients for {} frames of {:?}", window.coefficients, window.frames, window.basis);
            return Err(wavesplat_format::Error::Invalid(what));
        }
        let lengths: Vec<usize> = window.levels.iter().map(|n| *n as usize).collect();
        let promise = Promise { bound: file.bound, tolerance: file.tolerance, delta: window.delta };
        let mut codec = Self::new(basis, file.sample, promise, 1);
        codec.missing_value = file.missing_value;
        codec.parts = wavelet::ranges(&lengths);
        Ok(codec)
    }

    /// Frames of the window.
    pub fn frames(&self) -> usize {
        self.basis.frames()
    }

    /// Whether a sample is missing: not finite, or the declared value.
    pub fn is_missing(&self, value: f64) -> bool {
        sample::is_missing(value, self.missing_value)
    }

    /// The larger error of a decoded value as it is splatted and as it is extracted; rounded up. Infinite if it would be
    /// taken for a missing one.
    pub fn error(&self, splatted: f64, extracted: f64, source: f64) -> f64 {
        let (a, b) = (difference_up(splatted, source), difference_up(extracted, source));
        let lost = a.is_nan() || b.is_nan() || self.is_missing(extracted);
        if lost { f64::INFINITY } else { a.max(b) }
    }
}

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

/// The series of [`LANES`] voxels from their codes: coefficient = code * step, then the inverse transform.
///
/// `codes(k)` are the codes of coefficient k. Encoder and decoder both come through here, so they agree to the bit.
fn reconstruct(
    basis: &dyn TimeBasis,
    step: f64,
    codes: impl Fn(usize) -> [i32; LANES],
    work: &mut [Lane],
    series: &mut [Lane],
) {
    for (k, lane) in work.iter_mut().enumerate() {
        for (c, code) in lane.iter_mut().zip(codes(k)) {
            *c = f64::from(code) * step;
        }
    }
    basis.inverse(work, series);
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
