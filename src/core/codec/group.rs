//! A few series while they are coded.

use super::WindowCodec;
use crate::base::vectors::dispatch;
use crate::codec::bound::Measure;
use crate::wavelet::{LANES, Lane};

/// The samples and coefficients of [`LANES`] voxels; reused from group to group.
#[derive(Debug)]
pub(super) struct Group {
    /// The samples, missing ones filled; `frames` lanes.
    pub(super) source: Vec<Lane>,
    /// The weight of each sample's error, 0 if the sample is missing; `frames` lanes.
    pub(super) weight: Vec<Lane>,
    /// The weight that all samples share; none if their weights differ, samples are missing or lanes are unused.
    pub(super) common_weight: Option<f64>,
    /// The coefficients before quantisation; K lanes.
    pub(super) coefficients: Vec<Lane>,
    /// The quantised coefficients, 0 if dropped; K lanes.
    pub(super) codes: Vec<[i32; LANES]>,
    /// The series decoded from the codes; `frames` lanes.
    pub(super) decoded: Vec<Lane>,
    work: Vec<Lane>,
}

impl Group {
    pub(super) fn new(codec: &WindowCodec) -> Self {
        let (frames, k) = (codec.frames(), codec.basis.coefficients());
        Self {
            source: vec![Lane::default(); frames],
            weight: vec![Lane::default(); frames],
            common_weight: None,
            coefficients: vec![Lane::default(); k],
            codes: vec![[0; LANES]; k],
            decoded: vec![Lane::default(); frames],
            work: vec![Lane::default(); k],
        }
    }

    /// Transforms the source (eq 5).
    pub(super) fn transform(&mut self, codec: &WindowCodec) {
        codec.basis.forward(&self.source, &mut self.coefficients);
    }

    /// Decodes the codes.
    pub(super) fn decode(&mut self, codec: &WindowCodec, step: f64) {
        dispatch!(dequantise(&self.codes[..], step, &mut self.work[..]));
        codec.basis.inverse(&mut self.work, &mut self.decoded);
    }

    /// Makes all codes of the marked lanes, and their decoded samples, zero.
    pub(super) fn clear(&mut self, marked: [bool; LANES]) {
        dispatch!(clear(&mut self.codes[..], &mut self.decoded[..], marked));
    }

    /// Which series are within their bound of zero.
    pub(super) fn is_small(&self, measure: Measure) -> [bool; LANES] {
        let weighted = dispatch!(sizes(&self.source[..], &self.weight[..]));
        match measure {
            Measure::Largest => weighted.largest.map(|largest| largest <= 1.0),
            Measure::RootMeanSquare => std::array::from_fn(|l| weighted.squares[l] <= self.present(l)),
        }
    }

    /// The largest weight of each lane.
    pub(super) fn largest_weights(&self) -> Lane {
        std::array::from_fn(|l| self.weight.iter().fold(0.0, |most: f64, weight| most.max(weight[l])))
    }

    /// How many samples of a lane are not missing.
    pub(super) fn present(&self, lane: usize) -> f64 {
        self.weight.iter().filter(|weight| weight[lane] > 0.0).count() as f64
    }
}

/// Decodes coefficients.
#[inline(always)]
fn dequantise(codes: &[[i32; LANES]], step: f64, out: &mut [Lane]) {
    for (out, codes) in out.iter_mut().zip(codes) {
        for l in 0..LANES {
            out[l] = f64::from(codes[l]) * step;
        }
    }
}

#[inline(always)]
fn clear(codes: &mut [[i32; LANES]], decoded: &mut [Lane], marked: [bool; LANES]) {
    for codes in codes {
        for l in 0..LANES {
            codes[l] = if marked[l] { 0 } else { codes[l] };
        }
    }
    for decoded in decoded {
        for l in 0..LANES {
            decoded[l] = if marked[l] { 0.0 } else { decoded[l] };
        }
    }
}

/// The weighted samples of each lane.
struct Sizes {
    largest: Lane,
    squares: Lane,
}

#[inline(always)]
fn sizes(source: &[Lane], weight: &[Lane]) -> Sizes {
    let mut sizes = Sizes { largest: Lane::default(), squares: Lane::default() };
    for (source, weight) in source.iter().zip(weight) {
        for l in 0..LANES {
            let size = source[l].abs() * weight[l];
            sizes.largest[l] = if size > sizes.largest[l] { size } else { sizes.largest[l] };
            sizes.squares[l] += size * size;
        }
    }
    sizes
}
