//! Finds the series of a block that change none of its statistics but the sum of squared errors, by arithmetic in 32-bit floats. Only the others are decoded and
//! compared in doubles.
//!
//! Let a sample be decoded in 32-bit floats from K coefficients c_k (eq 5), and in doubles, rounded to its type or not. Factors,
//! products and sums are rounded by at most 2^-24 of their magnitude. So the two differ by less than this:
//!
//! ```text
//! slack = (2 K + 8) 2^-24 sum over k of max over t of |u_k(t)| max over the voxels of |c_k|
//! ```
//!
//! A series changes nothing if its errors plus slack are no larger than an exact error of the same block, and its samples with
//! slack lie between exact samples of it. The sum of squared errors takes what 32-bit floats give.

use super::box_samples::BoxSamples;
use super::check::Ranges;
use super::field::Used;
use super::forward::{keep_largest, products};
use super::load::Source;
use super::real::Real;
use crate::base::sample::SampleType;
use crate::base::vectors::dispatch;
use wavesplat_format::Basis;

/// Compares series in 32-bit floats, [`RUN`] voxels at a time.
pub(super) struct Screen<'a> {
    samples: BoxSamples<'a>,
    /// The decoded nodes, `[k][voxel]`, and the k that may have nodes that are not zero.
    field: &'a [f32],
    ks: &'a [usize],
    /// None if nodes are samples.
    functions: Option<Functions>,
    delta: f64,
    /// The largest difference of a sample and what it is loaded as.
    loading: f64,
    /// The nodes of a run, for each k that is used.
    nodes: Vec<Row>,
    /// Its source samples, frame by frame.
    source: Vec<Row>,
    /// Its decoded samples, frame by frame.
    decoded: Vec<Row>,
    found: Found,
    /// How far the exact errors and samples of the run may be off.
    slack: f64,
}

/// The functions of time of the k that are used.
struct Functions {
    /// u_k(t) as `[t][k]`
    columns: Vec<Vec<f32>>,
    /// max over t of |u_k(t)|
    largest: Vec<f64>,
}

/// Values of the voxels of a run.
type Row = [f32; RUN];

/// What comparing the series of a run gives, for each voxel.
struct Found {
    largest: Row,
    lo: Row,
    hi: Row,
    /// The sum of squared errors in units of delta; not finite if an error is not.
    squares: Row,
}

impl<'a> Screen<'a> {
    /// Whether series of a block can be compared in 32-bit floats: each sample has the same bound, no sample is missing, and nodes
    /// have that type.
    pub(super) fn applies<R: Real>(of: &Source<'_>) -> bool {
        let is_float = matches!(of.codec.sample, SampleType::F32 | SampleType::F64);
        let is_sum = of.codec.scheme.basis == Basis::Samples || of.codec.basis.rows().is_some();
        let has_bound = of.codec.bound.is_same() && of.codec.bound.delta >= LEAST_DELTA;
        is_float && is_sum && has_bound && of.missing.count == 0 && R::singles(&[]).is_some()
    }

    /// A screen for the series of a block and its decoded field; none if it does not [apply](Self::applies).
    pub(super) fn new<R: Real>(of: &Source<'a>, field: &'a [R], used: &'a Used) -> Option<Self> {
        let field = R::singles(field).filter(|_| Self::applies::<R>(of))?;
        let (frames, empty) = (of.codec.frames(), [0.0; RUN]);
        Some(Self {
            samples: of.samples,
            field,
            ks: &used.ks,
            functions: used.basis(of.codec.basis.as_ref()).rows().map(|rows| Functions::new(rows, frames)),
            delta: of.codec.bound.delta,
            loading: if of.codec.sample == SampleType::F32 { 0.0 } else { rounding(of.missing.magnitude) },
            nodes: vec![empty; used.ks.len()],
            source: vec![empty; frames],
            decoded: vec![empty; frames],
            found: Found { largest: empty, lo: empty, hi: empty, squares: empty },
            slack: 0.0,
        })
    }

    /// Compares the series of `count` voxels, beginning with `first`.
    pub(super) fn compare(&mut self, first: usize, count: usize) {
        let voxels = self.samples.voxels();
        for (k, nodes) in self.ks.iter().zip(&mut self.nodes) {
            nodes[..count].copy_from_slice(&self.field[k * voxels + first..][..count]);
        }
        self.samples.load_singles(first, count, &mut self.source);
        let of_delta = (1.0 / self.delta) as f32;
        self.slack = self.loading;
        match &self.functions {
            None => dispatch!(compare(&self.nodes[..], &self.source[..], of_delta, &mut self.found)),
            Some(functions) => {
                self.slack += functions.slack(&self.nodes);
                dispatch!(products(&functions.columns[..], &self.nodes[..], &mut self.decoded[..]));
                dispatch!(compare(&self.decoded[..], &self.source[..], of_delta, &mut self.found));
            }
        }
    }

    /// What holds for the exact errors and samples of `count` series, beginning with the `at`-th of the run compared last.
    pub(super) fn ranges(&self, at: usize, count: usize) -> Ranges {
        let Found { largest, lo, hi, squares } = &self.found;
        let of =
            |row: &Row, all: fn(f32, f32) -> f32| f64::from(row[at..at + count].iter().copied().fold(row[at], all));
        let squares = squares[at..at + count].iter().map(|squares| f64::from(*squares)).sum::<f64>();
        let largest = if squares.is_finite() { of(largest, f32::max) } else { f64::INFINITY };
        Ranges {
            largest: largest * UP + self.slack,
            lo: of(lo, f32::min) - self.slack,
            hi: of(hi, f32::max) + self.slack,
            squares: squares * self.delta * self.delta,
        }
    }
}

impl Functions {
    fn new(rows: &[Vec<f64>], frames: usize) -> Self {
        let columns = (0..frames).map(|t| rows.iter().map(|row| row[t] as f32).collect()).collect();
        let largest = rows.iter().map(|row| row.iter().fold(0.0, |most: f64, u| most.max(u.abs()))).collect();
        Self { columns, largest }
    }

    /// The slack of samples that are decoded from some nodes. A series with NaN is never within the bound, so the slack ignores it.
    fn slack(&self, nodes: &[Row]) -> f64 {
        let mut magnitudes = vec![0.0; nodes.len()];
        dispatch!(keep_largest(nodes, &mut magnitudes[..]));
        let sum: f64 = magnitudes.iter().zip(&self.largest).map(|(of_nodes, most)| most * f64::from(*of_nodes)).sum();
        if sum > 0.0 { (2 * nodes.len() + 8) as f64 * ROUNDING * (sum + UNDERFLOW) } else { 0.0 }
    }
}

/// The most that numbers up to a magnitude lose when they become 32-bit floats.
fn rounding(magnitude: f64) -> f64 {
    if magnitude > 0.0 { magnitude * ROUNDING + f64::from(f32::from_bits(1)) } else { 0.0 }
}

#[inline(always)]
fn compare(decoded: &[Row], source: &[Row], of_delta: f32, found: &mut Found) {
    for first in (0..RUN).step_by(WIDTH) {
        let (mut largest, mut squares) = ([0.0; WIDTH], [0.0; WIDTH]);
        let (mut lo, mut hi) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        for (decoded, source) in decoded.iter().zip(source) {
            let (decoded, source) = (&decoded[first..first + WIDTH], &source[first..first + WIDTH]);
            for l in 0..WIDTH {
                let (v, error) = (decoded[l], (decoded[l] - source[l]).abs());
                let share = error * of_delta;
                largest[l] = if error > largest[l] { error } else { largest[l] };
                lo[l] = if v < lo[l] { v } else { lo[l] };
                hi[l] = if v > hi[l] { v } else { hi[l] };
                squares[l] += share * share;
            }
        }
        found.largest[first..first + WIDTH].copy_from_slice(&largest);
        found.squares[first..first + WIDTH].copy_from_slice(&squares);
        found.lo[first..first + WIDTH].copy_from_slice(&lo);
        found.hi[first..first + WIDTH].copy_from_slice(&hi);
    }
}

/// Voxels compared together: a multiple of those decoded together.
pub(super) const RUN: usize = super::forward::VOXELS;

/// Voxels whose statistics stay in registers.
const WIDTH: usize = 16;

/// Half the distance of 1 and the next 32-bit float.
const ROUNDING: f64 = 1.0 / (1 << 24) as f64;

/// An error is at most this many times the rounded difference of two 32-bit floats.
const UP: f64 = 1.0 + 4.0 * ROUNDING;

/// More than the products of a sum lose by underflow, in units of the slack's factor.
const UNDERFLOW: f64 = 1e-35;

/// Smaller bounds may have shares that are not finite.
const LEAST_DELTA: f64 = 1e-30;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::sample;
    use crate::codec::WindowCodec;
    use crate::codec::bound::{Bound, ErrorBound};
    use crate::codec::load::Missing;
    use crate::codec::scheme::Scheme;
    use crate::wavelet::{LANES, Lane};
    use proptest::prelude::*;

    proptest! {
        /// Exact errors and samples of series decoded in doubles lie in the ranges.
        #[test]
        fn ranges_hold_for_exact_arithmetic(
            frames in 1usize..20, voxels in 1usize..200, seed: u32, learned: bool, is_double: bool, scale in -20i32..20,
        ) {
            let number = |i: usize| f64::from((i as u32 ^ seed).wrapping_mul(0x9E37_79B1) as i32) * 10.0_f64.powi(scale - 9);
            let ty = if is_double { SampleType::F64 } else { SampleType::F32 };
            let functions = if learned { (0..3 * frames).map(|i| (number(i) / 10.0_f64.powi(scale) * 9e3) as i16).collect() } else { Vec::new() };
            let basis = if learned { Basis::Learned } else { Basis::Samples };
            let bound = ErrorBound::new(Bound::Pointwise, 0.1, 10.0_f64.powi(scale));
            let codec = WindowCodec::new(Scheme { functions, ..Scheme::along_time(basis) }, frames, ty, bound, 8);
            let k = codec.basis.coefficients();
            let values: Vec<f64> = (0..frames * voxels).map(|i| number(i + 77)).collect();
            let mut bytes = vec![0; values.len() * ty.size()];
            sample::store(ty, &values, &mut bytes);
            let field: Vec<f32> = (0..k * voxels).map(|i| if i / voxels % 2 == 0 { number(i + 9) as f32 } else { 0.0 }).collect();
            let marked: Vec<bool> = (0..k).map(|k| k % 2 == 0).collect();
            let missing = Missing::find(&codec, &bytes);
            let samples = BoxSamples::whole(ty, &bytes, [voxels, 1, 1]);
            let source = Source { codec: &codec, samples, missing: &missing };
            let used = Used::new(codec.basis.as_ref(), &marked);
            let mut screen = Screen::new(&source, &field, &used).expect("floats within one bound");
            for first in (0..voxels).step_by(RUN) {
                let run = RUN.min(voxels - first);
                screen.compare(first, run);
                for (at, count) in crate::codec::lane_groups(run) {
                    let ranges = screen.ranges(at, count);
                    for (voxel, t) in (at..at + count).flat_map(|voxel| (0..frames).map(move |t| (first + voxel, t))) {
                        let mut lanes: Vec<Lane> = (0..k).map(|k| [f64::from(field[k * voxels + voxel]); LANES]).collect();
                        let mut series = vec![Lane::default(); frames];
                        codec.basis.inverse(&mut lanes, &mut series);
                        let decoded = series[t][0];
                        let mut stored = [0.0];
                        sample::load(ty, &bytes[(t * voxels + voxel) * ty.size()..][..ty.size()], &mut stored);
                        for v in [decoded, sample::round_to(ty, decoded)] {
                            prop_assert!((v - stored[0]).abs() <= ranges.largest);
                        }
                        let v = sample::round_to(ty, decoded);
                        prop_assert!(ranges.lo <= v && v <= ranges.hi);
                    }
                }
            }
        }
    }
}
