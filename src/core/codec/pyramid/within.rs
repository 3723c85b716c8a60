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
}
