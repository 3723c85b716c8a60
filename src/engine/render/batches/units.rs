//! The units of samples.

/// A linear map from values to 32-bit numbers: `(value - zero) * per`.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Units {
    pub(in crate::render) zero: f64,
    pub(in crate::render) per: f64,
}

impl Units {
    /// A value in these units.
    pub(in crate::render) fn number(&self, value: f64) -> f32 {
        /// Sums of 32-bit numbers up to this do not overflow.
        const MOST: f64 = 5e37;
        ((value - self.zero) * self.per).clamp(-MOST, MOST) as f32
    }

    /// The value of a number of these units.
    pub(in crate::render) fn value(&self, number: f32) -> f64 {
        f64::from(number) / self.per + self.zero
    }
}
