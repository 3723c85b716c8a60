//! Frames in memory.

use super::{Archive, FrameSource, FrameWindow, copy_box};
use crate::base::error::{Error, Result};
use crate::base::grid::{Grid, Region};
use crate::base::sample::SampleType;
use std::sync::Arc;

/// An archive whose frames are an array in memory. Clones share the samples.
///
/// ```
/// # mod wavesplat { pub use wavesplat_core::{base::error::Error, source}; }
/// use wavesplat::source::{ArraySource, FrameSource};
///
/// let source = ArraySource::from_f32([4, 3, 2], &[0.5; 10 * 4 * 3 * 2])?;
/// assert_eq!(source.archive().frames, Some(10));
/// # Ok::<(), wavesplat::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct ArraySource {
    archive: Archive,
    /// Little-endian: x fastest, then y, z, and time slowest.
    samples: Arc<[u8]>,
}

impl ArraySource {
    /// Frames of `dims` voxels along x, y, z, one world unit apart. In `samples` x is fastest, then y, z, and time
    /// slowest.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn from_f32(dims: [usize; 3], samples: &[f32]) -> Result<Self> {
        let bytes = samples.iter().flat_map(|sample| sample.to_le_bytes()).collect();
        Self::new(Grid::unit(dims), SampleType::F32, bytes)
    }

    /// Frames of samples of any type, little-endian, in the same order.
    ///
    /// # Errors
    /// [`Error::Setting`] unless the samples are a whole number of frames, at least one, of at least one voxel.
    pub fn new(grid: Grid, sample: SampleType, samples: Vec<u8>) -> Result<Self> {
        let voxels = grid.dims.into_iter().try_fold(1_usize, usize::checked_mul);
        let frame = voxels.and_then(|voxels| voxels.checked_mul(sample.size())).filter(|bytes| *bytes > 0);
        let frames = frame.filter(|frame| samples.len().is_multiple_of(*frame)).map(|frame| samples.len() / frame);
        let Some(frames) = frames.filter(|frames| *frames > 0) else {
            let (bytes, [x, y, z]) = (samples.len(), grid.dims);
            return Err(Error::setting(
                "samples",
                format!("{bytes} bytes are no whole frames of {x} x {y} x {z} {sample} samples"),
            ));
        };
        Ok(Self { archive: Archive::new(grid, sample, Some(frames)), samples: samples.into() })
    }

    /// Number of frames.
    fn len(&self) -> usize {
        self.archive.frames.unwrap_or_default()
    }
}

impl FrameSource for ArraySource {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        match first.checked_add(count).filter(|end| *end <= self.len()) {
            Some(_) => Ok(Box::new(ArrayWindow { source: self.clone(), first, count })),
            None => Err(Error::setting("frames", format!("{count} from {first} on, but the array has {}", self.len()))),
        }
    }
}

/// Some frames of an array.
struct ArrayWindow {
    source: ArraySource,
    first: usize,
    count: usize,
}

impl FrameWindow for ArrayWindow {
    fn frames(&self) -> usize {
        self.count
    }

    fn read_box(&self, frame: usize, region: &Region, out: &mut [u8]) -> Result<()> {
        let Archive { grid, sample, .. } = &self.source.archive;
        let frame = &self.source.samples[(self.first + frame) * grid.whole().voxels() * sample.size()..];
        copy_box(frame, grid, sample.size(), region, out);
        Ok(())
    }

    fn name(&self, frame: usize) -> String {
        format!("frame {}", self.first + frame)
    }

    fn check_unchanged(&self) -> Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{DIMS, check_window, payload};
    use super::*;

    #[test]
    fn windows_are_of_the_right_frames() {
        let ty = SampleType::U16;
        let mut source = ArraySource::new(Grid::unit(DIMS), ty, payload(ty, 0..4, false)).expect("whole frames");
        let window = source.window(1, 3).expect("there are 4");
        check_window(window.as_ref(), ty, 1);
        assert!(source.window(2, 3).is_err() && source.window(1, usize::MAX).is_err());
    }

    #[test]
    fn only_whole_frames_are_an_archive() {
        for (dims, samples) in [([2, 2, 2], 12), ([2, 2, 2], 0), ([0, 2, 2], 8), ([usize::MAX, 2, 2], 8)] {
            assert!(ArraySource::from_f32(dims, &vec![0.0; samples]).is_err(), "{dims:?}");
        }
    }
}
