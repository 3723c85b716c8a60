//! Which coefficients to keep (method.md section 4): the smallest are dropped for as long as the promise holds.

use super::{WindowCodec, reconstruct};
use crate::bound::Bound;
use crate::wavelet::{LANES, Lane};

/// The coefficients of [`LANES`] voxels while they are coded; reused from group to group.
#[derive(Debug)]
pub(super) struct Group {
    /// The samples, missing ones filled; `frames` lanes.
    pub(super) source: Vec<Lane>,
    /// 1 where a sample's error counts, 0 where it is missing; `frames` lanes.
    pub(super) weight: Vec<Lane>,
    /// K lanes.
    pub(super) coefficients: Vec<Lane>,
    /// Quantised coefficients; those below their voxel's entry in `dropped` are not kept. K lanes.
    codes: Vec<[i32; LANES]>,
    /// The place of each coefficient in its voxel's order of dropping; K lanes.
    rank: Vec<[u16; LANES]>,
    dropped: [u16; LANES],
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
                let q = (c / step).round();
                fits &= q.abs() < f64::from(i32::MAX); // false for NaN too
                *code = q as i32;
            }
        }
        fits
    }

    /// The code that is kept of coefficient k of a lane.
    pub(super) fn code(&self, k: usize, lane: usize) -> i32 {
        kept(&self.codes, &self.rank, &self.dropped, k, lane)
    }

    /// Drops as many of the smallest coefficients as the error allows, and decodes the rest into `decoded`.
    pub(super) fn truncate(&mut self, codec: &WindowCodec, step: f64, error: f64) {
        let counts = self.order();
        let mut holds = [0; LANES]; // so many can be dropped, or none can
        let mut fails = counts.map(|n| n + 1);
        self.dropped = counts; // a series within the bound of zero keeps none
        loop {
            self.reconstruct(codec, step);
            let errors = self.errors(codec.bound);
            for l in 0..LANES {
                let end = if errors[l] <= error { &mut holds[l] } else { &mut fails[l] };
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

    /// Ranks the coefficients of each lane by size, those that are zero already first; returns how many are not zero.
    fn order(&mut self) -> [u16; LANES] {
        std::array::from_fn(|l| {
            let mut order: Vec<u16> =
                (0..self.codes.len() as u16).filter(|k| self.codes[*k as usize][l] != 0).collect();
            let size = |k: &u16| self.coefficients[*k as usize][l].abs();
            order.sort_unstable_by(|i, j| size(i).total_cmp(&size(j)).then(j.cmp(i)));
            for (rank, k) in order.iter().enumerate() {
                self.rank[*k as usize][l] = rank as u16;
            }
            order.len() as u16
        })
    }

    fn reconstruct(&mut self, codec: &WindowCodec, step: f64) {
        let code = |k, l| kept(&self.codes, &self.rank, &self.dropped, k, l);
        reconstruct(codec.basis.as_ref(), step, code, &mut self.work, &mut self.decoded);
    }

    /// The error of each lane in the bound's own measure: the largest over the frames, or the root of the mean square.
    fn errors(&self, bound: Bound) -> Lane {
        let mut out = Lane::default();
        for ((decoded, source), weight) in self.decoded.iter().zip(&self.source).zip(&self.weight) {
            for l in 0..LANES {
                let e = (decoded[l] - source[l]).abs() * weight[l];
                out[l] = match bound {
                    Bound::Pointwise => out[l].max(e),
                    Bound::Rms => out[l] + e * e,
                };
            }
        }
        match bound {
            Bound::Pointwise => out,
            Bound::Rms => out.map(|sum| (sum / self.source.len() as f64).sqrt()),
        }
    }
}

fn kept(codes: &[[i32; LANES]], rank: &[[u16; LANES]], dropped: &[u16; LANES], k: usize, lane: usize) -> i32 {
    if rank[k][lane] >= dropped[lane] { codes[k][lane] } else { 0 }
}
