//! Packs codes into streams.

use super::{ACTIVITIES, CLASS_OF, CLASSES, Grid, LONG, ONES, Row, SCALE_OF, SCALES, cells, volume};
use crate::bits::{BitWriter, put_varint};
use crate::segments::{estimate_segments, pack_segments};

/// Packs the codes of several boxes. `codes` holds the boxes one after another, x fastest, then y, z, t.
///
/// `boxes[i]` are the extents of a box along x, y, z, t. `FORMAT.md` specifies the bytes.
pub fn pack_cells(codes: &[i32], boxes: &[[usize; 4]], out: &mut Vec<u8>) {
    let mut bits = Vec::new();
    Streams::collect(codes, boxes, &mut bits).finish(out);
    out.append(&mut bits);
}

/// Estimates how many bytes [`pack_cells`] appends.
pub fn estimate_cells(codes: &[i32], boxes: &[[usize; 4]]) -> usize {
    let mut bits = Vec::new();
    let packed = Streams::collect(codes, boxes, &mut bits).estimate();
    packed + bits.len()
}

struct Streams<'a> {
    significance: [Vec<u8>; CLASSES],
    values: [Vec<u8>; SCALES],
    bits: BitWriter<'a>,
}

impl<'a> Streams<'a> {
    fn new(bits: &'a mut Vec<u8>, boxes: &[[usize; 4]]) -> Self {
        let mut significance = [const { Vec::new() }; CLASSES];
        significance[0].reserve(boxes.iter().map(cells).sum());
        Self { significance, values: [const { Vec::new() }; SCALES], bits: BitWriter::new(bits) }
    }

    fn collect(mut codes: &[i32], boxes: &[[usize; 4]], bits: &'a mut Vec<u8>) -> Self {
        let mut streams = Self::new(bits, boxes);
        for &extents in boxes {
            let (here, after) = codes.split_at(volume(&extents));
            streams.add(here, extents);
            codes = after;
        }
        streams
    }

    /// All streams one after another, and the length of each. Completes the bits.
    fn joined(self) -> (Vec<u8>, Vec<usize>) {
        let streams: Vec<Vec<u8>> = self.significance.into_iter().chain(self.values).collect();
        self.bits.finish();
        (streams.concat(), streams.iter().map(Vec::len).collect())
    }

    fn finish(self, out: &mut Vec<u8>) {
        let (symbols, lengths) = self.joined();
        lengths.iter().for_each(|&length| put_varint(length, out));
        pack_segments(&symbols, &lengths, out);
    }

    /// Estimates how many bytes the streams take when packed.
    fn estimate(self) -> usize {
        let (symbols, lengths) = self.joined();
        lengths.len() + estimate_segments(&symbols, &lengths)
    }

    /// Adds the codes of a box.
    fn add(&mut self, codes: &[i32], extents: [usize; 4]) {
        let mut grid = Grid::new(extents);
        let outside = vec![0; extents[0]];
        let mut significant = vec![0; grid.cells[0]];
        let mut activity = significant.clone();
        for row in grid.rows() {
            let lines = lines(codes, &extents, row, &outside);
            mark(lines, &mut significant);
            let (around, counts) = grid.around(row);
            let mut before = 0;
            for (((activity, count), &byte), &around) in activity.iter_mut().zip(counts).zip(&significant).zip(around) {
                *activity = around.wrapping_add(before);
                *count = ONES[usize::from(byte)];
                before = *count;
            }
            self.add_row(lines, &significant, &activity);
        }
    }

    /// Adds a row of cells. Takes 8 cells at once if they and their neighbours are zero.
    fn add_row(&mut self, lines: [&[i32]; 4], significant: &[u8], activity: &[u8]) {
        for (i, (bytes, around)) in significant.chunks(8).zip(activity.chunks(8)).enumerate() {
            if bytes.iter().chain(around).all(|&byte| byte == 0) {
                self.significance[0].extend_from_slice(bytes);
                continue;
            }
            for (j, (&byte, &around)) in bytes.iter().zip(around).enumerate() {
                self.significance[usize::from(CLASS_OF[usize::from(around) % ACTIVITIES])].push(byte);
                if byte != 0 {
                    self.add_cell(lines, 8 * i + j, byte, around);
                }
            }
        }
    }

    /// Adds the values of a cell.
    fn add_cell(&mut self, lines: [&[i32]; 4], cell: usize, significant: u8, activity: u8) {
        let busy = usize::from(2 * ONES[usize::from(significant)] + activity / 2);
        let values = &mut self.values[usize::from(SCALE_OF[busy % ACTIVITIES])];
        let mut left = significant;
        while left != 0 {
            let bit = left.trailing_zeros() as usize;
            let code = lines[bit / 2][2 * cell + bit % 2];
            values.push(symbol(code, &mut self.bits));
            left &= left - 1;
        }
    }
}

/// The symbol of a nonzero code. Writes the value's low bits, if any.
fn symbol(code: i32, bits: &mut BitWriter) -> u8 {
    let value = (((code << 1) ^ (code >> 31)) as u32).wrapping_sub(1);
    if value < LONG {
        return value as u8;
    }
    let low = 29 - value.leading_zeros();
    bits.put(value & ((1 << low) - 1), low);
    (LONG + 4 * (low - 5) + (value >> low & 3)) as u8
}

/// The four lines of codes that make up a row of cells, in the order of the significance bits.
fn lines<'a>(codes: &'a [i32], extents: &[usize; 4], row: Row, outside: &'a [i32]) -> [&'a [i32]; 4] {
    let ([sx, sy, ..], [y, z]) = (*extents, row.whole);
    let line = |there: bool, skip: usize| if there { &codes[row.code + skip..][..sx] } else { outside };
    [line(true, 0), line(y, sx), line(z, sx * sy), line(y && z, sx * sy + sx)]
}

/// Computes the significance bytes of a row, in groups of 8.
fn mark(lines: [&[i32]; 4], significant: &mut [u8]) {
    for (i, bytes) in significant.chunks_mut(8).enumerate() {
        let last = lines[0].len().min(16 * i + 16);
        let parts = lines.map(|line| &line[16 * i..last]);
        bytes.fill(0);
        if parts.iter().any(|part| part.iter().fold(0, |any, code| any | code) != 0) {
            (0..4).for_each(|line| mark_line(parts[line], 2 * line, bytes));
        }
    }
}

/// Sets two bits of each significance byte.
fn mark_line(codes: &[i32], shift: usize, bytes: &mut [u8]) {
    let (pairs, last) = codes.as_chunks::<2>();
    for (byte, pair) in bytes.iter_mut().zip(pairs) {
        *byte |= (u8::from(pair[0] != 0) | u8::from(pair[1] != 0) << 1) << shift;
    }
    if let ([code], Some(byte)) = (last, bytes.get_mut(pairs.len())) {
        *byte |= u8::from(*code != 0) << shift;
    }
}
