//! Frames from a pipe, raw or as arrays of NumPy: forward only, one window held at a time, in memory or in a temporary file.

use super::refuse_options;
use crate::{npy, raw};
use std::io::{self, Chain, Cursor, Read};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::grid::Grid;
use wavesplat_core::base::npy::MAGIC;
use wavesplat_core::base::output::STANDARD;
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::frames::{Bytes, Frame, Frames};
use wavesplat_core::source::layout::Shape;
use wavesplat_core::source::parts::Stored;
use wavesplat_core::source::series::{check_grid, override_grid};
use wavesplat_core::source::spill_buffer::{SpillBuffer, read_some};
use wavesplat_core::source::{Archive, FrameSource, FrameWindow, OpenOptions, times};

const CHUNK: usize = 1 << 20; // bytes asked for at a time

/// Frames one after another from a reader.
pub(crate) struct Stream<R> {
    /// What messages call it.
    name: PathBuf,
    archive: Archive,
    shape: Shape,
    stored: Stored, // of one frame
    memory: usize,
    next: usize, // number of the next frame
    ended: bool,
    chunk: Vec<u8>,
    reader: Chain<Cursor<Vec<u8>>, R>,
    /// The header before each frame, if each is an array of its own.
    repeated: Option<npy::Array>,
}

impl<R: Read> Stream<R> {
    /// Reads the header before the first frame.
    pub(crate) fn open(name: &Path, mut reader: R, options: &OpenOptions) -> Result<Self> {
        if options.axes.is_some() {
            return Err(Error::setting("axes", "is for files: a stream has frames z y x, one after another"));
        }
        let mut head = Vec::new();
        let magic = MAGIC.len() as u64;
        reader.by_ref().take(magic).read_to_end(&mut head).map_err(|e| Error::io(name, "reading", e))?;
        let is_npy = head == MAGIC;
        let mut reader = Cursor::new(head).chain(reader);
        let StreamHeader { shape, ty, frames, big_endian, repeated } = match (&options.dims, is_npy) {
            (Some(_), false) => headerless(name, &mut reader, options)?,
            (Some(_), true) if options.dims_are_remembered => numpy(name, &mut reader, &options.for_headers())?,
            (Some(_), true) => {
                return Err(Error::setting("dims", "the npy stream has a header; leave them out"));
            }
            (None, true) => numpy(name, &mut reader, options)?,
            (None, false) => {
                return Err(Error::path(name, Note::with("is no npy stream", Remedy::DescribeSamples)));
            }
        };
        let mut grid = Grid::unit(shape.dims());
        override_grid(&mut grid, options);
        check_grid(&grid, options, name)?;
        let memory = options.for_window(shape.sample());
        let mut archive = Archive { format: "stream", memory, ..Archive::new(grid, shape.sample(), frames) };
        times::settle(&mut archive, options)?;
        let stored = Stored::plain(shape.dims(), 1, ty, big_endian).map_err(|e| Error::input(name, e))?;
        Ok(Self {
            name: name.into(),
            archive,
            shape,
            stored,
            memory,
            next: 0,
            ended: false,
            chunk: vec![0; CHUNK],
            reader,
            repeated,
        })
    }

    /// Reads up to `frames` frames into `held`, or skips them without a buffer. Returns the number of frames read.
    fn copy(&mut self, frames: usize, mut held: Option<&mut SpillBuffer>) -> Result<usize> {
        let left = self.archive.frames.map_or(frames, |all| frames.min(all - self.next));
        for done in 0..left {
            let place = (done * self.stored.bytes) as u64;
            if self.ended || !self.copy_frame(held.as_deref_mut(), place)? {
                return Ok(done);
            }
            self.next += 1;
        }
        Ok(left)
    }

    /// Moves one frame to its place; false if the stream ends before it.
    fn copy_frame(&mut self, mut held: Option<&mut SpillBuffer>, place: u64) -> Result<bool> {
        let (frame, bytes) = (self.next, self.stored.bytes);
        if frame > 0 && self.repeated.is_some() && !self.next_array()? {
            return self.end(0);
        }
        let mut got = 0;
        while got < bytes {
            let wanted = CHUNK.min(bytes - got);
            let n = read_some(&mut self.reader, &mut self.chunk[..wanted])
                .map_err(|e| Error::io(&self.name, format!("reading frame {frame}"), e))?;
            if n == 0 {
                return self.end(got);
            }
            let kept = held.as_mut().map_or(Ok(()), |held| held.write_at(place + got as u64, &self.chunk[..n]));
            kept.map_err(|e| Error::io(&self.name, format!("holding frame {frame}"), e))?;
            got += n;
        }
        if self.archive.frames == Some(frame + 1) {
            self.expect_end()?;
        }
        Ok(true)
    }

    /// Reads the header of an array after the first one; false if the stream ends before it.
    fn next_array(&mut self) -> Result<bool> {
        let mut head = [0];
        let failed = |e| Error::io(&self.name, "reading", e);
        if read_some(&mut self.reader, &mut head).map_err(failed)? == 0 {
            return Ok(false);
        }
        let found = npy::read_header(&mut Cursor::new(head).chain(&mut self.reader), &self.name)?;
        let alike = |array: &npy::Array| npy::Array { start: 0, ..array.clone() };
        let first = self.repeated.as_ref().map(alike);
        if first == Some(alike(&found)) {
            return Ok(true);
        }
        let what = format!("array {} is {} frame(s) of {}", self.next, found.frames, found.shape);
        Err(Error::input(&self.name, format!("{what}, unlike the first one, which is a frame of {}", self.shape)))
    }

    /// The stream ended after `got` bytes of the next frame.
    fn end(&mut self, got: usize) -> Result<bool> {
        self.ended = true;
        let (frame, bytes) = (self.next, self.stored.bytes);
        if got > 0 {
            let what = format!("ends inside frame {frame}: expected {bytes} bytes, got {got}");
            return Err(Error::input(&self.name, Note::with(what, Remedy::Adjust(&["dims", "sample"]))));
        }
        match self.archive.frames {
            Some(all) => Err(Error::input(&self.name, format!("ends after {frame} of {all} frames"))),
            None if frame == 0 => Err(Error::input(&self.name, "is empty")),
            None => {
                self.archive.frames = Some(frame);
                Ok(false)
            }
        }
    }

    fn expect_end(&mut self) -> Result<()> {
        self.ended = true;
        let mut one = [0];
        match read_some(&mut self.reader, &mut one).map_err(|e| Error::io(&self.name, "reading", e))? {
            0 => Ok(()),
            _ => {
                let all = self.archive.frames.unwrap_or(0);
                Err(Error::input(
                    STANDARD,
                    format!("goes on after its {all} frame(s); several arrays must have a frame (z, y, x) each"),
                ))
            }
        }
    }

    fn frame(&self, index: usize, first: usize) -> Frame {
        let offset = (index * self.stored.bytes) as u64;
        let name =
            if self.name == Path::new(STANDARD) { "standard input".into() } else { self.name.display().to_string() };
        let name = format!("{name}, frame {}", first + index);
        Frame { bytes: 0, offset, name }
    }
}

impl<R: Read + Send> FrameSource for Stream<R> {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        let Some(skip) = first.checked_sub(self.next) else {
            let what = format!("frame {first} is over: a stream only goes forward, and frame {} comes next", self.next);
            return Err(Error::setting("frames", what));
        };
        self.copy(skip, None)?;
        let count = self.archive.frames.map_or(count, |all| count.min(all - self.next));
        let bytes = count.saturating_mul(self.stored.bytes);
        let mut data = SpillBuffer::new(bytes, self.memory, &self.name)?;
        let held = self.copy(count, Some(&mut data))?;
        let frames = (0..held).map(|i| self.frame(i, first)).collect();
        let bytes = vec![(Bytes::SpillBuffer { data: Arc::new(data), file: None }, self.stored.clone())];
        Ok(Box::new(Frames { shape: self.shape, bytes, frames }))
    }
}

/// The properties of a stream, from its first header or from the user's options.
struct StreamHeader {
    shape: Shape,
    ty: StoredType,
    frames: Option<usize>,
    big_endian: bool,
    repeated: Option<npy::Array>,
}

fn headerless(name: &Path, reader: &mut impl Read, options: &OpenOptions) -> Result<StreamHeader> {
    let (shape, frames) = raw::shape(options)?;
    let skipped = io::copy(&mut reader.take(options.offset), &mut io::sink());
    match skipped.map_err(|e| Error::io(name, "reading", e))? {
        n if n == options.offset => {
            let frames = frames.filter(|_| !options.dims_are_remembered);
            Ok(StreamHeader {
                shape,
                ty: shape.sample().into(),
                frames,
                big_endian: options.big_endian,
                repeated: None,
            })
        }
        n => Err(Error::input(name, format!("ends after {n} bytes, inside the offset of {}", options.offset))),
    }
}

fn numpy(name: &Path, reader: &mut impl Read, options: &OpenOptions) -> Result<StreamHeader> {
    refuse_options(name, &npy::FORMAT, options)?;
    let array = npy::read_header(reader, name)?;
    let npy::Array { shape, ty, frames, big_endian, axes, .. } = array;
    let repeated = (axes == 3).then_some(array); // others like it may follow
    let frames = repeated.is_none().then_some(frames);
    Ok(StreamHeader { shape, ty, frames, big_endian, repeated })
}

#[cfg(test)]
mod tests;
