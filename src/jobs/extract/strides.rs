//! Where samples go in an extracted array.

use super::{Direction, OutputAxis, SampleOrder};
use wavesplat_core::base::grid::Region;

/// Steps, in samples, between neighbours in an extracted array.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Strides {
    pub frame: usize,
    pub voxel: [usize; 3],
    descending: [bool; 3],
    region: Region,
}

impl Strides {
    /// Steps in an array of these frames and voxels.
    pub(super) fn new(order: &SampleOrder, frames: usize, region: &Region) -> Self {
        let mut strides = Self { frame: 0, voxel: [0; 3], descending: [false; 3], region: *region };
        let mut step = 1;
        for axis in order.axes().into_iter().rev() {
            match axis {
                OutputAxis::Frames => strides.frame = step,
                OutputAxis::Voxels(axis, direction) => {
                    strides.voxel[axis] = step;
                    strides.descending[axis] = direction == Direction::Descending;
                }
            }
            step *= length(axis, frames, region);
        }
        strides
    }

    /// The place of a sample.
    pub(super) fn place(&self, frame: usize, voxel: [usize; 3]) -> usize {
        let along = |axis: usize| match self.descending[axis] {
            true => self.region.end[axis] - 1 - voxel[axis],
            false => voxel[axis] - self.region.start[axis],
        };
        self.frame * frame + (0..3).map(|axis| self.voxel[axis] * along(axis)).sum::<usize>()
    }

    /// The signed step from a voxel to the next along an axis.
    pub(super) fn along(&self, axis: usize) -> isize {
        let step = self.voxel[axis] as isize;
        if self.descending[axis] { -step } else { step }
    }
}

/// The length of an axis in an array of these frames and voxels.
pub(super) fn length(axis: OutputAxis, frames: usize, region: &Region) -> usize {
    axis.voxels().map_or(frames, |axis| region.dims()[axis])
}

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_core::base::description::{ArrayAxis, AxisRole, Description, Dimension};

    #[test]
    fn places_follow_the_order_of_the_axes() {
        let axis = |role, reversed| ArrayAxis { dimension: 0, role, reversed };
        let dimensions = vec![Dimension { name: "x".into(), length: 1, unlimited: false }];
        let axes = vec![axis(AxisRole::X, true), axis(AxisRole::Single, false), axis(AxisRole::Frames, false)];
        let order = SampleOrder::of_source(&Description { dimensions, axes, ..Description::default() });
        let strides = Strides::new(&order, 4, &Region { start: [1, 2, 3], end: [4, 4, 5] });
        assert_eq!((strides.place(3, [3, 2, 3]), strides.place(0, [1, 3, 4])), (3, 4 * 2 + 12 + 24));
        assert_eq!((strides.frame, strides.along(0)), (1, -4));
    }
}
