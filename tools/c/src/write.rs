//! Frames that a running program pushes into a file.
#![allow(unsafe_code)]

use crate::conversion::{check_place, convert, requested};
use crate::frames::{Frames, WavesplatFrames, number_of};
use crate::incoming::{FrameMemory, Outgoing, stream};
use crate::status::answer;
use crate::text::{give, optional, pointed, pointed_mut, required};
use std::collections::HashSet;
use std::ffi::{c_char, c_void};
use std::path::{PathBuf, absolute};
use std::ptr::null_mut;
use std::thread::{Builder, JoinHandle};
use wavesplat::{Error, Result};

/// A file that is being written.
pub struct WavesplatWriter {
    frames: Frames,
    path: PathBuf,
    /// Memory that the caller fills for the next frame.
    room: Option<FrameMemory>,
    /// All such memory that was given, which stays with the writer.
    given: HashSet<usize>,
    last: LastFrame,
    /// None after an error.
    running: Option<Running>,
    /// That error.
    failure: String,
}

/// The frame that was pushed last.
#[derive(Debug, Clone, Copy)]
enum LastFrame {
    None,
    Untimed,
    At(f64),
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

/// Adds a frame, and returns as soon as the conversion can take it. The frame is copied, unless it is in memory of `wavesplat_room`.
///
/// `strides` are the bytes from a sample to the next along x, y and z; null if they follow each other, x fastest. Frames are
/// converted later, a window (usually 32) at a time: an error may be about an earlier frame. After such an error the file cannot be
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
    // SAFETY: the caller's.
    answer(|| unsafe { push(writer, None, samples, strides) })
}

/// As `wavesplat_push`, for a frame with a time of its own, after that of the frame before. Either all frames have one, or none.
///
/// # Safety
/// `samples` and `strides` are as for `wavesplat_push`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_push_at(
    writer: *mut WavesplatWriter,
    time: f64,
    samples: *const c_void,
    strides: *const isize,
) -> i32 {
    // SAFETY: the caller's.
    answer(|| unsafe { push(writer, Some(time), samples, strides) })
}

/// Gives memory of the library for the next frame, aligned for any sample. It is pushed without a copy: write all samples, x fastest,
/// and push `samples` with null for `strides`. Do not use it after a push that succeeds, or after an error of the conversion.
///
/// # Safety
/// `samples` receives the memory, or null after an error.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn wavesplat_room(writer: *mut WavesplatWriter, samples: *mut *mut c_void) -> i32 {
    answer(|| {
        // SAFETY: the caller's.
        unsafe { give("samples", samples, null_mut()) }?;
        // SAFETY: the caller's.
        let room = unsafe { pointed_mut("writer", writer) }?.room()?;
        // SAFETY: the caller's.
        unsafe { give("samples", samples, room.cast()) }
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
        unsafe { give("dims", dims.cast(), frames.grid.dims)? };
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
        let (outgoing, incoming, times) = stream();
        let (to, of) = (path.clone(), frames.clone());
        let conversion = move || convert(incoming, times, &of, request, &to, replace);
        let conversion = Builder::new().name("wavesplat".into()).spawn(conversion);
        let conversion = conversion.map_err(|e| Error::io(&path, "starting a thread", e))?;
        let running = Some(Running { outgoing, conversion });
        Ok(Self {
            frames,
            path,
            room: None,
            given: HashSet::new(),
            last: LastFrame::None,
            running,
            failure: "by a bug in wavesplat".into(),
        })
    }

    /// Gives the conversion a frame.
    fn push(&mut self, frame: FrameMemory, time: Option<f64>) -> Result<()> {
        if self.running()?.outgoing.send(frame, time) {
            self.last = time.map_or(LastFrame::Untimed, LastFrame::At);
            return Ok(());
        }
        self.stop(false).inspect_err(|error| self.failure = error.to_string())
    }

    /// Refuses a time that does not follow that of the frame before.
    fn check_time(&self, time: Option<f64>) -> Result<()> {
        let what = match (time, self.last) {
            (Some(_), _) if self.frames.times.is_some() => {
                "frames have a `time_step`, so none has a time of its own".into()
            }
            (Some(time), _) if !time.is_finite() => format!("{time} is not finite"),
            (Some(time), LastFrame::At(last)) if time <= last => {
                format!("{time} is not after {last}, that of the frame before")
            }
            (Some(_), LastFrame::Untimed) => "the frames before have none".into(),
            (None, LastFrame::At(_)) => "the frames before have one each, so this one needs one".into(),
            _ => return Ok(()),
        };
        Err(Error::setting("time", what))
    }

    /// Memory for a frame.
    fn memory(&self) -> Result<FrameMemory> {
        let memory = self.running()?.outgoing.room(self.frames.bytes());
        memory.map_err(|e| Error::io(&self.path, "taking memory for a frame", e))
    }

    /// The address of the memory that the caller fills for the next frame.
    fn room(&mut self) -> Result<*mut u8> {
        let room = self.room.take().map_or_else(|| self.memory(), Ok)?;
        let first = self.room.insert(room).as_mut_ptr();
        self.given.insert(first.addr());
        Ok(first)
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

/// Pushes a frame: memory of the library as it is, other samples as a copy.
///
/// # Safety
/// As of [`wavesplat_push`].
unsafe fn push(
    writer: *mut WavesplatWriter,
    time: Option<f64>,
    samples: *const c_void,
    strides: *const isize,
) -> Result<()> {
    // SAFETY: the caller's.
    let (writer, first) = unsafe { (pointed_mut("writer", writer)?, pointed("samples", samples.cast::<u8>())?) };
    writer.check_time(time)?;
    let is_here = |room: &FrameMemory| std::ptr::eq(room.as_ptr(), first);
    if let Some(room) = writer.room.take_if(|room| strides.is_null() && is_here(room)) {
        return writer.push(room, time);
    }
    if writer.given.contains(&std::ptr::from_ref(first).addr()) && !writer.room.as_ref().is_some_and(is_here) {
        return Err(Error::setting("samples", "is memory that was pushed before; ask wavesplat_room for more"));
    }
    let strides = (!strides.is_null()).then_some(strides.cast::<[isize; 3]>());
    // SAFETY: the caller's.
    let strides = strides.map(|strides| unsafe { strides.read_unaligned() });
    let mut frame = writer.memory()?;
    // SAFETY: the caller's.
    unsafe { copy(&writer.frames, first, strides, &mut frame) };
    writer.push(frame, time)
}

/// Copies the samples of a frame, x fastest.
///
/// # Safety
/// `strides` reach all samples of a frame from `first`; without strides, they follow each other.
unsafe fn copy(frames: &Frames, first: *const u8, strides: Option<[isize; 3]>, out: &mut [u8]) {
    let (size, [nx, ny, _]) = (frames.sample.size(), frames.grid.dims);
    let row = nx * size;
    let together = [size, row, row * ny].map(usize::cast_signed);
    let [x, y, z] = strides.unwrap_or(together);
    // SAFETY: the caller's.
    let read = |at: isize, out: &mut [u8]| unsafe {
        out.copy_from_slice(std::slice::from_raw_parts(first.offset(at), out.len()));
    };
    if [x, y, z] == together {
        return read(0, out);
    }
    for (n, out) in out.chunks_exact_mut(row).enumerate() {
        let start = (n % ny).cast_signed() * y + (n / ny).cast_signed() * z;
        match x == together[0] {
            true => read(start, out),
            false => (0..).zip(out.chunks_exact_mut(size)).for_each(|(i, out)| read(start + i * x, out)),
        }
    }
}
