//! The conversion of pushed frames, which goes on in a thread of its own.

use crate::frames::Frames;
use crate::incoming::{InMemory, Incoming};
use std::path::{Path, PathBuf};
use std::sync::mpsc::Receiver;
use wavesplat::base::memory::{self, for_reading};
use wavesplat::base::progress::Silent;
use wavesplat::convert::{ConvertRequest, run};
use wavesplat::file::resume::IfUnfinished;
use wavesplat::formats;
use wavesplat::source::{Archive, FrameSource, FrameWindow, OpenOptions};
use wavesplat::{Error, Result};

/// What the settings ask for, as far as pushed frames can have it.
pub(crate) fn requested(settings: Option<&str>) -> Result<ConvertRequest> {
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
pub(crate) fn check_place(path: &Path, replace: bool) -> Result<()> {
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

/// Converts the frames that come, which may have times of their own, until they end.
pub(crate) fn convert(
    incoming: Incoming,
    times: Receiver<f64>,
    of: &Frames,
    mut request: ConvertRequest,
    path: &Path,
    replace: bool,
) -> Result<()> {
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
    let done = run(Box::new(Described::new(source, times, of)), &request, path, replace, if_unfinished, &Silent);
    done.map(drop).map_err(|failure| failure.error)
}

/// Frames whose windows may go to a temporary file.
fn streamed(incoming: Incoming, of: &Frames, memory: usize) -> Result<Box<dyn FrameSource>> {
    let options = OpenOptions {
        dims: Some(of.grid.dims.to_vec()),
        sample: Some(of.sample),
        big_endian: cfg!(target_endian = "big"),
        spacing: Some(of.grid.spacing),
        origin: Some(of.grid.origin),
        memory,
        ..OpenOptions::default()
    };
    formats::open_named_stream("frames", incoming, &options)
}

/// Frames that are in memory besides a window: one is filled, one waits, and one is taken.
const AT_ONCE: usize = 3;
/// Bytes of a window that are taken besides the usual memory.
const MOST_IN_MEMORY: usize = 1 << 30;

/// Frames with all that the caller says of them.
struct Described {
    stream: Box<dyn FrameSource>,
    times: Receiver<f64>,
    of: Frames,
    archive: Archive,
}

impl Described {
    fn new(stream: Box<dyn FrameSource>, times: Receiver<f64>, of: &Frames) -> Self {
        let Archive { memory, .. } = *stream.archive();
        Self { stream, times, of: of.clone(), archive: Archive { memory, ..of.archive() } }
    }
}

impl FrameSource for Described {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        let window = self.stream.window(first, count)?;
        let (frames, known) = (first + window.frames(), self.archive.times.len());
        self.archive.times.extend(self.times.try_iter().take(frames.saturating_sub(known)));
        self.archive.description = self.of.described(frames);
        Ok(window)
    }
}
