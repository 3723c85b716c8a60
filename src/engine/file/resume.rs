//! Resumes a file that a killed run left as `NAME.part`, or appends windows to a finished file.
//!
//! Both continue after the whole windows at the beginning of `NAME.part`. The windows of a finished file are copied
//! there first, so that the finished file stays unchanged until its successor takes its name.

use crate::file::CoefficientFile;
use std::io::{self, Read};
use std::path::Path;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::files;
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::output::{Output, part_of};
use wavesplat_core::source::scan::scan;
use wavesplat_core::source::{Archive, FrameSource};
use wavesplat_format::{CompletePrefix, Error as FormatError, Window};

/// What to do with the complete windows of an unfinished run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IfUnfinished {
    /// They are an error, so that they are neither overwritten nor continued by mistake.
    Fail,
    /// They are overwritten.
    Discard,
    /// The run continues after them.
    Resume,
}

impl IfUnfinished {
    /// The choice of the options `resume` and `force`.
    pub fn from_flags(force: bool, resume: bool) -> Self {
        match (resume, force) {
            (true, _) => Self::Resume,
            (false, true) => Self::Discard,
            (false, false) => Self::Fail,
        }
    }

    /// The whole windows of an unfinished file, if they matter.
    fn windows(self, part: &Path) -> Result<Option<CompletePrefix>> {
        if self == Self::Discard { Ok(None) } else { whole_windows(part) }
    }

    /// Returns the finished windows to continue from.
    fn choose(self, held: Option<CompletePrefix>, part: &Path) -> Result<Option<CompletePrefix>> {
        match (self, held) {
            (Self::Resume, held) => Ok(held),
            (Self::Fail, Some(held)) => {
                let what = format!("holds {} frames of a run that was not finished", held.metadata().frames);
                Err(Error::path(part, Note::with(what, Remedy::ResumeOrBeginAnew)))
            }
            (Self::Discard | Self::Fail, _) => Ok(None),
        }
    }
}

/// Opens the output file and reads the windows an earlier run finished. With `replace`, a file of that name is replaced
/// once the output is complete.
pub fn open(path: &Path, replace: bool, if_unfinished: IfUnfinished) -> Result<(Output, Option<CompletePrefix>)> {
    let mut out = Output::resumable(path, replace)?;
    let Some(part) = out.part() else {
        return match if_unfinished {
            IfUnfinished::Resume => Err(Error::setting("resume", "takes a file to write to, not a pipe or a device")),
            _ => Ok((out, None)),
        };
    };
    let held = if_unfinished.choose(if_unfinished.windows(part)?, part)?;
    out.begin_at(held.as_ref().map_or(0, CompletePrefix::bytes))?;
    Ok((out, held))
}

/// Whether an earlier run left an unfinished file that would become `path`.
pub fn is_begun(path: &Path) -> bool {
    part_of(path).exists()
}

/// Opens the successor of a finished file, which begins with all of its windows. Returns the windows to continue from:
/// the finished file's, or also those that an earlier run appended.
pub fn open_successor(file: &CoefficientFile, if_unfinished: IfUnfinished) -> Result<(Output, CompletePrefix)> {
    let (path, own) = (file.path(), file.whole_windows()?);
    let mut out = Output::resumable(path, true)?;
    file.check_unchanged()?; // before it was locked it may have been replaced
    let Some(part) = out.part() else { return Err(Error::input(path, "not a regular file")) };
    let part = part.to_path_buf();
    let held = if_unfinished.windows(&part)?;
    let is_copy = held.as_ref().is_some_and(|held| goes_on(&own, held)); // killed while it was copied
    match if_unfinished.choose(held.filter(|_| !is_copy), &part)? {
        Some(held) if goes_on(&held, &own) => {
            out.begin_at(held.bytes())?;
            Ok((out, held))
        }
        Some(_) => Err(Error::path(part, Note::with("is of another file", Remedy::BeginAnew))),
        None => {
            out.begin_at(0)?;
            let mut start = files::open(path)?.take(own.bytes());
            io::copy(&mut start, &mut out).map_err(|e| Error::io(&part, "copying", e))?;
            Ok((out, own))
        }
    }
}

/// Whether `all` has the id of `first` and begins with its windows.
fn goes_on(all: &CompletePrefix, first: &CompletePrefix) -> bool {
    all.id() == first.id() && all.metadata().windows.starts_with(&first.metadata().windows)
}

/// The whole windows at the beginning of a file; none if there is not even one.
fn whole_windows(part: &Path) -> Result<Option<CompletePrefix>> {
    match CompletePrefix::read(&FileBytes::open(part, Access::Read)?) {
        Ok(held) => Ok(Some(held).filter(|held| held.metadata().frames > 0)),
        Err(FormatError::Io(e)) => Err(Error::io(part, "reading", e)),
        Err(FormatError::Foreign(_)) if part.metadata().is_ok_and(|m| m.len() > 0) => {
            Err(Error::path(part, Note::with("is in the way, and not an unfinished conversion", Remedy::Replace)))
        }
        Err(_) => Ok(None),
    }
}

/// Checks every checksum of the written file, before it gets its name.
pub fn check(part: &Path) -> Result<()> {
    CoefficientFile::open_with(part, Access::Read)?.check_stored()
}

/// Whether a finished file is the result of converting these frames, judged by its settings, the number of frames and
/// the times.
pub fn is_complete(path: &Path, like: &wavesplat_format::Metadata, archive: &Archive) -> Result<bool> {
    let file = CoefficientFile::open_with(path, Access::Read)?;
    let is_long = archive.frames.is_none_or(|frames| frames == file.frames());
    let has_times = archive.begins_with_times(&file.metadata().times, file.frames());
    Ok(is_long && file.metadata().start() == *like && has_times)
}

/// Whether a file ends with windows of exactly the frames of `source`, judged by their digests. False if the source
/// does not know its number of frames.
pub fn ends_with(file: &CoefficientFile, source: &mut dyn FrameSource) -> Result<bool> {
    let Some(frames) = source.archive().frames else { return Ok(false) };
    let windows = &file.metadata().windows;
    let first = windows.iter().position(|w| w.first_frame as usize + frames == file.frames());
    first.map_or(Ok(false), |first| is_of(&windows[first..], file, source))
}

/// Whether the first frames of `source` are just those of a file's first window, by its digest.
pub fn begins_with(file: &CoefficientFile, source: &mut dyn FrameSource) -> Result<bool> {
    is_of(&file.metadata().windows[..1], file, source)
}

/// Whether the first frames of `source` are those of some windows.
fn is_of(windows: &[Window], file: &CoefficientFile, source: &mut dyn FrameSource) -> Result<bool> {
    let Archive { grid, sample, frames, .. } = source.archive().clone();
    let (of_source, missing_value) = file.of_source();
    let needed: usize = windows.iter().map(|window| window.frames as usize).sum();
    if (grid.dims, sample) != (file.grid.dims, of_source) || frames.is_some_and(|frames| frames < needed) {
        return Ok(false);
    }
    let mut at = 0;
    for known in windows {
        let window = source.window(at, known.frames as usize)?;
        at += known.frames as usize;
        if scan(window.as_ref(), &grid, sample, missing_value)?.digest != known.digest {
            return Ok(false);
        }
    }
    Ok(true)
}
