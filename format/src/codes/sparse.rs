//! Codes as a list of those that are not zero.

/// Where the codes of a box lie in the decoder's arrays: one array for each k of the box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CodeBox {
    /// Codes along x, y, z, k.
    pub extents: [usize; 4],
    /// Place of the first code of each k.
    pub first: usize,
    /// Distance of places along x, y, z.
    pub strides: [usize; 3],
    /// The codes of each 2 x 2 x 2 that may be nonzero, as bits from the first to the last, x fastest: another box holds the
    /// others.
    pub allowed: u8,
    /// The places whose codes are needed: others may be left out, but are checked.
    pub needed: Places,
}

/// A range of places.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Places {
    /// The first one.
    pub start: usize,
    /// The one after the last.
    pub end: usize,
}

impl Places {
    /// All places.
    pub const ALL: Self = Self { start: 0, end: usize::MAX };

    /// No places.
    pub const NONE: Self = Self { start: 0, end: 0 };
}

impl CodeBox {
    /// A box whose codes lie side by side, x fastest.
    pub fn contiguous(extents: [usize; 4]) -> Self {
        Self {
            extents,
            first: 0,
            strides: [1, extents[0], extents[0].saturating_mul(extents[1])],
            allowed: 0xFF,
            needed: Places::ALL,
        }
    }

    /// Whether every place fits in 32 bits.
    pub(crate) fn fits(&self) -> bool {
        let [x, y, z, _] = self.extents.map(|extent| extent.saturating_sub(1));
        u32::try_from(self.place_after(self.first, [x, y, z])).is_ok()
    }

    /// The place so many codes after another along x, y, z, or the largest number.
    pub(crate) fn place_after(&self, place: usize, codes: [usize; 3]) -> usize {
        self.strides.iter().zip(codes).fold(place, |place, (stride, n)| place.saturating_add(stride.saturating_mul(n)))
    }
}

/// The codes of a box before they are packed: `codes[place + slice * k]`.
#[derive(Debug, Clone, Copy)]
pub struct DenseCodes<'a> {
    /// Codes at the places of the box, and possibly others.
    pub codes: &'a [i32],
    /// Distance of the codes of one k and the next.
    pub slice: usize,
    /// Where the codes of each k lie.
    pub at: CodeBox,
}

impl<'a> DenseCodes<'a> {
    /// The codes of contiguous boxes, one box after another.
    pub fn one_after_another(codes: &'a [i32], boxes: &[CodeBox]) -> Vec<Self> {
        let mut rest = codes;
        let of_box = |at: &CodeBox| {
            let slice = at.extents[..3].iter().product();
            let (codes, after) = rest.split_at(slice * at.extents[3]);
            rest = after;
            Self { codes, slice, at: *at }
        };
        boxes.iter().map(of_box).collect()
    }

    /// The codes of the box side by side, zero where they belong to another box. `scratch` may hold them.
    pub(crate) fn contiguous<'b>(&'b self, scratch: &'b mut Vec<i32>) -> &'b [i32] {
        let Self { codes, slice, at } = *self;
        let [x, y, z, t] = at.extents;
        if at == CodeBox::contiguous(at.extents) && slice == x * y * z {
            return &codes[..x * y * z * t];
        }
        scratch.clear();
        scratch.reserve(x * y * z * t);
        for (t, z, y) in (0..t).flat_map(|t| (0..z).flat_map(move |z| (0..y).map(move |y| (t, z, y)))) {
            let row = &codes[t * slice + at.first + y * at.strides[1] + z * at.strides[2]..];
            let allowed = at.allowed >> (2 * (y % 2) + 4 * (z % 2));
            let own = |(x, code): (usize, &i32)| if allowed >> (x % 2) & 1 == 1 { *code } else { 0 };
            scratch.extend(row.iter().step_by(at.strides[0]).take(x).enumerate().map(own));
        }
        scratch
    }
}

/// The codes of some boxes that are not zero, with their places. A *run* holds the codes of one k of a box.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SparseCodes {
    pub(crate) places: Vec<u32>,
    pub(crate) values: Vec<i32>,
    /// Where each run ends.
    pub(crate) ends: Vec<usize>,
}

impl SparseCodes {
    /// No codes.
    pub const NONE: Self = Self { places: Vec::new(), values: Vec::new(), ends: Vec::new() };

    /// Bytes of memory that the codes take.
    pub fn held_bytes(&self) -> usize {
        let Self { places, values, ends } = self;
        size_of_val(&places[..]) + size_of_val(&values[..]) + size_of_val(&ends[..])
    }

    /// Returns unused memory to the system.
    pub fn shrink(&mut self) {
        self.places.shrink_to_fit();
        self.values.shrink_to_fit();
        self.ends.shrink_to_fit();
    }

    /// Removes all runs and keeps the memory.
    pub fn clear(&mut self) {
        self.places.clear();
        self.values.clear();
        self.ends.clear();
    }

    /// The number of codes that are not zero.
    pub fn count(&self) -> usize {
        self.values.len()
    }

    /// The number of runs.
    pub fn runs(&self) -> usize {
        self.ends.len()
    }

    /// The places and values of a run; empty if there is no such run.
    pub fn run(&self, run: usize) -> (&[u32], &[i32]) {
        let start = run.checked_sub(1).and_then(|before| self.ends.get(before)).copied().unwrap_or(0);
        let end = self.ends.get(run).copied().unwrap_or(start);
        (&self.places[start..end], &self.values[start..end])
    }

    /// Appends the codes of a box that are not zero, with their places.
    pub fn list(&mut self, of: &DenseCodes<'_>, places: &CodeBox) {
        let [x, y, z, t] = of.at.extents;
        let start = |at: &CodeBox, y: usize, z: usize| at.first + y * at.strides[1] + z * at.strides[2];
        for t in 0..t {
            let slice = of.codes.get(t * of.slice..).unwrap_or_default();
            for (z, y) in (0..z).flat_map(|z| (0..y).map(move |y| (z, y))) {
                let (row, to) = (&slice[start(&of.at, y, z)..], start(places, y, z));
                let allowed = of.at.allowed >> (2 * (y % 2) + 4 * (z % 2));
                let mut add = |x: usize, code: i32| {
                    if code != 0 && allowed >> (x % 2) & 1 == 1 {
                        self.places.push((to + x * places.strides[0]) as u32);
                        self.values.push(code);
                    }
                };
                if of.at.strides[0] == 1 {
                    nonzero(&row[..x], &mut add);
                } else {
                    row.iter().step_by(of.at.strides[0]).take(x).enumerate().for_each(|(x, code)| add(x, *code));
                }
            }
            self.ends.push(self.values.len());
        }
    }

    /// Moves every code to the place that `place(run, place)` returns, or removes it.
    pub fn map_places(&mut self, mut place: impl FnMut(usize, u32) -> Option<u32>) {
        let (mut kept, mut start) = (0, 0);
        for (run, end) in self.ends.iter_mut().enumerate() {
            for i in start..*end {
                if let Some(to) = place(run, self.places[i]) {
                    (self.places[kept], self.values[kept]) = (to, self.values[i]);
                    kept += 1;
                }
            }
            (start, *end) = (*end, kept);
        }
        self.places.truncate(kept);
        self.values.truncate(kept);
    }

    /// Appends runs without codes for boxes whose codes are all zero.
    pub fn skip(&mut self, boxes: &[CodeBox]) {
        let runs: usize = boxes.iter().map(|of| of.extents[3]).sum();
        self.ends.resize(self.ends.len() + runs, self.values.len());
    }

    /// Writes the codes of contiguous boxes, one box after another, including zeros.
    pub(crate) fn fill(&self, boxes: &[CodeBox], codes: &mut [i32]) {
        codes.fill(0);
        let (mut run, mut start) = (0, 0);
        for &CodeBox { extents: [x, y, z, t], .. } in boxes {
            for _ in 0..t {
                let (places, values) = self.run(run);
                places.iter().zip(values).for_each(|(place, value)| codes[start + *place as usize] = *value);
                (run, start) = (run + 1, start + x * y * z);
            }
        }
    }
}

/// Visits codes, but passes over zeros several at a time.
fn nonzero(codes: &[i32], visit: &mut impl FnMut(usize, i32)) {
    for (first, some) in (0..).step_by(16).zip(codes.chunks(16)) {
        if some.iter().fold(0, |any, code| any | code) != 0 {
            some.iter().enumerate().for_each(|(i, code)| visit(first + i, *code));
        }
    }
}
