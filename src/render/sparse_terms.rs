//! What a block adds to a picture: for each voxel some amounts in planes, and how the planes are used.

use super::plane_values::{BlockPlanes, Scratch};
pub(super) use super::splat::Order;
use crate::base::error::Result;

/// The planes of a group, one after another: coefficients, then values of single frames, then weights of what is
/// missing in single frames and of what is missing in all of them, then errors, and last lengths.
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
    /// Whether the last plane is of the weights of all voxels: lengths of the rays.
    pub lengths: bool,
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
        self.first_error() + self.error_planes + usize::from(self.lengths)
    }
}

/// What a block adds to the planes: for each voxel in array order, some (plane, amount).
#[derive(Debug)]
pub(super) struct SparseTerms {
    /// Where those of each voxel end.
    ends: Vec<u32>,
    planes: Vec<u16>,
    amounts: Vec<f64>,
}

impl SparseTerms {
    /// What those of a voxel take in so many planes, at most: as they are found, in a vector that grows, and in place.
    pub(super) const fn most_bytes(planes: usize) -> usize {
        planes * (2 * size_of::<(u32, u16, f64)>() + 2 + 8) + 2 * size_of::<u32>()
    }

    /// What a block has in so many planes.
    pub(super) fn of(block: &dyn BlockPlanes, planes: usize) -> Result<Self> {
        let (mut found, mut room) = (Vec::new(), Scratch::default());
        let mut ends = vec![0_u32; block.voxels() + 1];
        for plane in 0..planes {
            block.plane(plane, &mut room)?.for_each(|voxel, amount| {
                found.push((voxel as u32, plane as u16, amount));
                ends[voxel + 1] += 1;
            });
        }
        for voxel in 1..ends.len() {
            ends[voxel] += ends[voxel - 1];
        }
        let mut terms = Self { planes: vec![0; found.len()], amounts: vec![0.0; found.len()], ends };
        found.into_iter().for_each(|(voxel, plane, amount)| terms.put(voxel as usize, plane, amount));
        terms.ends.pop();
        Ok(terms)
    }

    /// Puts a term behind those of its voxel; until all are there, a voxel ends where its next term comes.
    fn put(&mut self, voxel: usize, plane: u16, amount: f64) {
        let at = &mut self.ends[voxel];
        (self.planes[*at as usize], self.amounts[*at as usize]) = (plane, amount);
        *at += 1;
    }

    /// The planes and amounts of a voxel.
    pub(super) fn of_voxel(&self, voxel: usize) -> (&[u16], &[f64]) {
        let start = if voxel == 0 { 0 } else { self.ends[voxel - 1] as usize };
        let range = start..self.ends[voxel] as usize;
        (&self.planes[range.clone()], &self.amounts[range])
    }
}

#[cfg(test)]
mod tests {
    use super::super::plane_values::PlaneValues;
    use super::*;

    #[test]
    fn planes_follow_one_another() {
        let layout = Layout {
            coefficients: 5,
            frames: 3,
            values: true,
            absent: true,
            error_planes: 2,
            lengths: false,
            order: Order::Planes,
        };
        assert_eq!((layout.value(0), layout.absent(0), layout.absent_in_all()), (5, 8, 11));
        assert_eq!((layout.first_error(), layout.planes()), (12, 14));
        let plain = Layout { values: false, absent: false, error_planes: 0, ..layout };
        assert_eq!(plain.planes(), 5);
    }

    #[test]
    fn every_voxel_has_the_terms_of_all_planes() {
        struct Three;
        impl BlockPlanes for Three {
            fn voxels(&self) -> usize {
                3
            }
            fn plane<'a>(&'a self, plane: usize, _: &'a mut Scratch) -> Result<PlaneValues<'a>> {
                Ok([PlaneValues::Single(&[0.0, 1.5, 2.0]), PlaneValues::Nothing, PlaneValues::Few(&[(2, -1.0)])][plane])
            }
            fn held(&self) -> [u64; 2] {
                [0; 2]
            }
        }
        let terms = SparseTerms::of(&Three, 3).expect("no block fails here");
        assert_eq!(terms.of_voxel(0), (&[][..], &[][..]));
        assert_eq!(terms.of_voxel(1), (&[0][..], &[1.5][..]));
        assert_eq!(terms.of_voxel(2), (&[0, 2][..], &[2.0, -1.0][..]));
    }
}
