//! A conversion of frames that a running program pushes.
#![allow(unsafe_code)]

use crate::frames::{Frames, WavesplatFrames, number_of};
use crate::incoming::{InMemory, Incoming, Outgoing, stream};
use crate::status::answer;
use crate::text::{give, optional, pointed, pointed_mut, required};
use std::ffi::{c_char, c_void};
use std::io;
use std::path::{Path, PathBuf, absolute};
use std::ptr::null_mut;
use std::thread::{Builder, JoinHandle};
use wavesplat::base::memory::{self, for_reading};
use wavesplat::base::progress::Silent;
use wavesplat::convert::{ConvertRequest, run};
use wavesplat::file::resume::IfUnfinished;
use wavesplat::formats;
use wavesplat::source::{Archive, FrameSource, FrameWindow, GivenTimes, OpenOptions};
use wavesplat::{Error, Result};

/// A file that is being written.
pub struct WavesplatWriter {
    frames: Frames,
    path: PathBuf,
    /// None after an error.
    running: Option<Running>,
    /// That error.
    failure: String,
}

struct Running {
    outgoing: Outgoing,
    conversion: JoinHandle<Result<()>>,
}

/// Begins a coefficient file of frames that `wavesplat_push` gives. It gets its name when it is finished; until then it is
/// `path` with ".part".
///
/// `settings` is JSON, such as `{"max_error": 0.05}` or `{"tolerance": 0.001, "keep": "range sign"}`, or null for the defaults. It
/// may have tolerance, max_error, bound ("pointwise", "rms" or {"relative": {"floor": 1}}), range ([0, 1]), missing ("mask" keeps
/// NaN, which is an error otherwise), missing_value, keep, basis, space, best_for, window, block, level, chain and memory.
///
/// It takes 512 MiB of memory besides a window of frames (usually 32) of up to 1 GiB; a larger window goes to a temporary file. Where
/// `memory` gives another number of bytes, a window goes there that takes more than an eighth of it, or a sixteenth if of doubles.
///
/// A file of this name is an error unless `replace` is not 0. It then also gives up what is in `path` with ".part" after a run was killed:
/// `wavesplat recover` makes a file of that.
///
/// # Safety
/// Strings are null-terminated UTF-8. `writer` receives the new writer, or null after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_create(
    path: *const c_char,
    frames: *const WavesplatFrames,
    settings: *const c_char,
    replace: i32,
    writer: *mut *mut WavesplatWriter,
) -> i32 {
    answer(|| {
        // SAFETY: the caller's.
        unsafe { give("writer", writer, null_mut()) }?;
        // SAFETY: the caller's.
        let (path, frames, settings) = unsafe {
            let frames = Frames::new(pointed("frames", frames)?)?;
            (required("path", path)?, frames, optional("settings", settings)?)
        };
        let begun = Box::new(WavesplatWriter::new(path, frames, settings, replace != 0)?);
        // SAFETY: the caller's.
        unsafe { give("writer", writer, Box::into_raw(begun)) }
    })
}

/// Adds a frame: copies it, and returns as soon as the conversion can take it.
///
/// `strides` are the bytes from a sample to the next along x, y and z; null if they follow each other, x fastest. Frames are
/// converted later, a window (usually 32) at a time: an error may be about an earlier frame. After an error the file cannot be
/// finished; call `wavesplat_finish` or `wavesplat_abandon` to free the writer.
///
/// # Safety
/// `samples` points to the first sample of the frame, and every address that the strides reach can be read.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_push(
    writer: *mut WavesplatWriter,
    samples: *const c_void,
    strides: *const isize,
) -> i32 {
    answer(|| {
        // SAFETY: the caller's.
        let (writer, first) = unsafe { (pointed_mut("writer", writer)?, pointed("samples", samples.cast::<u8>())?) };
        let strides = (!strides.is_null()).then_some(strides.cast::<[isize; 3]>());
        // SAFETY: the caller's.
        let strides = strides.map(|strides| unsafe { strides.read_unaligned() });
        // SAFETY: the caller's.
        writer.push(|frames, out| unsafe { copy(frames, first, strides, out) })
    })
}

/// The voxels along x, y and z of the frames that a writer takes, and the type of their samples.
///
/// # Safety
/// `dims` has room for three numbers, and `sample` for one.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_frame(writer: *const WavesplatWriter, dims: *mut usize, sample: *mut u32) -> i32 {
    answer(|| {
        // SAFETY: the caller's.
        let WavesplatWriter { frames, .. } = unsafe { pointed("writer", writer)? };
        // SAFETY: the caller's.
        unsafe { give("dims", dims.cast(), frames.dims)? };
        // SAFETY: the caller's.
        unsafe { give("sample", sample, number_of(frames.sample)) }
    })
}

/// Ends a file after its last frame, waits until it is whole, and frees the writer, also after an error.
///
/// # Safety
/// Do not use `writer` afterwards.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_finish(writer: *mut WavesplatWriter) -> i32 {
    // SAFETY: the caller's.
    answer(|| unsafe { taken(writer) }?.end(false))
}

/// Ends a file that shall not be finished, and frees the writer. Its finished windows stay in `path` with ".part", from which
/// `wavesplat recover` makes a file.
///
/// # Safety
/// Do not use `writer` afterwards.
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
    fn new(path: &str, frames: Frames, settings: Option<&str>, replace: bool) -> Result<Self> {
        let request = requested(settings)?;
        let path = absolute(path).map_err(|e| Error::io(path, "finding its folder", e))?;
        check_place(&path, replace)?;
        let (outgoing, incoming) = stream();
        let (to, of) = (path.clone(), frames.clone());
        let conversion = move || convert(incoming, &of, request, &to, replace);
        let conversion = Builder::new().name("wavesplat".into()).spawn(conversion);
        let conversion = conversion.map_err(|e| Error::io(&path, "starting a thread", e))?;
        let running = Some(Running { outgoing, conversion });
        Ok(Self { frames, path, running, failure: "by a bug in wavesplat".into() })
    }

    /// Gives the conversion a frame that `fill` writes.
    fn push(&mut self, fill: impl FnOnce(&Frames, &mut Vec<u8>)) -> Result<()> {
        let Running { outgoing, .. } = self.running()?;
        let mut frame = outgoing.room();
        frame.clear();
        let room = frame.try_reserve_exact(self.frames.bytes());
        room.map_err(|e| Error::io(&self.path, "copying a frame", io::Error::new(io::ErrorKind::OutOfMemory, e)))?;
        fill(&self.frames, &mut frame);
        if outgoing.send(frame) {
            return Ok(());
        }
        self.stop(false).inspect_err(|error| self.failure = error.to_string())
    }

    fn end(mut self, is_abandoned: bool) -> Result<()> {
        self.running()?;
        self.stop(is_abandoned)
    }

    fn running(&self) -> Result<&Running> {
        let failed = || Error::path(&self.path, format!("failed before: {}", self.failure));
        self.running.as_ref().ok_or_else(failed)
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

/// What the settings ask for, as far as pushed frames can have it.
fn requested(settings: Option<&str>) -> Result<ConvertRequest> {
    let settings = settings.map(str::trim).filter(|text| !text.is_empty()).unwrap_or("{}");
    let wrong = |what: String| Error::setting("settings", what);
    if !settings.starts_with('{') {
        return Err(wrong("takes an object of JSON, {...}".into()));
    }
    let request: ConvertRequest = serde_json::from_str(settings).map_err(|e| wrong(e.to_string()))?;
    if request.shard.is_some() || request.scan.is_some() || request.measures {
        return Err(wrong("`shard`, `scan` and `measures` are for files of frames".into()));
    }
    request.check().map(|()| request)
}

/// Finds out early whether a file can be written.
fn check_place(path: &Path, replace: bool) -> Result<()> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        return Err(Error::path(folder, "is no folder"));
    }
    if path.is_dir() || path.file_name().is_none() {
        return Err(Error::path(path, "is a folder"));
    }
    for taken in [path.into(), PathBuf::from(format!("{}.part", path.display()))] {
        if !replace && taken.exists() {
            return Err(Error::path(taken, "exists already; `replace` replaces it"));
        }
    }
    Ok(())
}

/// Copies the samples of a frame, x fastest.
///
/// # Safety
/// `strides` reach all samples of a frame from `first`; without strides, they follow each other.
unsafe fn copy(frames: &Frames, first: *const u8, strides: Option<[isize; 3]>, out: &mut Vec<u8>) {
    let (size, [nx, ny, nz]) = (frames.sample.size(), frames.dims);
    let row = nx * size;
    let [x, y, z] = strides.unwrap_or([size, row, row * ny].map(usize::cast_signed));
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

fn convert(incoming: Incoming, of: &Frames, mut request: ConvertRequest, path: &Path, replace: bool) -> Result<()> {
    let frames = request.config(&of.archive())?.window.saturating_add(AT_ONCE);
    let window = frames.saturating_mul(of.bytes());
    let is_usual = request.memory == memory::DEFAULT && window <= MOST_IN_MEMORY && cfg!(target_endian = "little");
    if is_usual {
        request.memory += window;
    }
    let source: Box<dyn FrameSource> = match is_usual {
        true => Box::new(InMemory::new(incoming, of, window)),
        false => streamed(incoming, of, for_reading(request.memory))?,
    };
    let if_unfinished = IfUnfinished::from_flags(replace, false);
    let done = run(Box::new(Named::new(source, of)), &request, path, replace, if_unfinished, &Silent);
    done.map(drop).map_err(|failure| failure.error)
}

/// Frames whose windows may go to a temporary file.
fn streamed(incoming: Incoming, of: &Frames, memory: usize) -> Result<Box<dyn FrameSource>> {
    let options = OpenOptions {
        dims: Some(of.dims.to_vec()),
        sample: Some(of.sample),
        big_endian: cfg!(target_endian = "big"),
        spacing: Some(of.spacing),
        origin: Some(of.origin),
        times: of.times.map(GivenTimes::Regular),
        time_unit: of.times.and(of.time_unit.clone()),
        memory,
        ..OpenOptions::default()
    };
    formats::open_named_stream("frames", incoming, &options)
}

/// Frames that are in memory besides a window: one is filled, one waits, and one is taken.
const AT_ONCE: usize = 3;
/// Bytes of a window that are taken besides the usual memory.
const MOST_IN_MEMORY: usize = 1 << 30;

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
