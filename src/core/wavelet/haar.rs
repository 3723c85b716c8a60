//! The [Haar](crate::bibliography) basis, orthonormal on the samples of a window of any length.
//!
//! Each step rotates two neighbours, the means of m1 and m2 samples, into a sum and a difference:
//!
//! ```text
//! s = a x1 + b x2    d = b x1 - a x2    a = sqrt(m1 / (m1 + m2))    b = sqrt(m2 / (m1 + m2))              (eq 17)
//! ```
//!
//! With m1 = m2 this is (x1 +- x2) / sqrt 2. A last node without a neighbour moves up one level unchanged, with its
//! smaller weight. So a constant series still has one coefficient, and a short last window needs no padding frames.
//!
//! Rotations preserve sums of squares: the squared error of a series is the sum of the squared errors of its
//! coefficients (eq 6).

use super::{LANES, Lane, TimeBasis};
use crate::base::vectors::dispatch;

/// The Haar basis for one window.
#[derive(Debug)]
pub(crate) struct Haar {
    frames: usize,
    /// The rotations (a, b) of each step, fine to coarse.
    steps: Vec<Vec<(f64, f64)>>,
}

impl Haar {
    /// Creates the basis for windows of `frames` frames, at least 1.
    pub(crate) fn new(frames: usize) -> Self {
        let mut weights = vec![1.0; frames];
        let mut steps = Vec::new();
        while weights.len() > 1 {
            steps.push(weights.as_chunks().0.iter().map(|[m1, m2]| rotation(*m1, *m2)).collect());
            weights = weights.chunks(2).map(|pair| pair.iter().sum()).collect();
        }
        Self { frames, steps }
    }
}

/// a and b of eq 17.
fn rotation(m1: f64, m2: f64) -> (f64, f64) {
    ((m1 / (m1 + m2)).sqrt(), (m2 / (m1 + m2)).sqrt())
}

impl TimeBasis for Haar {
    fn frames(&self) -> usize {
        self.frames
    }

    fn coefficients(&self) -> usize {
        self.frames
    }

    fn levels(&self) -> Vec<usize> {
        std::iter::once(1).chain(self.steps.iter().rev().map(Vec::len)).collect()
    }

    fn forward(&self, series: &[Lane], coefficients: &mut [Lane]) {
        dispatch!(forward(&self.steps[..], series, coefficients));
    }

    fn inverse(&self, coefficients: &mut [Lane], series: &mut [Lane]) {
        dispatch!(inverse(&self.steps[..], &*coefficients, series));
    }
}

#[inline(always)]
fn forward(steps: &[Vec<(f64, f64)>], series: &[Lane], coefficients: &mut [Lane]) {
    let mut sums = series.to_vec();
    let mut end = series.len();
    for step in steps {
        let details = &mut coefficients[end - step.len()..end];
        for (i, ((a, b), detail)) in step.iter().zip(details).enumerate() {
            let (x1, x2) = (sums[2 * i], sums[2 * i + 1]);
            sums[i] = combine(*a, &x1, *b, &x2);
            *detail = combine(*b, &x1, -*a, &x2);
        }
        carry_odd(&mut sums, step.len());
        end -= step.len();
    }
    coefficients[..end].copy_from_slice(&sums);
}

#[inline(always)]
fn inverse(steps: &[Vec<(f64, f64)>], coefficients: &[Lane], series: &mut [Lane]) {
    series[0] = coefficients[0];
    let mut len = 1;
    for step in steps.iter().rev() {
        let details = &coefficients[len..len + step.len()];
        if len > step.len() {
            series[2 * step.len()] = series[step.len()];
        }
        for (i, ((a, b), detail)) in step.iter().zip(details).enumerate().rev() {
            let sum = series[i];
            series[2 * i] = combine(*a, &sum, *b, detail);
            series[2 * i + 1] = combine(*b, &sum, -*a, detail);
        }
        len += step.len();
    }
}

/// Shortens `sums` to its first `pairs` entries, followed by the odd last one if there is one.
fn carry_odd(sums: &mut Vec<Lane>, pairs: usize) {
    if sums.len() > 2 * pairs {
        sums[pairs] = sums[2 * pairs];
        sums.truncate(pairs + 1);
    } else {
        sums.truncate(pairs);
    }
}

#[inline(always)]
fn combine(a: f64, x: &Lane, b: f64, y: &Lane) -> Lane {
    let mut out = Lane::default();
    for l in 0..LANES {
        out[l] = a * x[l] + b * y[l];
    }
    out
}
