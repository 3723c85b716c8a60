//! Truncation of a series: drops its smallest coefficients as long as the error bound holds.
//!
//! [Dobashi](crate::bibliography) orders the coefficients of a series by size and keeps the largest n of them:
//!
//! ```text
//! squared error = sum over the dropped k of c_{i,k}^2                                                     (eq 6)
//! v^_i(t_j) = sum over the kept k of c_{i,k} u_k(t_j)                                                     (eq 7)
//! ```
//!
//! Two misprints of the paper are corrected here. Its eq 6 sums the kept coefficients; the error is the sum over the
//! dropped ones. Its loop drops coefficients until the error reaches the tolerance, and keeps the set whose error
//! already does: one coefficient too few. The rule here: keep the fewest of the largest coefficients whose
//! reconstruction is within the bound. If zero is within the bound of a series, the series keeps none.
//!
//! Eq 6 needs an orthonormal basis, a bound of the mean, and unrounded coefficients. This code needs none of them: it
//! quantises coefficients first, decodes every candidate set, and measures the error on samples. Bisection finds the
//! number of coefficients to drop.

use super::WindowCodec;
use super::real::Real;
use crate::base::vectors::dispatch;
use crate::codec::bound::Measure;
use crate::wavelet::{LANES, Lane};

/// The coefficients of [`LANES`] voxels while they are coded; reused from group to group.
#[derive(Debug)]
pub(super) struct Group {
    /// The samples, missing ones filled; `frames` lanes.
    pub(super) source: Vec<Lane>,
    /// The weight of each sample's error, 0 if the sample is missing; `frames` lanes.
    pub(super) weight: Vec<Lane>,
    /// The coefficients before quantisation; K lanes.
    pub(super) coefficients: Vec<Lane>,
    /// The quantised coefficients. A voxel drops those whose rank is below its entry in `dropped`. K lanes.
    codes: Vec<[i32; LANES]>,
    /// The rank of each coefficient in its voxel's order of dropping; K lanes.
    rank: Vec<[i32; LANES]>,
    dropped: [i32; LANES],
    /// For each k with a nonzero code: k, and a sort key per lane (magnitude, then k in the low bits; [`NONE`] if the
    /// code is zero).
    sizes: Vec<(usize, [i64; LANES])>,
    /// The series decoded from the kept codes; `frames` lanes.
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
            sizes: Vec::with_capacity(k),
            decoded: vec![Lane::default(); frames],
            work: vec![Lane::default(); k],
        }
    }

    /// Transforms and quantises the source. False if a code does not fit; the block must then be stored exactly.
    pub(super) fn quantise(&mut self, codec: &WindowCodec, step: f64) -> bool {
        codec.basis.forward(&self.source, &mut self.coefficients);
        dispatch!(quantise(&self.coefficients[..], step, &mut self.codes[..]))
    }

    /// The kept codes of coefficient k; 0 for lanes that drop it.
    pub(super) fn kept(&self, k: usize) -> [i32; LANES] {
        kept(&self.codes[k], &self.rank[k], &self.dropped)
    }

    /// Drops as many of the smallest coefficients as the weighted errors allow, and decodes the rest into `decoded` (eq
    /// 7).
    pub(super) fn truncate(&mut self, codec: &WindowCodec, step: f64) {
        let counts = self.order();
        let mut holds = [0; LANES]; // the number of drops known to hold, or 0
        let mut fails = counts.map(|n| n + 1);
        self.dropped = counts; // first try to keep none
        loop {
            self.reconstruct(codec, step);
            let errors = self.errors(codec.bound.measure());
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

    /// Ranks the coefficients of each lane by size; among equals, the finer comes first. Returns the number of nonzero
    /// codes.
    fn order(&mut self) -> [i32; LANES] {
        self.sizes.clear();
        let mut counts = [0; LANES];
        let coded =
            self.codes.iter().zip(&self.coefficients).enumerate().filter(|(_, (codes, _))| **codes != [0; LANES]);
        for (k, (codes, coefficients)) in coded {
            let mut sizes = [NONE; LANES];
            for l in 0..LANES {
                // The bits of positive floats sort as the floats do; the low bits hold k.
                let size = coefficients[l].abs().to_bits() & !u64::from(u16::MAX) | u64::from(u16::MAX - k as u16);
                sizes[l] = if codes[l] == 0 { NONE } else { size as i64 };
                counts[l] += i32::from(codes[l] != 0);
            }
            self.sizes.push((k, sizes));
        }
        rank(&self.sizes, &mut self.rank);
        counts
    }

    fn reconstruct(&mut self, codec: &WindowCodec, step: f64) {
        dispatch!(decode_kept(&self.codes[..], &self.rank[..], &self.dropped, step, &mut self.work[..]));
        codec.basis.inverse(&mut self.work, &mut self.decoded);
    }

    /// The weighted error of each lane: the largest over the frames, or the root mean square.
    fn errors(&self, measure: Measure) -> Lane {
        let errors = dispatch!(errors(&self.decoded[..], &self.source[..], &self.weight[..]));
        match measure {
            Measure::Largest => errors.largest,
            Measure::RootMeanSquare => std::array::from_fn(|l| (errors.squares[l] / self.present(l)).sqrt()),
        }
    }

    /// How many samples of a lane are not missing; at least one.
    fn present(&self, lane: usize) -> f64 {
        self.weight.iter().filter(|weight| weight[lane] > 0.0).count().max(1) as f64
    }
}

/// Quantises coefficients to codes. False if a code does not fit.
#[inline(always)]
fn quantise(coefficients: &[Lane], step: f64, codes: &mut [[i32; LANES]]) -> bool {
    let mut fits = true;
    for (codes, coefficients) in codes.iter_mut().zip(coefficients) {
        for l in 0..LANES {
            let rounded = coefficients[l] / step + f64::BIG;
            let q = rounded - f64::BIG;
            // Also false for NaN, and for codes that decode to infinity.
            let small = (q.abs() < f64::from(i32::MAX)) & ((q * step).abs() < f64::INFINITY);
            fits &= small;
            codes[l] = (if small { rounded } else { f64::BIG }).less_big();
        }
    }
    fits
}

/// The sort key of a zero code, larger than any other.
const NONE: i64 = i64::MAX;

/// Ranks the sort keys of each lane.
fn rank(sizes: &[(usize, [i64; LANES])], rank: &mut [[i32; LANES]]) {
    if sizes.len() <= MOST_COMPARED {
        return dispatch!(rank_by_comparing(sizes, rank));
    }
    for l in 0..LANES {
        let mut order: Vec<(i64, usize)> = sizes.iter().map(|(k, sizes)| (sizes[l], *k)).collect();
        order.sort_unstable();
        order.into_iter().enumerate().for_each(|(position, (_, k))| rank[k][l] = position as i32);
    }
}

/// The most keys that are ranked by comparing all pairs.
const MOST_COMPARED: usize = 64;

/// Ranks by comparing all pairs: quadratic, but vector code.
#[inline(always)]
fn rank_by_comparing(sizes: &[(usize, [i64; LANES])], rank: &mut [[i32; LANES]]) {
    for (k, size) in sizes {
        let mut smaller = [0_i64; LANES];
        for (_, other) in sizes {
            for l in 0..LANES {
                smaller[l] -= (other[l] - size[l]) >> 63; // neither is negative
            }
        }
        rank[*k] = smaller.map(|n| n as i32);
    }
}

/// Decodes the kept coefficients; zero in lanes that drop one.
#[inline(always)]
fn decode_kept(codes: &[[i32; LANES]], rank: &[[i32; LANES]], dropped: &[i32; LANES], step: f64, out: &mut [Lane]) {
    for ((out, codes), rank) in out.iter_mut().zip(codes).zip(rank) {
        for l in 0..LANES {
            let keep = -i32::from(rank[l] >= dropped[l]); // all bits, or none
            out[l] = f64::from(codes[l] & keep) * step;
        }
    }
}

/// The weighted errors of each lane.
struct Errors {
    largest: Lane,
    squares: Lane,
}

#[inline(always)]
fn errors(decoded: &[Lane], source: &[Lane], weight: &[Lane]) -> Errors {
    let mut errors = Errors { largest: Lane::default(), squares: Lane::default() };
    for ((decoded, source), weight) in decoded.iter().zip(source).zip(weight) {
        for l in 0..LANES {
            let e = (decoded[l] - source[l]).abs() * weight[l];
            errors.largest[l] = if e > errors.largest[l] { e } else { errors.largest[l] };
            errors.squares[l] += e * e;
        }
    }
    errors
}

/// The codes of one coefficient, zero in lanes that drop it.
fn kept(codes: &[i32; LANES], rank: &[i32; LANES], dropped: &[i32; LANES]) -> [i32; LANES] {
    std::array::from_fn(|l| if rank[l] >= dropped[l] { codes[l] } else { 0 })
}
