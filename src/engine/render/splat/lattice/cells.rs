//! The cells (eq 35) of a band of a picture, with planes of sums.

use super::Sums;
use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};
use wavesplat_core::base::vectors::dispatch;
use wavesplat_core::base::zeroed::Zeroed;
use wavesplat_core::codec::real::Real;

/// The largest number of planes in a group: their sums stay in a register.
pub(super) const TOGETHER: usize = 16;

/// A rectangle of cells with planes of sums.
///
/// A row of cells is stored as one run for each of the q phases. The run of a phase holds the cells u = q j + phase
/// side by side, so the values that a row of voxels adds to them are side by side, too.
#[derive(Debug)]
pub(in crate::render) struct Cells {
    pub(super) rectangle: Rectangle,
    /// The sums of ordinary values in f32, plane by plane, [`TOGETHER`] planes at most in each buffer.
    pub(super) single: Vec<Zeroed<f32>>,
    /// For each plane, the sums in f64: all, or else those of values that sums in f32 cannot hold, and of the middles of
    /// blocks. A plane is the sum of both.
    pub(super) planes: Vec<PlaneSums>,
    pub(super) sums: Sums,
}

/// The sums of one plane of cells.
#[derive(Debug, Default)]
pub(super) struct PlaneSums {
    /// Whether it has sums in f32.
    pub(super) has_single: bool,
    /// The sums in f64; of planes in f32 allocated with the first value.
    pub(super) double: Option<Aligned<f64>>,
}

/// Room for planes with sums in f64. Which planes need them shows only when their blocks are added.
#[derive(Debug)]
pub(in crate::render) struct DoubleRoom {
    used: AtomicUsize,
    most: usize,
}

impl DoubleRoom {
    /// Room for `most` planes.
    pub(in crate::render) fn new(most: usize) -> Self {
        Self { used: AtomicUsize::new(0), most }
    }

    /// The number of planes that have sums in f64.
    pub(in crate::render) fn used(&self) -> usize {
        self.used.load(Relaxed)
    }

    /// The number of planes that have sums in f64 and room.
    pub(in crate::render) fn granted(&self) -> usize {
        self.used().min(self.most)
    }

    /// Whether more planes need sums in f64 than have room. Then the sums are of no use.
    pub(in crate::render) fn is_exceeded(&self) -> bool {
        self.used() > self.most
    }
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

/// Numbers that are processed together.
pub(super) const LINE: usize = 16;

/// Numbers whose lines are aligned, initially zero.
#[derive(Debug, Default)]
pub(super) struct Aligned<R> {
    numbers: Vec<R>,
    first: usize,
    len: usize,
}

impl<R: Real> Aligned<R> {
    pub(super) fn zeros(len: usize) -> Self {
        // Written here: memory that is read before it is written costs twice.
        let mut numbers = Vec::with_capacity(len + LINE - 1);
        numbers.resize(len + LINE - 1, R::default());
        let first = numbers.as_ptr().align_offset(LINE * size_of::<R>()).min(LINE - 1);
        Self { numbers, first, len }
    }

    /// The same memory for `len` numbers, if it is large enough; new memory otherwise.
    pub(super) fn resized(self, len: usize) -> Self {
        if self.first + len <= self.numbers.len() { Self { len, ..self } } else { Self::zeros(len) }
    }
}

impl<R> std::ops::Deref for Aligned<R> {
    type Target = [R];

    fn deref(&self) -> &[R] {
        &self.numbers[self.first..][..self.len]
    }
}

impl<R> std::ops::DerefMut for Aligned<R> {
    fn deref_mut(&mut self) -> &mut [R] {
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
    /// reaches `width` cells from `cell` on.
    pub(super) fn voxels_reaching(&self, axis: usize, cell: isize, width: usize, count: usize) -> Range<usize> {
        let (before, phases) = (self.first[axis] - cell, self.phases as isize);
        let within = |n: isize| n.clamp(0, count as isize) as usize;
        let start = within((before - width as isize + phases).div_euclid(phases));
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
    pub(super) fn new(rectangle: Rectangle, planes: usize, sums: Sums) -> Self {
        let buffer = |first: usize| Zeroed::new(TOGETHER.min(planes - first) * rectangle.area());
        let of_single = if sums == Sums::Single { planes } else { 0 };
        let single = (0..of_single).step_by(TOGETHER).map(buffer).collect();
        let double = || (sums == Sums::Double).then(|| Aligned::zeros(rectangle.area()));
        let plane = |_| PlaneSums { has_single: false, double: double() };
        Self { rectangle, single, planes: (0..planes).map(plane).collect(), sums }
    }

    /// All planes, for adding values. Planes with sums in f64 take `room`.
    pub(in crate::render) fn planes_mut<'a>(&'a mut self, room: &'a DoubleRoom) -> Vec<CellPlane<'a>> {
        let rectangle = self.rectangle;
        let single = self.single.iter_mut().flat_map(|planes| planes.chunks_exact_mut(rectangle.area().max(1)));
        // Sums in f64 and rectangles without cells have no chunks.
        let single = single.map(Some).chain(std::iter::repeat_with(|| None)).map(Option::unwrap_or_default);
        self.planes.iter_mut().zip(single).map(|(sums, single)| CellPlane { rectangle, single, sums, room }).collect()
    }
}

impl CellPlane<'_> {
    /// The sums in f32.
    pub(super) fn single(&mut self) -> &mut [f32] {
        self.sums.has_single = true;
        self.single
    }

    /// The sums in f64; allocates them as zeros if necessary.
    pub(super) fn double(&mut self) -> &mut [f64] {
        let (area, room) = (self.rectangle.area(), self.room);
        self.sums.double.get_or_insert_with(|| {
            room.used.fetch_add(1, Relaxed);
            Aligned::zeros(area)
        })
    }

    /// Adds `scale` times the cells of another rectangle to the sums in f32.
    pub(super) fn add_single(&mut self, rectangle: &Rectangle, sums: &[f32], scale: f32) {
        let own = self.rectangle;
        add_rectangle(&own, self.single(), rectangle, sums, |to, from| {
            dispatch!(add_scaled_single(to, from, scale));
        });
    }

    /// Adds `scale` times the cells of another rectangle to the sums in f64.
    pub(super) fn add_double<R: Real>(&mut self, rectangle: &Rectangle, sums: &[R], scale: f64) {
        let own = self.rectangle;
        add_rectangle(&own, self.double(), rectangle, sums, |to, from| {
            dispatch!(add_scaled_double(to, from, scale));
        });
    }
}

/// Calls `add(to, from)` for all runs of cells that two rectangles share.
fn add_rectangle<S, R>(
    own: &Rectangle,
    sums: &mut [S],
    rectangle: &Rectangle,
    more: &[R],
    add: impl Fn(&mut [S], &[R]),
) {
    for (v, from) in (rectangle.first[1]..).zip(more.chunks_exact(rectangle.size[0])) {
        let Some(row) = own.row(v) else { continue };
        let to = &mut sums[row];
        for (phase, from) in from.chunks_exact(rectangle.run).enumerate() {
            let run = own.run_of(rectangle.first[0] + phase as isize, rectangle.run / LINE);
            add(&mut to[run.start..][..run.here.len() * LINE], &from[run.here.start * LINE..]);
        }
    }
}

#[inline(always)]
fn add_scaled_single(sums: &mut [f32], more: &[f32], scale: f32) {
    sums.iter_mut().zip(more).for_each(|(sum, more)| *sum += scale * more);
}

#[inline(always)]
fn add_scaled_double<R: Real>(sums: &mut [f64], more: &[R], scale: f64) {
    sums.iter_mut().zip(more).for_each(|(sum, more)| *sum += scale * more.to_f64());
}

/// One plane of cells.
#[derive(Debug)]
pub(in crate::render) struct CellPlane<'a> {
    pub(super) rectangle: Rectangle,
    single: &'a mut [f32],
    sums: &'a mut PlaneSums,
    room: &'a DoubleRoom,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_the_cells_within_the_rectangle() {
        let rectangle = Rectangle::holding([-3, 2], [14, 2], 2);
        assert_eq!((rectangle.first, rectangle.size, rectangle.run), ([-32, 2], [64, 2], 32));
        let run = |start, here, inside| Run { start, here, inside };
        // Even cells first: -32, -30, ... 30, then -31, -29, ... 31.
        for (u, lines, expected) in [
            (-32, 1, run(0, 0..1, 0)),
            (-35, 2, run(32, 1..2, 14)),
            (-34, 1, run(0, 0..0, 15)),
            (31, 3, run(48, 0..1, 15)),
            (32, 3, run(32, 0..0, 0)),
        ] {
            assert_eq!(rectangle.run_of(u, lines), expected, "{u}");
        }
        assert_eq!([1, 2, 3, 4].map(|v| rectangle.row(v)), [None, Some(0..64), Some(64..128), None]);
        assert_eq!([-33, -32, 1, 31, 32].map(|u| rectangle.in_row(u)), [None, Some(0), Some(48), Some(63), None]);
    }
}
