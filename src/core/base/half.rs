//! Half-precision numbers (IEEE 754 binary16): 1 bit of sign, 5 of exponent, 10 of mantissa.

/// A half-precision number by its bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Half(u16);

/// Bits of an `f64` mantissa beyond those of a half.
const DROPPED: u32 = 52 - 10;

/// Difference of the exponents' biases.
const REBIAS: u64 = 1023 - 15;

/// The bits of infinity; those of not-a-number are larger.
const INFINITY: u64 = 0x7c00;

/// The quiet bit of a half that is not a number.
const QUIET: u64 = 0x0200;

impl Half {
    /// The distance of 1 to the next larger number.
    pub(crate) const EPSILON: f64 = 1.0 / 1024.0;
    /// The smallest number above 0.
    pub(crate) const LEAST: f64 = 1.0 / 16_777_216.0;
    /// The smallest number with all bits of its mantissa.
    const LEAST_NORMAL: f64 = 1.0 / 16_384.0;

    pub(crate) const fn from_le_bytes(bytes: [u8; 2]) -> Self {
        Self(u16::from_le_bytes(bytes))
    }

    pub(crate) const fn to_le_bytes(self) -> [u8; 2] {
        self.0.to_le_bytes()
    }

    /// The next larger half.
    pub(crate) fn next_up(self) -> Self {
        match self.0 {
            0x8000 => Self(1), // -0
            bits if bits & 0x8000 == 0 => Self(if u64::from(bits) < INFINITY { bits + 1 } else { bits }),
            bits => Self(bits - 1),
        }
    }

    /// The next smaller half.
    pub(crate) fn next_down(self) -> Self {
        let Self(up) = Self(self.0 ^ 0x8000).next_up();
        Self(up ^ 0x8000)
    }

    /// The nearest half, ties to even; beyond the largest, infinity.
    pub(crate) fn nearest(value: f64) -> Self {
        let sign = (value.to_bits() >> 48) as u16 & 0x8000;
        let magnitude = value.abs();
        let bits = if value.is_nan() {
            INFINITY | QUIET | (value.to_bits() >> DROPPED & 0x3ff)
        } else if magnitude < Self::LEAST_NORMAL {
            // Here f64 numbers are a multiple of LEAST apart, so the sum is rounded to a half.
            const APART: f64 = Half::LEAST * (1_u64 << 52) as f64;
            (magnitude + APART).to_bits() - APART.to_bits()
        } else {
            let bits = magnitude.to_bits();
            let is_odd = bits >> DROPPED & 1;
            let rounded = (bits + (1 << (DROPPED - 1)) - 1 + is_odd) >> DROPPED;
            (rounded - (REBIAS << 10)).min(INFINITY)
        };
        Self(sign | bits as u16)
    }
}

impl From<Half> for f64 {
    fn from(Half(bits): Half) -> Self {
        let sign = u64::from(bits & 0x8000) << 48;
        let magnitude = u64::from(bits & 0x7fff);
        let scale = Self::from_bits((1023 + REBIAS) << 52);
        let finite = (Self::from_bits(magnitude << DROPPED) * scale).to_bits();
        let quiet = if magnitude > INFINITY { QUIET } else { 0 };
        let other = (magnitude | quiet) << DROPPED | 0x7ff << 52;
        Self::from_bits(sign | if magnitude < INFINITY { finite } else { other })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_half_is_the_same_number_as_another_implementation_has() {
        for bits in 0..=u16::MAX {
            let expected = half::f16::from_bits(bits).to_f64();
            assert_eq!(f64::from(Half(bits)).to_bits(), expected.to_bits(), "{bits:#x}");
        }
    }

    #[test]
    fn every_half_is_nearest_to_itself() {
        for bits in 0..=u16::MAX {
            let found = Half::nearest(f64::from(Half(bits)));
            let quieted = if bits & 0x7fff > 0x7c00 { bits | 0x0200 } else { bits };
            assert_eq!(found, Half(quieted));
        }
    }

    #[test]
    fn numbers_between_halves_go_to_the_nearest_and_ties_to_even() {
        for low in 0..0x7c00 {
            let next = if low == 0x7bff { 65_536.0 } else { f64::from(Half(low + 1)) };
            let tie = (f64::from(Half(low)) + next) / 2.0;
            for (value, expected) in
                [(tie.next_down(), low), (tie, low + (low & 1)), (tie.next_up(), low + 1), (next.next_down(), low + 1)]
            {
                assert_eq!(Half::nearest(value), Half(expected), "{value:e}");
                assert_eq!(Half::nearest(-value), Half(expected | 0x8000), "-{value:e}");
            }
        }
    }

    #[test]
    fn numbers_beyond_all_halves_are_infinite_or_zero() {
        for value in [65_520.0, 1e10, f64::MAX, f64::INFINITY] {
            assert_eq!((Half::nearest(value), Half::nearest(-value)), (Half(0x7c00), Half(0xfc00)));
        }
        for value in [0.0, f64::from_bits(1), f64::MIN_POSITIVE, 1e-30, Half::LEAST / 2.0] {
            assert_eq!((Half::nearest(value), Half::nearest(-value)), (Half(0), Half(0x8000)));
        }
    }

    #[test]
    fn constants_are_what_they_say() {
        assert_eq!(f64::from(Half(1)), Half::LEAST);
        assert_eq!(f64::from(Half(0x0400)), Half::LEAST_NORMAL);
        assert_eq!(f64::from(Half(0x3c01)) - f64::from(Half(0x3c00)), Half::EPSILON);
    }
}
