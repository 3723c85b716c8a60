//! A conversion of frames that a running program pushes.
#![allow(unsafe_code)]

use crate::frames::{Frames, WavesplatFrames};
use crate::incoming::{Incoming, Outgoing, stream};
use crate::status::answer;
use crate::text::{optional, pointed, pointed_mut, required};
use std::ffi::{c_char, c_void};
use std::path::{Path, PathBuf};
use std::thread::{Builder, JoinHandle};
use wavesplat::base::memory::for_reading;
use wavesplat::base::progress::Silent;
use wavesplat::convert::{ConvertRequest, run};
use wavesplat::file::resume::IfUnfinished;
use wavesplat::formats;
use wavesplat::source::{Archive, FrameSource, FrameWindow, GivenTimes, OpenOptions, RegularTimes};
use wavesplat::{Error, Result};

/// A file that is being written.
pub struct WavesplatWriter {
    frames: Frames,
    path: PathBuf,
    /// None after an error.
    running: Option<Running>,
}

struct Running {
    outgoing: Outgoing,
    conversion: JoinHandle<Result<()>>,
}

/// Begins a coefficient file of frames that `wavesplat_push` gives. It gets its name when it is finished; until then it is
/// `path` with ".part".
///
/// `settings` is a text in JSON, such as `{"max_error": 0.05}` or `{"tolerance": 0.001, "keep": "range"}`, or null. The names
/// are those of the options of `wavesplat convert`, with underscores. A file of this name is an error unless `replace`.
///
/// # Safety
/// Texts end with a 0. `writer` takes a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_create(
    path: *const c_char,
    frames: *const WavesplatFrames,
    settings: *const c_char,
    replace: bool,
    writer: *mut *mut WavesplatWriter,
) -> i32 {
    answer(|| {
        // SAFETY: the caller's.
        let (path, frames, settings, writer) = unsafe {
            let frames = Frames::new(pointed("frames", frames)?)?;
            (required("path", path)?, frames, optional("settings", settings)?, pointed_mut("writer", writer)?)
        };
        *writer = Box::into_raw(Box::new(WavesplatWriter::new(path.into(), frames, settings, replace)?));
        Ok(())
    })
}

/// Adds a frame: copies it, and returns as soon as the conversion can take it.
///
/// `strides` are the bytes from a sample to the next along x, y and z; null if they follow each other, x fastest. After an error
/// the file cannot be finished.
///
/// # Safety
/// `samples` and `strides` reach all samples of a frame.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_push(
    writer: *mut WavesplatWriter,
    samples: *const c_void,
    strides: *const isize,
) -> i32 {
    answer(|| {
        // SAFETY: the caller's.
        let (writer, first) = unsafe { (pointed_mut("writer", writer)?, pointed("samples", samples.cast::<u8>())?) };
        // SAFETY: the caller's.
        let strides = if strides.is_null() { None } else { Some(unsafe { *strides.cast::<[isize; 3]>() }) };
        // SAFETY: the caller's.
        writer.push(|frames, out| unsafe { copy(frames, first, strides, out) })
    })
}

/// Ends a file after its last frame, waits until it is whole, and frees the writer, also after an error.
///
/// # Safety
/// `writer` is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_finish(writer: *mut WavesplatWriter) -> i32 {
    // SAFETY: the caller's.
    answer(|| unsafe { taken(writer) }?.end(false))
}

/// Ends a file that shall not be finished, and frees the writer. Its finished windows stay in `path` with ".part", from which
/// `wavesplat recover` makes a file.
///
/// # Safety
/// `writer` is not used any more.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_abandon(writer: *mut WavesplatWriter) {
    answer(|| {
        // SAFETY: the caller's.
        let _ = unsafe { taken(writer) }?.end(true); // the error that it was abandoned
        Ok(())
    });
}

/// # Safety
/// `writer` is null, or of [`wavesplat_create`] and used for the last time.
unsafe fn taken(writer: *mut WavesplatWriter) -> Result<Box<WavesplatWriter>> {
    // SAFETY: the caller's.
    unsafe { pointed_mut("writer", writer)? };
    // SAFETY: `wavesplat_create` made it by a box.
    Ok(unsafe { Box::from_raw(writer) })
}

impl WavesplatWriter {
    fn new(path: PathBuf, frames: Frames, settings: Option<&str>, replace: bool) -> Result<Self> {
        let request: ConvertRequest =
            serde_json::from_str(settings.unwrap_or("{}")).map_err(|e| Error::setting("settings", e.to_string()))?;
        request.check()?;
        if !replace && path.exists() {
            return Err(Error::path(path, "exists already; `replace` replaces it"));
        }
        let (outgoing, incoming) = stream();
        let (to, of) = (path.clone(), frames.clone());
        let conversion = move || convert(incoming, &of, &request, &to, replace);
        let conversion = Builder::new().name("wavesplat".into()).spawn(conversion);
        let conversion = conversion.map_err(|e| Error::io(&path, "starting a thread", e))?;
        Ok(Self { frames, path, running: Some(Running { outgoing, conversion }) })
    }

    /// Gives the conversion a frame that `fill` writes.
    fn push(&mut self, fill: impl FnOnce(&Frames, &mut Vec<u8>)) -> Result<()> {
        let Some(running) = &self.running else {
            return Err(Error::path(&self.path, "failed before, and takes no more frames"));
        };
        let mut frame = running.outgoing.room();
        fill(&self.frames, &mut frame);
        if running.outgoing.send(frame) { Ok(()) } else { self.stop(false) }
    }

    fn end(mut self, is_abandoned: bool) -> Result<()> {
        if self.running.is_none() {
            return Err(Error::path(&self.path, "failed before, and is not whole"));
        }
        self.stop(is_abandoned)
    }

    /// Waits for the end of the conversion.
    fn stop(&mut self, is_abandoned: bool) -> Result<()> {
        let Some(Running { outgoing, conversion }) = self.running.take() else { return Ok(()) };
        if is_abandoned {
            outgoing.abandon();
        } else {
            drop(outgoing);
        }
        conversion.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

/// Copies the samples of a frame, x fastest.
///
/// # Safety
/// `strides` reach all samples of a frame from `first`; without strides, they follow each other.
unsafe fn copy(frames: &Frames, first: *const u8, strides: Option<[isize; 3]>, out: &mut Vec<u8>) {
    let (size, [nx, ny, nz]) = (frames.sample.size(), frames.dims);
    let row = nx * size;
    let [x, y, z] = strides.unwrap_or([size, row, row * ny].map(usize::cast_signed));
    out.clear();
    out.reserve(row * ny * nz);
    // SAFETY: the caller's.
    let add = |at: isize, bytes: usize, out: &mut Vec<u8>| unsafe {
        out.extend_from_slice(std::slice::from_raw_parts(first.offset(at), bytes));
    };
    for (k, j) in (0..nz as isize).flat_map(|k| (0..ny as isize).map(move |j| (k, j))) {
        let start = j * y + k * z;
        match x == size.cast_signed() {
            true => add(start, row, out),
            false => (0..nx as isize).for_each(|i| add(start + i * x, size, out)),
        }
    }
}

fn convert(incoming: Incoming, of: &Frames, request: &ConvertRequest, path: &Path, replace: bool) -> Result<()> {
    let times = of.times.map(|[first, step]| RegularTimes::new(first, step)).transpose()?;
    let options = OpenOptions {
        dims: Some(of.dims.to_vec()),
        sample: Some(of.sample),
        spacing: Some(of.spacing),
        origin: Some(of.origin),
        times: times.map(GivenTimes::Regular),
        time_unit: of.time_unit.clone(),
        memory: for_reading(request.memory),
        ..OpenOptions::default()
    };
    let source = formats::open_named_stream("frames", incoming, &options)?;
    let source = Named::new(source, of);
    let if_unfinished = IfUnfinished::from_flags(replace, false);
    let done = run(Box::new(source), request, path, replace, if_unfinished, &Silent);
    done.map(drop).map_err(|failure| failure.error)
}

/// A stream with the name and the unit of its samples.
struct Named {
    stream: Box<dyn FrameSource>,
    archive: Archive,
}

impl Named {
    fn new(stream: Box<dyn FrameSource>, of: &Frames) -> Self {
        let mut archive = stream.archive().clone();
        archive.variable = of.variable.clone();
        archive.units.samples = of.unit.clone();
        Self { stream, archive }
    }
}

impl FrameSource for Named {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        self.stream.window(first, count)
    }
}
