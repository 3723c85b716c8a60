//! Unpacks streams into codes.

use super::{ACTIVITIES, CLASS_OF, CLASSES, Grid, LONG, ONES, Row, SCALE_OF, SCALES, SYMBOLS, cells, volume};
use crate::bits::{BitReader, take_varint};
use crate::bytes::{ParseResult, ensure};
use crate::segments::unpack_segments;
use crate::sparse::{CodeBox, SparseCodes};

/// Fills `codes` with the codes of all boxes; returns how many are not zero.
///
/// `boxes[i]` are the extents of a box along x, y, z, t.
///
/// # Errors
/// The reason if `raw` does not follow the format, or `codes` does not have the length that `boxes` require.
pub fn unpack_cells(raw: &[u8], boxes: &[[usize; 4]], codes: &mut [i32]) -> Result<usize, String> {
    let total = boxes.iter().map(volume).fold(0, usize::saturating_add);
    ensure(total == codes.len(), || format!("boxes of {total} codes instead of {}", codes.len()))?;
    let boxes: Vec<CodeBox> = boxes.iter().copied().map(CodeBox::contiguous).collect();
    let mut sparse = SparseCodes::default();
    let count = unpack_sparse_cells(raw, &boxes, &mut sparse)?;
    sparse.fill(&boxes, codes);
    Ok(count)
}

/// Appends the codes of all boxes that are not zero; returns how many they are.
///
/// # Errors
/// The reason if `raw` does not follow the format, or a place does not fit in 32 bits.
pub fn unpack_sparse_cells(raw: &[u8], boxes: &[CodeBox], codes: &mut SparseCodes) -> Result<usize, String> {
    let sum = |each: fn(&[usize; 4]) -> usize| boxes.iter().map(|of| each(&of.extents)).fold(0, usize::saturating_add);
    ensure(boxes.iter().all(CodeBox::fits), || "a box is too large".into())?;
    let mut streams = Streams::parse(raw, sum(cells), sum(volume))?;
    let mut out = Found::new(codes, streams.values());
    for of in boxes {
        streams.fill(of, &mut out)?;
    }
    out.finish();
    streams.finish()
}

/// Padding bytes after the symbols, so that 8 bytes can be read at every symbol.
const BEHIND: usize = 8;

/// Classes for each activity without the neighbour at x-1 (up to 24): 4 bits for each count at x-1 from 0 to 8.
static CLASSES_OF: [u64; 32] = {
    let mut table = [0; 32];
    let mut i = 0;
    while i < 32 * 9 {
        table[i / 9] |= (CLASS_OF[i / 9 + i % 9] as u64) << (4 * (i % 9));
        i += 1;
    }
    table
};

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

struct Streams<'a> {
    symbols: Vec<u8>,
    /// Index of the next symbol of each stream. The lengths are powers of two, so that lookups need no bounds check.
    classes: [usize; 8],
    scales: [usize; SCALES],
    /// Where each stream ends.
    ends: [usize; CLASSES + SCALES],
    bits: BitReader<'a>,
    /// Whether an invalid symbol was found.
    invalid: bool,
}

impl<'a> Streams<'a> {
    fn parse(raw: &'a [u8], cells: usize, codes: usize) -> ParseResult<Self> {
        let mut rest = raw;
        let (mut ends, mut sum) = ([0; CLASSES + SCALES], 0usize);
        for end in &mut ends {
            sum = sum.saturating_add(take_varint(&mut rest)?);
            *end = sum;
        }
        let marks = ends[CLASSES - 1];
        ensure(marks == cells, || format!("{marks} significance bytes for {cells} cells"))?;
        ensure(sum - marks <= codes, || format!("{} values for {codes} codes", sum - marks))?;
        let mut symbols = vec![0; sum + BEHIND];
        unpack_segments(&mut rest, &mut symbols[..sum])?;
        let begin = |i: usize| if i == 0 { 0 } else { ends[i - 1] };
        let classes = std::array::from_fn(|class| begin(class.min(CLASSES)));
        let scales = std::array::from_fn(|scale| begin(CLASSES + scale));
        Ok(Self { symbols, classes, scales, ends, bits: BitReader::new(rest), invalid: false })
    }

    /// Checks that every stream and the bits were used up; returns the number of nonzero codes.
    fn finish(self) -> ParseResult<usize> {
        let next = self.classes[..CLASSES].iter().chain(&self.scales);
        ensure(next.eq(&self.ends), || "the lengths of the streams do not match their cells".into())?;
        ensure(!self.invalid, || "a code out of range".into())?;
        let (values, left) = (self.values(), self.bits.end()?.len());
        ensure(left == 0, || format!("{left} bytes too many"))?;
        Ok(values)
    }

    /// The number of codes that are not zero.
    fn values(&self) -> usize {
        self.ends[CLASSES + SCALES - 1] - self.ends[CLASSES - 1]
    }

    /// Finds the codes of a box.
    fn fill(&mut self, of: &CodeBox, out: &mut Found<'_>) -> ParseResult {
        let mut grid = Grid::new(of.extents);
        let mut significant = vec![0; grid.cells[0]];
        let (first, strides) = (of.first as u32, of.strides.map(|stride| stride as u32));
        let ahead = |bit: usize| {
            strides[0] * (bit % 2) as u32 + strides[1] * (bit / 2 % 2) as u32 + strides[2] * (bit / 4) as u32
        };
        let steps = std::array::from_fn(ahead);
        let mut frame = 0;
        for row in grid.rows() {
            while frame < row.t {
                out.end_run();
                frame += 1;
            }
            let (around, counts) = grid.around(row);
            self.mark(around, counts, &mut significant);
            ensure(inside(&significant, row, of.extents[0]), || "a code outside its box is not zero".into())?;
            let start = first + strides[1] * 2 * row.y as u32 + strides[2] * 2 * row.z as u32;
            self.scatter((start, 2 * strides[0]), &steps, &significant, (around, counts), out);
        }
        (frame..of.extents[3]).for_each(|_| out.end_run());
        Ok(())
    }

    /// Reads the significance bytes of a row, and counts the ones of each.
    ///
    /// Every cell depends on the one before it, so runs of zeros with zero neighbours are read together.
    fn mark(&mut self, around: &[u8], counts: &mut [u8], significant: &mut [u8]) {
        counts.fill(0);
        significant.fill(0);
        let (symbols, mut next, mut before, mut x) = (&self.symbols[..], self.classes, 0, 0);
        while x < significant.len() {
            if before == 0 {
                let zeros = zeros_ahead(&around[x..], symbols, next[0]);
                next[0] += zeros;
                x += zeros;
                if zeros == 8 || x >= significant.len() {
                    continue;
                }
            }
            let class = CLASSES_OF[usize::from(around[x]) % 32] >> (4 * before) & 7;
            let place = &mut next[class as usize];
            let byte = symbols.get(*place).map_or(0, |byte| *byte);
            *place = place.wrapping_add(1);
            before = ONES[usize::from(byte)];
            significant[x] = byte;
            counts[x] = before;
            x += 1;
        }
        self.classes = next;
    }

    /// Reads the values of a row of cells; the first code of its first cell has the place `start`, that of the next cell
    /// is `apart` from it.
    fn scatter(
        &mut self,
        (start, apart): (u32, u32),
        steps: &[u32; 8],
        significant: &[u8],
        (around, counts): (&[u8], &[u8]),
        out: &mut Found<'_>,
    ) {
        let (mut before, mut place) = (0, start);
        for ((&byte, &around), &count) in significant.iter().zip(around).zip(counts) {
            if byte != 0 {
                let busy = usize::from(2 * count + around.wrapping_add(before) / 2);
                let scale = usize::from(SCALE_OF[busy % ACTIVITIES]) % SCALES;
                self.scatter_cell(place, steps, byte, scale, out);
            }
            before = count;
            place = place.wrapping_add(apart);
        }
    }

    /// Reads the values of a cell. Without long values it uses no loop, because a processor could not predict its end.
    #[inline(always)]
    fn scatter_cell(&mut self, place: u32, steps: &[u32; 8], significant: u8, scale: usize, out: &mut Found<'_>) {
        let next = self.scales[scale];
        let count = usize::from(ONES[usize::from(significant)]);
        let ahead = self.symbols.get(next..).and_then(|ahead| ahead.first_chunk::<8>()).unwrap_or(&[0; 8]);
        self.scales[scale] = next.wrapping_add(count);
        let bits = &PLACES[usize::from(significant)];
        let ahead = *ahead;
        let Some((places, values)) = out.next(count) else {
            self.invalid = true;
            return;
        };
        for i in 0..8 {
            places[i] = place.wrapping_add(steps[usize::from(bits[i]) % 8]);
            values[i] = unzigzag(u32::from(ahead[i]) + 1);
        }
        if u64::from_le_bytes(ahead) << (64 - 8 * count as u32) & 0x8080_8080_8080_8080 != 0 {
            self.lengthen(&ahead[..count], values);
        }
    }

    /// Replaces values that have low bits.
    #[cold]
    fn lengthen(&mut self, symbols: &[u8], values: &mut [i32; 8]) {
        for (value, &symbol) in values.iter_mut().zip(symbols) {
            if u32::from(symbol) >= LONG {
                *value = unzigzag(self.long(symbol).wrapping_add(1));
            }
        }
    }

    /// Reads the value of a symbol that has low bits.
    fn long(&mut self, symbol: u8) -> u32 {
        let symbol = u32::from(symbol);
        if symbol >= SYMBOLS {
            self.invalid = true;
            return 0;
        }
        let low = (symbol - LONG) / 4 + 5;
        let value = (4 + symbol % 4) << low | self.bits.take(low);
        self.invalid |= value == u32::MAX;
        value
    }
}

/// Codes found so far, with room for 8 more than there are: a cell writes 8, and keeps as many as it has.
struct Found<'a> {
    codes: &'a mut SparseCodes,
    count: usize,
}

impl<'a> Found<'a> {
    fn new(codes: &'a mut SparseCodes, more: usize) -> Self {
        let count = codes.values.len();
        codes.places.resize(count + more + 8, 0);
        codes.values.resize(count + more + 8, 0);
        Self { codes, count }
    }

    /// Where the next codes are written; none if there are more than announced.
    #[inline(always)]
    fn next(&mut self, count: usize) -> Option<(&mut [u32; 8], &mut [i32; 8])> {
        let first = self.count;
        self.count += count;
        Some((
            self.codes.places.get_mut(first..)?.first_chunk_mut()?,
            self.codes.values.get_mut(first..)?.first_chunk_mut()?,
        ))
    }

    fn end_run(&mut self) {
        self.codes.ends.push(self.count);
    }

    fn finish(self) {
        self.codes.places.truncate(self.count);
        self.codes.values.truncate(self.count);
    }
}

/// How many of the next 8 cells are zero and have neighbours that are zero, counted up to the first that is not.
#[inline(always)]
fn zeros_ahead(around: &[u8], symbols: &[u8], next: usize) -> usize {
    let ahead = symbols.get(next..).and_then(|next| next.first_chunk::<8>()).unwrap_or(&[1; 8]);
    let around = around.first_chunk::<8>().unwrap_or(&[1; 8]);
    let any = u64::from_le_bytes(*ahead) | u64::from_le_bytes(*around);
    any.trailing_zeros() as usize / 8
}

/// Maps 1, 2, 3, ... to -1, 1, -2, ...
fn unzigzag(value: u32) -> i32 {
    (value >> 1) as i32 ^ ((value & 1) as i32).wrapping_neg()
}

/// Whether the significance bytes of a row are zero outside the box.
fn inside(significant: &[u8], row: Row, width: usize) -> bool {
    let [y, z] = row.whole;
    let outside = if y { 0 } else { 0b1100_1100 } | if z { 0 } else { 0b1111_0000 };
    let any = if outside == 0 { 0 } else { significant.iter().fold(0, |any, byte| any | byte) };
    let last = if width.is_multiple_of(2) { 0 } else { significant.last().map_or(0, |byte| byte & 0b1010_1010) };
    any & outside == 0 && last == 0
}
