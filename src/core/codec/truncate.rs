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
//! the next would exceed the bound. In long windows, a few such coefficients are kept and passed over. If zero is within
//! the bound of a series, the series keeps none.
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
use super::order::Order;
use super::real::Real;
use crate::base::vectors::dispatch;
use crate::codec::bound::Measure;
use crate::wavelet::{LANES, Lane};
use std::ops::Range;

/// Codes groups of series by few coefficients.
#[derive(Debug)]
pub(super) struct Truncation<'a> {
    codec: &'a WindowCodec,
    step: f64,
    /// u_k(t) for each k.
    functions: Vec<Function>,
    order: Order,
    errors: Errors,
}

/// Neighbouring frames of a series.
type Chunk = [f32; CHUNK];
const CHUNK: usize = 8;

impl<'a> Truncation<'a> {
    /// Prepares to code the series of a block.
    pub(super) fn new(codec: &'a WindowCodec, step: f64) -> Self {
        let functions = codec.synthesis.iter().map(|row| Function::new(row)).collect();
        let order = Order::new(codec.basis.coefficients());
        Self { codec, step, functions, order, errors: Errors::new(codec) }
    }

    /// Transforms and quantises the source, drops as many of the smallest coefficients as the weighted errors allow, and
    /// decodes the rest (eq 7). False if a code does not fit; the block must then be stored exactly.
    pub(super) fn code(&mut self, group: &mut Group) -> bool {
        group.transform(self.codec);
        if !dispatch!(quantise(&group.coefficients[..], self.step, &mut group.codes[..])) {
            return false;
        }
        let small = group.is_small(self.codec.bound.measure());
        group.clear(small);
        if small == [true; LANES] {
            return true;
        }
        group.decode(self.codec, self.step);
        self.order.sort(&group.codes, &group.coefficients, self.step);
        if dispatch!(drop_smallest(&mut *self, &mut *group)) {
            group.decode(self.codec, self.step);
        }
        true
    }
}

/// A function of time, without the chunks at its beginning and end that are zero.
#[derive(Debug)]
struct Function {
    first: usize,
    chunks: Vec<Chunk>,
}

impl Function {
    fn new(row: &[f64]) -> Self {
        let mut chunks = chunks_of(row.iter().map(|u| *u as f32));
        let is_zero = |chunk: &Chunk| *chunk == Chunk::default();
        let first = chunks.iter().take_while(|chunk| is_zero(chunk)).count();
        chunks.drain(..first);
        let zeros = chunks.iter().rev().take_while(|chunk| is_zero(chunk)).count();
        chunks.truncate(chunks.len() - zeros);
        Self { first, chunks }
    }

    /// The chunks of a series that it changes.
    fn near(&self) -> Range<usize> {
        self.first..self.first + self.chunks.len()
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

/// Drops the coefficients of each lane, the smallest first. Keeps those without which the bound would be exceeded, and ends after a few of
/// them. Returns whether it dropped any.
#[inline(always)]
fn drop_smallest(of: &mut Truncation<'_>, group: &mut Group) -> bool {
    of.errors.load(group, of.step);
    let most_refused = (group.codes.len() / REFUSED_OF).max(1);
    let mut any = false;
    for lane in 0..LANES {
        let mut series = of.errors.series(lane);
        let mut refused = 0;
        for k in of.order.of_lane(lane) {
            let code = &mut group.codes[k][lane];
            if series.drop(&of.functions[k], *code) {
                (*code, any) = (0, true);
            } else {
                refused += 1;
            }
            if refused == most_refused {
                break;
            }
        }
    }
    any
}

/// Dropping ends when one in so many coefficients had to be kept, at the first in short windows. In long ones, the next may change other
/// frames, in which there is still room.
const REFUSED_OF: usize = 32;

/// The errors of one series.
struct Series<'a> {
    errors: &'a mut [Chunk],
    weights: &'a [Chunk],
    measure: Measure,
    /// The largest error, or sum of squared errors, that is within the bound.
    most: f32,
    /// The largest error before any drop, or the sum of squared errors so far.
    reached: f32,
    /// The weighted error of a code of 1 where its function is 1 and the weight is largest.
    unit: f32,
}

impl Series<'_> {
    /// Drops a code if the errors are then within the bound. Returns whether they are.
    #[inline(always)]
    fn drop(&mut self, function: &Function, code: i32) -> bool {
        let near = function.near();
        let factor = code as f32 * self.unit;
        let change = Change { function: &function.chunks, weights: &self.weights[near.clone()], factor };
        let holds = match self.measure {
            Measure::Largest => {
                change.largest_within(&self.errors[near.clone()], self.most) && self.holds_beside(&near)
            }
            Measure::RootMeanSquare => {
                let squares = self.reached + change.squares_added(&self.errors[near.clone()]);
                let holds = squares <= self.most;
                self.reached = if holds { squares } else { self.reached };
                holds
            }
        };
        if holds {
            change.apply(&mut self.errors[near]);
        }
        holds
    }

    /// Whether all other errors are within the bound. Before a drop, few series exceed it.
    #[inline(always)]
    fn holds_beside(&self, near: &Range<usize>) -> bool {
        let mut others = self.errors[..near.start].iter().chain(&self.errors[near.end..]).flatten();
        self.reached <= self.most || others.all(|error| error.abs() <= self.most)
    }
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

    /// How much the sum of squared errors grows.
    #[inline(always)]
    fn squares_added(&self, errors: &[Chunk]) -> f32 {
        let mut added = Chunk::default();
        for (chunk, errors) in errors.iter().enumerate() {
            let changed = self.changed(errors, chunk);
            for i in 0..changed.len() {
                added[i] += changed[i] * changed[i] - errors[i] * errors[i];
            }
        }
        added.iter().sum()
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
    /// [`Series::most`], [`Series::reached`] and [`Series::unit`] of each lane.
    most: [f32; LANES],
    reached: [f32; LANES],
    units: [f32; LANES],
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
            reached: [0.0; LANES],
            units: [0.0; LANES],
        }
    }

    /// The errors of a lane.
    #[inline(always)]
    fn series(&mut self, lane: usize) -> Series<'_> {
        let chunks = self.weights.len() / LANES;
        let of_lane = lane * chunks..(lane + 1) * chunks;
        let (errors, weights) = (&mut self.of_lanes[of_lane.clone()], &self.weights[of_lane]);
        let (most, reached, unit) = (self.most[lane], self.reached[lane], self.units[lane]);
        Series { errors, weights, measure: self.measure, most, reached, unit }
    }

    /// Loads the errors of a group.
    #[inline(always)]
    fn load(&mut self, group: &Group, step: f64) {
        let (largest, present) = match group.common_weight {
            Some(weight) => ([weight; LANES], [group.weight.len() as f64; LANES]),
            None => (group.largest_weights(), std::array::from_fn(|l| group.present(l))),
        };
        self.load_errors(group);
        self.load_weights(group, largest);
        let narrowed = 1.0 - self.rounding;
        self.most = match self.measure {
            Measure::Largest => [narrowed as f32; LANES],
            Measure::RootMeanSquare => present.map(|present| (present * narrowed * narrowed) as f32),
        };
        self.units = largest.map(|largest| (step * largest) as f32);
    }

    #[inline(always)]
    fn load_errors(&mut self, group: &Group) {
        let chunks = self.of_lanes.len() / LANES;
        let (mut largest, mut squares) = ([0.0_f32; LANES], [0.0_f32; LANES]);
        let frames = group.source.chunks(CHUNK).zip(group.decoded.chunks(CHUNK)).zip(group.weight.chunks(CHUNK));
        for (n, ((source, decoded), weight)) in frames.enumerate() {
            let mut errors = [[0.0; LANES]; CHUNK];
            for (errors, ((source, decoded), weight)) in errors.iter_mut().zip(source.iter().zip(decoded).zip(weight)) {
                for l in 0..LANES {
                    errors[l] = ((decoded[l] - source[l]) * weight[l]) as f32;
                    largest[l] = if errors[l].abs() > largest[l] { errors[l].abs() } else { largest[l] };
                    squares[l] += errors[l] * errors[l];
                }
            }
            for (t, errors) in errors.iter().enumerate() {
                for (l, error) in errors.iter().enumerate() {
                    self.of_lanes[l * chunks + n][t] = *error;
                }
            }
        }
        self.reached = if self.measure == Measure::Largest { largest } else { squares };
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

/// The share of the bound that is kept free, for each coefficient, for rounding in 32-bit floats. Errors and their changes are below two
/// bounds, so one drop rounds by less.
const ROUNDING: f64 = 1.0 / (1 << 20) as f64;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::sample::SampleType;
    use crate::codec::bound::{Bound, ErrorBound};
    use crate::codec::scheme::Scheme;
    use crate::wavelet::Basis;

    /// A number from -1 to 1.
    fn number(i: usize) -> f64 {
        f64::from((i as u32 + 1).wrapping_mul(0x9E37_79B1) >> 8) / f64::from(1 << 23) - 1.0
    }

    /// The weighted error of codes: the largest of a series, or the root mean square.
    fn error(codec: &WindowCodec, group: &Group, codes: &[i32], step: f64, lane: usize) -> f64 {
        let decoded =
            |t: usize| codes.iter().zip(&*codec.synthesis).map(|(code, u)| f64::from(*code) * step * u[t]).sum();
        let frames = group.source.iter().zip(&group.weight).enumerate();
        let errors = frames.map(|(t, (source, weight))| {
            let decoded: f64 = decoded(t);
            (decoded - source[lane]).abs() * weight[lane]
        });
        match codec.bound.measure() {
            Measure::Largest => errors.fold(0.0, f64::max),
            Measure::RootMeanSquare => (errors.map(|e| e * e).sum::<f64>() / group.present(lane)).sqrt(),
        }
    }

    /// The codes of a lane without as many of the smallest as the bound allows; none if rounding in 32-bit floats may decide.
    fn kept(codec: &WindowCodec, group: &Group, step: f64, lane: usize) -> Option<Vec<i32>> {
        let mut codes: Vec<i32> =
            group.coefficients.iter().map(|c| (c[lane] / step).round_ties_even() as i32).collect();
        if error(codec, group, &vec![0; codes.len()], step, lane) <= 1.0 {
            return Some(vec![0; codes.len()]);
        }
        let mut order: Vec<usize> = (0..codes.len()).filter(|k| codes[*k] != 0).collect();
        order.sort_by(|a, b| group.coefficients[*a][lane].abs().total_cmp(&group.coefficients[*b][lane].abs()));
        let mut refused = 0;
        for k in order {
            let code = std::mem::take(&mut codes[k]);
            let error = error(codec, group, &codes, step, lane);
            if (error - 1.0).abs() < 1e-3 {
                return None;
            }
            if error > 1.0 {
                codes[k] = code;
                refused += 1;
            }
            if refused == (codes.len() / 32).max(1) {
                break;
            }
        }
        Some(codes)
    }

    #[test]
    fn the_smallest_coefficients_are_dropped_as_long_as_the_bound_holds() {
        let (mut compared, mut dropped) = (0, 0);
        let windows = [
            (Basis::Haar, 32),
            (Basis::Haar, 13),
            (Basis::Haar, 128),
            (Basis::Multi, 33),
            (Basis::Multi, 5),
            (Basis::Multi, 129),
        ];
        for (basis, frames) in windows {
            for (bound, case) in
                [(Bound::Pointwise, 0), (Bound::Rms, 0), (Bound::Relative { floor: 0.1 }, 1), (Bound::Rms, 1)]
            {
                let bound = ErrorBound::new(bound, 0.1, 0.1);
                let codec = WindowCodec::new(Scheme::along_time(basis), frames, SampleType::F64, bound, 8);
                let step = bound.step(0.1, codec.gain);
                let (mut group, mut truncation) = (Group::new(&codec), Truncation::new(&codec, step));
                for seed in 0..640 / frames.max(32) {
                    for (t, (source, weight)) in group.source.iter_mut().zip(&mut group.weight).enumerate() {
                        let value = |l: usize| {
                            let wave = (t as f64 / 7.0 + l as f64).sin() + 0.3 * number(seed * 999 + t * LANES + l);
                            wave * [1.0, 0.2, 0.05][l % 3]
                        };
                        *source = std::array::from_fn(value);
                        let varies = |l: usize| [10.0, 10.0 * (1.0 + number(t + l).abs()), 0.0][(t + l + seed) % 3];
                        *weight = if case == 0 { [10.0; LANES] } else { std::array::from_fn(varies) };
                    }
                    group.common_weight = (case == 0).then_some(10.0);
                    assert!(truncation.code(&mut group));
                    for lane in 0..LANES {
                        let Some(expected) = kept(&codec, &group, step, lane) else { continue };
                        let found: Vec<i32> = group.codes.iter().map(|codes| codes[lane]).collect();
                        assert_eq!(found, expected, "{basis:?} {:?}, lane {lane}", bound.bound);
                        compared += 1;
                        let nonzero = group.coefficients.iter().filter(|c| (c[lane] / step).round_ties_even() != 0.0);
                        dropped += nonzero.count() - found.iter().filter(|code| **code != 0).count();
                    }
                }
            }
        }
        assert!(compared > 1800 && dropped > compared, "{compared} {dropped}");
    }
}
