//! What a block adds to a picture: for each voxel some amounts in planes, and how the planes are used.

pub(super) use super::splat::Order;
use crate::sample::{self, SampleType};

/// The planes of a group, one after another: coefficients, then values of single frames, then weights of what is
/// missing in single frames and of what is missing in all of them, and last errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Planes of coefficients.
    pub coefficients: usize,
    /// Frames of the group.
    pub frames: usize,
    /// Whether values are splatted into single frames.
    pub values: bool,
    /// Whether anything is missing.
    pub absent: bool,
    /// Planes of errors; none unless pictures are certified.
    pub error_planes: usize,
    /// How tiles should keep the planes.
    pub order: Order,
}

impl Layout {
    /// The plane of the values of a frame.
    pub fn value(&self, frame: usize) -> usize {
        self.coefficients + frame
    }

    /// Number of planes whose sums are values.
    pub fn value_planes(&self) -> usize {
        self.coefficients + if self.values { self.frames } else { 0 }
    }

    /// The plane of the weights that are missing in a frame.
    pub fn absent(&self, frame: usize) -> usize {
        self.value_planes() + frame
    }

    /// Whose samples a plane holds: the frame, and whether those are weights that are missing.
    pub(super) fn samples(&self, plane: usize) -> Option<(usize, bool)> {
        let of = |first: usize, there: bool| plane.checked_sub(first).filter(|f| there && *f < self.frames);
        let absent = || of(self.absent(0), self.absent).map(|f| (f, true));
        of(self.value(0), self.values).map(|f| (f, false)).or_else(absent)
    }

    /// The plane of the weights that are missing in all frames.
    pub fn absent_in_all(&self) -> usize {
        self.value_planes() + self.frames
    }

    /// The first plane of errors.
    pub fn first_error(&self) -> usize {
        self.value_planes() + if self.absent { self.frames + 1 } else { 0 }
    }

    /// Number of planes.
    pub fn planes(&self) -> usize {
        self.first_error() + self.error_planes
    }
}

/// What a block adds to the planes: for each voxel in array order, some (plane, amount).
#[derive(Debug, Default)]
pub struct Terms {
    ends: Vec<u32>,
    planes: Vec<u16>,
    amounts: Vec<f64>,
    /// Nonzero coefficients among them.
    pub coefficients: u64,
    /// Stored bytes that were read for them.
    pub bytes_read: u64,
}

impl Terms {
    /// Without a voxel yet.
    pub fn new(bytes_read: u64) -> Self {
        Self { bytes_read, ..Self::default() }
    }

    /// One term of 1 in plane 0 for every voxel: what the weights are made of.
    pub fn ones(voxels: usize) -> Self {
        let mut terms = Self::default();
        for _ in 0..voxels {
            terms.add(0, 1.0);
            terms.end_voxel();
        }
        terms
    }

    /// Adds a term to the current voxel.
    pub fn add(&mut self, plane: usize, amount: f64) {
        self.planes.push(plane as u16);
        self.amounts.push(amount);
    }

    /// Adds errors of the current voxel, one for each error plane.
    pub(super) fn add_errors(&mut self, layout: &Layout, errors: &[f64]) {
        let planes = layout.first_error()..layout.planes();
        planes.zip(errors).filter(|(_, e)| **e > 0.0).for_each(|(plane, e)| self.add(plane, *e));
    }

    /// Goes on to the next voxel.
    pub fn end_voxel(&mut self) {
        self.ends.push(self.planes.len() as u32);
    }

    /// The planes and amounts of a voxel.
    pub fn of_voxel(&self, voxel: usize) -> (&[u16], &[f64]) {
        let start = if voxel == 0 { 0 } else { self.ends[voxel - 1] as usize };
        let range = start..self.ends[voxel] as usize;
        (&self.planes[range.clone()], &self.amounts[range])
    }

    /// Weights that are missing: in all frames of the window, or in those of the group that `absent` names.
    pub(super) fn add_absent(&mut self, layout: &Layout, in_all: bool, absent: impl Fn(usize) -> bool) {
        if in_all {
            self.add(layout.absent_in_all(), 1.0);
        } else {
            (0..layout.frames).filter(|f| absent(*f)).for_each(|f| self.add(layout.absent(f), 1.0));
        }
    }

    /// The terms of samples that are splatted frame by frame, each off by `errors`: `samples` holds `layout.frames`
    /// frames of as many voxels.
    pub fn of_samples(
        layout: &Layout,
        ty: SampleType,
        samples: &[u8],
        errors: &[f64],
        is_missing: impl Fn(usize, f64) -> bool,
    ) -> Self {
        let mut values = vec![0.0; samples.len() / ty.size()];
        sample::load(ty, samples, &mut values);
        let voxels = values.len() / layout.frames;
        let mut terms = Self::default();
        for voxel in 0..voxels {
            let missing = |f: usize| is_missing(f * voxels + voxel, values[f * voxels + voxel]);
            for f in (0..layout.frames).filter(|f| !missing(*f) && values[f * voxels + voxel] != 0.0) {
                terms.add(layout.value(f), values[f * voxels + voxel]);
            }
            if layout.absent {
                terms.add_absent(layout, false, missing);
            }
            terms.add_errors(layout, errors);
            terms.end_voxel();
        }
        terms
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_follow_one_another() {
        let layout =
            Layout { coefficients: 5, frames: 3, values: true, absent: true, error_planes: 2, order: Order::Planes };
        assert_eq!((layout.value(0), layout.absent(0), layout.absent_in_all()), (5, 8, 11));
        assert_eq!((layout.first_error(), layout.planes()), (12, 14));
        let plain = Layout { values: false, absent: false, error_planes: 0, ..layout };
        assert_eq!(plain.planes(), 5);
    }

    #[test]
    fn missing_samples_take_weights_instead_of_values() {
        let layout =
            Layout { coefficients: 0, frames: 2, values: true, absent: true, error_planes: 0, order: Order::Planes };
        let samples: Vec<u8> = [f32::NAN, 1.0, 3.0, 2.0].iter().flat_map(|v| v.to_le_bytes()).collect();
        let terms = Terms::of_samples(&layout, SampleType::F32, &samples, &[], |_, v| v.is_nan());
        assert_eq!(terms.of_voxel(0), (&[1u16, 2][..], &[3.0, 1.0][..]));
        assert_eq!(terms.of_voxel(1), (&[0u16, 1][..], &[1.0, 2.0][..]));
    }
}
