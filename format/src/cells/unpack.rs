//! Streams to codes.

use super::{ACTIVITIES, CLASS_OF, CLASSES, Grid, LONG, ONES, Row, SCALE_OF, SCALES, SYMBOLS, cells, volume};
use crate::bits::{BitReader, take_varint};
use crate::bytes::{Check, ensure};
use crate::segments::unpack_segments;

/// Fills `codes` with those of all boxes; returns how many are not zero.
///
/// `boxes[i]` are the extents of a box along x, y, z, t.
pub fn unpack_cells(raw: &[u8], boxes: &[[usize; 4]], codes: &mut [i32]) -> Result<usize, String> {
    codes.fill(0);
    let total = boxes.iter().map(volume).fold(0, usize::saturating_add);
    ensure(total == codes.len(), || format!("boxes of {total} codes for {}", codes.len()))?;
    let mut streams = Streams::parse(raw, boxes.iter().map(cells).sum(), total)?;
    let mut rest = codes;
    for &extents in boxes {
        let (codes, after) = rest.split_at_mut(volume(&extents));
        streams.fill(codes, extents)?;
        rest = after;
    }
    streams.finish()
}

/// Bytes behind the symbols, so that 8 can be looked at from each.
const BEHIND: usize = 8;

struct Streams<'a> {
    symbols: Vec<u8>,
    /// The next symbol of each stream; lengths are powers of two, that lookups need no check.
    classes: [usize; 8],
    scales: [usize; SCALES],
    /// Where each stream ends.
    ends: [usize; CLASSES + SCALES],
    bits: BitReader<'a>,
    /// Whether some symbol means nothing.
    wrong: bool,
}

impl<'a> Streams<'a> {
    fn parse(raw: &'a [u8], cells: usize, codes: usize) -> Check<Self> {
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
        Ok(Self { symbols, classes, scales, ends, bits: BitReader::new(rest), wrong: false })
    }

    /// Every stream and the bits must have come to their end.
    fn finish(self) -> Check<usize> {
        let next = self.classes[..CLASSES].iter().chain(&self.scales);
        ensure(next.eq(&self.ends), || "streams do not have the lengths that their cells call for".into())?;
        ensure(!self.wrong, || "a code out of range".into())?;
        let left = self.bits.end()?.len();
        ensure(left == 0, || format!("{left} bytes too many"))?;
        Ok(self.ends[CLASSES + SCALES - 1] - self.ends[CLASSES - 1])
    }

    /// A box, whose codes are zero so far.
    fn fill(&mut self, codes: &mut [i32], extents: [usize; 4]) -> Check {
        let mut grid = Grid::new(extents);
        let mut significant = vec![0; grid.cells[0]];
        let ahead = |bit: usize| bit % 2 + extents[0] * (bit / 2 % 2 + extents[1] * (bit / 4));
        let steps = std::array::from_fn(ahead);
        for row in grid.rows() {
            let (around, counts) = grid.around(row);
            self.mark(around, counts, &mut significant);
            ensure(inside(&significant, row, extents[0]), || "a code outside its box is not zero".into())?;
            self.scatter(&mut codes[row.code..], &steps, &significant, around, counts);
        }
        Ok(())
    }

    /// The significance bytes of a row, and how many ones each has; 8 that are zero amid zeros at once.
    fn mark(&mut self, around: &[u8], counts: &mut [u8], significant: &mut [u8]) {
        let (mut before, mut x) = (0, 0);
        while x < significant.len() {
            let end = significant.len().min(x + 8);
            if before == 0 && end == x + 8 && self.skip_zeros(&around[x..end]) {
                counts[x..end].fill(0);
                significant[x..end].fill(0);
            } else {
                let rows = around[x..end].iter().zip(&mut counts[x..end]).zip(&mut significant[x..end]);
                for ((around, count), byte) in rows {
                    *byte = self.next_byte(around.wrapping_add(before));
                    before = ONES[usize::from(*byte)];
                    *count = before;
                }
            }
            x = end;
        }
    }

    /// Takes 8 zeros if those come next and there is no activity.
    #[inline(always)]
    fn skip_zeros(&mut self, around: &[u8]) -> bool {
        let next = self.symbols.get(self.classes[0]..).and_then(|next| next.first_chunk::<8>());
        let zeros = around == [0; 8] && next == Some(&[0; 8]);
        self.classes[0] += if zeros { 8 } else { 0 };
        zeros
    }

    /// The next significance byte under an activity; past the end zero, which the end finds out.
    #[inline(always)]
    fn next_byte(&mut self, activity: u8) -> u8 {
        let next = &mut self.classes[usize::from(CLASS_OF[usize::from(activity) % ACTIVITIES] % 8)];
        let byte = self.symbols.get(*next).map_or(0, |byte| *byte);
        *next = next.wrapping_add(1);
        byte
    }

    /// The values of a row of cells.
    fn scatter(&mut self, codes: &mut [i32], steps: &[usize; 8], significant: &[u8], around: &[u8], counts: &[u8]) {
        let mut before = 0;
        for (x, ((&byte, &around), &count)) in significant.iter().zip(around).zip(counts).enumerate() {
            if byte != 0 {
                let busy = usize::from(2 * count + around.wrapping_add(before) / 2);
                let scale = usize::from(SCALE_OF[busy % ACTIVITIES]) % SCALES;
                self.scatter_cell(&mut codes[2 * x..], steps, byte, scale);
            }
            before = count;
        }
    }

    #[inline(always)]
    fn scatter_cell(&mut self, codes: &mut [i32], steps: &[usize; 8], significant: u8, scale: usize) {
        let (mut left, mut next) = (significant, self.scales[scale]);
        while left != 0 {
            let symbol = self.symbols.get(next).map_or(0, |symbol| *symbol);
            let value = if u32::from(symbol) < LONG { u32::from(symbol) } else { self.long(symbol) };
            codes[steps[left.trailing_zeros() as usize % 8]] = unzigzag(value.wrapping_add(1));
            next = next.wrapping_add(1);
            left &= left - 1;
        }
        self.scales[scale] = next;
    }

    /// The value of a symbol that has further bits.
    #[cold]
    fn long(&mut self, symbol: u8) -> u32 {
        let symbol = u32::from(symbol);
        if symbol >= SYMBOLS {
            self.wrong = true;
            return 0;
        }
        let low = (symbol - LONG) / 4 + 5;
        let value = (4 + symbol % 4) << low | self.bits.take(low);
        self.wrong |= value == u32::MAX;
        value
    }
}

/// 1, 2, 3, ... as -1, 1, -2, ...
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
