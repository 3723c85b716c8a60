//! Archives whose samples are computed when they are read.

use wavesplat::base::error::Result;
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::sample::SampleType;
use wavesplat::source::{Archive, FrameSource, FrameWindow};

/// An archive of `sample(frame, voxel)`, little-endian.
#[derive(Clone)]
pub(crate) struct Computed<const N: usize, F> {
    archive: Archive,
    sample: F,
}

/// A function of frame and voxel that gives a sample's bytes.
pub(crate) trait Sampled<const N: usize>: Fn(usize, usize) -> [u8; N] + Clone + Send + Sync + 'static {}

impl<const N: usize, F: Fn(usize, usize) -> [u8; N] + Clone + Send + Sync + 'static> Sampled<N> for F {}

impl<const N: usize, F: Sampled<N>> Computed<N, F> {
    pub(crate) fn new(grid: Grid, ty: SampleType, frames: usize, sample: F) -> Self {
        assert_eq!(ty.size(), N);
        Self { archive: Archive::new(grid, ty, Some(frames)), sample }
    }

    pub(crate) fn at(&self, frame: usize, voxel: usize) -> [u8; N] {
        (self.sample)(frame, voxel)
    }
}

impl<const N: usize, F: Sampled<N>> FrameSource for Computed<N, F> {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        Ok(Box::new(Window { source: self.clone(), first, count }))
    }
}

struct Window<const N: usize, F> {
    source: Computed<N, F>,
    first: usize,
    count: usize,
}

impl<const N: usize, F: Sampled<N>> FrameWindow for Window<N, F> {
    fn frames(&self) -> usize {
        self.count
    }

    fn read_box(&self, frame: usize, region: &Region, out: &mut [u8]) -> Result<()> {
        let [nx, ny, _] = self.source.archive.grid.dims;
        let row = region.dims()[0];
        for ((y, z), to) in region.rows().zip(out.chunks_exact_mut(row * N)) {
            let first = (z * ny + y) * nx + region.start[0];
            for (i, bytes) in to.as_chunks_mut().0.iter_mut().enumerate() {
                *bytes = self.source.at(self.first + frame, first + i);
            }
        }
        Ok(())
    }

    fn name(&self, frame: usize) -> String {
        format!("frame {}", self.first + frame)
    }

    fn check_unchanged(&self) -> Result<()> {
        Ok(())
    }
}
