//! The samples of a part of a block, decoded from its coefficients without those of the other voxels.

use super::WindowCodec;
use super::decode::Block;
use super::field::{Field, RUN};
use crate::base::grid::Region;
use crate::wavelet::LANES;
use std::ops::Range;
use wavesplat_format::{BlockEntry, PartKind};

/// Whether [`Block::samples_of_part`] can decode the samples of a block: a pyramid gives its coefficients, and no sample is missing or
/// stored exactly.
pub fn is_divisible(codec: &WindowCodec, entry: &BlockEntry) -> bool {
    let is_coded = |kind: PartKind| matches!(kind, PartKind::Level(_) | PartKind::Outliers | PartKind::Sums);
    codec.scheme.pyramid.is_some() && !entry.lost && entry.parts.iter().all(|part| is_coded(part.kind))
}

/// The voxels that are decoded for a part: rows in whole groups.
pub fn decoded_together(part: &Region) -> usize {
    let [x, y, z] = part.dims();
    x.next_multiple_of(LANES) * y * z
}

impl Block {
    /// The samples of some frames in a part of the block, in their own type, little-endian: frame after frame, x fastest. `field` are
    /// the block's coefficients. The block is [divisible](is_divisible); `frames` ascend.
    pub fn samples_of_part(&self, codec: &WindowCodec, field: &Field<'_>, frames: &[usize], part: &Region) -> Vec<u8> {
        let size = codec.sample.size();
        let mut out = vec![0; frames.len() * part.voxels() * size];
        self.for_each_run_in(codec, field, frames, rows(part, self.size), |at, values| {
            if let Some(to) = self.place(at, frames, part) {
                self.store(codec, at, values, &mut out[to * size..(to + values.len()) * size]);
            }
        });
        for (at, bytes) in self.outliers.positions.iter().zip(self.outliers.samples.chunks_exact(size)) {
            if let Some(to) = self.place(*at as usize, frames, part) {
                out[to * size..(to + 1) * size].copy_from_slice(bytes);
            }
        }
        out
    }

    /// The place of a sample, `frame * voxels + voxel` in the block, among those of some frames in a part.
    fn place(&self, sample: usize, frames: &[usize], part: &Region) -> Option<usize> {
        let (frame, voxel, [nx, ny, _]) = (sample / self.voxels, sample % self.voxels, self.size);
        let frame = frames.binary_search(&frame).ok()?;
        let voxel = [voxel % nx, voxel / nx % ny, voxel / (nx * ny)];
        let is_inside = (0..3).all(|a| (part.start[a]..part.end[a]).contains(&voxel[a]));
        is_inside.then(|| frame * part.voxels() + part.index(voxel))
    }
}

/// The rows of a part of a block of so many voxels along x, y, z, in runs of voxels that are decoded together.
fn rows(part: &Region, [nx, ny, _]: [usize; 3]) -> impl Iterator<Item = Range<usize>> + Clone + use<> {
    let Region { start: [x, y, z], end: [end_x, end_y, end_z] } = *part;
    let firsts = (z..end_z).flat_map(move |z| (y..end_y).map(move |y| nx * (y + ny * z)));
    firsts.flat_map(move |row| (x..end_x).step_by(RUN).map(move |x| row + x..row + end_x.min(x + RUN)))
}
