//! The part of a lattice that is computed.

use std::ops::Range;

/// A part of a lattice: whole rows along x. The nodes outside of it are arbitrary.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Within {
    pub(super) y: Range<usize>,
    pub(super) z: Range<usize>,
    /// The places in a slice of the layers that have these rows.
    pub(super) places: Range<usize>,
}

impl Within {
    pub(super) fn new([x, y, _]: [usize; 3], in_y: Range<usize>, in_z: Range<usize>) -> Self {
        let places = in_z.start * x * y..in_z.end * x * y;
        Self { y: in_y, z: in_z, places }
    }

    /// Whether it is the whole of a lattice with these nodes.
    pub(super) fn is_whole(&self, extents: [usize; 3]) -> bool {
        *self == Self::new(extents, 0..extents[1], 0..extents[2])
    }
}

/// The range around all that are not empty.
pub(super) fn around(ranges: impl Iterator<Item = Range<usize>>) -> Range<usize> {
    let join = |all: Range<usize>, of: Range<usize>| all.start.min(of.start)..all.end.max(of.end);
    ranges.filter(|range| !range.is_empty()).reduce(join).unwrap_or(0..0)
}
