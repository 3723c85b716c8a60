//! Bytes in about their entropy: the range variant of asymmetric numeral systems (rANS), with fixed frequencies
//! ([Duda](https://arxiv.org/abs/1311.2540)).
//!
//! Frequencies F add up to 2^b. Byte value s owns F slots from `start`, the sum of the frequencies of lower values.
//! Packing s turns a state X into
//!
//! ```text
//! X' = 2^b floor(X / F) + start + X mod F                                                                 (eq 40)
//! ```
//!
//! and decoding undoes that: X' mod 2^b is a slot of s, and X = F floor(X' / 2^b) + X' mod 2^b - start. A state holds
//! 16 to 32 bits: it gives up its low 16 bits before it would grow beyond 32. Symbols are coded from the last to the
//! first, so that they are decoded in order.
//!
//! Symbols of long strings take turns in several states, so that a processor works on them at once
//! ([Giesen](https://arxiv.org/abs/1402.3392)).

use crate::bits::{BitReader, BitWriter, take_bytes, take_varint};
use crate::bytes::{ParseResult, ensure};

/// Frequency of each byte. The sum is a power of two.
pub(crate) type Frequencies = [u16; 256];

/// The least value of a state. States start here when packing, so they end here when unpacking.
const LOWEST: u32 = 1 << 16;

/// The states in which symbols take turns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum States {
    /// One, for short strings.
    One,
    /// Four.
    Few,
    /// Thirty-two, for vector code.
    Many,
}

impl States {
    /// The states of a string of `symbols` symbols that is not coded with many.
    pub(crate) fn of_length(symbols: usize) -> Self {
        if symbols < LONG { Self::One } else { Self::Few }
    }

    fn count(self) -> usize {
        match self {
            Self::One => 1,
            Self::Few => FEW,
            Self::Many => MANY,
        }
    }
}

const FEW: usize = 4;
const MANY: usize = 32;
/// Strings of at least this many symbols have more than one state.
const LONG: usize = 1024;

/// Scales counts to frequencies whose sum is `1 << bits`. Every symbol that occurs gets at least 1.
pub(crate) fn normalise(counts: &[u32; 256], bits: u32) -> Frequencies {
    let total: u64 = counts.iter().map(|&count| u64::from(count)).sum();
    let scale = |count: u32| ((u64::from(count) << bits) + total / 2) / total.max(1);
    let mut frequencies = counts.map(|count| if count == 0 { 0 } else { scale(count).max(1) as u16 });
    let mut sum: u32 = frequencies.iter().map(|&f| u32::from(f)).sum();
    while sum != 1 << bits {
        let Some(largest) = frequencies.iter_mut().max() else { break };
        let more = sum < 1 << bits;
        *largest = if more { *largest + 1 } else { *largest - 1 };
        sum = if more { sum + 1 } else { sum - 1 };
    }
    frequencies
}

/// Appends frequencies whose sum is `1 << bits`. No single frequency may be the whole sum.
///
/// For each byte from 0 on, until the sum is reached: the length of its frequency in bits, as the difference from the
/// previous length, then the frequency's bits below the highest.
pub(crate) fn put_frequencies(frequencies: &Frequencies, bits: u32, out: &mut Vec<u8>) {
    let mut writer = BitWriter::new(out);
    let (mut previous, mut sum) = (bits, 0);
    for frequency in frequencies.iter().map(|&f| u32::from(f)) {
        if sum == 1 << bits {
            break;
        }
        let length = 32 - frequency.leading_zeros();
        put_length(length, previous, &mut writer);
        let low = length.saturating_sub(1);
        writer.put(frequency & ((1 << low) - 1), low);
        previous = length;
        sum += frequency;
    }
    writer.finish();
}

fn put_length(length: u32, previous: u32, writer: &mut BitWriter) {
    if length == previous {
        writer.put(0, 1);
    } else if length == previous + 1 {
        writer.put(0b001, 3);
    } else if length + 1 == previous {
        writer.put(0b101, 3);
    } else {
        writer.put(0b11 | length << 2, 6);
    }
}

fn take_length(previous: u32, reader: &mut BitReader) -> u32 {
    if reader.take(1) == 0 {
        previous
    } else if reader.take(1) == 1 {
        reader.take(4)
    } else if reader.take(1) == 0 {
        previous + 1
    } else {
        previous.wrapping_sub(1)
    }
}

/// Reads frequencies whose sum must be `1 << bits`.
pub(crate) fn take_frequencies(bytes: &mut &[u8], bits: u32) -> ParseResult<Frequencies> {
    let mut reader = BitReader::new(bytes);
    let mut frequencies = [0; 256];
    let (mut previous, mut sum) = (bits, 0);
    for frequency in &mut frequencies {
        if sum == 1 << bits {
            break;
        }
        let length = take_length(previous, &mut reader);
        ensure(length <= bits, || "a frequency is too long".into())?;
        if length > 0 {
            *frequency = (1 << (length - 1) | reader.take(length - 1)) as u16;
        }
        previous = length;
        sum += u32::from(*frequency);
    }
    ensure(sum == 1 << bits, || format!("frequencies add up to {sum} instead of {}", 1 << bits))?;
    *bytes = reader.end()?;
    Ok(frequencies)
}

/// Precomputed values for packing a symbol.
#[derive(Clone, Copy, Default)]
struct Encode {
    /// `2^(32 + bits) / frequency`, rounded up: the reciprocal that divides every state below `limit` exactly.
    reciprocal: u64,
    /// States at or above this first emit 16 bits.
    limit: u32,
    /// `2^bits - frequency`.
    others: u32,
    start: u32,
}

impl Encode {
    fn new(frequency: u16, start: u32, bits: u32) -> Self {
        let frequency = u32::from(frequency);
        let reciprocal = (1u64 << (32 + bits)).div_ceil(u64::from(frequency.max(1)));
        Self { reciprocal, limit: frequency << (32 - bits), others: (1 << bits) - frequency, start }
    }
}

/// Appends the coded symbols: states, then words of 16 bits. The frequency of every symbol must be above 0.
pub(crate) fn encode(symbols: &[u8], frequencies: &Frequencies, (bits, states): (u32, States), out: &mut Vec<u8>) {
    match states {
        States::One => encode_lanes::<1>(symbols, frequencies, bits, out),
        States::Few => encode_lanes::<FEW>(symbols, frequencies, bits, out),
        States::Many => encode_lanes::<MANY>(symbols, frequencies, bits, out),
    }
}

fn encode_lanes<const N: usize>(symbols: &[u8], frequencies: &Frequencies, bits: u32, out: &mut Vec<u8>) {
    let mut start = 0;
    let table: [Encode; 256] = std::array::from_fn(|symbol| {
        start += u32::from(frequencies[symbol]);
        Encode::new(frequencies[symbol], start - u32::from(frequencies[symbol]), bits)
    });
    let mut words = Words { words: vec![0; symbols.len() + 1], next: symbols.len() };
    let mut states = [LOWEST; N];
    let (rounds, tail) = symbols.as_chunks::<N>();
    for (state, &symbol) in states.iter_mut().zip(tail).rev() {
        *state = words.push(*state, &table[usize::from(symbol)], bits);
    }
    for round in rounds.iter().rev() {
        for (state, &symbol) in states.iter_mut().zip(round).rev() {
            *state = words.push(*state, &table[usize::from(symbol)], bits);
        }
    }
    let words = words.all();
    crate::bits::put_varint(words.len(), out);
    out.extend(states.iter().flat_map(|state| state.to_le_bytes()));
    out.extend(words.iter().flat_map(|word| word.to_le_bytes()));
}

/// Words that states gave up, filled from the end, because a decoder takes the last one first. A symbol makes a state give up at most one.
struct Words {
    words: Vec<u16>,
    /// The place of the next word. Those behind it are taken.
    next: usize,
}

impl Words {
    /// Packs a symbol (eq 40). Returns the state, which first gives up 16 bits if it would overflow. It has no branches, because a
    /// processor could not predict them.
    #[inline(always)]
    fn push(&mut self, state: u32, symbol: &Encode, bits: u32) -> u32 {
        self.words[self.next] = state as u16;
        let is_large = state >= symbol.limit;
        self.next -= usize::from(is_large);
        let state = if is_large { state >> 16 } else { state };
        let quotient = (u64::from(state).wrapping_mul(symbol.reciprocal) >> (32 + bits)) as u32;
        state.wrapping_add(quotient.wrapping_mul(symbol.others)).wrapping_add(symbol.start)
    }

    /// The words in the order in which a decoder takes them.
    fn all(&self) -> &[u16] {
        &self.words[self.next + 1..]
    }
}

/// Reads what [`encode`] appended and fills `symbols`.
pub(crate) fn decode(
    bytes: &mut &[u8],
    frequencies: &Frequencies,
    (bits, lanes): (u32, States),
    symbols: &mut [u8],
) -> ParseResult {
    let (count, states) = (take_varint(bytes)?, 4 * lanes.count());
    let (states, words) = take_bytes(bytes, count.saturating_mul(2).saturating_add(states))?.split_at(states);
    let coded = Coded { states: states.as_chunks().0, words: words.as_chunks().0 };
    match bits {
        12 => coded.decode(lanes, &Slots::<4096>::new(frequencies), symbols),
        _ => coded.decode(lanes, &Slots::<16384>::new(frequencies), symbols),
    }
}

/// A coded string.
struct Coded<'a> {
    states: &'a [[u8; 4]],
    words: &'a [[u8; 2]],
}

impl Coded<'_> {
    fn decode<const S: usize>(&self, states: States, slots: &Slots<S>, symbols: &mut [u8]) -> ParseResult {
        match states {
            States::One => decode_lanes(slots, self.first::<1>()?, self.words, symbols),
            States::Few => decode_lanes(slots, self.first::<FEW>()?, self.words, symbols),
            States::Many => decode_lanes(slots, self.first::<MANY>()?, self.words, symbols),
        }
    }

    fn first<const N: usize>(&self) -> ParseResult<&[[u8; 4]; N]> {
        self.states.first_chunk().ok_or_else(|| "states are missing".into())
    }
}

/// Tables for unpacking: the symbol of each of `S` slots, and `frequency * 65536 + first slot` of each symbol.
struct Slots<const S: usize> {
    symbols: [u8; S],
    ranges: [u32; 256],
}

impl<const S: usize> Slots<S> {
    fn new(frequencies: &Frequencies) -> Box<Self> {
        let mut slots = Box::new(Self { symbols: [0; S], ranges: [0; 256] });
        let mut start = 0;
        for (symbol, &frequency) in frequencies.iter().enumerate() {
            let end = start + usize::from(frequency);
            slots.symbols[start..end].fill(symbol as u8);
            slots.ranges[symbol] = u32::from(frequency) << 16 | start as u32;
            start = end;
        }
        slots
    }
}

fn decode_lanes<const N: usize, const S: usize>(
    slots: &Slots<S>,
    states: &[[u8; 4]; N],
    words: &[[u8; 2]],
    symbols: &mut [u8],
) -> ParseResult {
    let mut states = states.map(u32::from_le_bytes);
    ensure(states.iter().all(|&state| state >= LOWEST), || "a state is too low".into())?;
    let mut next = 0;
    let (rounds, tail) = symbols.as_chunks_mut::<N>();
    for round in rounds {
        for (state, symbol) in states.iter_mut().zip(round) {
            *symbol = pop(state, slots, words, &mut next);
        }
    }
    for (state, symbol) in states.iter_mut().zip(tail) {
        *symbol = pop(state, slots, words, &mut next);
    }
    let done = next == words.len() && states.iter().all(|&state| state == LOWEST);
    ensure(done, || "symbols and words do not end at the same place".into())
}

/// The next symbol of a state: the inverse of eq 40. Past the last word it reads zeros; the check at the end then fails.
#[inline(always)]
fn pop<const S: usize>(state: &mut u32, slots: &Slots<S>, words: &[[u8; 2]], next: &mut usize) -> u8 {
    let slot = *state & (S as u32 - 1);
    let symbol = slots.symbols[slot as usize];
    let range = slots.ranges[usize::from(symbol)];
    let rest = (range >> 16).wrapping_mul(*state >> S.trailing_zeros());
    let low = rest.wrapping_add(slot).wrapping_sub(range & 0xFFFF);
    let word = words.get(*next).map_or(0, |word| u16::from_le_bytes(*word));
    let short = low < LOWEST;
    *state = if short { low << 16 | u32::from(word) } else { low };
    *next = next.wrapping_add(usize::from(short));
    symbol
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sum(frequencies: &Frequencies) -> u32 {
        frequencies.iter().map(|&f| u32::from(f)).sum()
    }

    #[test]
    fn rare_symbols_keep_a_frequency() {
        let mut counts = [1; 256];
        counts[9] = u32::MAX;
        let frequencies = normalise(&counts, 12);
        assert_eq!((frequencies[9], frequencies[10], sum(&frequencies)), (4096 - 255, 1, 4096));
        assert_eq!(normalise(&[u32::MAX; 256], 14), [64; 256]);
    }

    #[test]
    fn hostile_frequencies_are_refused() {
        let message = |bytes: &[u8]| take_frequencies(&mut &bytes[..], 12).expect_err("hostile");
        assert!(message(&[0b1]).contains("too long"), "one more than all bits");
        assert!(message(&[0b11_0111]).contains("too long"), "13 bits");
        assert!(message(&[0b00_0011; 100]).contains("add up"), "none");
        assert!(message(&[0, 0x20, 0]).contains("add up"), "too many");
        assert!(message(&[0b0]).contains("within"), "no bytes left");
    }

    proptest! {
        #[test]
        fn symbols_round_trip(
            symbols in prop::collection::vec(prop_oneof![9 => 0u8..4, 1 => any::<u8>()], 2..3000),
            bits in prop::sample::select(vec![12u32, 14]),
            states in prop::sample::select(vec![States::One, States::Few, States::Many]),
        ) {
            let mut counts = [0; 256];
            [0, 1].iter().chain(&symbols).for_each(|&symbol| counts[usize::from(symbol)] += 1);
            let frequencies = normalise(&counts, bits);
            prop_assert_eq!(sum(&frequencies), 1 << bits);
            let mut out = Vec::new();
            put_frequencies(&frequencies, bits, &mut out);
            encode(&symbols, &frequencies, (bits, states), &mut out);
            let (mut rest, mut back) = (&out[..], vec![0; symbols.len()]);
            prop_assert_eq!(take_frequencies(&mut rest, bits).expect("packed"), frequencies);
            decode(&mut rest, &frequencies, (bits, states), &mut back).expect("packed");
            prop_assert!(rest.is_empty() && back == symbols);
        }
    }
}
