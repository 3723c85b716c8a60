//! The cells (eq 35) of a band of a picture, with planes of sums.

use std::ops::Range;

/// A rectangle of cells with planes of sums.
///
/// A row of cells is stored as one run for each of the q phases. The run of a phase holds the cells u = q j + phase
/// side by side, so the values that a row of voxels adds to them are side by side, too.
#[derive(Debug)]
pub(in crate::render) struct Cells {
    rectangle: Rectangle,
    /// Planes without any value are not allocated.
    planes: Vec<Option<Aligned>>,
}

/// The extent of a rectangle of cells and its layout in memory.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Rectangle {
    /// The first cell along u and v. The first cell along u starts a cache line, at positions common to all rectangles.
    pub(super) first: [isize; 2],
    /// Cells along u and v.
    pub(super) size: [usize; 2],
    /// q
    pub(super) phases: usize,
    /// Cells per phase in a row: a whole number of cache lines.
    pub(super) run: usize,
}

/// A run of whole cache lines of cells of one phase in a row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Run {
    /// The index in the row of the first cell that lies in the rectangle.
    pub(super) start: usize,
    /// The lines that lie in the rectangle.
    pub(super) here: Range<usize>,
    /// The index of the requested cell in the first line.
    pub(super) inside: usize,
}

/// Numbers in a cache line.
pub(super) const LINE: usize = 8;

/// Numbers aligned to cache lines, initially zero.
#[derive(Debug, Default)]
pub(super) struct Aligned {
    numbers: Vec<f64>,
    first: usize,
    len: usize,
}

impl Aligned {
    pub(super) fn of(len: usize) -> Self {
        // Written here: memory that is read before it is written costs twice.
        let mut numbers = Vec::with_capacity(len + LINE - 1);
        numbers.resize(len + LINE - 1, 0.0);
        let first = numbers.as_ptr().align_offset(LINE * size_of::<f64>()).min(LINE - 1);
        Self { numbers, first, len }
    }
}

impl std::ops::Deref for Aligned {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.numbers[self.first..][..self.len]
    }
}

impl std::ops::DerefMut for Aligned {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.numbers[self.first..][..self.len]
    }
}

impl Rectangle {
    /// The smallest rectangle that holds `size` cells from `first` on.
    pub(super) fn holding(first: [isize; 2], size: [usize; 2], phases: usize) -> Self {
        let before = first[0].rem_euclid((phases * LINE) as isize);
        let lines = (size[0] + before as usize).div_ceil(phases * LINE);
        // Not a power of two: lines below one another would share a few sets of the first-level cache.
        let run = LINE * if (phases * lines).is_multiple_of(8) { lines + 1 } else { lines };
        Self { first: [first[0] - before, first[1]], size: [phases * run, size[1]], phases, run }
    }

    /// Number of cells in a plane.
    pub(super) fn area(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// The voxels of a row that reach the rectangle along an axis. The row has `count` voxels, q cells apart; the first
    /// reaches `cell` and the `degree` cells after it.
    pub(super) fn voxels_reaching(&self, axis: usize, cell: isize, degree: usize, count: usize) -> Range<usize> {
        let (before, phases) = (self.first[axis] - cell, self.phases as isize);
        let within = |n: isize| n.clamp(0, count as isize) as usize;
        let start = within((before - degree as isize + phases - 1).div_euclid(phases));
        let end = within((before + self.size[axis] as isize + phases - 1).div_euclid(phases));
        start..end.max(start)
    }

    /// The run of `lines` cache lines of a row whose first line contains cell u.
    pub(super) fn run_of(&self, u: isize, lines: usize) -> Run {
        let (u, size, line) = (u - self.first[0], self.run as isize, LINE as isize);
        let (phase, j) = (u.rem_euclid(self.phases as isize), u.div_euclid(self.phases as isize));
        let first = j.div_euclid(line);
        let here = (-first).max(0).min(lines as isize)..(size / line - first).clamp(0, lines as isize);
        let here = if here.is_empty() { 0..0 } else { here.start as usize..here.end as usize };
        let start = phase * size + (first + here.start as isize).clamp(0, size / line) * line;
        Run { start: start as usize, here, inside: j.rem_euclid(line) as usize }
    }

    /// The index of cell u in its row; `None` outside the rectangle.
    pub(super) fn in_row(&self, u: isize) -> Option<usize> {
        let u = u - self.first[0];
        let j = u.div_euclid(self.phases as isize);
        (0..self.run as isize).contains(&j).then(|| u.rem_euclid(self.phases as isize) as usize * self.run + j as usize)
    }

    /// The cells u, u + q, ... of a row, less than `count` cells from u, that lie in the rectangle: the offset of the
    /// first of them from u, and their range in the row.
    pub(super) fn first_in_row(&self, u: isize, count: usize) -> (usize, Range<usize>) {
        let phases = self.phases;
        let skipped = ((self.first[0] - u).max(0) as usize).div_ceil(phases);
        let wanted = count.div_ceil(phases).saturating_sub(skipped);
        let here = self.in_row(u + (skipped * phases) as isize);
        let run = here.map_or(0..0, |start| start..start + wanted.min(self.run - start % self.run));
        (skipped * phases, run)
    }

    /// The range of row v in a plane; `None` outside the rectangle.
    pub(super) fn row(&self, v: isize) -> Option<Range<usize>> {
        let v = usize::try_from(v - self.first[1]).ok().filter(|v| *v < self.size[1])?;
        Some(v * self.size[0]..(v + 1) * self.size[0])
    }
}

impl Cells {
    /// The extent of the cells.
    pub(in crate::render) fn rectangle(&self) -> Rectangle {
        self.rectangle
    }

    /// Cells with all planes at zero.
    pub(super) fn new(rectangle: Rectangle, planes: usize) -> Self {
        Self { rectangle, planes: (0..planes).map(|_| None).collect() }
    }

    /// The allocated planes: their indices and sums.
    pub(super) fn touched(&self) -> impl Iterator<Item = (usize, &[f64])> {
        let planes = self.planes.iter().enumerate();
        planes.filter_map(|(number, sums)| sums.as_deref().map(|sums| (number, sums)))
    }

    /// All planes, for adding values.
    pub(in crate::render) fn planes_mut(&mut self) -> Vec<CellPlane<'_>> {
        let rectangle = self.rectangle;
        self.planes.iter_mut().map(|sums| CellPlane { rectangle, sums }).collect()
    }
}

impl CellPlane<'_> {
    /// The sums; allocates them as zeros if necessary.
    pub(super) fn sums(&mut self) -> &mut [f64] {
        let area = self.rectangle.area();
        self.sums.get_or_insert_with(|| Aligned::of(area))
    }

    /// Adds the cells of another rectangle.
    pub(super) fn add(&mut self, rectangle: &Rectangle, sums: &[f64]) {
        let own = self.rectangle;
        let own_sums = self.sums();
        for (v, from) in (rectangle.first[1]..).zip(sums.chunks_exact(rectangle.size[0])) {
            let Some(row) = own.row(v) else { continue };
            let to = &mut own_sums[row];
            for (phase, from) in from.chunks_exact(rectangle.run).enumerate() {
                let run = own.run_of(rectangle.first[0] + phase as isize, rectangle.run / LINE);
                add_to(&mut to[run.start..][..run.here.len() * LINE], &from[run.here.start * LINE..]);
            }
        }
    }
}

#[cfg_attr(not(feature = "portable"), multiversion::multiversion(targets("x86_64+avx512f", "x86_64+avx2")))]
fn add_to(sums: &mut [f64], more: &[f64]) {
    sums.iter_mut().zip(more).for_each(|(sum, more)| *sum += more);
}

/// One plane of cells.
#[derive(Debug)]
pub(in crate::render) struct CellPlane<'a> {
    pub(super) rectangle: Rectangle,
    sums: &'a mut Option<Aligned>,
}

/// The number of planes in a bundle, for `planes` planes in total.
pub(super) fn side_by_side(planes: usize) -> usize {
    planes.next_power_of_two().min(TOGETHER)
}

/// The largest number of planes in a bundle: their sums stay in registers, and their cells in the first-level cache for
/// some pixels.
pub(super) const TOGETHER: usize = 16;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_the_cells_within_the_rectangle() {
        let rectangle = Rectangle::holding([-3, 2], [14, 2], 2);
        assert_eq!((rectangle.first, rectangle.size, rectangle.run), ([-16, 2], [32, 2], 16));
        let run = |start, here, inside| Run { start, here, inside };
        // Even cells first: -16, -14, ... 14, then -15, -13, ... 15.
        for (u, lines, expected) in [
            (-16, 1, run(0, 0..1, 0)),
            (-19, 2, run(16, 1..2, 6)),
            (-18, 1, run(0, 0..0, 7)),
            (15, 3, run(24, 0..1, 7)),
            (16, 3, run(16, 0..0, 0)),
        ] {
            assert_eq!(rectangle.run_of(u, lines), expected, "{u}");
        }
        for (u, count, expected) in
            [(-16, 4, (0, 0..2)), (-19, 8, (4, 16..18)), (13, 9, (0, 30..32)), (16, 3, (0, 0..0))]
        {
            assert_eq!(rectangle.first_in_row(u, count), expected, "{u}");
        }
        assert_eq!([1, 2, 3, 4].map(|v| rectangle.row(v)), [None, Some(0..32), Some(32..64), None]);
        assert_eq!([-17, -16, 1, 15, 16].map(|u| rectangle.in_row(u)), [None, Some(0), Some(24), Some(31), None]);
    }
}
