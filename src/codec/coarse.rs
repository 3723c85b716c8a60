//! Decodes a block on a coarse lattice: single samples for a first impression, from few of its bytes.
//!
//! The lattice takes every n-th voxel along each axis, from the block's first on. A pyramid adds coarse nodes first, and
//! predicts them from coarser ones alone (eq 32). So its first level parts give the nodes of a lattice exactly, and the
//! rest need not be read. Blocks without a pyramid are decoded whole, and then thinned.

use super::WindowCodec;
use super::buffer::{Buffer, Pooled};
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
        let ranges = codec.part_ranges(self.size);
        let parts = &ranges[..[4, 2, 1][self.level as usize]];
        let mut codes = Buffer::of(parts.last().map_or(0, |last| last.end));
        for (part, range) in (0..).zip(parts) {
            reader.codes(entry, part, &mut codes[range.clone()])?;
        }
        Ok(match pyramid.single {
            true => self.values_of_codes::<f32>(codec, pyramid, (entry.stats.step, &codes)),
            false => self.values_of_codes::<f64>(codec, pyramid, (entry.stats.step, &codes)),
        })
    }

    fn values_of_codes<R: Real + Pooled>(
        &self,
        codec: &WindowCodec,
        pyramid: &Pyramid,
        (step, codes): (f64, &[i32]),
    ) -> Vec<f64> {
        let level = self.level;
        let passes = PredictionPasses::down_to(pyramid, codec.shape(self.size), level);
        let [x, y, z, ks] = passes.nodes();
        let mut field = Buffer::<R>::of(x * y * z * ks);
        let marked = passes.decode(step, codes, &mut field);
        let level_along = |axis: Axis| if pyramid.order.contains(&axis) { level } else { 0 };
        let places = self.places([x, y, z], [Axis::X, Axis::Y, Axis::Z].map(level_along));
        let nodes = |k: usize| {
            let of_k = &field[k * (x * y * z)..][..x * y * z];
            places.iter().map(|at| of_k[*at].to_f64()).collect()
        };
        self.invert(codec, places.len(), |k| {
            let k = k >> level_along(Axis::T);
            marked[k].then(|| nodes(k))
        })
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

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_format::Stencil;

    /// The next of some scattered numbers below `end`.
    fn below(end: usize, state: &mut u64) -> usize {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (*state >> 33) as usize % end
    }

    fn some_pyramid(state: &mut u64) -> Pyramid {
        let mut left = vec![Axis::X, Axis::Y, Axis::Z, Axis::T];
        let order = (0..below(5, state)).map(|_| left.swap_remove(below(left.len(), state))).collect();
        let stencil = [Stencil::Linear, Stencil::Cubic][below(2, state)];
        Pyramid { order, stencil, growth: 1.5, most: [1.0, 2.0, 9.0][below(3, state)], single: false }
    }

    #[test]
    fn the_nodes_of_a_level_are_those_of_all_passes() {
        let state = &mut 7;
        let mut compared = 0;
        for case in 0..2000 {
            let pyramid = some_pyramid(state);
            let shape: [usize; 4] = std::array::from_fn(|_| 1 + below([17, 4][case % 2], state));
            let codes: Vec<i32> = (0..shape.iter().product()).map(|_| below(9, state) as i32 - 4).collect();
            let mut whole = vec![0.0; codes.len()];
            PredictionPasses::new(&pyramid, shape).decode(0.3, &codes, &mut whole);
            for level in 0..=COARSEST {
                let passes = PredictionPasses::down_to(&pyramid, shape, level);
                let [x, y, z, _] = passes.nodes();
                let mut coarse = vec![0.0_f64; passes.nodes().iter().product()];
                passes.decode(0.3, &codes[..coarse.len()], &mut coarse);
                let apart = [Axis::X, Axis::Y, Axis::Z, Axis::T]
                    .map(|a| usize::from(pyramid.order.contains(&a)) * level as usize);
                for (i, found) in coarse.iter().enumerate() {
                    let node = [i % x, i / x % y, i / (x * y) % z, i / (x * y * z)];
                    let at: [usize; 4] = std::array::from_fn(|a| node[a] << apart[a]);
                    let expected: f64 = whole[at[0] + shape[0] * (at[1] + shape[1] * (at[2] + shape[2] * at[3]))];
                    assert_eq!(found.to_bits(), expected.to_bits(), "{pyramid:?} {shape:?} {level} {at:?}");
                    compared += 1;
                }
            }
        }
        assert!(compared > 1_000_000, "{compared}");
    }
    #[test]
    fn some_ks_have_the_nodes_of_all_passes() {
        let state = &mut 11;
        let (mut compared, mut left_out) = (0, 0);
        for case in 0..2000 {
            let pyramid = some_pyramid(state);
            let [x, y, z] = std::array::from_fn(|_| 1 + below([9, 4][case % 2], state));
            let shape = [x, y, z, 1 + below(33, state)];
            let codes: Vec<i32> = (0..shape.iter().product()).map(|_| below(9, state) as i32 - 4).collect();
            let passes = PredictionPasses::new(&pyramid, shape);
            let wanted: Vec<bool> = (0..shape[3]).map(|_| below(8, state) == 0).collect();
            let (mut whole, mut some) = (vec![0.0_f64; codes.len()], vec![f64::NAN; codes.len()]);
            assert_eq!(passes.decode(0.3, &codes, &mut whole), passes.decode_some(&wanted, 0.3, &codes, &mut some));
            let of_k = |nodes: &[f64], k: usize| nodes[k * x * y * z..][..x * y * z].to_vec();
            for k in 0..shape[3] {
                let (found, expected) = (of_k(&some, k), of_k(&whole, k));
                assert!(!wanted[k] || found == expected, "{pyramid:?} {shape:?} {wanted:?} {k}");
                assert!(found.iter().all(|v| v.is_finite()));
                compared += usize::from(wanted[k]);
                left_out += usize::from(found != expected);
            }
        }
        assert!(compared > 2000 && left_out > 2000, "{compared} {left_out}");
    }
}
