//! Narrows an archive to some frames and voxels.

use super::{Archive, FrameSource, FrameWindow};
use crate::base::description::narrowed;
use crate::base::error::{Error, Result};
use crate::base::grid::Region;

/// Every `step`-th frame from `first`, `frames` of them (all that come, if unknown), and in them the voxels of
/// `region`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Selection {
    /// The first frame.
    pub first: usize,
    /// Frames from one to the next.
    pub step: usize,
    /// How many frames; `None` for a stream: all frames to its end.
    pub frames: Option<usize>,
    /// The voxels.
    pub region: Region,
}

impl Selection {
    /// The numbers of the frames, as far as the archive's are known.
    fn numbers(&self, archive: &Archive) -> Vec<usize> {
        let all = self.first..archive.frames.unwrap_or(0);
        all.step_by(self.step).take(self.frames.unwrap_or(usize::MAX)).collect()
    }

    /// The selected part of an archive.
    fn narrow(&self, mut archive: Archive) -> Archive {
        let frames = self.numbers(&archive);
        archive.description = archive.description.map(|all| narrowed(&all, &frames, &self.region, 1));
        archive.grid = archive.grid.crop(&self.region);
        archive.frames = self.frames;
        archive.times = archive.times.iter().skip(self.first).step_by(self.step).copied().collect();
        archive.times.truncate(self.frames.unwrap_or(usize::MAX));
        archive.regular_times = archive.regular_times.map(|times| times.stepped(self.first, self.step));
        archive
    }
}

/// Narrows a source to a selection, which must lie within it.
pub fn select(source: Box<dyn FrameSource>, selection: Selection) -> Result<Box<dyn FrameSource>> {
    let archive = source.archive().clone();
    let whole = archive.grid.whole();
    if !whole.contains(&selection.region) || selection.region.is_empty() {
        let [x, y, z] = archive.grid.dims;
        return Err(Error::setting("region", format!("not within the volume of {x}x{y}x{z} voxels, or empty")));
    }
    let archive = selection.narrow(archive);
    let grows = source.archive().frames.is_none();
    Ok(Box::new(Selected { source, archive, selection, grows }))
}

struct Selected {
    source: Box<dyn FrameSource>,
    archive: Archive,
    selection: Selection,
    /// Whether the number of frames is not known at first.
    grows: bool,
}

impl FrameSource for Selected {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        let Selection { first: start, step, region, .. } = self.selection;
        let window = self.source.window_of(start + first * step, count, step)?;
        if self.grows {
            self.archive = self.selection.narrow(self.source.archive().clone());
        }
        Ok(Box::new(NarrowedWindow { frames: window.frames(), window, start: region.start, step: 1 }))
    }
}

/// Every `step`-th frame of a window from its first, at most `count` of them.
pub(crate) fn stepped(window: Box<dyn FrameWindow>, count: usize, step: usize) -> Box<dyn FrameWindow> {
    let frames = window.frames().div_ceil(step).min(count);
    Box::new(NarrowedWindow { window, start: [0; 3], frames, step })
}

/// Some frames of a window, and voxels from some place.
struct NarrowedWindow {
    window: Box<dyn FrameWindow>,
    start: [usize; 3],
    frames: usize,
    step: usize,
}

impl FrameWindow for NarrowedWindow {
    fn frames(&self) -> usize {
        self.frames
    }

    fn read_box(&self, frame: usize, region: &Region, out: &mut [u8]) -> Result<()> {
        self.window.read_box(frame * self.step, &region.moved_by(self.start), out)
    }

    fn name(&self, frame: usize) -> String {
        self.window.name(frame * self.step)
    }

    fn check_unchanged(&self) -> Result<()> {
        self.window.check_unchanged()
    }
}
