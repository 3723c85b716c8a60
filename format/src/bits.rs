//! Bit strings, and numbers of variable length.

use crate::bytes::{ParseResult, ensure};

/// Appends numbers of any bit width, lowest bit first.
pub(crate) struct BitWriter<'a> {
    out: &'a mut Vec<u8>,
    held: u64,
    count: u32,
}

impl<'a> BitWriter<'a> {
    pub(crate) fn new(out: &'a mut Vec<u8>) -> Self {
        Self { out, held: 0, count: 0 }
    }

    /// Appends a number of `bits` bits (0 to 32). Its higher bits must be zero.
    pub(crate) fn put(&mut self, value: u32, bits: u32) {
        self.held |= u64::from(value) << self.count;
        self.count += bits;
        while self.count >= 8 {
            self.out.push(self.held as u8);
            self.held >>= 8;
            self.count -= 8;
        }
    }

    /// Fills the last byte with zeros.
    pub(crate) fn finish(self) {
        if self.count > 0 {
            self.out.push(self.held as u8);
        }
    }
}

/// Reads numbers of any bit width. Past the end it reads zeros; [`BitReader::end`] then fails.
pub(crate) struct BitReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> BitReader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// Reads the next `bits` bits, 0 to 32.
    pub(crate) fn take(&mut self, bits: u32) -> u32 {
        let ahead = self.bytes.get(self.at / 8..).unwrap_or(&[]);
        let word = ahead.first_chunk().map_or_else(|| short_word(ahead), |word| u64::from_le_bytes(*word));
        let value = word >> (self.at % 8) & ((1 << bits) - 1);
        self.at = self.at.saturating_add(bits as usize);
        value as u32
    }

    /// Returns the bytes after the last byte read, whose unread bits must be zero.
    pub(crate) fn end(self) -> ParseResult<&'a [u8]> {
        let (used, rest) = self.bytes.split_at_checked(self.at.div_ceil(8)).ok_or("ends within its bits")?;
        let padding = if self.at.is_multiple_of(8) { 0 } else { used.last().map_or(0, |last| last >> (self.at % 8)) };
        ensure(padding == 0, || "padding bits are not zero".into())?;
        Ok(rest)
    }
}

/// Fewer than 8 bytes as a word, padded with zeros.
fn short_word(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |word, &byte| word << 8 | u64::from(byte))
}

/// Appends a number in 7-bit groups, the lowest first. The highest bit of a byte says that another byte follows.
pub(crate) fn put_varint(mut value: usize, out: &mut Vec<u8>) {
    while value > 0x7F {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}

/// Reads a number of at most 5 bytes. Fails if fewer bytes could hold it.
pub(crate) fn take_varint(bytes: &mut &[u8]) -> ParseResult<usize> {
    let mut value = 0u64;
    for shift in 0..5 {
        let (&byte, rest) = bytes.split_first().ok_or("ends within a number")?;
        *bytes = rest;
        value |= u64::from(byte & 0x7F) << (7 * shift);
        if byte < 0x80 {
            ensure(byte > 0 || shift == 0, || "a number is longer than necessary".into())?;
            return usize::try_from(value).map_err(|_| "a number is too large".into());
        }
    }
    Err("a number is too long".into())
}

/// Reads `count` bytes.
pub(crate) fn take_bytes<'a>(bytes: &mut &'a [u8], count: usize) -> ParseResult<&'a [u8]> {
    let short = || format!("{} bytes are left, {count} expected", bytes.len());
    let (head, rest) = bytes.split_at_checked(count).ok_or_else(short)?;
    *bytes = rest;
    Ok(head)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_have_the_documented_bytes() {
        let mut out = Vec::new();
        put_varint(5, &mut out);
        put_varint(300, &mut out);
        assert_eq!(out, [5, 0xAC, 2]);
        for hostile in [&[][..], &[0x80], &[0x80, 0], &[255; 5]] {
            assert!(take_varint(&mut &hostile[..]).is_err(), "{hostile:?}");
        }
    }

    #[test]
    fn padding_is_zero_and_bits_do_not_run_out() {
        let mut bits = BitReader::new(&[0b101, 7]);
        assert_eq!(bits.take(3), 5);
        assert_eq!(bits.end(), Ok(&[7u8][..]));
        let mut bits = BitReader::new(&[0b1101]);
        bits.take(3);
        assert!(bits.end().is_err());
        let mut bits = BitReader::new(&[1]);
        assert_eq!(bits.take(9), 1);
        assert!(bits.end().is_err());
    }

    proptest! {
        #[test]
        fn numbers_round_trip(values in prop::collection::vec((any::<u32>(), 0u32..33), 0..50)) {
            let low = |value: u32, bits: u32| (u64::from(value) & ((1 << bits) - 1)) as u32;
            let mut out = Vec::new();
            let mut writer = BitWriter::new(&mut out);
            values.iter().for_each(|&(value, bits)| writer.put(low(value, bits), bits));
            writer.finish();
            let mut reader = BitReader::new(&out);
            for &(value, bits) in &values {
                prop_assert_eq!(reader.take(bits), low(value, bits));
            }
            prop_assert_eq!(reader.end(), Ok(&[][..]));
        }

        #[test]
        fn varints_round_trip(value in 0usize..1 << 35) {
            let mut out = Vec::new();
            put_varint(value, &mut out);
            prop_assert_eq!(take_varint(&mut &out[..]), Ok(value));
        }
    }
}
