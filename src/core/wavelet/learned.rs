//! An orthonormal basis learned from the window's own series: the principal components found by the encoder (eq 20).
//!
//! The file stores the first functions as 16-bit numbers. The Gram-Schmidt process, applied twice to remove rounding
//! errors, makes them orthonormal one after another. Haar functions complete the basis. If Haar functions depend on
//! earlier ones, functions of single frames follow.

use super::{Haar, LANES, Lane, TimeBasis, synthesis};
use crate::base::vectors::dispatch;

/// The unit of a stored function's values.
const UNIT: f64 = 1.0 / 32768.0;

/// Orthonormal functions.
#[derive(Debug)]
pub struct Learned {
    /// `rows[k][t]`
    rows: Vec<Vec<f64>>,
    /// `columns[t][k]`
    columns: Vec<Vec<f64>>,
    frames: usize,
}

impl Learned {
    /// Creates a basis from `functions` (`frames` values each, in units of 2^-15), made orthonormal one after another,
    /// and completed by Haar functions.
    pub(crate) fn new(functions: &[i16], frames: usize) -> Self {
        let learned = functions.chunks_exact(frames).map(|row| row.iter().map(|v| f64::from(*v) * UNIT).collect());
        let mut rows: Vec<Vec<f64>> = Vec::with_capacity(frames);
        let unit = |t| (0..frames).map(|s| if s == t { 1.0 } else { 0.0 }).collect();
        let completing = synthesis(&Haar::new(frames)).into_iter().chain((0..frames).map(unit));
        for candidate in learned.chain(completing) {
            if rows.len() < frames {
                rows.extend(orthonormal(candidate, &rows));
            }
        }
        Self::from_rows(rows, frames)
    }

    fn from_rows(rows: Vec<Vec<f64>>, frames: usize) -> Self {
        let columns = (0..frames).map(|t| rows.iter().map(|row| row[t]).collect()).collect();
        Self { rows, columns, frames }
    }

    /// Rounds a function to the numbers that a file stores.
    pub fn quantise(row: &[f64]) -> impl Iterator<Item = i16> {
        row.iter().map(|v| (v / UNIT).round().clamp(-32767.0, 32767.0) as i16)
    }
}

/// The part of a function that is orthogonal to all rows, with norm 1; none if almost nothing is left.
fn orthonormal(mut f: Vec<f64>, rows: &[Vec<f64>]) -> Option<Vec<f64>> {
    let before = dot(&f, &f);
    for row in rows.iter().chain(rows) {
        // Twice, because one pass leaves rounding errors.
        let along = dot(&f, row);
        f.iter_mut().zip(row).for_each(|(f, u)| *f -= along * u);
    }
    let squares = dot(&f, &f);
    let norm = squares.sqrt();
    (squares > SMALLEST * before.max(SMALLEST)).then(|| f.into_iter().map(|f| f / norm).collect())
}

/// The share of a function's energy below which it counts as dependent on the functions before it.
const SMALLEST: f64 = 1e-10;

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl TimeBasis for Learned {
    fn frames(&self) -> usize {
        self.frames
    }

    fn coefficients(&self) -> usize {
        self.rows.len()
    }

    fn levels(&self) -> Vec<usize> {
        // The most important first. Each level has as many as all levels before it.
        let k = self.rows.len();
        let ends = (0..).map(|l| (1_usize << l).min(k)).take_while(|end| *end < k).chain([k]);
        let mut before = 0;
        ends.map(|end| end - std::mem::replace(&mut before, end)).collect()
    }

    fn forward(&self, series: &[Lane], coefficients: &mut [Lane]) {
        dispatch!(sums_of_products(&self.rows[..], series, coefficients));
    }

    fn rows(&self) -> Option<&[Vec<f64>]> {
        Some(&self.rows)
    }

    fn inverse(&self, coefficients: &mut [Lane], series: &mut [Lane]) {
        dispatch!(sums_of_products(&self.columns[..], &*coefficients, series));
    }

    fn only(&self, marked: &[bool]) -> Option<Box<dyn TimeBasis>> {
        if !marked.contains(&false) {
            return None;
        }
        let rows = self.rows.iter().zip(marked).filter(|(_, marked)| **marked).map(|(row, _)| row.clone());
        Some(Box::new(Self::from_rows(rows.collect(), self.frames)))
    }

    fn only_frames(&self, frames: &[usize]) -> Option<Box<dyn TimeBasis>> {
        let some = |row: &Vec<f64>| frames.iter().map(|frame| row[*frame]).collect();
        let is_part = (1..self.frames).contains(&frames.len());
        is_part.then(|| Box::new(Self::from_rows(self.rows.iter().map(some).collect(), frames.len())) as _)
    }
}

/// out_i = sum over j of `factors[i][j]` times lane j, from the first j to the last (eq 5, or its transpose).
#[inline(always)]
fn sums_of_products(factors: &[Vec<f64>], lanes: &[Lane], out: &mut [Lane]) {
    let (some, last) = factors.as_chunks::<SIDE_BY_SIDE>();
    let (some_out, last_out) = out.as_chunks_mut::<SIDE_BY_SIDE>();
    for (out, factors) in some_out.iter_mut().zip(some) {
        *out = products(factors, lanes);
    }
    for (out, factors) in last_out.iter_mut().zip(last) {
        [*out] = products(std::array::from_ref(factors), lanes);
    }
}

#[inline(always)]
fn products<const N: usize>(factors: &[Vec<f64>; N], lanes: &[Lane]) -> [Lane; N] {
    let factors = factors.each_ref().map(|f| &f[..lanes.len()]);
    let mut sums = [Lane::default(); N];
    for (j, lane) in lanes.iter().enumerate() {
        for i in 0..N {
            for l in 0..LANES {
                sums[i][l] += lane[l] * factors[i][j];
            }
        }
    }
    sums
}

/// The number of sums computed together, because each must wait for its last addition.
const SIDE_BY_SIDE: usize = 4;
