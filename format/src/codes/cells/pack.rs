//! Packs codes into streams.

use super::super::sparse::DenseCodes;
use super::super::values::{in_order, short_symbols, symbol};
use super::{ACTIVITIES, CLASS_OF, CLASSES, Grid, ONES, Row, SCALE_OF, SCALES, cells};
use crate::bits::{BitWriter, put_varint};
use crate::segments::{Heads, estimate_segments, pack_segments};

/// Packs the codes of several boxes. `FORMAT.md` specifies the bytes.
pub(crate) fn pack_cells(boxes: &[DenseCodes<'_>], heads: Heads, out: &mut Vec<u8>) {
    let mut bits = Vec::new();
    Streams::collect(boxes, &mut bits).finish(heads, out);
    out.append(&mut bits);
}

/// Estimates how many bytes [`pack_cells`] appends.
pub(crate) fn estimate_cells(boxes: &[DenseCodes<'_>]) -> usize {
    let mut bits = Vec::new();
    let packed = Streams::collect(boxes, &mut bits).estimate();
    packed + bits.len()
}

struct Streams<'a> {
    significance: [Vec<u8>; CLASSES],
    values: [Vec<u8>; SCALES],
    bits: BitWriter<'a>,
}

impl<'a> Streams<'a> {
    fn new(bits: &'a mut Vec<u8>, boxes: &[DenseCodes<'_>]) -> Self {
        let mut significance = [const { Vec::new() }; CLASSES];
        significance[0].reserve(boxes.iter().map(|of| cells(&of.at.extents)).sum());
        Self { significance, values: [const { Vec::new() }; SCALES], bits: BitWriter::new(bits) }
    }

    fn collect(boxes: &[DenseCodes<'_>], bits: &'a mut Vec<u8>) -> Self {
        let mut streams = Self::new(bits, boxes);
        let mut scratch = Vec::new();
        boxes.iter().for_each(|of| streams.add(of.contiguous(&mut scratch), of.at.extents));
        streams
    }

    /// All streams one after another, and the length of each. Completes the bits.
    fn joined(self) -> (Vec<u8>, Vec<usize>) {
        let streams: Vec<Vec<u8>> = self.significance.into_iter().chain(self.values).collect();
        self.bits.finish();
        (streams.concat(), streams.iter().map(Vec::len).collect())
    }

    fn finish(self, heads: Heads, out: &mut Vec<u8>) {
        let (symbols, lengths) = self.joined();
        lengths.iter().for_each(|&length| put_varint(length, out));
        pack_segments(&symbols, &lengths, heads, out);
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
        let (mut activity, mut marked) = (significant.clone(), vec![0; grid.cells[0] + 1]);
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
            self.add_row(lines, &significant, &activity, &mut marked);
        }
    }

    /// Adds a row of cells. Takes 8 cells at once if they and their neighbours are zero. `marked` has room for one cell more than the
    /// row has.
    fn add_row(&mut self, lines: [&[i32]; 4], significant: &[u8], activity: &[u8], marked: &mut [usize]) {
        let mut found = 0;
        for (i, (bytes, around)) in significant.chunks(8).zip(activity.chunks(8)).enumerate() {
            if bytes.iter().chain(around).all(|&byte| byte == 0) {
                self.significance[0].extend_from_slice(bytes);
                continue;
            }
            for (j, (&byte, &around)) in bytes.iter().zip(around).enumerate() {
                self.significance[usize::from(CLASS_OF[usize::from(around) % ACTIVITIES])].push(byte);
                marked[found] = 8 * i + j;
                found += usize::from(byte != 0);
            }
        }
        marked[..found].iter().for_each(|&x| self.add_cell(codes_of(lines, 2 * x), significant[x], activity[x]));
    }

    /// Adds the values of a cell. Without long values it uses no loop over them, because a processor could not predict its end.
    fn add_cell(&mut self, codes: [i32; 8], significant: u8, activity: u8) {
        let count = ONES[usize::from(significant)];
        let busy = usize::from(2 * count + activity / 2);
        let values = &mut self.values[usize::from(SCALE_OF[busy % ACTIVITIES])];
        let in_order = in_order(codes, significant);
        let end = values.len() + usize::from(count);
        match short_symbols(&in_order) {
            Some(symbols) => values.extend_from_slice(&symbols),
            None => values.extend(in_order[..count.into()].iter().map(|code| symbol(*code, &mut self.bits))),
        }
        values.truncate(end);
    }
}

/// The four lines of codes that make up a row of cells, in the order of the significance bits.
fn lines<'a>(codes: &'a [i32], extents: &[usize; 4], row: Row, outside: &'a [i32]) -> [&'a [i32]; 4] {
    let ([sx, sy, ..], [y, z]) = (*extents, row.whole);
    let line = |there: bool, skip: usize| if there { &codes[row.code + skip..][..sx] } else { outside };
    [line(true, 0), line(y, sx), line(z, sx * sy), line(y && z, sx * sy + sx)]
}

/// The codes of the cell whose first codes are the `x`-th of the lines; 0 outside of the box.
#[inline(always)]
fn codes_of(lines: [&[i32]; 4], x: usize) -> [i32; 8] {
    let pairs = lines.map(|line| match line.get(x..x + 2) {
        Some(pair) => [pair[0], pair[1]],
        None => [line[x], 0],
    });
    [pairs[0][0], pairs[0][1], pairs[1][0], pairs[1][1], pairs[2][0], pairs[2][1], pairs[3][0], pairs[3][1]]
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
