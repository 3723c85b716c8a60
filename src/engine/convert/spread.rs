//! Places that spread evenly over a volume, however many there are.

/// A place below `counts`: number `number` of the sequence of [Roberts](wavesplat_core::bibliography).
pub(super) fn evenly(number: usize, counts: [usize; 3]) -> [usize; 3] {
    std::array::from_fn(|axis| {
        let position = (0.5 + GOLDEN[axis] * number as f64).fract();
        (position * counts[axis] as f64) as usize
    })
}

/// Fractions with evenly spread multiples: powers of the inverse of the root of x^4 = x + 1.
const GOLDEN: [f64; 3] = [0.819_172_513_396_164_4, 0.671_043_606_703_789_3, 0.549_700_477_901_970_2];
