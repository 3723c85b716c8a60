//! Files that hold one plane each, stacked to frames.

use crate::numbering::Planes;
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Region;
use wavesplat_core::source::series::{Series, check_grid, override_grid, too_many_frames};
use wavesplat_core::source::{Archive, FrameSource, FrameWindow, OpenOptions, times};

/// Opens files of planes, frame after frame and in each from the first plane to the last. `first` is the first of them.
///
/// # Errors
/// Files that hold more than a plane.
pub(super) fn stacked(
    first: &Path,
    options: &OpenOptions,
    Planes(planes): Planes,
    open: impl Fn(&OpenOptions) -> Result<Series>,
) -> Result<Box<dyn FrameSource>> {
    let own = OpenOptions { spacing: None, origin: None, times: None, time_unit: None, clock: None, ..options.clone() };
    let source = open(&own)?;
    let mut archive = source.archive().clone();
    let files = archive.frames.unwrap_or(0);
    let [x, y, z] = archive.grid.dims;
    if z != 1 || files % planes != 0 {
        let what = format!("names count frames and planes, but each file has {z} planes: a pattern in quotes chooses");
        return Err(Error::input(first, format!("{what} files of one series")));
    }
    archive.grid.dims = [x, y, planes];
    override_grid(&mut archive.grid, options);
    check_grid(&archive.grid, options, first)?;
    archive.frames = Some(files / planes);
    archive.times = archive.times.iter().step_by(planes).copied().collect();
    archive.description = None; // of a plane
    archive.memory = archive.memory.min(options.memory);
    archive.notes.push(format!("each file is one of {planes} planes of a frame, by the numbers in the names").into());
    times::settle(&mut archive, options)?;
    Ok(Box::new(Stacked { source, archive, planes }))
}

struct Stacked {
    /// Of planes.
    source: Series,
    archive: Archive,
    planes: usize,
}

impl FrameSource for Stacked {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        let frames = self.archive.frames.unwrap_or(0);
        if first.checked_add(count).is_none_or(|end| end > frames) {
            return Err(too_many_frames(first, count, frames));
        }
        let window = self.source.window(first * self.planes, count * self.planes)?;
        Ok(Box::new(StackedWindow { window, planes: self.planes, sample_size: self.archive.sample.size() }))
    }
}

struct StackedWindow {
    window: Box<dyn FrameWindow>,
    planes: usize,
    /// In bytes.
    sample_size: usize,
}

impl FrameWindow for StackedWindow {
    fn frames(&self) -> usize {
        self.window.frames() / self.planes
    }

    fn read_box(&self, frame: usize, region: &Region, out: &mut [u8]) -> Result<()> {
        let [x, y, _] = region.dims();
        let plane = (x * y * self.sample_size).max(1);
        let flat = Region { start: [region.start[0], region.start[1], 0], end: [region.end[0], region.end[1], 1] };
        for (z, out) in (region.start[2]..region.end[2]).zip(out.chunks_exact_mut(plane)) {
            self.window.read_box(frame * self.planes + z, &flat, out)?;
        }
        Ok(())
    }

    fn name(&self, frame: usize) -> String {
        self.window.name(frame * self.planes)
    }

    fn check_unchanged(&self) -> Result<()> {
        self.window.check_unchanged()
    }
}
