//! Compares differences with bounds in exact arithmetic: integers of any length, in units of 2^-1074.

use std::cmp::Ordering;

/// An integer of any length in 64-bit words, the least significant first.
type Whole = Vec<u64>;

/// |x| in units of 2^-1074; x is finite.
fn whole(x: f64) -> Whole {
    assert!(x.is_finite());
    let (mantissa, exponent) = parts(x);
    shifted(&vec![mantissa], (exponent + 1074) as usize)
}

/// |x| = mantissa * 2^exponent.
fn parts(x: f64) -> (u64, i64) {
    let bits = x.to_bits();
    let (field, fraction) = ((bits >> 52 & 0x7ff) as i64, bits & ((1 << 52) - 1));
    if field == 0 { (fraction, -1074) } else { (fraction | 1 << 52, field - 1075) }
}

fn shifted(a: &Whole, bits: usize) -> Whole {
    let mut out = vec![0; bits / 64];
    let mut carry = 0_u128;
    for word in a {
        carry |= u128::from(*word) << (bits % 64);
        out.push(carry as u64);
        carry >>= 64;
    }
    out.push(carry as u64);
    out
}

fn word(a: &Whole, i: usize) -> u64 {
    a.get(i).copied().unwrap_or(0)
}

fn compare(a: &Whole, b: &Whole) -> Ordering {
    let words = (0..a.len().max(b.len())).rev();
    words.map(|i| word(a, i).cmp(&word(b, i))).find(|o| o.is_ne()).unwrap_or(Ordering::Equal)
}

fn sum(a: &Whole, b: &Whole) -> Whole {
    let mut carry = 0_u128;
    let mut out = Vec::new();
    for i in 0..=a.len().max(b.len()) {
        carry += u128::from(word(a, i)) + u128::from(word(b, i));
        out.push(carry as u64);
        carry >>= 64;
    }
    out
}

/// a - b, which is not negative.
fn less(a: &Whole, b: &Whole) -> Whole {
    let mut borrow = 0_i128;
    let out = (0..a.len().max(b.len()))
        .map(|i| {
            let d = i128::from(word(a, i)) - i128::from(word(b, i)) + borrow;
            borrow = d >> 64;
            d as u64
        })
        .collect();
    assert_eq!(borrow, 0);
    out
}

fn product(a: &Whole, b: &Whole) -> Whole {
    let mut out = vec![0_u64; a.len() + b.len()];
    for (i, x) in a.iter().enumerate().filter(|(_, x)| **x != 0) {
        let mut carry = 0_u128;
        for (j, slot) in out[i..].iter_mut().enumerate() {
            carry += u128::from(*slot) + u128::from(*x) * u128::from(word(b, j));
            *slot = carry as u64;
            carry >>= 64;
        }
    }
    out
}

/// |a - b|.
fn distance(a: f64, b: f64) -> Whole {
    let (x, y) = (whole(a), whole(b));
    match (a.is_sign_negative() == b.is_sign_negative(), compare(&x, &y)) {
        (false, _) => sum(&x, &y),
        (true, Ordering::Less) => less(&y, &x),
        (true, _) => less(&x, &y),
    }
}

/// A bound: share * tolerance * (hi - lo), exactly.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limit {
    share: f64,
    tolerance: f64,
    lo: f64,
    hi: f64,
}

/// Below this share of a bound, rounding in `f64` cannot decide the comparison.
const CLEAR: f64 = 1.0 - 1e-12;

impl Limit {
    /// tolerance * (hi - lo)
    pub(crate) fn range(tolerance: f64, lo: f64, hi: f64) -> Self {
        Self { share: 1.0, tolerance, lo, hi }
    }

    /// A bound given as a number.
    pub(crate) fn of(number: f64) -> Self {
        Self::range(1.0, 0.0, number)
    }

    /// The relative bound of a sample: tolerance * max(|value|, floor).
    pub(crate) fn relative(tolerance: f64, floor: f64, value: f64) -> Self {
        Self::range(tolerance, 0.0, value.abs().max(floor))
    }

    /// A share of the bound.
    pub(crate) fn used(self, share: f64) -> Self {
        Self { share, ..self }
    }

    /// Whether |a - b| <= the bound.
    pub(crate) fn holds(&self, a: f64, b: f64) -> bool {
        if a == b {
            return true;
        }
        let bound = self.approximate();
        if bound.is_normal() && bound > 1e-290 && (a - b).abs() < bound * CLEAR {
            return true;
        }
        let (mantissa, exponent) = self.factor();
        let right = product(&mantissa, &distance(self.hi, self.lo));
        compare(&shifted(&distance(a, b), exponent), &right).is_le()
    }

    /// Whether sqrt(sum of (a - b)^2 over the pairs / `frames`) <= the bound.
    pub(crate) fn holds_rms(&self, pairs: &[(f64, f64)], frames: usize) -> bool {
        let bound = self.approximate();
        let squares: f64 = pairs.iter().map(|(a, b)| ((a - b) / bound).powi(2)).sum();
        if bound.is_normal() && bound > 1e-290 && squares < frames as f64 * CLEAR * CLEAR {
            return true;
        }
        let (mantissa, exponent) = self.factor();
        let right = product(&mantissa, &distance(self.hi, self.lo));
        let right = product(&vec![frames as u64], &product(&right, &right));
        let square = |(a, b): &(f64, f64)| {
            let d = shifted(&distance(*a, *b), exponent);
            product(&d, &d)
        };
        let left = pairs.iter().filter(|(a, b)| a != b).fold(vec![0], |all, pair| sum(&all, &square(pair)));
        compare(&left, &right).is_le()
    }

    fn approximate(&self) -> f64 {
        self.share * self.tolerance * (self.hi - self.lo)
    }

    /// share * tolerance as an integer and the power of 2 by which it is divided.
    fn factor(&self) -> (Whole, usize) {
        assert!(self.lo <= self.hi && [self.share, self.tolerance].iter().all(|f| (0.0..=1.0).contains(f)));
        let [(a, down), (b, further)] = [self.share, self.tolerance].map(parts);
        (product(&vec![a], &vec![b]), -(down + further) as usize)
    }
}

#[test]
fn exact_comparisons_see_the_last_bit() {
    let limit = Limit::range(0.5, -f64::MAX, f64::MAX);
    assert!(limit.holds(f64::MAX, 0.0) && limit.holds(0.0, -f64::MAX));
    assert!(!limit.holds(f64::MAX, -5e-324));
    assert!(Limit::of(1.0).holds(1.0, 0.0) && !Limit::of(1.0).holds(1.0, -5e-324));
    assert!(!Limit::of(0.0).holds(5e-324, 0.0) && Limit::of(5e-324).holds(5e-324, 0.0));
    assert!(Limit::of(1e-300).holds(0.0, -0.0));
    // As floats, 0.1 is a little more than a tenth and 0.3 a little less than three tenths.
    assert!(Limit::range(0.1, 0.0, 3.0).holds(0.3, 0.0));
    assert!(!Limit::range(0.1, 0.0, 3.0).holds(0.1 * 3.0, 0.0));
    assert!(Limit::relative(0.25, 1.0, -8.0).holds(-6.0, -8.0) && !Limit::relative(0.25, 1.0, -8.0).holds(-5.9, -8.0));
    assert!(
        Limit::relative(0.25, 1.0, -0.5).holds(-0.25, -0.5) && !Limit::relative(0.25, 0.0, -0.5).holds(-0.25, -0.5)
    );
    assert!(Limit::of(4.0).used(0.25).holds(1.0, 0.0) && !Limit::of(4.0).used(0.25_f64.next_down()).holds(1.0, 0.0));
    assert!(!Limit::of(1e-300).used(1e-20).holds(1e-319, 0.0) && Limit::of(1e-300).used(1e-20).holds(5e-324, 0.0));
    assert!(
        Limit::of(5.0).holds_rms(&[(1.0, -6.0), (1.0, 2.0)], 2)
            && !Limit::of(5.0).holds_rms(&[(7.0, 0.0), (1.0_f64.next_up(), 0.0)], 2)
    );
}
