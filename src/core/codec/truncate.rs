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
//! already does: one coefficient too few. The rule here: drop one coefficient after another, the smallest first, until
//! the next would exceed the bound. If zero is within the bound of a series, the series keeps none.
//!
//! Eq 6 needs an orthonormal basis, a bound of the mean, and unrounded coefficients. This code needs none of them: it
//! quantises first, and follows the error of every sample. Dropping the code q_k changes it to
//!
//! ```text
//! e_j - step q_k u_k(t_j)
//! ```
//!
//! Errors are followed in 32-bit floats, under a bound that is narrower by their rounding. The encoder checks the decoded
//! samples of what is kept.

use super::WindowCodec;
use super::group::Group;
use super::real::Real;
use crate::base::vectors::dispatch;
use crate::codec::bound::Measure;
use crate::wavelet::{LANES, Lane};

/// Codes groups of series by few coefficients.
#[derive(Debug)]
pub(super) struct Truncation<'a> {
    codec: &'a WindowCodec,
    step: f64,
    /// u_k(t): the chunks of each k in turn, zeros behind the last frame.
    functions: Vec<Chunk>,
    /// The chunks of a series.
    chunks: usize,
    /// For each k with a code that is not zero, the sort key of each lane; sorted lane by lane.
    keys: Vec<[u32; LANES]>,
    /// The networks that sort 2^n rows of keys.
    networks: Vec<Vec<[u16; 2]>>,
    errors: Errors,
}

/// Neighbouring frames of a series.
type Chunk = [f32; CHUNK];
const CHUNK: usize = 8;

impl<'a> Truncation<'a> {
    /// Prepares to code the series of a block.
    pub(super) fn new(codec: &'a WindowCodec, step: f64) -> Self {
        let functions: Vec<Chunk> =
            codec.synthesis.iter().flat_map(|row| chunks_of(row.iter().map(|u| *u as f32))).collect();
        let levels = codec.basis.coefficients().next_power_of_two().ilog2();
        let networks = (0..=levels).map(sorting_network).collect();
        let chunks = functions.len() / codec.basis.coefficients();
        Self { codec, step, functions, chunks, keys: Vec::new(), networks, errors: Errors::new(codec) }
    }

    /// Transforms and quantises the source, drops as many of the smallest coefficients as the weighted errors allow, and
    /// decodes the rest (eq 7). False if a code does not fit; the block must then be stored exactly.
    pub(super) fn code(&mut self, group: &mut Group) -> bool {
        group.transform(self.codec);
        if !dispatch!(quantise(&group.coefficients[..], self.step, &mut group.codes[..])) {
            return false;
        }
        let small = group.is_small(self.codec.bound.measure());
        if small == [true; LANES] {
            group.clear(small);
            return true;
        }
        group.decode(self.codec, self.step);
        group.clear(small);
        self.sort(group);
        if dispatch!(drop_smallest(&mut *self, &mut *group)) {
            group.decode(self.codec, self.step);
        }
        true
    }

    /// Sorts the coefficients of each lane by size; among equals, the finer comes first.
    fn sort(&mut self, group: &Group) {
        self.keys.clear();
        dispatch!(keys(&group.codes[..], &group.coefficients[..], self.step, &mut self.keys));
        let levels = self.keys.len().next_power_of_two().ilog2();
        dispatch!(sort_lanes(&mut self.keys[..], &self.networks[levels as usize][..]));
    }
}

/// Numbers in chunks, the last one filled with zeros.
fn chunks_of(mut numbers: impl ExactSizeIterator<Item = f32>) -> Vec<Chunk> {
    let chunks = numbers.len().div_ceil(CHUNK);
    (0..chunks).map(|_| std::array::from_fn(|_| numbers.next().unwrap_or(0.0))).collect()
}

/// Quantises coefficients to codes. False if a code does not fit.
#[inline(always)]
fn quantise(coefficients: &[Lane], step: f64, codes: &mut [[i32; LANES]]) -> bool {
    let (mut fits, per_step) = (true, 1.0 / step);
    for (codes, coefficients) in codes.iter_mut().zip(coefficients) {
        for l in 0..LANES {
            let rounded = coefficients[l] * per_step + f64::BIG;
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
const NONE: u32 = u32::MAX;

/// The bits of keys that hold k, all set.
fn index_bits(coefficients: usize) -> u32 {
    coefficients.next_power_of_two() as u32 - 1
}

/// Makes a sort key of each coefficient: its size in steps, and in the low bits how much k is less than the largest that they hold.
#[inline(always)]
fn keys(codes: &[[i32; LANES]], coefficients: &[Lane], step: f64, keys: &mut Vec<[u32; LANES]>) {
    let (low, per_step) = (index_bits(codes.len()), 1.0 / step);
    for (k, (codes, coefficients)) in codes.iter().zip(coefficients).enumerate() {
        let mut row = [NONE; LANES];
        let mut any = 0;
        for l in 0..LANES {
            // The bits of positive floats sort as the floats do.
            let size = (coefficients[l] * per_step).abs() as f32;
            let key = size.to_bits() & !low | (low - k as u32);
            row[l] = if codes[l] == 0 { NONE } else { key };
            any |= codes[l];
        }
        if any != 0 {
            keys.push(row);
        }
    }
}

/// The pairs of rows whose exchange sorts 2^levels rows: [Batcher](crate::bibliography)'s merges of odd and even entries.
fn sorting_network(levels: u32) -> Vec<[u16; 2]> {
    let mut pairs = Vec::new();
    for sorted in 0..levels {
        for apart in (0..=sorted).rev() {
            let first = if apart < sorted { 1 << apart } else { 0 };
            let lows = (first..(1_usize << levels) - (1 << apart)).filter(|low| (low - first) >> apart & 1 == 0);
            let pair = lows.map(|low| [low, low + (1 << apart)]);
            pairs.extend(
                pair.filter(|[low, high]| low >> (sorted + 1) == high >> (sorted + 1))
                    .map(|rows| rows.map(|row| row as u16)),
            );
        }
    }
    pairs
}

/// Sorts the lanes of rows by a network, which may be one for more rows.
#[inline(always)]
fn sort_lanes(rows: &mut [[u32; LANES]], network: &[[u16; 2]]) {
    for [low, high] in network {
        if usize::from(*high) < rows.len() {
            exchange(rows, usize::from(*low), usize::from(*high));
        }
    }
}

/// Sorts two rows lane by lane.
#[inline(always)]
fn exchange(rows: &mut [[u32; LANES]], low: usize, high: usize) {
    let (a, b) = (rows[low], rows[high]);
    for l in 0..LANES {
        rows[low][l] = if a[l] < b[l] { a[l] } else { b[l] };
        rows[high][l] = if a[l] < b[l] { b[l] } else { a[l] };
    }
}

/// Drops the coefficients of each lane, the smallest first, until the next would exceed the bound. Returns whether it
/// dropped any.
#[inline(always)]
fn drop_smallest(of: &mut Truncation<'_>, group: &mut Group) -> bool {
    let (low, chunks, mut any) = (index_bits(group.codes.len()), of.chunks, false);
    let units = of.errors.load(group, of.step);
    let series = of.errors.of_lanes.chunks_exact_mut(chunks).zip(of.errors.weights.chunks_exact(chunks)).enumerate();
    for (lane, (errors, weights)) in series {
        let most = of.errors.most[lane];
        for keys in of.keys.iter().take_while(|keys| keys[lane] != NONE) {
            let k = (low - (keys[lane] & low)) as usize;
            let code = &mut group.codes[k][lane];
            let change =
                Change { function: &of.functions[k * chunks..][..chunks], weights, factor: *code as f32 * units[lane] };
            let holds = match of.errors.measure {
                Measure::Largest => change.largest_within(errors, most),
                Measure::RootMeanSquare => change.squares_within(errors, most),
            };
            if !holds {
                break;
            }
            change.apply(errors);
            (*code, any) = (0, true);
        }
    }
    any
}

/// What changes the errors of a series: -factor times a function of time, by the weights of the errors.
struct Change<'a> {
    function: &'a [Chunk],
    weights: &'a [Chunk],
    factor: f32,
}

impl Change<'_> {
    /// The changed errors.
    #[inline(always)]
    fn changed(&self, errors: &Chunk, chunk: usize) -> Chunk {
        let (function, weights) = (&self.function[chunk], &self.weights[chunk]);
        let mut changed = *errors;
        for i in 0..errors.len() {
            changed[i] -= self.factor * function[i] * weights[i];
        }
        changed
    }

    /// Whether no changed error is larger.
    #[inline(always)]
    fn largest_within(&self, errors: &[Chunk], most: f32) -> bool {
        let mut within = true;
        for (chunk, errors) in errors.iter().enumerate() {
            within &= self.changed(errors, chunk).iter().fold(true, |within, error| within & (error.abs() <= most));
        }
        within
    }

    /// Whether the sum of squares of the changed errors is not larger.
    #[inline(always)]
    fn squares_within(&self, errors: &[Chunk], most: f32) -> bool {
        let mut squares = Chunk::default();
        for (chunk, errors) in errors.iter().enumerate() {
            let changed = self.changed(errors, chunk);
            for i in 0..changed.len() {
                squares[i] += changed[i] * changed[i];
            }
        }
        squares.iter().sum::<f32>() <= most
    }

    #[inline(always)]
    fn apply(&self, errors: &mut [Chunk]) {
        for (chunk, errors) in errors.iter_mut().enumerate() {
            *errors = self.changed(errors, chunk);
        }
    }
}

/// Weighted errors in 32-bit floats.
#[derive(Debug)]
struct Errors {
    measure: Measure,
    /// The share of the bound that is left for rounding.
    rounding: f64,
    /// The errors of a group: the chunks of each lane in turn, zeros behind the last frame.
    of_lanes: Vec<Chunk>,
    /// Their weights, divided by the largest of the series.
    weights: Vec<Chunk>,
    /// Whether all weights of the group are ones.
    is_uniform: bool,
    /// The largest error, or sum of squared errors, that surely is within the bound of each series.
    most: [f32; LANES],
}

impl Errors {
    fn new(codec: &WindowCodec) -> Self {
        let zeros = chunks_of(vec![0.0; codec.frames()].into_iter()).repeat(LANES);
        Self {
            measure: codec.bound.measure(),
            rounding: codec.basis.coefficients() as f64 * ROUNDING,
            weights: zeros.clone(),
            of_lanes: zeros,
            is_uniform: false,
            most: [0.0; LANES],
        }
    }

    /// Loads the errors of a group. Returns for each series the weighted error of a code of 1 where its function is 1 and the weight is
    /// largest.
    #[inline(always)]
    fn load(&mut self, group: &Group, step: f64) -> [f32; LANES] {
        let (largest, present) = match group.common_weight {
            Some(weight) => ([weight; LANES], [group.weight.len() as f64; LANES]),
            None => (group.largest_weights(), std::array::from_fn(|l| group.present(l))),
        };
        let chunks = self.of_lanes.len() / LANES;
        let frames = group.source.chunks(CHUNK).zip(group.decoded.chunks(CHUNK)).zip(group.weight.chunks(CHUNK));
        for (n, ((source, decoded), weight)) in frames.enumerate() {
            let mut errors = [[0.0; LANES]; CHUNK];
            for (errors, ((source, decoded), weight)) in errors.iter_mut().zip(source.iter().zip(decoded).zip(weight)) {
                for l in 0..LANES {
                    errors[l] = ((decoded[l] - source[l]) * weight[l]) as f32;
                }
            }
            for (t, errors) in errors.iter().enumerate() {
                for (l, error) in errors.iter().enumerate() {
                    self.of_lanes[l * chunks + n][t] = *error;
                }
            }
        }
        self.load_weights(group, largest);
        let most = if self.measure == Measure::Largest { [1.0; LANES] } else { present };
        self.most = most.map(|most| (most * (1.0 - self.rounding)) as f32);
        largest.map(|largest| (step * largest) as f32)
    }

    #[inline(always)]
    fn load_weights(&mut self, group: &Group, largest: Lane) {
        let is_uniform = group.common_weight.is_some();
        if is_uniform && self.is_uniform {
            return;
        }
        self.is_uniform = is_uniform;
        let of_lane = self.weights.len() / LANES;
        for (l, weights) in self.weights.chunks_exact_mut(of_lane).enumerate() {
            let frames = weights.as_flattened_mut().iter_mut().zip(&group.weight);
            frames.for_each(|(share, weight)| *share = (weight[l] / largest[l]) as f32);
        }
    }
}

/// A coefficient's share of the bound that rounding in 32-bit floats may take: errors and changes are below two bounds.
const ROUNDING: f64 = 1.0 / (1 << 20) as f64;
