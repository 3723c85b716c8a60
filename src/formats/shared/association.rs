//! What VTK's arrays have a sample for.

/// What an array has one sample for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Association {
    /// Each point of the lattice.
    Points,
    /// Each cell between points.
    Cells,
}

impl Association {
    /// Samples along x, y, z of a lattice of points; an axis of one point has one cell.
    pub(crate) fn dims(self, points: [usize; 3]) -> [usize; 3] {
        points.map(|n| if self == Self::Cells && n > 1 { n - 1 } else { n })
    }

    /// Where the first sample is of a lattice whose first point is `first`: cells have theirs in their middle.
    pub(crate) fn origin(self, points: [usize; 3], first: [f64; 3], spacing: [f64; 3]) -> [f64; 3] {
        let shift = |axis: usize| if self == Self::Cells && points[axis] > 1 { spacing[axis] / 2.0 } else { 0.0 };
        std::array::from_fn(|axis| first[axis] + shift(axis))
    }
}
