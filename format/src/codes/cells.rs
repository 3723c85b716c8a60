//! Codes packed by contexts.
//!
//! A cell is 2 x 2 x 2 codes. A byte says which of them are not zero. Neighbours predict how many: the activity of a
//! cell is the number of nonzero codes in the cells before it along x, y, z and t. Bytes of cells with similar activity
//! go to one stream, and nonzero codes to streams by the activity around and in their cell. Every stream is then packed
//! by rANS with frequencies of its own (eq 40). `FORMAT.md`, section 7, specifies the bytes.

mod pack;
#[cfg(test)]
mod reference;
#[cfg(test)]
mod tests;
mod unpack;

pub(super) use pack::{estimate_cells, pack_cells};
pub(super) use unpack::unpack_cells;

use super::sparse::CodeBox;
use super::{volume, volumes};
use crate::segments::max_segments;

/// Number of streams of significance bytes, chosen by the activity around a cell.
const CLASSES: usize = 5;

/// Number of streams of values, chosen by the activity around and in a cell.
const SCALES: usize = 4;

/// Number of activities: up to 8 codes in each of 4 neighbours, rounded up to a power of two so that lookups need no bounds
/// check.
const ACTIVITIES: usize = 64;

/// Stream of significance bytes for each activity.
static CLASS_OF: [u8; ACTIVITIES] = classes([1, 3, 8, 16]);

/// Stream of values, by twice the number of nonzero codes in a cell plus half the activity.
static SCALE_OF: [u8; ACTIVITIES] = classes([4, 10, 20, ACTIVITIES]);

/// The number of thresholds that each activity reaches.
const fn classes(thresholds: [usize; 4]) -> [u8; ACTIVITIES] {
    let mut table = [0; ACTIVITIES];
    let mut i = 0;
    while i < 4 * ACTIVITIES {
        table[i / 4] += (i / 4 >= thresholds[i % 4]) as u8;
        i += 1;
    }
    table
}

/// Number of ones in each byte: not every processor has an instruction for this.
pub(super) static ONES: [u8; 256] = {
    let mut table = [0; 256];
    let mut i = 1;
    while i < 256 {
        table[i] = table[i / 2] + (i % 2) as u8;
        i += 1;
    }
    table
};

/// Upper bound on the packed bytes of boxes with these extents.
///
/// That is a symbol for each cell, a symbol and 29 bits for each code, and a few numbers.
pub(super) fn max_packed(boxes: &[CodeBox]) -> usize {
    let cells = boxes.iter().map(|of| cells(&of.extents)).fold(0, usize::saturating_add);
    let codes = volumes(boxes);
    let symbols = codes.saturating_add(cells);
    let raw = codes.saturating_mul(29).div_ceil(8);
    let lengths = 5 * (CLASSES + SCALES);
    max_segments(symbols, CLASSES + SCALES).saturating_add(raw).saturating_add(lengths)
}

/// Number of cells in a box.
fn cells(&[x, y, z, t]: &[usize; 4]) -> usize {
    volume(&[x.div_ceil(2), y.div_ceil(2), z.div_ceil(2), t])
}

/// The cells of a box, row by row.
struct Grid {
    /// Codes along x, y, z, t.
    extents: [usize; 4],
    /// Cells along x, y, z.
    cells: [usize; 3],
    /// Number of nonzero codes in each cell of the latest frame. A row of zeros precedes each plane, and a plane of zeros
    /// precedes all.
    counts: Vec<u8>,
    /// Sum of the counts of the neighbours at y-1, z-1, t-1 for each cell of a row, followed by 8 nonzero values.
    around: Vec<u8>,
}

/// Position of a row of cells.
#[derive(Clone, Copy)]
struct Row {
    /// Its indices along y, z, t.
    y: usize,
    z: usize,
    t: usize,
    /// Index of its first code in the box, and of its first count.
    code: usize,
    count: usize,
    /// Whether its cells extend to a second code along y and along z.
    whole: [bool; 2],
}

impl Grid {
    fn new(extents: [usize; 4]) -> Self {
        let [x, y, z, _] = extents.map(|extent| extent.div_ceil(2));
        let counts = if volume(&extents) == 0 { 0 } else { x * (y + 1) * (z + 1) };
        Self { extents, cells: [x, y, z], counts: vec![0; counts], around: vec![1; x + 8] }
    }

    /// All rows, in order.
    fn rows(&self) -> impl Iterator<Item = Row> + use<> {
        let ([sx, sy, sz, st], [cx, cy, cz]) = (self.extents, self.cells);
        let st = if self.counts.is_empty() { 0 } else { st };
        let row = move |t, z, y| Row {
            y,
            z,
            t,
            code: sx * (2 * y + sy * (2 * z + sz * t)),
            count: cx * (y + 1 + (cy + 1) * (z + 1)),
            whole: [2 * y + 1 < sy, 2 * z + 1 < sz],
        };
        (0..st).flat_map(move |t| (0..cz).flat_map(move |z| (0..cy).map(move |y| row(t, z, y))))
    }

    /// Sums the counts of a row's neighbours. Returns the sums and the row's counts at t-1, which the caller replaces.
    fn around(&mut self, row: Row) -> (&[u8], &mut [u8]) {
        let [cx, cy, _] = self.cells;
        let (before, here) = self.counts.split_at_mut(row.count);
        let (up, back) = (&before[row.count - cx..], &before[row.count - cx * (cy + 1)..]);
        for (((around, here), up), back) in self.around.iter_mut().zip(&*here).zip(up).zip(back) {
            *around = here.wrapping_add(*up).wrapping_add(*back);
        }
        (&self.around, &mut here[..cx])
    }
}
