//! Reads TIFF.

use super::pages::{Page, Pages};
use super::stack::Stack;
use super::{imagej, ome};
use crate::shared::component;
use std::fmt;
use std::ops::Range;
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::source::file_header::{FileHeader, Units};
use wavesplat_core::source::layout::{Layout, Shape};
use wavesplat_core::source::parts::{DataLocation, Decode, Part, Stored};
use wavesplat_core::source::spill_buffer::SpillBuffer;
use wavesplat_core::source::{Advised, OpenOptions, Parsed};

/// The bytes decoded at once may use 1/4 of the memory for a window.
const SHARE: usize = 4;

/// Bytes that one compressed byte can stand for.
const MOST: u64 = 4096;

/// Checks that all pages are alike, and reads the first page's description.
pub(super) fn describe(path: &Path, options: &OpenOptions) -> Result<FileHeader> {
    let state = FileBytes::open(path, Access::Read)?.state();
    let mut pages = Pages::open(path)?;
    let (page, said) = (pages.page()?, pages.description());
    let count = pages.count(&page)?;
    let refused = |e: String| Error::input(path, e);
    let stack = stack(&said, count, pages.pixels_per_unit()).map_err(refused)?;
    let (shape, channel, variable) = shape(&stack, &page, options).map_err(|e| Error::input(path, e))?;
    check_room(count, &page, state.len).map_err(refused)?;
    check_chunks(path, &page, options.memory)?;
    let layout = Layout::plain(shape.dims(), 1);
    let stored = Stored::new(&layout, page.ty, false).map_err(refused)?;
    let frames = stack.frames;
    let Stack { spacing, ref space_unit, .. } = stack;
    let units = Units { space: space_unit.clone(), times: stack.time_unit(), ..Units::default() };
    let times = stack.times();
    let decoder = Planes { pages: None, page, stack, channel };
    let part = Part { path: path.into(), state, frames, stored, at: DataLocation::Decoded(Box::new(decoder)) };
    Ok(FileHeader { spacing, times, units, variable, ..FileHeader::plain(shape, vec![part]) })
}

/// The voxels of a frame, the channel that is meant, and its name.
/// The pages as the first one describes them. Without a description, they are one frame.
pub(super) fn stack(said: &str, pages: usize, pixels_per_unit: [Option<f64>; 2]) -> Parsed<Stack> {
    let stack = match said {
        said if ome::is_ome(said) => ome::parse(said)?,
        said if said.starts_with(imagej::START) => imagej::parse(said, pages, pixels_per_unit)?,
        _ => Stack::new(['Z', 'C', 'T'], [pages, 1, 1])?,
    };
    let all = [stack.frames, stack.planes, stack.channels].into_iter().try_fold(1_usize, usize::checked_mul);
    if all == Some(pages) {
        return Ok(stack);
    }
    let Stack { frames, planes, channels, .. } = stack;
    Err(format!("has {pages} page(s), but says {planes} plane(s) of {channels} channel(s) in {frames} frame(s)"))
}

fn shape(stack: &Stack, page: &Page, options: &OpenOptions) -> Advised<(Shape, usize, Option<String>)> {
    let (channel, variable) = component::only_array(None, stack.channels, options.variable.as_deref())?;
    let shape = Shape::new([page.dims[0], page.dims[1], stack.planes], page.ty.sample())?;
    Ok((shape, channel, variable))
}

/// An error if so short a file cannot hold so many pages, however they are compressed.
fn check_room(pages: usize, page: &Page, len: u64) -> Parsed<()> {
    let bytes = page.bytes().and_then(|bytes| (bytes as u64).checked_mul(pages as u64));
    match bytes {
        Some(bytes) if bytes <= len.saturating_mul(MOST) => Ok(()),
        _ => Err(format!("has {pages} page(s) of {:?} pixels, which {len} bytes cannot hold", page.dims)),
    }
}

/// An error if a strip or tile is too large to be decoded.
fn check_chunks(path: &Path, page: &Page, memory: usize) -> Result<()> {
    let bytes = page.chunk_bytes();
    if bytes <= memory / SHARE {
        return Ok(());
    }
    let needed = bytes.saturating_mul(SHARE).div_ceil(1 << 20);
    let what = format!("{} is in strips or tiles of {bytes} bytes, which need {needed}MiB", path.display());
    Err(Error::setting("memory", what))
}

/// Decodes frames plane by plane.
struct Planes {
    /// The open file.
    pages: Option<Pages>,
    page: Page,
    stack: Stack,
    channel: usize,
}

impl Decode for Planes {
    fn decode(&mut self, path: &Path, frames: Range<usize>, out: &mut SpillBuffer) -> Result<()> {
        let mut pages = match self.pages.take() {
            Some(pages) => pages,
            None => Pages::open(path)?,
        };
        let bytes = self.page.bytes().unwrap_or_default(); // as was checked
        for z in 0..self.stack.planes {
            let index = self.stack.page(frames.start, z, self.channel);
            pages.read(index, &self.page, (z * bytes) as u64, out)?;
        }
        self.pages = Some(pages);
        Ok(())
    }

    fn close_file(&mut self) {
        self.pages = None;
    }
}

impl fmt::Debug for Planes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Planes").field("page", &self.page).field("stack", &self.stack).finish_non_exhaustive()
    }
}
