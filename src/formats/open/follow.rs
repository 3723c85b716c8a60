//! Frames of a run that goes on: files as they appear, in a folder, by a pattern or in a list; or one file that grows.

use super::inputs::{Expanded, expand, is_empty, is_pattern};
use super::{by_name, describe_frame, npy, stream};
use crate::format::Reader;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};
use std::{iter, slice};
use wavesplat_core::base::description::extended;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::output::STANDARD;
use wavesplat_core::source::file_header::FileHeader;
use wavesplat_core::source::follow::{Follow, FollowedReader, Watch};
use wavesplat_core::source::series::{FrameFiles, Series, SeriesBuilder};
use wavesplat_core::source::{Archive, Extent, FrameSource, FrameWindow, OpenOptions, times};

/// What cannot be read may be incomplete. It is an error if it has stayed the same for so long, or the run has ended.
const PATIENCE: Duration = Duration::from_secs(60);

/// Opens what a run writes. Waits for the first frame.
///
/// # Errors
/// Those of [`open`](super::open()); also inputs that cannot be read while they are written, and a run that ends without a frame.
pub(super) fn open(inputs: &[PathBuf], options: &OpenOptions, follow: &Follow) -> Result<Box<dyn FrameSource>> {
    let [only] = inputs else {
        return Err(Error::setting("follow", "takes one folder, pattern in quotes, list of files, or file that grows"));
    };
    if only == Path::new(STANDARD) {
        return Err(Error::setting("follow", "is for files: standard input ends with the program that writes it"));
    }
    if !options.magnitude.is_empty() {
        return Err(Error::setting("magnitude", "is for runs that have ended"));
    }
    let mut watch = Watch::new(follow.end.clone());
    let is_there = |_| Ok((only.exists() || is_pattern(only)).then_some(()));
    if watch.wait_for(is_there)?.is_none() {
        return Err(Error::path(only, "was not there when the run ended"));
    }
    if !has_files(only) {
        return growing(only, options, follow);
    }
    Ok(Box::new(Followed::begin(only, options, follow)?))
}

/// The first file that a run writes, if it writes several.
pub(super) fn first_file(inputs: &[PathBuf], options: &OpenOptions, follow: &Follow) -> Result<Option<PathBuf>> {
    match inputs {
        [only] if has_files(only) => {
            let source = Followed::begin(only, options, follow)?;
            Ok(source.finder.files.paths.into_iter().next())
        }
        _ => Ok(None),
    }
}

/// Whether an input stands for several files.
fn has_files(input: &Path) -> bool {
    let is_list = by_name(input).is_some_and(|format| matches!(format.reader, Reader::List(_)));
    input.is_dir() || !input.exists() || is_list
}

/// A file of raw frames or an `.npy` file that grows, or a named pipe.
fn growing(path: &Path, options: &OpenOptions, follow: &Follow) -> Result<Box<dyn FrameSource>> {
    let is_stream = match by_name(path) {
        Some(format) => format.is(&npy::FORMAT),
        None => options.dims.is_some(),
    };
    if !is_stream {
        let what =
            "cannot be read while it grows: raw frames, one .npy file, a pipe of either, or a folder of frames can";
        return Err(Error::path(path, what));
    }
    let file = File::open(path).map_err(|e| Error::io(path, "opening", e))?;
    Ok(Box::new(stream::Stream::open(path, FollowedReader::new(file, follow.end.clone()), options)?))
}

/// A complete file that was found.
struct Found {
    path: PathBuf,
    /// Its time in a list of files.
    time: Option<f64>,
    header: FileHeader,
}

/// Finds files as a run completes them.
struct Finder {
    input: PathBuf,
    options: OpenOptions,
    watch: Option<Watch>,
    /// The files that were found.
    files: FrameFiles,
    follow: Follow,
    /// Since when the input cannot be read.
    unreadable: Option<Instant>,
}

impl Finder {
    /// Waits for complete files; none if the run has ended.
    fn next(&mut self) -> Result<Vec<Found>> {
        let Some(mut watch) = self.watch.take() else { return Ok(Vec::new()) };
        let found = watch.wait_for(|is_over| self.look(is_over))?.unwrap_or_default();
        self.watch = Some(watch).filter(|_| !found.is_empty());
        for Found { path, time, .. } in &found {
            self.files.paths.push(path.clone());
            self.files.times.extend(time);
        }
        Ok(found)
    }

    /// The files that have become complete, if there are some. What cannot be read may be incomplete.
    fn look(&mut self, is_over: bool) -> Result<Option<Vec<Found>>> {
        if self.files.paths.is_empty() && is_empty(&self.input, &self.options) {
            return Ok(None);
        }
        let error = match self.complete_files(is_over).and_then(|new| self.read(new)) {
            Ok(found) => {
                self.unreadable = None;
                return Ok(Some(found).filter(|found| !found.is_empty()));
            }
            Err(error) => error,
        };
        let since = *self.unreadable.get_or_insert_with(Instant::now);
        let is_lasting = is_over || since.elapsed() >= PATIENCE || matches!(error, Error::Changed { .. });
        if is_lasting { Err(error) } else { Ok(None) }
    }

    /// The complete files after those that were found, in order, with the times of a list.
    fn complete_files(&mut self, is_over: bool) -> Result<Vec<(PathBuf, Option<f64>)>> {
        let Expanded { files: all, planes } = expand(slice::from_ref(&self.input), &self.options)?;
        if planes.is_some() {
            return Err(Error::setting("follow", "takes files of whole frames, and these hold a plane each"));
        }
        if !all.paths.starts_with(&self.files.paths) {
            let what = "files that were read are gone, or new ones come before them in order";
            return Err(Error::changed(&self.input, what));
        }
        let times = all.times.into_iter().map(Some).chain(iter::repeat(None));
        let new = all.paths.into_iter().zip(times).skip(self.files.paths.len());
        Ok(new.take_while(|(path, _)| is_over || self.follow.is_settled(path)).collect())
    }

    /// Reads the headers of files up to one that cannot be read; an error if that is the first.
    fn read(&self, files: Vec<(PathBuf, Option<f64>)>) -> Result<Vec<Found>> {
        let mut found = Vec::new();
        for (path, time) in files {
            let is_first = self.files.paths.is_empty() && found.is_empty();
            let extent = if is_first { Extent::Whole } else { Extent::AlongTime };
            match describe_frame(&path, &self.options, extent) {
                Ok(header) => found.push(Found { path, time, header }),
                Err(error) if found.is_empty() => return Err(error),
                Err(_) => break,
            }
        }
        Ok(found)
    }
}

/// Frames in files that appear one after another.
struct Followed {
    finder: Finder,
    /// What was found, until the run has ended.
    so_far: Option<SeriesBuilder>,
    /// All frames, once the run has ended.
    whole: Option<Series>,
    /// The archive. Its number of frames is known once the run has ended.
    archive: Archive,
}

impl Followed {
    /// Waits for the first complete file.
    fn begin(input: &Path, options: &OpenOptions, follow: &Follow) -> Result<Self> {
        let options = OpenOptions { follow: None, ..options.clone() };
        let (watch, files) = (Some(Watch::new(follow.end.clone())), FrameFiles::default());
        let mut finder =
            Finder { input: input.into(), options, follow: follow.clone(), watch, files, unreadable: None };
        let mut found = finder.next()?.into_iter();
        let Some(Found { path, header, .. }) = found.next() else {
            return Err(Error::path(&finder.input, "had no complete frame when the run ended"));
        };
        let mut series = SeriesBuilder::begin(&path, header, false, &finder.options);
        found.try_for_each(|Found { path, header, .. }| series.add(&path, header))?;
        let times = series.times(&finder.files).to_vec();
        let mut archive = Archive { frames: None, times, ..series.so_far().archive().clone() };
        times::settle(&mut archive, &finder.options)?;
        Ok(Self { finder, so_far: Some(series), whole: None, archive })
    }

    /// The number of frames that were found.
    fn frames(&self) -> usize {
        let series = self.so_far.as_ref().map(SeriesBuilder::so_far).or(self.whole.as_ref());
        series.and_then(|series| series.archive().frames).unwrap_or(0)
    }

    /// Waits for more frames, or for the end of the run.
    fn grow(&mut self) -> Result<()> {
        let Some(mut series) = self.so_far.take() else { return Ok(()) };
        let found = self.finder.next()?;
        if found.is_empty() {
            let whole = series.finish(&self.finder.files)?;
            let first = self.archive.description.take();
            self.archive = whole.archive().clone();
            if let (None, Some(first)) = (&self.archive.description, first) {
                self.archive.description = Some(extended(first, whole.archive().frames.unwrap_or(0) as u64).0);
            }
            self.whole = Some(whole);
            return Ok(());
        }
        found.into_iter().try_for_each(|Found { path, header, .. }| series.add(&path, header))?;
        self.take_times(&series)?;
        self.so_far = Some(series);
        Ok(())
    }

    /// Takes the times of new frames, unless the user gives times or the first frames have none.
    fn take_times(&mut self, series: &SeriesBuilder) -> Result<()> {
        if self.archive.times.is_empty() || self.archive.regular_times.is_some() {
            return Ok(());
        }
        let times = series.times(&self.finder.files);
        if times.is_empty() {
            let what = "not all of the new files have a time on the clock of the first one";
            return Err(Error::input(&self.finder.input, Note::with(what, Remedy::Set("times"))));
        }
        self.archive.times = times.to_vec();
        Ok(())
    }
}

impl FrameSource for Followed {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        self.window_of(first, count, 1)
    }

    fn window_of(&mut self, first: usize, count: usize, step: usize) -> Result<Box<dyn FrameWindow>> {
        let end = first.saturating_add(count.saturating_sub(1).saturating_mul(step)).saturating_add(1);
        while self.whole.is_none() && self.frames() < end {
            self.grow()?;
        }
        let count = count.min(self.frames().saturating_sub(first).div_ceil(step));
        let series = self.so_far.as_mut().map(SeriesBuilder::so_far_mut).or(self.whole.as_mut());
        let Some(series) = series else { return Err(Error::path(&self.finder.input, "could not be followed")) };
        series.window_of(first.min(self.archive.frames.unwrap_or(first)), count, step)
    }
}
