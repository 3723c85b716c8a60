//! The two floating-point types in which a pyramid can be computed.

use super::buffer::Pooled;
use crate::base::zeroed::Pod;
use std::ops::{Add, Mul, Sub};

/// `f32` or `f64`. All operations are correctly rounded, so every machine computes the same bits.
pub trait Real:
    Pooled + Pod + Send + Sync + PartialOrd + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self>
{
    /// Codes are smaller than this. Whole numbers up to it, and halves between them, are exact.
    const MOST_CODE: Self;

    /// Blocks with larger samples are stored exactly, because sums of their coefficients could overflow.
    const LARGEST: f64;

    /// Adding and then subtracting this rounds smaller numbers to the nearest whole one.
    const BIG: Self;

    /// Rounds to the type.
    fn from_f64(x: f64) -> Self;

    /// Converts a code.
    fn from_code(code: i32) -> Self;

    /// Converts exactly.
    fn to_f64(self) -> f64;

    /// Whether the value is NaN.
    fn is_nan(self) -> bool;

    /// The whole number n (below 2^31 for `f64`, 2^22 for `f32`) from the sum n + [`Self::BIG`], by the sum's low bits.
    /// A general conversion to an integer would not compile to vector code.
    fn less_big(self) -> i32;

    /// The values, if they are 32-bit floats.
    fn singles(values: &[Self]) -> Option<&[f32]>;
}

/// A value that becomes a node.
pub(crate) trait IntoNode<R>: Copy {
    /// The node.
    fn node(self) -> R;
}

impl<R: Real> IntoNode<R> for R {
    #[inline(always)]
    fn node(self) -> R {
        self
    }
}

/// The little-endian bytes of a 32-bit float.
impl<R: Real> IntoNode<R> for [u8; 4] {
    #[inline(always)]
    fn node(self) -> R {
        R::from_f64(f32::from_le_bytes(self).into())
    }
}

impl Real for f32 {
    const MOST_CODE: Self = 2_097_152.0;
    const LARGEST: f64 = f32::MAX as f64 / 4096.0;
    const BIG: Self = 12_582_912.0;

    fn from_f64(x: f64) -> Self {
        x as Self
    }

    fn from_code(code: i32) -> Self {
        code as Self
    }

    fn is_nan(self) -> bool {
        self.is_nan()
    }

    fn to_f64(self) -> f64 {
        self.into()
    }

    fn less_big(self) -> i32 {
        self.to_bits().wrapping_sub(Self::BIG.to_bits()) as i32
    }

    fn singles(values: &[Self]) -> Option<&[f32]> {
        Some(values)
    }
}

impl Real for f64 {
    const MOST_CODE: Self = 1_073_741_824.0;
    const LARGEST: f64 = f64::MAX / 4096.0;
    const BIG: Self = 6_755_399_441_055_744.0;

    fn from_f64(x: f64) -> Self {
        x
    }

    fn from_code(code: i32) -> Self {
        code.into()
    }

    fn is_nan(self) -> bool {
        self.is_nan()
    }

    fn to_f64(self) -> f64 {
        self
    }

    fn less_big(self) -> i32 {
        self.to_bits().wrapping_sub(Self::BIG.to_bits()) as i32
    }

    fn singles(_: &[Self]) -> Option<&[f32]> {
        None
    }
}
