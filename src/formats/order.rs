//! The order of extracted samples: any order of the axes, each axis of voxels in either direction.

use wavesplat_core::base::description::{AxisRole, Description};

/// An axis of the extracted array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutputAxis {
    /// Frames, ascending.
    Frames,
    /// Voxels along x (0), y (1) or z (2), ascending or from the last to the first.
    Voxels(usize, Direction),
}

/// The direction of an axis of voxels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From the first voxel to the last.
    Ascending,
    /// From the last voxel to the first.
    Descending,
}

/// The axes of the extracted array, the slowest first: frames, x, y and z once each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SampleOrder([OutputAxis; 4]);

impl Default for SampleOrder {
    /// Frame by frame, x fastest.
    fn default() -> Self {
        let [z, y, x] = [2, 1, 0].map(|axis| OutputAxis::Voxels(axis, Direction::Ascending));
        Self([OutputAxis::Frames, z, y, x])
    }
}

impl SampleOrder {
    /// The order of the source's array. Axes that it lacks are the slowest.
    pub fn of_source(description: &Description) -> Self {
        let of_axis = |role: AxisRole, reversed: bool| match (role, role.voxels()) {
            (AxisRole::Frames, _) => Some(OutputAxis::Frames),
            (_, Some(axis)) if reversed => Some(OutputAxis::Voxels(axis, Direction::Descending)),
            (_, axis) => axis.map(|axis| OutputAxis::Voxels(axis, Direction::Ascending)),
        };
        let known: Vec<OutputAxis> =
            description.axes.iter().filter_map(|axis| of_axis(axis.role, axis.reversed)).collect();
        let is_absent = |axis: &OutputAxis| known.iter().all(|other| other.voxels() != axis.voxels());
        let absent = Self::default().0.into_iter().filter(is_absent);
        let mut axes = absent.chain(known.iter().copied());
        Self(std::array::from_fn(|_| axes.next().unwrap_or(OutputAxis::Frames)))
    }

    /// Frame by frame, with the voxels in the order of the source's array.
    pub fn of_lattice(description: &Description) -> Self {
        let Self(axes) = Self::of_source(description);
        let voxels = axes.into_iter().filter(|axis| *axis != OutputAxis::Frames);
        let mut axes = [OutputAxis::Frames].into_iter().chain(voxels);
        Self(std::array::from_fn(|_| axes.next().unwrap_or(OutputAxis::Frames)))
    }

    /// The axes, the slowest first.
    pub fn axes(&self) -> [OutputAxis; 4] {
        self.0
    }
}

impl OutputAxis {
    /// The axis of voxels: 0 for x, 1 for y, 2 for z; none of frames.
    pub fn voxels(self) -> Option<usize> {
        match self {
            Self::Frames => None,
            Self::Voxels(axis, _) => Some(axis),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_core::base::description::{ArrayAxis, Dimension};

    #[test]
    fn absent_axes_are_the_slowest() {
        let axis = |role, reversed| ArrayAxis { dimension: 0, role, reversed };
        let dimensions = vec![Dimension { name: "x".into(), length: 1, unlimited: false }];
        let axes = vec![axis(AxisRole::X, true), axis(AxisRole::Single, false), axis(AxisRole::Frames, false)];
        let order = SampleOrder::of_source(&Description { dimensions, axes, ..Description::default() });
        let [z, y] = [2, 1].map(|axis| OutputAxis::Voxels(axis, Direction::Ascending));
        assert_eq!(order.axes(), [z, y, OutputAxis::Voxels(0, Direction::Descending), OutputAxis::Frames]);
        assert_eq!(SampleOrder::of_source(&Description::default()), SampleOrder::default());
    }
}
