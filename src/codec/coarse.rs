//! Decodes a block on a coarse lattice: single samples for a first impression, from few of its bytes.
//!
//! The lattice takes every n-th voxel along each axis, from the block's first on. A pyramid adds coarse nodes first, and
//! predicts them from coarser ones alone (eq 32). So its first level parts give the nodes of a lattice exactly, and the
//! rest need not be read. Blocks without a pyramid are decoded whole, and then thinned.

use super::WindowCodec;
use super::buffer::Buffer;
use super::decode::Block;
use super::pyramid::PredictionPasses;
use super::real::Real;
use crate::base::sample;
use crate::wavelet;
use std::collections::HashMap;
use wavesplat_format::{Axis, BlockEntry, Pyramid, Reader, Result, Storage};

/// The level whose nodes are all in the first level part. Coarser lattices leave out nodes of it.
const COARSEST: u32 = 2;

/// The samples to decode of a block.
#[derive(Debug, Clone)]
pub(crate) struct Lattice {
    /// The number of voxels of the block along x, y, z.
    size: [usize; 3],
    /// Distance of voxels along each axis: a power of two.
    stride: usize,
    /// Frame numbers, counted from the first frame of the window.
    frames: Vec<usize>,
    /// The level of a pyramid that has all its nodes.
    level: u32,
}

impl Lattice {
    /// Every `stride`-th voxel, a power of two, along each axis of a block of `size` voxels, in some frames of the
    /// window, ascending. Where a pyramid refines time, frames between its coarse nodes are replaced by the last one
    /// before; level 1 is taken if two frames fall on the same node.
    pub(crate) fn new(codec: &WindowCodec, size: [usize; 3], (stride, frames): (usize, &[usize])) -> Self {
        let level = stride.trailing_zeros().min(COARSEST);
        let refines_time = codec.scheme.pyramid.as_ref().is_some_and(|p| p.order.contains(&Axis::T));
        let apart = |level: u32| frames.windows(2).all(|pair| pair[0] >> level != pair[1] >> level);
        let level = if refines_time && !apart(level) { level.min(1) } else { level };
        let on_node = |frame: &usize| if refines_time { frame >> level << level } else { *frame };
        Self { size, stride, frames: frames.iter().map(on_node).collect(), level }
    }

    fn voxels(&self) -> usize {
        self.size.iter().product()
    }

    /// The index of every voxel of the lattice in an array of `shape` whose nodes are `1 << levels[axis]` voxels apart.
    fn places(&self, shape: [usize; 3], levels: [u32; 3]) -> Vec<usize> {
        let along = |a: usize| (0..self.size[a]).step_by(self.stride).map(move |i| i >> levels[a]);
        let rows = along(2).flat_map(|z| along(1).map(move |y| (z * shape[1] + y) * shape[0]));
        rows.flat_map(|row| along(0).map(move |x| row + x)).collect()
    }

    /// Decodes the samples of a block: frame after frame, x fastest; NaN where one is missing, or where the block is
    /// lost.
    pub(crate) fn decode<S: Storage>(
        &self,
        reader: &Reader<S>,
        codec: &WindowCodec,
        entry: &BlockEntry,
    ) -> Result<Vec<f32>> {
        let places = self.places(self.size, [0; 3]);
        if entry.lost {
            return Ok(vec![f32::NAN; self.frames.len() * places.len()]);
        }
        let values = match &codec.scheme.pyramid {
            Some(pyramid) => self.values_of_parts(reader, codec, (pyramid, entry))?,
            None => self.values_of_block(reader, codec, (&places, entry))?,
        };
        let mut samples: Vec<f32> = values.into_iter().map(|v| v as f32).collect();
        self.put_stored(reader, codec, (&places, entry), &mut samples)?;
        Ok(samples)
    }

    /// From all coefficients that the frames need.
    fn values_of_block<S: Storage>(
        &self,
        reader: &Reader<S>,
        codec: &WindowCodec,
        (places, entry): (&[usize], &BlockEntry),
    ) -> Result<Vec<f64>> {
        let wanted = wavelet::needed(&codec.synthesis, &self.frames);
        let block = Block::read(reader, codec, entry, self.size, &wanted)?;
        let field = block.field(codec);
        let nodes = |k: usize| places.iter().map(|at| field.at(k * block.voxels + at)).collect();
        Ok(self.invert(codec, places.len(), |k| wanted[k].then(|| nodes(k))))
    }

    /// From the first level parts of a pyramid.
    fn values_of_parts<S: Storage>(
        &self,
        reader: &Reader<S>,
        codec: &WindowCodec,
        (pyramid, entry): (&Pyramid, &BlockEntry),
    ) -> Result<Vec<f64>> {
        Ok(match pyramid.single {
            true => self.values_of_codes::<f32, S>(reader, codec, (pyramid, entry))?,
            false => self.values_of_codes::<f64, S>(reader, codec, (pyramid, entry))?,
        })
    }

    fn values_of_codes<R: Real, S: Storage>(
        &self,
        reader: &Reader<S>,
        codec: &WindowCodec,
        (pyramid, entry): (&Pyramid, &BlockEntry),
    ) -> Result<Vec<f64>> {
        let level = self.level;
        let passes = PredictionPasses::down_to(pyramid, codec.shape(self.size), level);
        let codes = passes.read(reader, entry, |_| true)?;
        let [x, y, z, ks] = passes.nodes();
        let mut field = Buffer::<R>::of(x * y * z * ks);
        let marked = passes.decode(entry.stats.step, &codes, &mut field);
        let level_along = |axis: Axis| if pyramid.order.contains(&axis) { level } else { 0 };
        let places = self.places([x, y, z], [Axis::X, Axis::Y, Axis::Z].map(level_along));
        let nodes = |k: usize| {
            let of_k = &field[k * (x * y * z)..][..x * y * z];
            places.iter().map(|at| of_k[*at].to_f64()).collect()
        };
        Ok(self.invert(codec, places.len(), |k| {
            let k = k >> level_along(Axis::T);
            marked[k].then(|| nodes(k))
        }))
    }

    /// The frames (eq 7) from the coefficients of each k; `None` stands for zeros.
    fn invert(&self, codec: &WindowCodec, voxels: usize, coefficients: impl Fn(usize) -> Option<Vec<f64>>) -> Vec<f64> {
        let mut values = vec![0.0; self.frames.len() * voxels];
        for (k, of_frames) in codec.synthesis.iter().enumerate() {
            if self.frames.iter().all(|f| of_frames[*f] == 0.0) {
                continue;
            }
            let Some(coefficients) = coefficients(k) else { continue };
            for (frame, values) in self.frames.iter().zip(values.chunks_exact_mut(voxels)) {
                values.iter_mut().zip(&coefficients).for_each(|(v, c)| *v += of_frames[*frame] * c);
            }
        }
        values
    }

    /// Puts exactly stored samples in their places, and NaN where one is missing.
    fn put_stored<S: Storage>(
        &self,
        reader: &Reader<S>,
        codec: &WindowCodec,
        (places, entry): (&[usize], &BlockEntry),
        samples: &mut [f32],
    ) -> Result<()> {
        let (ty, size) = (codec.sample, codec.sample.size());
        let value = |bytes: &[u8]| {
            let mut value = [0.0];
            sample::load(ty, bytes, &mut value);
            if codec.is_missing(value[0]) { f32::NAN } else { value[0] as f32 }
        };
        let (exact, missing, outliers) = (reader.exact(entry)?, reader.missing(entry)?, reader.outliers(entry)?);
        if exact.is_none() && missing.is_none() && outliers.positions.is_empty() {
            return Ok(());
        }
        let stored = outliers.positions.iter().zip(outliers.samples.chunks_exact(size));
        let stored: HashMap<usize, &[u8]> = stored.map(|(at, bytes)| (*at as usize, bytes)).collect();
        let indices = self.frames.iter().flat_map(|f| places.iter().map(move |at| f * self.voxels() + at));
        for (index, out) in indices.zip(samples) {
            if let Some(exact) = &exact {
                *out = value(&exact[index * size..(index + 1) * size]);
            }
            if let Some(bytes) = stored.get(&index) {
                *out = value(bytes);
            }
            if missing.as_ref().is_some_and(|(mask, _)| mask[index]) {
                *out = f32::NAN;
            }
        }
        Ok(())
    }
}
