//! Values of codes as symbols, and lists of codes while they are found.

use super::sparse::SparseCodes;
use crate::bits::{BitReader, BitWriter};

/// Smaller symbols are values. The others give the length of a value in bits and its highest bits.
pub(super) const LONG: u32 = 128;

/// Number of value symbols.
pub(super) const SYMBOLS: u32 = LONG + 4 * (32 - 8) + 4;

/// Codes for which there is room at a time.
const ROOM: usize = 4 << 10;

/// Entries after symbols and after codes, so that 8 can be read or written at each place.
pub(super) const BEHIND: usize = 8;

/// Positions of the ones in each byte, lowest first, filled up with the highest.
static PLACES: [[u8; 8]; 256] = {
    let mut table = [[0; 8]; 256];
    let mut byte = 1;
    while byte < 256 {
        let (mut i, mut left) = (0, byte);
        while i < 8 {
            table[byte][i] = left.trailing_zeros() as u8;
            left = if left.is_power_of_two() { left } else { left & (left - 1) };
            i += 1;
        }
        byte += 1;
    }
    table
};

/// For each byte of a cell, the distances of its nonzero codes from the cell's first code.
pub(super) type Offsets = [[u32; 8]; 256];

/// The offsets in a box whose codes are `strides` apart along x, y, z.
pub(super) fn offsets(strides: [u32; 3]) -> Box<Offsets> {
    let along = |bit: u8, axis: usize| strides[axis].wrapping_mul(u32::from(bit >> axis & 1));
    let steps: [u32; 8] = std::array::from_fn(|bit| (0..3).map(|axis| along(bit as u8, axis)).sum());
    let mut offsets = Box::new([[0; 8]; 256]);
    for (offsets, places) in offsets.iter_mut().zip(&PLACES) {
        *offsets = places.map(|bit| steps[usize::from(bit) % 8]);
    }
    offsets
}

/// The symbol of a nonzero code. Writes the value's low bits, if any.
pub(super) fn symbol(code: i32, bits: &mut BitWriter) -> u8 {
    let value = value(code);
    if value < LONG {
        return value as u8;
    }
    let low = 29 - value.leading_zeros();
    bits.put(value & ((1 << low) - 1), low);
    (LONG + 4 * (low - 5) + (value >> low & 3)) as u8
}

/// The nonzero codes of a cell, in order, and then copies of the last; `significant` marks them.
#[inline(always)]
pub(super) fn in_order(codes: [i32; 8], significant: u8) -> [i32; 8] {
    PLACES[usize::from(significant)].map(|place| codes[usize::from(place) % 8])
}

/// The symbols of nonzero codes, if none has low bits.
#[inline(always)]
pub(super) fn short_symbols(codes: &[i32; 8]) -> Option<[u8; 8]> {
    let values = codes.map(value);
    let are_short = values.iter().fold(0, |any, value| any | value) < LONG;
    are_short.then(|| values.map(|value| value as u8))
}

/// Maps -1, 1, -2, ... to 0, 1, 2, ...
fn value(code: i32) -> u32 {
    (((code << 1) ^ (code >> 31)) as u32).wrapping_sub(1)
}

/// Maps 1, 2, 3, ... to -1, 1, -2, ...
fn unzigzag(value: u32) -> i32 {
    (value >> 1) as i32 ^ ((value & 1) as i32).wrapping_neg()
}

/// Turns symbols into codes.
pub(super) struct Found<'a, 'b> {
    /// The codes so far, with room for more: a cell writes 8, and keeps as many as it has.
    codes: &'a mut SparseCodes,
    count: usize,
    /// The lists never get longer than this.
    most: usize,
    /// The low bits of large values.
    bits: BitReader<'b>,
    /// Whether an invalid symbol was found.
    pub(super) invalid: bool,
}

impl<'a, 'b> Found<'a, 'b> {
    /// Appends at most `most` codes.
    pub(super) fn new(codes: &'a mut SparseCodes, most: usize, bits: BitReader<'b>) -> Self {
        codes.places.reserve(most + BEHIND);
        codes.values.reserve(most + BEHIND);
        let count = codes.values.len();
        Self { count, most: count + most + BEHIND, codes, bits, invalid: false }
    }

    /// Makes room for the codes of so many cells, but for no more codes than were announced. Memory is touched when it is needed.
    pub(super) fn make_room(&mut self, cells: usize) {
        let len = self.most.min(self.count + 8 * cells);
        if len > self.codes.values.len() {
            let len = self.most.min(len + ROOM);
            self.codes.places.resize(len, 0);
            self.codes.values.resize(len, 0);
        }
    }

    /// Passes over the codes of a cell.
    #[inline(always)]
    pub(super) fn pass_cell(&mut self, byte: u8, symbols: &[u8; 8]) {
        let symbols = &symbols[..usize::from(super::cells::ONES[usize::from(byte)])];
        if symbols.iter().any(|symbol| u32::from(*symbol) >= LONG) {
            Self::lengthen(&mut self.bits, &mut self.invalid, symbols, &mut [0; 8]);
        }
    }

    /// Appends the codes of a cell whose first code has the place `place`. Without long values it uses no loop, because a
    /// processor could not predict its end.
    #[inline(always)]
    pub(super) fn add_cell(&mut self, place: u32, offsets: &Offsets, byte: u8, symbols: &[u8; 8]) {
        let (first, count) = (self.count, u32::from(super::cells::ONES[usize::from(byte)]));
        self.count += count as usize;
        let places = self.codes.places.get_mut(first..).and_then(|places| places.first_chunk_mut::<8>());
        let values = self.codes.values.get_mut(first..).and_then(|values| values.first_chunk_mut::<8>());
        let (Some(places), Some(values)) = (places, values) else {
            self.invalid = true; // more than announced
            return;
        };
        let offsets = &offsets[usize::from(byte)];
        for i in 0..8 {
            places[i] = place.wrapping_add(offsets[i]);
        }
        for i in 0..8 {
            values[i] = unzigzag(u32::from(symbols[i]) + 1);
        }
        let of_cell = u64::from_le_bytes(*symbols) << ((64 - 8 * count) % 64);
        if of_cell & 0x8080_8080_8080_8080 != 0 {
            Self::lengthen(&mut self.bits, &mut self.invalid, &symbols[..count as usize], values);
        }
    }

    /// Replaces values that have low bits.
    #[cold]
    fn lengthen(bits: &mut BitReader, invalid: &mut bool, symbols: &[u8], values: &mut [i32; 8]) {
        for (value, &symbol) in values.iter_mut().zip(symbols) {
            let symbol = u32::from(symbol);
            if symbol >= SYMBOLS {
                *invalid = true;
            } else if symbol >= LONG {
                let low = (symbol - LONG) / 4 + 5;
                let long = (4 + symbol % 4) << low | bits.take(low);
                *invalid |= long == u32::MAX;
                *value = unzigzag(long.wrapping_add(1));
            }
        }
    }

    /// Ends the codes of one k of a box.
    pub(super) fn end_run(&mut self) {
        self.codes.ends.push(self.count);
    }

    /// Completes the list. Returns the reader of low bits, which should be at its end, and whether all symbols were
    /// valid.
    pub(super) fn finish(self) -> (BitReader<'b>, bool) {
        self.codes.places.truncate(self.count);
        self.codes.values.truncate(self.count);
        (self.bits, !self.invalid)
    }
}
