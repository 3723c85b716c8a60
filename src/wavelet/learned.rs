//! An orthonormal basis of the window's own series: a few learned functions, completed by Haar functions (and, should some of these be sums of others, by single
//! frames).

use super::{Haar, LANES, Lane, TimeBasis, synthesis};

/// What a value of a stored function counts.
const UNIT: f64 = 1.0 / 32768.0;

/// Orthonormal functions, `rows[k][t]`.
#[derive(Debug)]
pub struct Learned {
    rows: Vec<Vec<f64>>,
    frames: usize,
}

impl Learned {
    /// The basis whose first functions are those of `functions` (`frames` values each, in units of 2^-15), made orthonormal
    /// one after another; Haar functions complete it.
    pub fn new(functions: &[i16], frames: usize) -> Self {
        let learned = functions.chunks_exact(frames).map(|row| row.iter().map(|v| f64::from(*v) * UNIT).collect());
        let mut rows: Vec<Vec<f64>> = Vec::with_capacity(frames);
        let unit = |t| (0..frames).map(|s| if s == t { 1.0 } else { 0.0 }).collect();
        let completing = synthesis(&Haar::new(frames)).into_iter().chain((0..frames).map(unit));
        for candidate in learned.chain(completing) {
            if rows.len() < frames {
                rows.extend(orthonormal(candidate, &rows));
            }
        }
        Self { rows, frames }
    }

    /// Functions as a file stores them.
    pub fn quantise(row: &[f64]) -> impl Iterator<Item = i16> {
        row.iter().map(|v| (v / UNIT).round().clamp(-32767.0, 32767.0) as i16)
    }
}

/// What of a function no row gives, with norm 1; none if that is next to nothing.
fn orthonormal(mut f: Vec<f64>, rows: &[Vec<f64>]) -> Option<Vec<f64>> {
    let before = dot(&f, &f);
    for row in rows.iter().chain(rows) {
        // Twice: once leaves what rounding made of it.
        let along = dot(&f, row);
        f.iter_mut().zip(row).for_each(|(f, u)| *f -= along * u);
    }
    let squares = dot(&f, &f);
    let norm = squares.sqrt();
    (squares > SMALLEST * before.max(SMALLEST)).then(|| f.into_iter().map(|f| f / norm).collect())
}

/// Share of a function's energy below which it is taken for a sum of those before it.
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
        // The more important first: as many in each level as in all before it.
        let k = self.rows.len();
        let ends = (0..).map(|l| (1_usize << l).min(k)).take_while(|end| *end < k).chain([k]);
        let mut before = 0;
        ends.map(|end| end - std::mem::replace(&mut before, end)).collect()
    }

    fn forward(&self, series: &[Lane], coefficients: &mut [Lane]) {
        for (c, row) in coefficients.iter_mut().zip(&self.rows) {
            *c = Lane::default();
            for (v, u) in series.iter().zip(row) {
                (0..LANES).for_each(|l| c[l] += u * v[l]);
            }
        }
    }

    fn inverse(&self, coefficients: &mut [Lane], series: &mut [Lane]) {
        series.fill(Lane::default());
        for (c, row) in coefficients.iter().zip(&self.rows).filter(|(c, _)| **c != Lane::default()) {
            for (v, u) in series.iter_mut().zip(row) {
                (0..LANES).for_each(|l| v[l] += c[l] * u);
            }
        }
    }
}
