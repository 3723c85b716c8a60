//! Unpacks streams into codes.

use super::super::sparse::{CodeBox, SparseCodes};
use super::super::values::{BEHIND, Found, offsets};
use super::super::volumes;
use super::{ACTIVITIES, CLASS_OF, CLASSES, Grid, ONES, Row, SCALE_OF, SCALES, cells};
use crate::bits::{BitReader, take_varint};
use crate::bytes::{ParseResult, ensure};
use crate::segments::{Heads, unpack_segments};

/// Appends the needed codes of all boxes that are not zero; returns how many are not zero.
///
/// # Errors
/// The reason if `raw` does not follow the format, or a place does not fit in 32 bits.
pub(crate) fn unpack_cells(raw: &[u8], boxes: &[CodeBox], heads: Heads, codes: &mut SparseCodes) -> ParseResult<usize> {
    ensure(boxes.iter().all(CodeBox::fits), || "a box is too large".into())?;
    let cells = boxes.iter().map(|of| cells(&of.extents)).fold(0, usize::saturating_add);
    let (mut streams, bits) = Streams::parse(raw, heads, (cells, volumes(boxes)))?;
    let mut found = Found::new(codes, streams.values(), bits);
    for of in boxes {
        streams.fill(of, &mut found)?;
    }
    let (bits, valid) = found.finish();
    streams.check_used()?;
    ensure(valid, || "a code out of range".into())?;
    let left = bits.end()?.len();
    ensure(left == 0, || format!("{left} bytes too many"))?;
    Ok(streams.values())
}

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

struct Streams {
    symbols: Vec<u8>,
    /// Index of the next symbol of each stream. The lengths are powers of two, so that lookups need no bounds check.
    classes: [usize; 8],
    scales: [usize; SCALES],
    /// Where each stream ends.
    ends: [usize; CLASSES + SCALES],
}

impl Streams {
    /// The streams, and the low bits of large values.
    fn parse(raw: &[u8], heads: Heads, (cells, codes): (usize, usize)) -> ParseResult<(Self, BitReader<'_>)> {
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
        unpack_segments(&mut rest, heads, &mut symbols[..sum])?;
        let begin = |i: usize| if i == 0 { 0 } else { ends[i - 1] };
        let classes = std::array::from_fn(|class| begin(class.min(CLASSES)));
        let scales = std::array::from_fn(|scale| begin(CLASSES + scale));
        Ok((Self { symbols, classes, scales, ends }, BitReader::new(rest)))
    }

    /// Checks that every stream was used up.
    fn check_used(&self) -> ParseResult {
        let next = self.classes[..CLASSES].iter().chain(&self.scales);
        ensure(next.eq(&self.ends), || "the lengths of the streams do not match their cells".into())
    }

    /// The number of codes that are not zero.
    fn values(&self) -> usize {
        self.ends[CLASSES + SCALES - 1] - self.ends[CLASSES - 1]
    }

    /// Finds the codes of a box.
    fn fill(&mut self, of: &CodeBox, out: &mut Found<'_, '_>) -> ParseResult {
        let mut grid = Grid::new(of.extents);
        let mut room = vec![Marked::default(); grid.cells[0] + 1];
        let (first, strides) = (of.first as u32, of.strides.map(|stride| stride as u32));
        let offsets = offsets(strides);
        let mut frame = 0;
        for row in grid.rows() {
            while frame < row.t {
                out.end_run();
                frame += 1;
            }
            let (around, counts) = grid.around(row);
            let marked = self.mark(around, counts, &mut room);
            ensure(inside(marked, row, of), || "a code outside its box is not zero".into())?;
            let start = first + strides[1] * 2 * row.y as u32 + strides[2] * 2 * row.z as u32;
            if is_needed(start as usize, of) {
                out.make_room(marked.len());
                self.read(marked, |cell, symbols| {
                    out.add_cell(start.wrapping_add(cell.x.wrapping_mul(2 * strides[0])), &offsets, cell.byte, symbols);
                });
            } else {
                self.read(marked, |cell, symbols| out.pass_cell(cell.byte, symbols));
            }
        }
        (frame..of.extents[3]).for_each(|_| out.end_run());
        Ok(())
    }

    /// Reads the significance bytes of a row. Counts the ones of each byte, and lists the cells that are not zero;
    /// `marked` has room for one cell more than a row has.
    ///
    /// Every cell depends on the one before it, so runs of zeros with zero neighbours are read together.
    fn mark<'m>(&mut self, around: &[u8], counts: &mut [u8], marked: &'m mut [Marked]) -> &'m [Marked] {
        counts.fill(0);
        let (symbols, mut next, mut before, mut x, mut found) = (&self.symbols[..], self.classes, 0, 0, 0);
        while x < counts.len() {
            if before == 0 {
                let zeros = zeros_ahead(&around[x..], symbols, next[0]);
                next[0] += zeros;
                x += zeros;
                if zeros == 8 || x >= counts.len() {
                    continue;
                }
            }
            let near = around[x];
            let class = CLASSES_OF[usize::from(near) % 32] >> (4 * before) & 7;
            let place = &mut next[class as usize];
            let byte = symbols.get(*place).map_or(0, |byte| *byte);
            *place = place.wrapping_add(1);
            marked[found] = Marked { x: x as u32, byte, activity: near.wrapping_add(before) };
            found += usize::from(byte != 0);
            before = ONES[usize::from(byte)];
            counts[x] = before;
            x += 1;
        }
        self.classes = next;
        &marked[..found]
    }

    /// Calls `add(cell, its next symbols)` for the marked cells of a row.
    #[inline(always)]
    fn read(&mut self, marked: &[Marked], mut add: impl FnMut(&Marked, &[u8; 8])) {
        for cell in marked {
            let count = ONES[usize::from(cell.byte)];
            let busy = usize::from(2 * count + cell.activity / 2);
            let scale = usize::from(SCALE_OF[busy % ACTIVITIES]) % SCALES;
            let next = self.scales[scale];
            let ahead = self.symbols.get(next..).and_then(|ahead| ahead.first_chunk::<8>()).unwrap_or(&[0; 8]);
            self.scales[scale] = next.wrapping_add(count.into());
            add(cell, ahead);
        }
    }
}

/// A cell of a row that is not zero.
#[derive(Clone, Copy, Default)]
struct Marked {
    x: u32,
    byte: u8,
    activity: u8,
}

/// How many of the next 8 cells are zero and have neighbours that are zero, counted up to the first that is not.
#[inline(always)]
fn zeros_ahead(around: &[u8], symbols: &[u8], next: usize) -> usize {
    let ahead = symbols.get(next..).and_then(|next| next.first_chunk::<8>()).unwrap_or(&[1; 8]);
    let around = around.first_chunk::<8>().unwrap_or(&[1; 8]);
    let any = u64::from_le_bytes(*ahead) | u64::from_le_bytes(*around);
    any.trailing_zeros() as usize / 8
}

/// Whether some codes of a row of cells may be needed; its first code has the place `start`.
fn is_needed(start: usize, of: &CodeBox) -> bool {
    start < of.needed.end && of.needed.start <= of.place_after(start, [of.extents[0], 1, 1])
}

/// Whether the cells of a row are zero where codes lie outside of the box or belong to another one.
fn inside(marked: &[Marked], row: Row, of: &CodeBox) -> bool {
    let [y, z] = row.whole;
    let outside = if y { 0 } else { 0b1100_1100 } | if z { 0 } else { 0b1111_0000 } | !of.allowed;
    let any = if outside == 0 { 0 } else { marked.iter().fold(0, |any, cell| any | cell.byte) };
    let (even, last) = (of.extents[0].is_multiple_of(2), marked.last());
    let last = last.filter(|cell| !even && cell.x as usize == of.extents[0] / 2).map_or(0, |cell| cell.byte);
    any & outside == 0 && last & 0b1010_1010 == 0
}
