//! Reads TIFF.

use super::pages::{Page, Pages};
use super::stack::{Counts, Stack, guessed, named};
use super::{imagej, ome, shaped};
use crate::shared::component;
use std::fmt;
use std::ops::Range;
use std::path::Path;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::source::file_header::{FileHeader, Units};
use wavesplat_core::source::layout::Shape;
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
    let described = Described { said: &said, count, page: &page, pixels_per_unit: pages.pixels_per_unit() };
    let (stack, note) = described.stack(options.axes.as_deref()).map_err(|e| Error::input(path, e))?;
    let (shape, channel, variable) = shape(&stack, &page, options).map_err(|e| Error::input(path, e))?;
    let (spacing, times, frames) = (stack.spacing, stack.times(), stack.frames);
    let units = Units { space: stack.space_unit.clone(), times: stack.time_unit(), ..Units::default() };
    let part = if stack.pages() == Some(count) {
        check_room(count, &page, state.len).map_err(refused)?;
        check_chunks(path, &page, options.memory)?;
        let stored = Stored::new(&stack.layout(page.dims), page.ty, false).map_err(refused)?;
        let decoder = Planes { pages: None, page, stack, channel };
        Part { path: path.into(), state, frames, stored, at: DataLocation::Decoded(Box::new(decoder)) }
    } else {
        let (layout, big_endian) = (stack.contiguous(page.dims, channel), pages.is_big_endian());
        let stored = Stored::new(&layout, page.ty, big_endian).map_err(refused)?;
        let start = pages.contiguous(&page, stored.bytes as u64, state.len)?;
        Part { path: path.into(), state, frames, stored, at: DataLocation::Byte(start) }
    };
    let notes = note.into_iter().collect();
    Ok(FileHeader { spacing, times, units, variable, notes, ..FileHeader::plain(shape, vec![part]) })
}

/// What a file says of its pages.
pub(super) struct Described<'a> {
    /// The text of the first page.
    pub(super) said: &'a str,
    /// Number of pages.
    pub(super) count: usize,
    pub(super) page: &'a Page,
    pub(super) pixels_per_unit: [Option<f64>; 2],
}

impl Described<'_> {
    /// The pages as the user's letters say or the first page describes them, with a note on a guess. Without a
    /// description, they are one frame.
    pub(super) fn stack(&self, letters: Option<&str>) -> Advised<(Stack, Option<Note>)> {
        let (count, dims) = (self.count, self.page.dims);
        let (own, axes) = match self.said {
            said if ome::is_ome(said) => as_said(ome::parse(said)?, dims),
            said if said.starts_with(imagej::START) => as_said(imagej::parse(said, count, self.pixels_per_unit)?, dims),
            said if shaped::is_shaped(said) => (None, self.shaped(letters.is_some())?),
            _ => (None, self.plain()),
        };
        let pages = own.as_ref().map_or(count, |own| if count == 1 { own.pages().unwrap_or(1) } else { count });
        let (stack, note) = match (letters, own) {
            (None, Some(own)) => (own, None),
            (None, None) => {
                let (axes, note) = guessed(axes)?;
                (Stack::along(&axes)?, note)
            }
            (Some(letters), own) => {
                let stack = Stack::along(&named(&axes, Some(pages).filter(|pages| *pages > 1), letters)?)?;
                let own = own.unwrap_or_else(|| stack.clone());
                let Stack { spacing, space_unit, interval, stamps, .. } = own;
                (Stack { spacing, space_unit, interval, stamps, ..stack }, None)
            }
        };
        let is_one_of_many = count == 1 && !ome::is_ome(self.said); // an OME-TIFF may be in several files
        if is_one_of_many || stack.pages() == Some(count) {
            return Ok((stack, note));
        }
        let Stack { frames, planes, channels, .. } = stack;
        let what = format!("{planes} plane(s) of {channels} channel(s) in {frames} frame(s)");
        Err(Note::with(format!("has {count} page(s), but says {what}"), Remedy::Set("axes")))
    }

    /// The axes of tifffile's shape. A shape of other pages is an error, unless the user says what they are.
    fn shaped(&self, is_named: bool) -> Advised<Vec<Counts>> {
        let axes = shaped::parse(self.said)?;
        let lengths: Vec<usize> = axes.iter().map(|axis| axis.length).collect();
        let (outer, inner) = lengths.split_at(lengths.len() - 2);
        let [x, y] = self.page.dims;
        let all = outer.iter().try_fold(1_usize, |all, length| all.checked_mul(*length));
        if inner == [y, x] && (all == Some(self.count) || self.count == 1 && all.is_some()) {
            return Ok(axes);
        }
        if is_named {
            return Ok(self.plain());
        }
        let text = format!("has {} page(s) of {y}x{x} pixels, but says the shape {lengths:?}", self.count);
        Err(Note::with(text, Remedy::Set("axes")))
    }

    /// Pages without a description.
    fn plain(&self) -> Vec<Counts> {
        let [x, y] = self.page.dims;
        let all = [('?', self.count), ('Y', y), ('X', x)].into_iter();
        let axes = all.map(|(letter, length)| Counts { letter, length });
        axes.filter(|axis| axis.letter != '?' || axis.length > 1).collect()
    }
}

/// A stack that the file describes, and its axes.
fn as_said(stack: Stack, dims: [usize; 2]) -> (Option<Stack>, Vec<Counts>) {
    let axes = stack.axes(dims);
    (Some(stack), axes)
}

/// The voxels of a frame, the channel that is meant, and its name.
fn shape(stack: &Stack, page: &Page, options: &OpenOptions) -> Advised<(Shape, usize, Option<String>)> {
    let (channel, variable) = component::only_array(None, stack.channels, options.variable.as_deref())?;
    let shape = Shape::new(stack.layout(page.dims).dims(), page.ty.sample())?;
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
