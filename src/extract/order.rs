//! The order of extracted samples: any order of the axes, each axis of voxels in either direction.

use crate::base::description::{AxisRole, Description};
use crate::base::grid::Region;

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

    /// Steps in an array of these frames and voxels.
    pub(super) fn strides(&self, frames: usize, region: &Region) -> Strides {
        let mut strides = Strides { frame: 0, voxel: [0; 3], descending: [false; 3], region: *region };
        let mut step = 1;
        for axis in self.0.iter().rev() {
            match *axis {
                OutputAxis::Frames => strides.frame = step,
                OutputAxis::Voxels(axis, direction) => {
                    strides.voxel[axis] = step;
                    strides.descending[axis] = direction == Direction::Descending;
                }
            }
            step *= axis.len(frames, region);
        }
        strides
    }
}

impl OutputAxis {
    /// None for frames, or the axis of voxels.
    pub(super) fn voxels(self) -> Option<usize> {
        match self {
            Self::Frames => None,
            Self::Voxels(axis, _) => Some(axis),
        }
    }

    /// The length of the axis in an array of these frames and voxels.
    pub(super) fn len(self, frames: usize, region: &Region) -> usize {
        self.voxels().map_or(frames, |axis| region.dims()[axis])
    }
}

/// Steps, in samples, between neighbours in an extracted array.
#[derive(Debug, Clone, Copy)]
pub(super) struct Strides {
    pub(super) frame: usize,
    voxel: [usize; 3],
    descending: [bool; 3],
    region: Region,
}

impl Strides {
    /// The place of a sample.
    pub(super) fn place(&self, frame: usize, voxel: [usize; 3]) -> usize {
        let along = |axis: usize| match self.descending[axis] {
            true => self.region.end[axis] - 1 - voxel[axis],
            false => voxel[axis] - self.region.start[axis],
        };
        self.frame * frame + (0..3).map(|axis| self.voxel[axis] * along(axis)).sum::<usize>()
    }

    /// The signed step from a voxel to the next along x.
    pub(super) fn along_x(&self) -> isize {
        let step = self.voxel[0] as isize;
        if self.descending[0] { -step } else { step }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::description::{ArrayAxis, Dimension};

    #[test]
    fn absent_axes_are_the_slowest() {
        let axis = |role, reversed| ArrayAxis { dimension: 0, role, reversed };
        let dimensions = vec![Dimension { name: "x".into(), length: 1, unlimited: false }];
        let axes = vec![axis(AxisRole::X, true), axis(AxisRole::Single, false), axis(AxisRole::Frames, false)];
        let order = SampleOrder::of_source(&Description { dimensions, axes, ..Description::default() });
        let [z, y] = [2, 1].map(|axis| OutputAxis::Voxels(axis, Direction::Ascending));
        assert_eq!(order.axes(), [z, y, OutputAxis::Voxels(0, Direction::Descending), OutputAxis::Frames]);
        assert_eq!(SampleOrder::of_source(&Description::default()), SampleOrder::default());
        let strides = order.strides(4, &Region { start: [1, 2, 3], end: [4, 4, 5] });
        assert_eq!((strides.place(3, [3, 2, 3]), strides.place(0, [1, 3, 4])), (3, 4 * 2 + 12 + 24));
        assert_eq!((strides.frame, strides.along_x()), (1, -4));
    }
}
