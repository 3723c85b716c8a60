//! Whether a VTK array has its samples at points or in cells.

/// Where an array has its samples: one at each point, or one in each cell.
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

    /// The position of the first sample of a lattice with the first point `first`. The sample of a cell is in its middle.
    pub(crate) fn origin(self, points: [usize; 3], first: [f64; 3], spacing: [f64; 3]) -> [f64; 3] {
        let shift = |axis: usize| if self == Self::Cells && points[axis] > 1 { spacing[axis] / 2.0 } else { 0.0 };
        std::array::from_fn(|axis| first[axis] + shift(axis))
    }
}
