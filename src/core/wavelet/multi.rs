//! The piecewise fractal multiwavelet of [GHM](crate::bibliography) on an interval.
//!
//! It has 2N + 1 functions on N unit intervals, one at each node and one at each midpoint; N is a power of two. Samples
//! sit at nodes (even t) and midpoints (odd t). The prefilter makes the finest coefficients of samples s:
//!
//! ```text
//! node: s sqrt(2/3)    end node: s sqrt(1/3)    midpoint: (s + 3/10 (left + right)) 5/(4 sqrt 3)          (eq 18)
//! ```
//!
//! One step turns the 2N + 1 coefficients of N intervals [node, midpoint, node, ..., node] into N + 1 coefficients of
//! N/2 intervals and N wavelets, until N is 1. Its rows are orthonormal; q = sqrt 2:
//!
//! ```text
//! midpoint (6, 8q, 6)/10q                    node (-1, -3q, 9, 10q, 9, -3q, -1)/20                        (eq 19)
//! end node (10, 9, -3q, -1)/10q              end wavelet (-10, 9, -3q, -1)/10q
//! even (-1, -3q, 9, -10q, 9, -3q, -1)/20     odd (-1, -3q, 9, 0, -9, 3q, 1)/10q
//! ```
//!
//! A midpoint's row applies to the fine [midpoint, node, midpoint] of its interval. Rows of seven apply to the fine
//! functions around their coarse node, rows of four to those from the end inwards. Straight lines have three
//! coefficients.
//!
//! The basis is orthonormal for functions, not for samples. Coefficients are scaled by sqrt 2, which eq 18 includes, so
//! that their squares are near those of samples: for 33 samples, the squared error of samples is 0.96 to 3.67 times the
//! energy of dropped coefficients. So a bound on samples must be checked on samples.
//!
//! A window of another length is extended with its last sample to the next 2N + 1, only within this file.

use super::{LANES, Lane, TimeBasis};
use crate::base::vectors::dispatch;

const Q: f64 = std::f64::consts::SQRT_2;

/// A coarse interval's midpoint function, on its fine [mid, node, mid].
const MID: [[f64; 3]; 1] = [[6.0 / (10.0 * Q), 8.0 * Q / (10.0 * Q), 6.0 / (10.0 * Q)]];
/// An interior coarse node's function, symmetric wavelet and antisymmetric wavelet, centred on it.
const NODE: [[f64; 7]; 3] = [
    [-0.05, -3.0 * Q / 20.0, 0.45, 10.0 * Q / 20.0, 0.45, -3.0 * Q / 20.0, -0.05],
    [-0.05, -3.0 * Q / 20.0, 0.45, -10.0 * Q / 20.0, 0.45, -3.0 * Q / 20.0, -0.05],
    [-1.0 / (10.0 * Q), -0.3, 9.0 / (10.0 * Q), 0.0, -9.0 / (10.0 * Q), 0.3, 1.0 / (10.0 * Q)],
];
/// The function and the wavelet of the first node, inward from it.
const FIRST: [[f64; 4]; 2] = [
    [10.0 / (10.0 * Q), 9.0 / (10.0 * Q), -0.3, -1.0 / (10.0 * Q)],
    [-10.0 / (10.0 * Q), 9.0 / (10.0 * Q), -0.3, -1.0 / (10.0 * Q)],
];
/// The same of the last node, towards it.
const LAST: [[f64; 4]; 2] = [reversed(FIRST[0]), reversed(FIRST[1])];

const fn reversed(taps: [f64; 4]) -> [f64; 4] {
    [taps[3], taps[2], taps[1], taps[0]]
}

/// The multiwavelet basis for one window.
#[derive(Debug)]
pub(crate) struct Multi {
    frames: usize,
    intervals: usize,
}

impl Multi {
    /// Creates the basis for windows of `frames` frames, at least 1.
    pub(crate) fn new(frames: usize) -> Self {
        Self { frames, intervals: frames.saturating_sub(1).div_ceil(2).max(1).next_power_of_two() }
    }
}

impl TimeBasis for Multi {
    fn frames(&self) -> usize {
        self.frames
    }

    fn coefficients(&self) -> usize {
        2 * self.intervals + 1
    }

    fn levels(&self) -> Vec<usize> {
        std::iter::once(3).chain((1..=self.intervals.ilog2()).map(|l| 1 << l)).collect()
    }

    fn forward(&self, series: &[Lane], coefficients: &mut [Lane]) {
        dispatch!(forward(self.intervals, series, coefficients));
    }

    fn inverse(&self, coefficients: &mut [Lane], series: &mut [Lane]) {
        dispatch!(inverse(self.intervals, &*coefficients, series));
    }
}

#[inline(always)]
fn forward(mut intervals: usize, series: &[Lane], coefficients: &mut [Lane]) {
    let mut fine = series.to_vec();
    fine.resize(coefficients.len(), series[series.len() - 1]);
    let mut coarse = vec![Lane::default(); intervals + 1];
    prefilter(&mut fine);
    while intervals > 1 {
        let wavelets = &mut coefficients[intervals + 1..2 * intervals + 1];
        filter(intervals, &mut Analysis { fine: &fine, coarse: &mut coarse, wavelets });
        std::mem::swap(&mut fine, &mut coarse);
        intervals /= 2;
    }
    coefficients[..3].copy_from_slice(&fine[..3]);
}

#[inline(always)]
fn inverse(most: usize, coefficients: &[Lane], series: &mut [Lane]) {
    let mut fine = vec![Lane::default(); coefficients.len()];
    let mut coarse = fine.clone();
    coarse[..3].copy_from_slice(&coefficients[..3]);
    let mut intervals = 2;
    while intervals <= most {
        let wavelets = &coefficients[intervals + 1..2 * intervals + 1];
        fine[..2 * intervals + 1].fill(Lane::default());
        filter(intervals, &mut Synthesis { fine: &mut fine, coarse: &coarse, wavelets });
        std::mem::swap(&mut fine, &mut coarse);
        intervals *= 2;
    }
    undo_prefilter(&mut coarse);
    series.copy_from_slice(&coarse[..series.len()]);
}

/// A function of the next coarser level, or a wavelet.
#[derive(Clone, Copy)]
enum Target {
    Scaling(usize),
    Wavelet(usize),
}

/// What rows of eq 19 that begin with the same fine function are applied to.
trait Filter {
    /// Applies rows with these taps, each for its target, at the first of their fine functions.
    fn apply<const ROWS: usize, const TAPS: usize>(
        &mut self,
        to: [Target; ROWS],
        first: usize,
        rows: &[[f64; TAPS]; ROWS],
    );
}

/// Applies every row of eq 19 on a level with `intervals` fine intervals.
#[inline(always)]
fn filter(intervals: usize, of: &mut impl Filter) {
    let last = intervals / 2; // the last coarse node
    of.apply([Target::Scaling(0), Target::Wavelet(0)], 0, &FIRST);
    for c in 1..last {
        of.apply([Target::Scaling(2 * c), Target::Wavelet(2 * c - 1), Target::Wavelet(2 * c)], 4 * c - 3, &NODE);
    }
    for c in 0..last {
        of.apply([Target::Scaling(2 * c + 1)], 4 * c + 1, &MID);
    }
    of.apply([Target::Scaling(2 * last), Target::Wavelet(intervals - 1)], 2 * intervals - 3, &LAST);
}

/// Computes a level's coarse functions and wavelets from its fine functions.
struct Analysis<'a> {
    fine: &'a [Lane],
    coarse: &'a mut [Lane],
    wavelets: &'a mut [Lane],
}

impl Filter for Analysis<'_> {
    #[inline(always)]
    fn apply<const ROWS: usize, const TAPS: usize>(
        &mut self,
        to: [Target; ROWS],
        first: usize,
        rows: &[[f64; TAPS]; ROWS],
    ) {
        let fine: &[Lane; TAPS] = self.fine[first..].first_chunk().expect("fine functions of every row");
        for (to, taps) in to.into_iter().zip(rows) {
            let mut sum = Lane::default();
            for (tap, value) in taps.iter().zip(fine) {
                for l in 0..LANES {
                    sum[l] += tap * value[l];
                }
            }
            match to {
                Target::Scaling(i) => self.coarse[i] = sum,
                Target::Wavelet(i) => self.wavelets[i] = sum,
            }
        }
    }
}

/// Adds a level's coarse functions and wavelets to its fine functions.
struct Synthesis<'a> {
    fine: &'a mut [Lane],
    coarse: &'a [Lane],
    wavelets: &'a [Lane],
}

impl Filter for Synthesis<'_> {
    #[inline(always)]
    fn apply<const ROWS: usize, const TAPS: usize>(
        &mut self,
        from: [Target; ROWS],
        first: usize,
        rows: &[[f64; TAPS]; ROWS],
    ) {
        let from = from.map(|from| match from {
            Target::Scaling(i) => self.coarse[i],
            Target::Wavelet(i) => self.wavelets[i],
        });
        for (n, value) in self.fine[first..][..TAPS].iter_mut().enumerate() {
            for (taps, from) in rows.iter().zip(&from) {
                for l in 0..LANES {
                    value[l] += taps[n] * from[l];
                }
            }
        }
    }
}

/// c = s / sqrt 3 at a node; an end node's function is cut in half. Times sqrt 2.
const NODE_SCALE: f64 = 0.816_496_580_927_726; // sqrt(2 / 3)
const END_SCALE: f64 = 0.577_350_269_189_625_8; // sqrt(1 / 3)
/// c = (s + 3/10 (s_left + s_right)) * 5 / (4 sqrt 6) at a midpoint. Times sqrt 2.
const MID_SCALE: f64 = 0.721_687_836_487_032_2; // 5 / (4 sqrt 3)

/// Transforms samples to the finest coefficients (eq 18).
#[inline(always)]
fn prefilter(values: &mut [Lane]) {
    for m in (1..values.len()).step_by(2) {
        let (left, right) = (values[m - 1], values[m + 1]);
        for l in 0..LANES {
            values[m][l] = (values[m][l] + 0.3 * (left[l] + right[l])) * MID_SCALE;
        }
    }
    for_each_node(values, |value, scale| *value *= scale);
}

/// Transforms the finest coefficients to samples: the inverse of eq 18.
#[inline(always)]
fn undo_prefilter(values: &mut [Lane]) {
    for_each_node(values, |value, scale| *value /= scale);
    for m in (1..values.len()).step_by(2) {
        let (left, right) = (values[m - 1], values[m + 1]);
        for l in 0..LANES {
            values[m][l] = values[m][l] / MID_SCALE - 0.3 * (left[l] + right[l]);
        }
    }
}

#[inline(always)]
fn for_each_node(values: &mut [Lane], mut apply: impl FnMut(&mut f64, f64)) {
    let last = values.len() - 1;
    for (i, lane) in values.iter_mut().enumerate().step_by(2) {
        let scale = if i == 0 || i == last { END_SCALE } else { NODE_SCALE };
        lane.iter_mut().for_each(|value| apply(value, scale));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_has_three_coefficients() {
        let basis = Multi::new(33);
        let ramp: Vec<Lane> = (0..33).map(|t| [2.0 + 0.7 * t as f64; LANES]).collect();
        let mut coefficients = vec![Lane::default(); 33];
        basis.forward(&ramp, &mut coefficients);
        assert!(coefficients[3..].iter().all(|c| c[0].abs() < 1e-12));
    }
}
