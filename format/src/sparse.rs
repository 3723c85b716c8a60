//! Codes as a list of those that are not zero.

/// Where the codes of a box lie in the arrays of whoever decodes them: one array for each k of the box.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct CodeBox {
    /// Codes along x, y, z, k.
    pub extents: [usize; 4],
    /// Place of the first code of each k.
    pub first: usize,
    /// Distance of places along x, y, z.
    pub strides: [usize; 3],
}

impl CodeBox {
    /// A box whose codes lie side by side, x fastest.
    pub fn contiguous(extents: [usize; 4]) -> Self {
        Self { extents, first: 0, strides: [1, extents[0], extents[0].saturating_mul(extents[1])] }
    }

    /// Whether every place fits in 32 bits.
    pub(crate) fn fits(&self) -> bool {
        let along = |a: usize| self.extents[a].saturating_sub(1).saturating_mul(self.strides[a]);
        let last = (0..3).fold(self.first, |sum, a| sum.saturating_add(along(a)));
        u32::try_from(last).is_ok()
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
