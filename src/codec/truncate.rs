//! Which coefficients to keep (method.md section 4): the smallest are dropped for as long as the promise holds.

use super::WindowCodec;
use crate::bound::Measure;
use crate::wavelet::{LANES, Lane};

/// The coefficients of [`LANES`] voxels while they are coded; reused from group to group.
#[derive(Debug)]
pub(super) struct Group {
    /// The samples, missing ones filled; `frames` lanes.
    pub(super) source: Vec<Lane>,
    /// What a sample's error is multiplied by, 0 where it is missing; `frames` lanes.
    pub(super) weight: Vec<Lane>,
    /// K lanes.
    pub(super) coefficients: Vec<Lane>,
    /// Quantised coefficients; those below their voxel's entry in `dropped` are not kept. K lanes.
    codes: Vec<[i32; LANES]>,
    /// The place of each coefficient in its voxel's order of dropping; K lanes.
    rank: Vec<[u16; LANES]>,
    dropped: [u16; LANES],
    /// Scratch: sizes of one voxel's coefficients, and their numbers in the low bits.
    order: Vec<u64>,
    /// What the decoder makes of the kept codes; `frames` lanes.
    pub(super) decoded: Vec<Lane>,
    work: Vec<Lane>,
}

impl Group {
    pub(super) fn new(codec: &WindowCodec) -> Self {
        let (frames, k) = (codec.frames(), codec.basis.coefficients());
        Self {
            source: vec![Lane::default(); frames],
            weight: vec![Lane::default(); frames],
            coefficients: vec![Lane::default(); k],
            codes: vec![[0; LANES]; k],
            rank: vec![[0; LANES]; k],
            dropped: [0; LANES],
            order: Vec::with_capacity(k),
            decoded: vec![Lane::default(); frames],
            work: vec![Lane::default(); k],
        }
    }

    /// Transforms and quantises the source. False if a code does not fit, so that the block must be stored exactly.
    pub(super) fn quantise(&mut self, codec: &WindowCodec, step: f64) -> bool {
        codec.basis.forward(&self.source, &mut self.coefficients);
        let mut fits = true;
        for (codes, coefficients) in self.codes.iter_mut().zip(&self.coefficients) {
            for (code, c) in codes.iter_mut().zip(coefficients) {
                let q = nearest(c / step);
                // False for NaN, too, and for what the decoder would find infinite.
                fits &= q.abs() < f64::from(i32::MAX) && (q * step).abs() < f64::INFINITY;
                *code = q as i32;
            }
        }
        fits
    }

    /// The codes of coefficient k that are kept.
    pub(super) fn kept(&self, k: usize) -> [i32; LANES] {
        kept(&self.codes[k], &self.rank[k], &self.dropped)
    }

    /// Drops as many of the smallest coefficients as the weighed errors allow, and decodes the rest into `decoded`.
    pub(super) fn truncate(&mut self, codec: &WindowCodec, step: f64) {
        let counts = self.order();
        let mut holds = [0; LANES]; // so many can be dropped, or none can
        let mut fails = counts.map(|n| n + 1);
        self.dropped = counts; // a series within the bound of zero keeps none
        loop {
            self.reconstruct(codec, step);
            let errors = self.errors(codec.promise.measure());
            for l in 0..LANES {
                let end = if errors[l] <= 1.0 { &mut holds[l] } else { &mut fails[l] };
                *end = self.dropped[l];
            }
            let open = |l: usize| fails[l] > holds[l] + 1;
            if !(0..LANES).any(open) {
                break;
            }
            self.dropped = std::array::from_fn(|l| if open(l) { (holds[l] + fails[l]) / 2 } else { holds[l] });
        }
        if self.dropped != holds {
            self.dropped = holds;
            self.reconstruct(codec, step);
        }
    }

    /// Ranks the coefficients of each lane by size, the finer first where equal; returns how many are not zero.
    fn order(&mut self) -> [u16; LANES] {
        std::array::from_fn(|l| {
            self.order.clear();
            for (k, _) in self.codes.iter().enumerate().filter(|(_, codes)| codes[l] != 0) {
                // The bits of positive numbers are ordered as the numbers are; the lowest make room for k.
                let size = self.coefficients[k][l].abs().to_bits() & !u64::from(u16::MAX);
                self.order.push(size | u64::from(u16::MAX - k as u16));
            }
            self.order.sort_unstable();
            for (rank, key) in self.order.iter().enumerate() {
                self.rank[usize::from(u16::MAX - *key as u16)][l] = rank as u16;
            }
            self.order.len() as u16
        })
    }

    fn reconstruct(&mut self, codec: &WindowCodec, step: f64) {
        for (k, c) in self.work.iter_mut().enumerate() {
            *c = kept(&self.codes[k], &self.rank[k], &self.dropped).map(|code| f64::from(code) * step);
        }
        codec.basis.inverse(&mut self.work, &mut self.decoded);
    }

    /// The weighed error of each lane: the largest over the frames, or the root of the mean square.
    fn errors(&self, measure: Measure) -> Lane {
        match measure {
            Measure::Largest => self.fold_errors(f64::max),
            Measure::RootMeanSquare => {
                let frames = self.source.len() as f64;
                self.fold_errors(|sum, e| sum + e * e).map(|sum| (sum / frames).sqrt())
            }
        }
    }

    fn fold_errors(&self, add: impl Fn(f64, f64) -> f64) -> Lane {
        let mut out = Lane::default();
        for ((decoded, source), weight) in self.decoded.iter().zip(&self.source).zip(&self.weight) {
            for l in 0..LANES {
                out[l] = add(out[l], (decoded[l] - source[l]).abs() * weight[l]);
            }
        }
        out
    }
}

/// The codes of one coefficient, zero where the lane drops it.
fn kept(codes: &[i32; LANES], rank: &[u16; LANES], dropped: &[u16; LANES]) -> [i32; LANES] {
    std::array::from_fn(|l| if rank[l] >= dropped[l] { codes[l] } else { 0 })
}

/// The nearest whole number, for what fits a code. Adding and taking away 1.5 x 2^52 leaves no bits for a fraction.
fn nearest(x: f64) -> f64 {
    const BIG: f64 = 6_755_399_441_055_744.0;
    (x + BIG) - BIG
}
