//! Frames in memory.

use std::sync::Arc;
use wavesplat::base::error::Result;
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::sample::SampleType;
use wavesplat::source::{Archive, FrameSource, FrameWindow};

/// An archive in memory.
#[derive(Clone)]
pub(crate) struct Memory {
    archive: Archive,
    /// All frames, t slowest.
    pub(crate) frames: Arc<Vec<u8>>,
}

impl Memory {
    pub(crate) fn new(grid: Grid, sample: SampleType, frames: Vec<u8>) -> Self {
        let count = frames.len() / (grid.whole().voxels() * sample.size());
        assert_eq!(count * grid.whole().voxels() * sample.size(), frames.len());
        Self { archive: Archive::new(grid, sample, Some(count)), frames: Arc::new(frames) }
    }
}

impl FrameSource for Memory {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        assert!(first + count <= self.archive.frames.unwrap());
        Ok(Box::new(Window { memory: self.clone(), first, count }))
    }
}

struct Window {
    memory: Memory,
    first: usize,
    count: usize,
}

impl FrameWindow for Window {
    fn frames(&self) -> usize {
        self.count
    }

    fn read_box(&self, frame: usize, region: &Region, out: &mut [u8]) -> Result<()> {
        let Archive { grid, sample, .. } = &self.memory.archive;
        let size = sample.size();
        let frame_start = (self.first + frame) * grid.whole().voxels();
        let row = region.dims()[0] * size;
        for ((y, z), to) in region.rows().zip(out.chunks_exact_mut(row)) {
            let from = (frame_start + (z * grid.dims[1] + y) * grid.dims[0] + region.start[0]) * size;
            to.copy_from_slice(&self.memory.frames[from..from + row]);
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
