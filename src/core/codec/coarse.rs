//! Single samples of a block for a first impression, from few of its bytes.
//!
//! A level of detail skips the level parts that every n-th voxel does not need (eq 32). Larger strides skip some of the
//! voxels that the coarsest level of detail decodes. Blocks without a pyramid are decoded whole.

use super::WindowCodec;
use super::decode::{Block, WantedFrames};
use crate::base::sample;
use wavesplat_format::BlockEntry;

/// The coarsest level of detail that saves bytes within the last tier. Its nodes are exactly those of the first level part.
const COARSEST: u32 = 2;

/// The level of detail at which to decode every `stride`-th voxel, a power of two. Each tier above leaves one level out.
pub fn level_of(codec: &WindowCodec, stride: usize) -> u32 {
    stride.trailing_zeros().min(u32::from(codec.tiers()) + COARSEST)
}

/// Every `stride`-th voxel along each axis of a block of `size` voxels, in some frames of the window: frame after frame, x
/// fastest; NaN where a sample is missing, or where the block is lost. The codec must have the level of detail of
/// [`level_of`], or a finer one. `read` reads the block with the
/// coefficients that its argument marks.
pub fn thinned<E>(
    codec: &WindowCodec,
    entry: &BlockEntry,
    size: [usize; 3],
    stride: usize,
    frames: &[usize],
    read: impl FnOnce(&[bool]) -> Result<Block, E>,
) -> Result<Vec<f32>, E> {
    let [x, y, z] = codec.decoded_size(size);
    let step = stride >> codec.lod;
    let along = |n: usize| (0..n).step_by(step);
    let taken: Vec<usize> =
        along(z).flat_map(|k| along(y).flat_map(move |j| along(x).map(move |i| i + x * (j + y * k)))).collect();
    if entry.lost {
        return Ok(vec![f32::NAN; frames.len() * taken.len()]);
    }
    let wanted = WantedFrames::new(codec, frames.to_vec());
    let block = read(&wanted.coefficients)?;
    let (bytes, each) = (block.samples_of(codec, &wanted), codec.sample.size());
    let mut values = vec![0.0; block.voxels];
    let mut samples = Vec::with_capacity(frames.len() * taken.len());
    for frame in frames {
        sample::load(codec.sample, &bytes[frame * block.voxels * each..][..block.voxels * each], &mut values);
        let first = frame * block.voxels;
        let is_missing = |at: usize| block.is_missing(first + at) || codec.is_missing(values[at]);
        samples.extend(taken.iter().map(|at| if is_missing(*at) { f32::NAN } else { values[*at] as f32 }));
    }
    Ok(samples)
}
