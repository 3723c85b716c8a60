//! Codes bits in about as much space as their entropy: a binary arithmetic coder whose chances adapt to the bits
//! ([Martin](https://sachingarg.com/compression/entropy_coding/range_coder.pdf)).
//!
//! An interval of 32 bits is divided at `bound = (range >> 16) * chance` for each bit: 0 takes the part below, 1 that above. Once the
//! interval is below 2^24, its highest byte is settled, except for a carry, and leaves the coder.

/// How likely the next bit of a kind is 0, learned from those before.
#[derive(Debug, Clone, Copy)]
pub struct Chance {
    /// The chance of 0, in units of 2^-16.
    of_zero: u32,
    /// How far it moves with the next bit, as a shift.
    shift: u32,
}

impl Chance {
    /// Both bits are equally likely.
    pub const EVEN: Self = Self { of_zero: 1 << 15, shift: 1 };

    /// Learns from a bit; the first bits of a kind count most. Returns the length of the bit's part of an interval that is divided at `bound`.
    fn learn(&mut self, bit: bool, bound: u32, range: u32) -> u32 {
        if bit {
            self.of_zero -= self.of_zero >> self.shift;
        } else {
            self.of_zero += ((1 << 16) - self.of_zero) >> self.shift;
        }
        self.shift = (self.shift + 1).min(SLOWEST);
        if bit { range - bound } else { bound }
    }

    /// Where an interval is divided.
    fn bound(self, range: u32) -> u32 {
        (range >> 16) * self.of_zero
    }
}

/// Chances move by at least one part in 2^this, rounded down, so none reaches 0 or 1.
const SLOWEST: u32 = 6;

/// Intervals are at least this long.
const SHORTEST: u32 = 1 << 24;

/// Writes bits.
#[derive(Debug)]
pub struct BitEncoder {
    /// The interval's lower end; bit 32 is a carry.
    low: u64,
    range: u32,
    /// The last byte that a carry may change, if there is one, and the number of bytes 0xFF behind it.
    pending: Option<u8>,
    full: usize,
    out: Vec<u8>,
}

impl Default for BitEncoder {
    fn default() -> Self {
        Self { low: 0, range: u32::MAX, pending: None, full: 0, out: Vec::new() }
    }
}

impl BitEncoder {
    /// Writes a bit of a kind.
    pub fn put(&mut self, chance: &mut Chance, bit: bool) {
        let bound = chance.bound(self.range);
        self.low += if bit { u64::from(bound) } else { 0 };
        self.range = chance.learn(bit, bound, self.range);
        while self.range < SHORTEST {
            self.range <<= 8;
            self.settle();
        }
    }

    /// The bytes that stand for all bits.
    pub fn finish(mut self) -> Vec<u8> {
        (0..WORD).for_each(|_| self.settle());
        self.release(0);
        let zeros = self.out.iter().rev().take_while(|byte| **byte == 0).count();
        self.out.truncate(self.out.len() - zeros); // a reader reads zeros behind the end
        self.out
    }

    /// Moves the highest byte of the interval out.
    fn settle(&mut self) {
        let (byte, carry) = ((self.low >> 24) as u8, (self.low >> 32) as u8);
        if byte == 0xFF && carry == 0 {
            self.full += 1;
        } else {
            self.release(carry);
            self.pending = Some(byte);
        }
        self.low = self.low << 8 & u64::from(u32::MAX);
    }

    /// Writes the pending bytes.
    fn release(&mut self, carry: u8) {
        self.out.extend(self.pending.take().map(|byte| byte.wrapping_add(carry)));
        self.out.extend(std::iter::repeat_n(0xFF_u8.wrapping_add(carry), std::mem::take(&mut self.full)));
    }
}

/// Bytes of an interval's end.
const WORD: usize = 4;

/// Reads bits. Behind the last byte it reads zeros.
#[derive(Debug)]
pub struct BitDecoder<'a> {
    bytes: std::slice::Iter<'a, u8>,
    range: u32,
    /// The code, counted from the interval's lower end.
    code: u32,
}

impl<'a> BitDecoder<'a> {
    /// Reads what [`BitEncoder::finish`] returned.
    pub fn new(bytes: &'a [u8]) -> Self {
        let mut decoder = Self { bytes: bytes.iter(), range: u32::MAX, code: 0 };
        (0..WORD).for_each(|_| decoder.shift());
        decoder
    }

    /// Reads a bit of a kind.
    pub fn take(&mut self, chance: &mut Chance) -> bool {
        let bound = chance.bound(self.range);
        let bit = self.code >= bound;
        self.code -= if bit { bound } else { 0 };
        self.range = chance.learn(bit, bound, self.range);
        while self.range < SHORTEST {
            self.range <<= 8;
            self.shift();
        }
        bit
    }

    fn shift(&mut self) {
        self.code = self.code << 8 | u32::from(self.bytes.next().copied().unwrap_or(0));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn coded(bits: &[(usize, bool)]) -> Vec<u8> {
        let (mut encoder, mut chances) = (BitEncoder::default(), [Chance::EVEN; 4]);
        bits.iter().for_each(|(kind, bit)| encoder.put(&mut chances[*kind], *bit));
        encoder.finish()
    }

    proptest! {
        #[test]
        fn bits_are_read_as_written(bits in prop::collection::vec((0..4usize, prop::bool::weighted(0.03)), 0..4000), flip in any::<bool>()) {
            let bits: Vec<_> = bits.into_iter().map(|(kind, bit)| (kind, bit != (flip && kind == 2))).collect();
            let bytes = coded(&bits);
            let (mut decoder, mut chances) = (BitDecoder::new(&bytes), [Chance::EVEN; 4]);
            for (kind, bit) in &bits {
                prop_assert_eq!(decoder.take(&mut chances[*kind]), *bit);
            }
        }
    }

    #[test]
    fn bits_take_about_their_entropy() {
        let bits: Vec<_> = (0..80_000_u32).map(|i| (0, i.wrapping_mul(0x9E37_79B1) >> 24 < 8)).collect(); // one in 32
        let share = 1.0 / 32.0_f64;
        let entropy = -(share * share.log2() + (1.0 - share) * (1.0 - share).log2()) * bits.len() as f64 / 8.0;
        let len = coded(&bits).len() as f64;
        assert!((entropy * 0.9..entropy * 1.1).contains(&len), "{len} bytes of {entropy}");
    }

    #[test]
    fn long_runs_take_next_to_nothing() {
        assert!(coded(&vec![(1, true); 100_000]).len() < 40);
        assert!(coded(&[]).is_empty());
    }
}
