//! The nonzero values of a block, voxel by voxel, as the footprint backend needs them.

use crate::render::batches::{BlockPlanes, Scratch};
use wavesplat_core::base::error::Result;

/// The values of a block: for each voxel in array order, a list of (plane, value).
#[derive(Debug)]
pub(in crate::render) struct SparseTerms {
    /// The end of each voxel's list.
    ends: Vec<u32>,
    planes: Vec<u16>,
    values: Vec<f64>,
}

impl SparseTerms {
    /// An upper bound of the bytes of a voxel with `planes` planes: in the growing vector of found values, and in the
    /// final lists.
    pub(in crate::render) const fn most_bytes(planes: usize) -> usize {
        planes * (2 * size_of::<(u32, u16, f64)>() + 2 + 8) + 2 * size_of::<u32>()
    }

    /// Collects the values of a block in `planes` planes.
    pub(in crate::render) fn from_block(block: &dyn BlockPlanes, planes: usize) -> Result<Self> {
        let (mut found, mut scratch) = (Vec::new(), Scratch::default());
        let mut ends = vec![0_u32; block.voxels() + 1];
        for plane in 0..planes {
            block.plane(plane, &mut scratch)?.for_each(|voxel, value| {
                found.push((voxel as u32, plane as u16, value));
                ends[voxel + 1] += 1;
            });
        }
        for voxel in 1..ends.len() {
            ends[voxel] += ends[voxel - 1];
        }
        let mut terms = Self { planes: vec![0; found.len()], values: vec![0.0; found.len()], ends };
        found.into_iter().for_each(|(voxel, plane, value)| terms.put(voxel as usize, plane, value));
        terms.ends.pop();
        Ok(terms)
    }

    /// Appends a value to the list of its voxel. Until all values are stored, `ends` holds the position of each voxel's
    /// next value.
    fn put(&mut self, voxel: usize, plane: u16, value: f64) {
        let at = &mut self.ends[voxel];
        (self.planes[*at as usize], self.values[*at as usize]) = (plane, value);
        *at += 1;
    }

    /// The planes and values of a voxel.
    pub(in crate::render) fn of_voxel(&self, voxel: usize) -> (&[u16], &[f64]) {
        let start = if voxel == 0 { 0 } else { self.ends[voxel - 1] as usize };
        let range = start..self.ends[voxel] as usize;
        (&self.planes[range.clone()], &self.values[range])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::batches::PlaneValues;

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
        let terms = SparseTerms::from_block(&Three, 3).expect("no block fails here");
        assert_eq!(terms.of_voxel(0), (&[][..], &[][..]));
        assert_eq!(terms.of_voxel(1), (&[0][..], &[1.5][..]));
        assert_eq!(terms.of_voxel(2), (&[0, 2][..], &[2.0, -1.0][..]));
    }
}
