//! The voxels of a frame, and how the samples of some frames lie in an array: axes in any order and direction.

use super::Parsed;
use crate::base::description::AxisRole;
use crate::base::sample::SampleType;

/// The voxels and the sample type of every frame of an archive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    dims: [usize; 3],
    sample: SampleType,
    frame_bytes: usize,
}

impl Shape {
    /// Refuses empty frames and those whose bytes cannot be addressed, with the reason.
    pub fn new(dims: [usize; 3], sample: SampleType) -> Parsed<Self> {
        let [x, y, z] = dims;
        if dims.contains(&0) {
            return Err(format!("a frame of {x}x{y}x{z} voxels is empty"));
        }
        let voxels = x.checked_mul(y).and_then(|n| n.checked_mul(z));
        let bytes = voxels.and_then(|n| n.checked_mul(sample.size())).filter(|n| isize::try_from(*n).is_ok());
        let frame_bytes = bytes.ok_or_else(|| format!("a frame of {x}x{y}x{z} voxels is too large"))?;
        Ok(Self { dims, sample, frame_bytes })
    }

    /// Voxels along x, y, z.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// The type of the samples.
    pub fn sample(&self) -> SampleType {
        self.sample
    }

    /// Bytes of one frame.
    pub fn frame_bytes(&self) -> usize {
        self.frame_bytes
    }
}

impl std::fmt::Display for Shape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [x, y, z] = self.dims;
        write!(f, "{x}x{y}x{z} {} samples", self.sample)
    }
}

/// An axis of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Axis {
    /// Its role: an axis of frames or voxels, or one with a single chosen item, such as an axis of components.
    pub role: AxisRole,
    /// At least 1.
    pub len: usize,
    /// The chosen item of a single axis.
    pub index: usize,
    /// Whether voxels are stored from the last to the first.
    pub backwards: bool,
}

impl Axis {
    /// An axis that is stored from its first to its last.
    pub fn new(role: AxisRole, len: usize) -> Self {
        Self { role, len, index: 0, backwards: false }
    }

    /// An axis with one chosen item, which counts neither frames nor voxels.
    pub fn single(index: usize, len: usize) -> Self {
        Self { index, ..Self::new(AxisRole::Single, len) }
    }
}

/// The axes of an array, the slowest first. Axes that it lacks have a length of 1.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Layout(pub Vec<Axis>);

impl Layout {
    /// Frames one after another, z slowest and x fastest.
    pub fn plain([x, y, z]: [usize; 3], frames: usize) -> Self {
        let axes = [(AxisRole::Frames, frames), (AxisRole::Z, z), (AxisRole::Y, y), (AxisRole::X, x)];
        Self(axes.map(|(role, len)| Axis::new(role, len)).to_vec())
    }

    /// The length of the axis that counts this.
    pub fn len(&self, role: AxisRole) -> usize {
        self.0.iter().find(|axis| axis.role == role).map_or(1, |axis| axis.len)
    }

    /// Voxels along x, y, z.
    pub fn dims(&self) -> [usize; 3] {
        [0, 1, 2].map(|axis| self.len(AxisRole::of_voxels(axis)))
    }

    /// The same array of another number of frames.
    pub fn with_frames(mut self, frames: usize) -> Self {
        self.0.iter_mut().filter(|axis| axis.role == AxisRole::Frames).for_each(|axis| axis.len = frames);
        self
    }

    /// Drops the slowest axes with a chosen index. Returns the number of samples before the chosen part, and the layout
    /// of that part.
    pub fn chosen_part(&self) -> (usize, Self) {
        let (mut before, mut rest) = (0, self.clone());
        while let Some(Axis { role: AxisRole::Single, index, .. }) = rest.0.first().copied() {
            rest.0.remove(0);
            before += index * rest.0.iter().map(|axis| axis.len).product::<usize>();
        }
        (before, rest)
    }

    /// Bytes of the whole array.
    pub fn bytes(&self, size: usize) -> Parsed<usize> {
        let bytes = self.0.iter().try_fold(size, |bytes, axis| bytes.checked_mul(axis.len));
        bytes.filter(|n| isize::try_from(*n).is_ok()).ok_or_else(|| "an array of its size is too large".into())
    }

    /// Where samples of `size` bytes are.
    pub(crate) fn strides(&self, size: usize) -> Parsed<Strides> {
        self.bytes(size)?;
        let mut strides = Strides { first: 0, frame: 0, voxel: [0; 3] };
        let mut stride = size as i64;
        for axis in self.0.iter().rev() {
            let last = stride * (axis.len as i64 - 1);
            let signed = if axis.backwards { -stride } else { stride };
            strides.first += if axis.backwards { last as u64 } else { 0 };
            match (axis.role, axis.role.voxels()) {
                (AxisRole::Frames, _) => strides.frame = stride as u64,
                (_, Some(along)) => strides.voxel[along] = signed,
                (_, None) => strides.first += stride as u64 * axis.index as u64,
            }
            stride *= axis.len as i64;
        }
        Ok(strides)
    }
}

/// Bytes from one sample of an array to others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Strides {
    /// From the array's first byte to voxel (0, 0, 0) of its first frame.
    pub first: u64,
    /// To the next frame.
    pub frame: u64,
    /// To the next voxel along x, y, z.
    pub voxel: [i64; 3],
}

impl Strides {
    /// Whether the voxels of a frame of these dimensions are contiguous, x fastest, then y and z.
    pub(crate) fn is_plain(&self, dims: [usize; 3], size: usize) -> bool {
        self.voxel == [size, size * dims[0], size * dims[0] * dims[1]].map(|n| n as i64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strides_lead_to_every_sample() {
        let (frames, z) = (Axis::new(AxisRole::Frames, 5), Axis::new(AxisRole::Z, 4));
        let mut layout = Layout(vec![Axis::new(AxisRole::X, 3), Axis::single(1, 2), frames, z]);
        layout.0[3].backwards = true;
        let strides = layout.strides(2).expect("small");
        let index = |x: u64, t: u64, z: u64| ((x * 2 + 1) * 5 + t) * 4 + (3 - z);
        for (x, t, z) in [(0, 0, 0), (2, 4, 3), (1, 2, 1)] {
            let at = strides.first + t * strides.frame;
            let at = at as i64 + x as i64 * strides.voxel[0] + z as i64 * strides.voxel[2];
            assert_eq!(at as u64, 2 * index(x, t, z));
        }
        assert_eq!(layout.dims(), [3, 1, 4]);
        assert_eq!(layout.bytes(2), Ok(240));
    }

    #[test]
    fn the_chosen_part_comes_after_the_indices_before_it() {
        let frames = Axis::new(AxisRole::Frames, 5);
        let layout = Layout(vec![Axis::single(1, 2), Axis::single(3, 4), frames, Axis::single(0, 3)]);
        assert_eq!(layout.chosen_part(), (4 * 5 * 3 + 3 * 5 * 3, Layout(layout.0[2..].to_vec())));
    }

    #[test]
    fn only_the_usual_order_is_plain() {
        let dims = [7, 5, 3];
        assert!(Layout::plain(dims, 9).strides(4).expect("small").is_plain(dims, 4));
        let mut other = Layout::plain(dims, 9);
        other.0.swap(1, 2);
        assert!(!other.strides(4).expect("small").is_plain(dims, 4));
        assert!(Layout::plain([usize::MAX, 2, 2], 1).bytes(1).is_err());
    }
}
