//! The samples of a block and of the neighbouring voxels that predict them.

use super::WindowCodec;
use super::buffer::Buffer;
use crate::base::sample::{self, SampleType};
use std::ops::Deref;

/// A block, and the voxels whose samples are known.
#[derive(Debug, Clone, Copy)]
pub struct BlockWithGhosts {
    /// Voxels of the block along x, y, z.
    pub size: [usize; 3],
    /// Voxels with samples: the block's own, and possibly one more along each of x, y, z.
    pub known: [usize; 3],
}

/// Samples of a caller, or a copy of some.
pub(super) enum SampleBytes<'a> {
    Lent(&'a [u8]),
    Own(Buffer<u8>),
}

impl Deref for SampleBytes<'_> {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Self::Lent(samples) => samples,
            Self::Own(samples) => samples,
        }
    }
}

impl From<[usize; 3]> for BlockWithGhosts {
    /// A block without the samples around it.
    fn from(size: [usize; 3]) -> Self {
        Self { size, known: size }
    }
}

impl BlockWithGhosts {
    /// The samples of `outer` voxels along x, y, z, at least as many as are known. Beyond the known voxels, the last
    /// two planes are extrapolated linearly. Those of the known voxels may have room behind them, and then stay in place.
    pub(super) fn extended<'a>(
        &self,
        codec: &WindowCodec,
        outer: [usize; 3],
        samples: SampleBytes<'a>,
    ) -> SampleBytes<'a> {
        let (ty, mut known) = (codec.sample, self.known);
        if known == outer {
            return samples;
        }
        let mut extended = match samples {
            SampleBytes::Own(samples) if samples.len() == bytes(codec, outer) => {
                move_apart(ty, codec.frames(), samples, known, outer)
            }
            samples => copied(ty, &samples, known, known, outer),
        };
        for axis in 0..3 {
            if known[axis] < outer[axis] {
                extrapolate(codec, &mut extended, outer, known, axis, known[axis]);
                known[axis] += 1;
            }
        }
        SampleBytes::Own(extended)
    }

    /// The nodes of a block of a tier above 0, from what is known: those in the volume and, along axes that have a node behind it,
    /// the volume's last two planes of voxels. Those are extrapolated as for the blocks below.
    pub(super) fn coarse(&self, codec: &WindowCodec, mut nodes: Buffer<u8>) -> Buffer<u8> {
        if self.known == self.size {
            return nodes;
        }
        let mut known = self.known;
        for axis in 0..3 {
            if known[axis] > self.size[axis] {
                extrapolate(codec, &mut nodes, self.known, known, axis, known[axis] - 2);
                known[axis] -= 1;
            }
        }
        move_together(codec.sample, codec.frames(), &mut nodes, self.known, self.size);
        nodes.shorten(bytes(codec, self.size));
        nodes
    }
}

/// Bytes of so many voxels in all frames.
fn bytes(codec: &WindowCodec, voxels: [usize; 3]) -> usize {
    codec.frames() * voxels.iter().product::<usize>() * codec.sample.size()
}

/// The samples of `size` voxels, frame by frame, from an array of `from` voxels in one of `to` voxels. The others are arbitrary.
pub(super) fn copied(ty: SampleType, samples: &[u8], size: [usize; 3], from: [usize; 3], to: [usize; 3]) -> Buffer<u8> {
    let each = ty.size();
    let frames = samples.len() / (each * from.iter().product::<usize>());
    let mut out = Buffer::with_len(frames * to.iter().product::<usize>() * each);
    for at in rows(frames, size) {
        let samples = &samples[each * first(from, at)..][..size[0] * each];
        out[each * first(to, at)..][..samples.len()].copy_from_slice(samples);
    }
    out
}

/// Moves the samples of `from` voxels to their places in an array of `to` voxels. The others are arbitrary.
fn move_apart(ty: SampleType, frames: usize, mut samples: Buffer<u8>, from: [usize; 3], to: [usize; 3]) -> Buffer<u8> {
    let each = ty.size();
    for at in rows(frames, from).rev() {
        let start = each * first(from, at);
        samples.copy_within(start..start + from[0] * each, each * first(to, at)); // rows before it lie before its new place
    }
    samples
}

/// Moves the samples of `to` voxels in an array of `from` voxels together.
fn move_together(ty: SampleType, frames: usize, samples: &mut [u8], from: [usize; 3], to: [usize; 3]) {
    let each = ty.size();
    for at in rows(frames, to) {
        let start = each * first(from, at);
        samples.copy_within(start..start + to[0] * each, each * first(to, at)); // rows after it lie behind its new place
    }
}

/// Extrapolates a plane of samples across an axis: twice the last of the known planes minus the one before it. Where one of the
/// two samples is missing, it repeats the last. Writes the result as plane `to`. `samples` are an array of `size` voxels for each frame.
fn extrapolate(codec: &WindowCodec, samples: &mut [u8], size: [usize; 3], known: [usize; 3], axis: usize, to: usize) {
    let (ty, each) = (codec.sample, codec.sample.size());
    let pitch = [1, size[0], size[0] * size[1]];
    let (run, [inner, outer]) = match axis {
        0 => (1, [1, 2]),
        1 => (known[0], [0, 2]),
        _ => (known[0], [0, 1]),
    };
    let of_row = |row: usize| (0..known[inner]).step_by(run).map(move |n| n * pitch[inner] + row * pitch[outer]);
    let runs: Vec<usize> = (0..known[outer]).flat_map(of_row).collect();
    let plane = |n: usize| runs.iter().map(move |first| each * (first + n * pitch[axis]));
    let mut bytes = vec![0; runs.len() * run * each];
    let [mut last, mut before] = [0; 2].map(|_| vec![0.0; runs.len() * run]);
    for frame in samples.chunks_exact_mut(each * size.iter().product::<usize>()) {
        for (values, n) in [(&mut last, known[axis] - 1), (&mut before, known[axis].saturating_sub(2))] {
            let copies = bytes.chunks_exact_mut(run * each).zip(plane(n));
            copies.for_each(|(bytes, at)| bytes.copy_from_slice(&frame[at..][..run * each]));
            sample::load(ty, &bytes, values);
        }
        for (last, before) in last.iter_mut().zip(&before) {
            if !codec.is_missing(*last) && !codec.is_missing(*before) {
                *last = 2.0 * *last - before;
            }
        }
        sample::store(ty, &last, &mut bytes);
        let copies = bytes.chunks_exact(run * each).zip(plane(to));
        copies.for_each(|(bytes, at)| frame[at..][..run * each].copy_from_slice(bytes));
    }
}

/// A row of a frame.
#[derive(Clone, Copy)]
struct RowOfFrame {
    frame: usize,
    z: usize,
    y: usize,
}

/// The rows of `frames` frames of `size` voxels, in order.
fn rows(frames: usize, [_, y, z]: [usize; 3]) -> impl DoubleEndedIterator<Item = RowOfFrame> {
    (0..frames).flat_map(move |frame| (0..z).flat_map(move |z| (0..y).map(move |y| RowOfFrame { frame, z, y })))
}

/// The number of a row's first sample in an array of so many voxels.
fn first([x, y, z]: [usize; 3], row: RowOfFrame) -> usize {
    x * (row.y + y * (row.z + z * row.frame))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::codec::bound::{Bound, ErrorBound};
    use crate::codec::scheme::{Basis, Scheme};

    const FRAMES: usize = 3;

    fn codec() -> WindowCodec {
        let bound = ErrorBound::new(Bound::Pointwise, 0.1, 0.1);
        WindowCodec::new(Scheme::along_time(Basis::Samples), FRAMES, SampleType::F32, bound, 8)
    }

    fn samples(voxels: [usize; 3]) -> Vec<u8> {
        let values: Vec<f64> =
            (0..FRAMES * voxels.iter().product::<usize>()).map(|i| (i * 7919 % 1009) as f64).collect();
        let mut bytes = vec![0; 4 * values.len()];
        sample::store(SampleType::F32, &values, &mut bytes);
        bytes
    }

    #[test]
    fn blocks_extended_in_place_are_those_of_a_copy() {
        let (codec, size) = (codec(), [8, 6, 4]);
        let outer = size.map(|n| n + 1);
        for case in 0..8 {
            let known = std::array::from_fn(|axis| size[axis] + (case >> axis & 1));
            let (of, samples) = (BlockWithGhosts { size, known }, samples(known));
            let mut with_room = Buffer::with_len(bytes(&codec, outer));
            with_room[..samples.len()].copy_from_slice(&samples);
            let extended = of.extended(&codec, outer, SampleBytes::Own(with_room));
            assert_eq!(extended[..], of.extended(&codec, outer, SampleBytes::Lent(&samples))[..]);
            assert_eq!(copied(codec.sample, &extended, known, outer, known)[..], samples[..]);
        }
    }

    #[test]
    fn nodes_moved_together_are_those_of_a_copy() {
        let (codec, known, size) = (codec(), [7, 6, 5], [6, 6, 4]);
        let samples = samples(known);
        let nodes = BlockWithGhosts { size, known }.coarse(&codec, samples[..].into());
        assert_eq!(nodes.len(), bytes(&codec, size));
        let mut expected = Buffer::from(&samples[..]);
        extrapolate(&codec, &mut expected, known, known, 0, 5);
        extrapolate(&codec, &mut expected, known, [6, 6, 5], 2, 3);
        assert_eq!(nodes[..], copied(codec.sample, &expected, size, known, size)[..]);
    }
}
