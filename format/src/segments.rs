//! Packs a string of bytes in segments, each in the shortest of several encodings.

use crate::bits::{put_varint, take_bytes, take_varint};
use crate::bytes::{ParseResult, ensure};
use crate::rans::{States, decode, encode, normalise, put_frequencies, take_frequencies};

/// Frequencies can change after this many symbols of a stream.
const PIECE: usize = 1 << 12;

/// The encoding of a segment: the lowest bits of its head.
const RAW: usize = 0;
const CONSTANT: usize = 1;
const COARSE: usize = 2;
const FINE: usize = 3;
/// As the two before, with 32 states.
const WIDE: usize = 2;

/// The heads of segments.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Heads {
    /// Two bits for the encoding: as in version 1.0.
    Narrow,
    /// Three bits for the encoding, with one for 32 states.
    Wide,
}

impl Heads {
    /// Bits for the encoding.
    fn bits(self) -> u32 {
        if self == Self::Narrow { 2 } else { 3 }
    }
}

/// Segments of at least this many coded bytes have 32 states, whose bytes are less than a hundredth of them.
const LONG: usize = 1 << 13;

/// Precision of the frequencies in bits.
const COARSE_BITS: u32 = 12;
const FINE_BITS: u32 = 14;

/// Upper bound on the bytes that a piece adds to its symbols.
const HEAD: usize = 5;

/// Upper bound on the packed bytes of `symbols` symbols in `streams` streams.
pub(crate) fn max_segments(symbols: usize, streams: usize) -> usize {
    symbols.saturating_add(HEAD * (streams + symbols / PIECE))
}

/// Packs streams. `symbols` holds them one after another; `lengths` is the length of each.
pub(crate) fn pack_segments(symbols: &[u8], lengths: &[usize], heads: Heads, out: &mut Vec<u8>) {
    let mut rest = symbols;
    for segment in Segment::split(symbols, lengths) {
        let (symbols, after) = rest.split_at(segment.length);
        segment.pack(symbols, heads, out);
        rest = after;
    }
}

/// Estimates how many bytes [`pack_segments`] appends.
pub(crate) fn estimate_segments(symbols: &[u8], lengths: &[usize]) -> usize {
    let cost: u64 = Segment::split(symbols, lengths).iter().map(|segment| segment.cost).sum();
    (cost >> 19) as usize
}

/// Fills `symbols` from the segments at the front of `bytes`, and advances `bytes` past them.
pub(crate) fn unpack_segments(bytes: &mut &[u8], heads: Heads, symbols: &mut [u8]) -> ParseResult {
    let mut rest = symbols;
    while !rest.is_empty() {
        let head = take_varint(bytes)?;
        let (length, kind) = (head >> heads.bits(), head & ((1 << heads.bits()) - 1));
        let fits = 0 < length && length <= rest.len();
        ensure(fits, || format!("a segment of {length} symbols where {} are left", rest.len()))?;
        let (segment, after) = rest.split_at_mut(length);
        unpack_segment(bytes, kind, segment)?;
        rest = after;
    }
    Ok(())
}

fn unpack_segment(bytes: &mut &[u8], kind: usize, symbols: &mut [u8]) -> ParseResult {
    match kind {
        RAW => symbols.copy_from_slice(take_bytes(bytes, symbols.len())?),
        CONSTANT => symbols.fill(take_bytes(bytes, 1)?[0]),
        _ => {
            ensure(kind <= FINE + WIDE, || format!("a segment of kind {kind}"))?;
            let bits = if kind.is_multiple_of(2) { COARSE_BITS } else { FINE_BITS };
            let frequencies = take_frequencies(bytes, bits)?;
            let states = if kind > FINE { States::Many } else { States::of_length(symbols.len()) };
            decode(bytes, &frequencies, (bits, states), symbols)?;
        }
    }
    Ok(())
}

/// A run of symbols with the same frequencies.
struct Segment {
    length: usize,
    counts: [u32; 256],
    /// Estimated size in units of 1/65536 bit.
    cost: u64,
}

impl Segment {
    fn new(symbols: &[u8]) -> Self {
        Self::counted(symbols.len(), histogram(symbols))
    }

    fn counted(length: usize, counts: [u32; 256]) -> Self {
        Self { length, counts, cost: cost(length, &counts) }
    }

    /// The segments of streams: pieces, each joined with the previous segment unless that makes them longer.
    fn split(symbols: &[u8], lengths: &[usize]) -> Vec<Self> {
        let mut segments: Vec<Self> = Vec::new();
        let mut rest = symbols;
        for &length in lengths {
            let (stream, after) = rest.split_at(length);
            rest = after;
            for piece in stream.chunks(PIECE).map(Self::new) {
                let apart = if let Some(last) = segments.last_mut() { last.join(piece) } else { Some(piece) };
                segments.extend(apart);
            }
        }
        segments
    }

    /// Joins the next piece to this segment, or returns it if the two are shorter apart.
    fn join(&mut self, next: Self) -> Option<Self> {
        let counts = std::array::from_fn(|symbol| self.counts[symbol] + next.counts[symbol]);
        let both = Self::counted(self.length + next.length, counts);
        if both.cost > self.cost + next.cost {
            return Some(next);
        }
        *self = both;
        None
    }

    fn pack(&self, symbols: &[u8], heads: Heads, out: &mut Vec<u8>) {
        let head = |kind, out: &mut Vec<u8>| put_varint(self.length << heads.bits() | kind, out);
        let start = out.len();
        if self.counts.iter().filter(|&&count| count > 0).count() == 1 {
            head(CONSTANT, out);
            return out.push(symbols[0]);
        }
        let bits = self.bits();
        let wide = heads == Heads::Wide && self.coded(bits) >> 19 >= LONG as u64;
        let kind = if bits == COARSE_BITS { COARSE } else { FINE };
        head(if wide { kind + WIDE } else { kind }, out);
        let frequencies = normalise(&self.counts, bits);
        put_frequencies(&frequencies, bits, out);
        let states = if wide { States::Many } else { States::of_length(symbols.len()) };
        encode(symbols, &frequencies, (bits, states), out);
        if out.len() - start > symbols.len() {
            out.truncate(start);
            head(RAW, out);
            out.extend_from_slice(symbols);
        }
    }

    /// Precision of the frequencies in bits. Fine frequencies unpack more slowly, so they must save at least 1/256.
    fn bits(&self) -> u32 {
        let coarse = self.coded(COARSE_BITS);
        if self.coded(FINE_BITS) < coarse - coarse / 256 { FINE_BITS } else { COARSE_BITS }
    }

    /// Size in units of 1/65536 bit with frequencies of `bits` bits.
    fn coded(&self, bits: u32) -> u64 {
        let frequencies = normalise(&self.counts, bits);
        let mut table = Vec::new();
        put_frequencies(&frequencies, bits, &mut table);
        let used = self.counts.iter().zip(frequencies).filter(|(count, _)| **count > 0);
        let symbols = used.map(|(&count, f)| u64::from(count) * ((u64::from(bits) << 16) - log2(f.into())));
        symbols.sum::<u64>() + ((8 * table.len() as u64) << 16)
    }
}

/// Estimated size in units of 1/65536 bit: the entropy, 8 bits for each frequency, 100 bits for the head and the states.
fn cost(length: usize, counts: &[u32; 256]) -> u64 {
    let used = counts.iter().filter(|&&count| count > 0);
    let (kinds, saved) = used.fold((0, 0), |(kinds, saved), &c| (kinds + 1, saved + u64::from(c) * log2(c)));
    let coded = length as u64 * log2(length as u32) - saved + ((100 + 8 * kinds) << 16);
    let raw = (24 + 8 * length as u64) << 16;
    if kinds == 1 { 32 << 16 } else { raw.min(coded) }
}

/// Base 2 logarithm in units of 1/65536. Integer arithmetic makes it the same on every machine.
fn log2(value: u32) -> u64 {
    let whole = value.max(1).ilog2();
    let mantissa = (u64::from(value.max(1)) << 31) >> whole;
    let (at, between) = ((mantissa >> 23) as usize & 0xFF, mantissa & 0x7F_FFFF);
    let (low, high) = (u64::from(LOG2[at]), u64::from(LOG2[at + 1]));
    (u64::from(whole) << 16) + low + (((high - low) * between) >> 23)
}

/// `log2(1 + i / 256)` in units of 1/65536.
static LOG2: [u32; 257] = {
    let mut table = [0; 257];
    let mut i = 0;
    while i < 257 {
        table[i] = fraction(i as u64);
        i += 1;
    }
    table
};

/// One entry of [`LOG2`], bit by bit: squaring a number doubles its logarithm.
const fn fraction(i: u64) -> u32 {
    let (mut value, mut bits, mut step) = ((256 + i) << 23, 0, 0);
    if i == 256 {
        return 1 << 16;
    }
    while step < 16 {
        value = (value * value) >> 31;
        bits <<= 1;
        if value >> 32 != 0 {
            value >>= 1;
            bits |= 1;
        }
        step += 1;
    }
    bits
}

/// Counts how often each byte occurs. Four tables of counters, because equal neighbours would wait for each other in one.
fn histogram(symbols: &[u8]) -> [u32; 256] {
    let mut counts = [[0u32; 256]; 4];
    let (fours, tail) = symbols.as_chunks::<4>();
    for four in fours {
        for (counts, &symbol) in counts.iter_mut().zip(four) {
            counts[usize::from(symbol)] += 1;
        }
    }
    tail.iter().for_each(|&symbol| counts[0][usize::from(symbol)] += 1);
    std::array::from_fn(|symbol| counts.iter().map(|counts| counts[symbol]).sum())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packed(streams: &[&[u8]]) -> Vec<u8> {
        let lengths: Vec<usize> = streams.iter().map(|stream| stream.len()).collect();
        let (symbols, mut out) = (streams.concat(), Vec::new());
        pack_segments(&symbols, &lengths, Heads::Narrow, &mut out);
        assert!(out.len() <= max_segments(symbols.len(), streams.len()));
        let (mut rest, mut back) = (&out[..], vec![0; symbols.len()]);
        unpack_segments(&mut rest, Heads::Narrow, &mut back).expect("packed");
        assert!(rest.is_empty() && back == symbols);
        out
    }

    /// Small numbers in no simple order, sometimes 255.
    fn noise(count: u32, kinds: u32) -> Vec<u8> {
        let scramble = |i: u32| (i.wrapping_mul(0x9E37_79B1) ^ i >> 3).wrapping_mul(0x85EB_CA6B) >> 13;
        (0..count).map(|i| if scramble(i) % 1000 == 0 { 255 } else { (scramble(i) % kinds) as u8 }).collect()
    }

    #[test]
    fn every_kind_is_used_where_it_is_shortest() {
        let kind = |symbols: &[u8]| usize::from(packed(&[symbols])[0] & 3);
        assert_eq!(kind(&[7; 9]), CONSTANT);
        assert_eq!(kind(&[7, 8, 9]), RAW);
        assert_eq!(kind(&noise(5000, 256)), RAW);
        assert_eq!(kind(&noise(5000, 5)), COARSE);
        let rare: Vec<u8> = (0..200_000u32).map(|i| if i % 2000 == 0 { (i / 2000) as u8 } else { 0 }).collect();
        assert_eq!(kind(&rare), FINE);
    }

    #[test]
    fn streams_are_joined_where_alike_and_cut_where_not() {
        let (few, many) = (noise(2 * PIECE as u32, 3), noise(2 * PIECE as u32, 90));
        let apart = packed(&[&few]).len() + packed(&[&many]).len();
        assert_eq!(packed(&[&few, &many]).len(), apart);
        assert_eq!(packed(&[&[few, many].concat()]).len(), apart);
        let (a, b) = (noise(300, 9), noise(301, 9));
        assert!(packed(&[&a, &b]).len() + 5 < packed(&[&a]).len() + packed(&[&b]).len());
    }

    #[test]
    fn logarithms_are_close() {
        for value in [1u32, 2, 3, 100, 4095, 4096, 1_000_003, u32::MAX] {
            let exact = f64::from(value).log2() * 65536.0;
            assert!((log2(value) as f64 - exact).abs() < 4.0, "{value}");
        }
    }
}
