//! No transform along time: coefficients are samples, and u_k(t) is 1 at t = k and 0 elsewhere (eq 5).

use super::{Lane, TimeBasis};

/// The identity transform.
#[derive(Debug)]
pub(crate) struct Samples(pub(super) usize);

impl TimeBasis for Samples {
    fn frames(&self) -> usize {
        self.0
    }

    fn coefficients(&self) -> usize {
        self.0
    }

    fn levels(&self) -> Vec<usize> {
        vec![self.0]
    }

    fn forward(&self, series: &[Lane], coefficients: &mut [Lane]) {
        coefficients.copy_from_slice(series);
    }

    fn inverse(&self, coefficients: &mut [Lane], series: &mut [Lane]) {
        series.copy_from_slice(coefficients);
    }
}
