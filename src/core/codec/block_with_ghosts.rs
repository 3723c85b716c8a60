//! The samples of a block and of the neighbouring voxels that predict them.

use super::WindowCodec;
use crate::base::sample;
use std::borrow::Cow;

/// A block, and the voxels whose samples are known.
#[derive(Debug, Clone, Copy)]
pub struct BlockWithGhosts {
    /// Voxels of the block along x, y, z.
    pub size: [usize; 3],
    /// Voxels with samples: the block's own, and possibly one more along each of x, y, z.
    pub known: [usize; 3],
}

impl From<[usize; 3]> for BlockWithGhosts {
    /// A block without the samples around it.
    fn from(size: [usize; 3]) -> Self {
        Self { size, known: size }
    }
}

impl BlockWithGhosts {
    /// The samples of the block alone, frame by frame.
    pub(super) fn own<'a>(&self, codec: &WindowCodec, samples: &'a [u8]) -> Cow<'a, [u8]> {
        let (each, [x, y, z]) = (codec.sample.size(), self.size);
        if self.known == self.size {
            return Cow::Borrowed(samples);
        }
        let row = |t: usize, z: usize, y: usize| each * self.known[0] * (y + self.known[1] * (z + self.known[2] * t));
        let mut own = Vec::with_capacity(codec.frames() * x * y * z * each);
        for (t, z, y) in rows(codec.frames(), [y, z]) {
            own.extend_from_slice(&samples[row(t, z, y)..][..x * each]);
        }
        Cow::Owned(own)
    }

    /// The samples of `outer` voxels along x, y, z, at least as many as are known. Beyond the known voxels, the last
    /// two planes are extrapolated linearly.
    pub(super) fn extended<'a>(&self, codec: &WindowCodec, outer: [usize; 3], samples: &'a [u8]) -> Cow<'a, [u8]> {
        let mut known = self.known;
        let mut extended = Cow::Borrowed(samples);
        for axis in 0..3 {
            if known[axis] < outer[axis] {
                extended = Cow::Owned(continued(codec, &extended, known, axis, known[axis]));
                known[axis] += 1;
            }
        }
        extended
    }

    /// The nodes of a block of a tier above 0, from what is known: those in the volume and, along axes that have a node behind it,
    /// the volume's last two planes of voxels. Those are extrapolated as for the blocks below.
    pub(super) fn coarse<'a>(&self, codec: &WindowCodec, samples: &'a [u8]) -> Cow<'a, [u8]> {
        let mut known = self.known;
        let mut nodes = Cow::Borrowed(samples);
        for axis in 0..3 {
            if known[axis] > self.size[axis] {
                nodes = Cow::Owned(continued(codec, &nodes, known, axis, known[axis] - 2));
                known[axis] -= 1;
            }
        }
        nodes
    }
}

/// Extrapolates one more plane of samples along an axis: twice the last plane minus the one before it. Where one of the
/// two samples is missing, it repeats the last. Keeps the first planes before it.
fn continued(codec: &WindowCodec, samples: &[u8], known: [usize; 3], axis: usize, kept: usize) -> Vec<u8> {
    let (ty, each) = (codec.sample, codec.sample.size());
    let inner: usize = known[..axis].iter().product();
    let (plane, n) = (inner * each, known[axis]);
    let (mut last, mut before) = (vec![0.0; inner], vec![0.0; inner]);
    let mut out = Vec::with_capacity(samples.len() / n * (n + 1));
    for part in samples.chunks_exact(plane * n) {
        out.extend_from_slice(&part[..plane * kept]);
        sample::load(ty, &part[plane * (n - 1)..], &mut last);
        sample::load(ty, &part[plane * n.saturating_sub(2)..][..plane], &mut before);
        for (last, before) in last.iter_mut().zip(&before) {
            if !codec.is_missing(*last) && !codec.is_missing(*before) {
                *last = 2.0 * *last - before;
            }
        }
        let at = out.len();
        out.resize(at + plane, 0);
        sample::store(ty, &last, &mut out[at..]);
    }
    out
}

/// The numbers (t, z, y) of rows.
fn rows(frames: usize, [y, z]: [usize; 2]) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..frames).flat_map(move |t| (0..z).flat_map(move |z| (0..y).map(move |y| (t, z, y))))
}
