//! Frames of a run that goes on: files as they appear, in a folder, by a pattern or in a list; or one file that grows.

use super::inputs::{Expanded, expand, is_empty, is_list, is_pattern};
use super::{by_name, describe_frame, npy, open_files, open_series, stream};
use crate::zarr::metadata_file;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::{iter, slice};
use wavesplat_core::base::description::{Description, extended};
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::output::STANDARD;
use wavesplat_core::source::file_header::FileHeader;
use wavesplat_core::source::follow::{Follow, FollowedReader, GrowingFile, NamedPipe, wait_for};
use wavesplat_core::source::series::{FrameFiles, SeriesBuilder, check_grid};
use wavesplat_core::source::{Archive, Extent, FrameSource, FrameWindow, OpenOptions, times};

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
    let is_there = |_| Ok((only.exists() || is_pattern(only)).then_some(()));
    if wait_for(follow, is_there)?.is_none() {
        return Err(Error::path(only, "was not there when the run ended"));
    }
    if metadata_file(only).is_some() {
        return Err(Error::path(only, "is a Zarr store, which can be read once the run has ended"));
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
            let finder = Finder::new(only, options, follow);
            wait_for(follow, |is_over| {
                finder.look(is_over, |mut files| Ok(files.drain(..).next().map(|(path, _)| path)))
            })
        }
        _ => Ok(None),
    }
}

/// Whether an input stands for several files.
fn has_files(input: &Path) -> bool {
    input.is_dir() || !input.exists() || is_list(input)
}

/// A file of raw frames or an `.npy` file that grows, or a named pipe. One that says how many frames it has may have its full length before
/// they are written, so it is read once the run has ended.
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
    let is_file = path.is_file();
    let reader: Box<dyn Read + Send> = match is_file {
        true => Box::new(GrowingFile(File::open(path).map_err(|e| Error::io(path, "opening", e))?)),
        false => Box::new(NamedPipe::open(path.into())),
    };
    let stream = stream::Stream::open(path, FollowedReader::new(reader, follow.clone()), options)?;
    if !is_file || stream.archive().frames.is_none() {
        return Ok(Box::new(stream));
    }
    wait_for(follow, |is_over| {
        follow.is_complete(path, is_over); // a change is no silence
        Ok(None::<()>)
    })?;
    open_files(&[path.into()], options)
}

/// A complete file, and its time in a list of files.
type Complete = (PathBuf, Option<f64>);

/// A complete file whose header was read.
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
    follow: Follow,
    /// The files that were found.
    files: FrameFiles,
}

impl Finder {
    fn new(input: &Path, options: &OpenOptions, follow: &Follow) -> Self {
        let (options, files) = (options.clone(), FrameFiles::default());
        Self { input: input.into(), options, follow: follow.clone(), files }
    }

    /// Waits for complete files; none if the run has ended.
    fn next(&mut self) -> Result<Vec<Found>> {
        let look = |is_over| self.look(is_over, |new| self.read(new));
        let found = wait_for(&self.follow, look)?.unwrap_or_default();
        if found.is_empty() {
            self.follow.end_with(self.files.paths.len());
        }
        for Found { path, time, .. } in &found {
            self.files.paths.push(path.clone());
            self.files.times.extend(time);
        }
        Ok(found)
    }

    /// The result of `read` for the files that have become complete. What cannot be read may be incomplete until the run ends.
    fn look<T>(&self, is_over: bool, read: impl Fn(Vec<Complete>) -> Result<Option<T>>) -> Result<Option<T>> {
        if self.files.paths.is_empty() && is_empty(&self.input, &self.options) {
            return Ok(None);
        }
        match self.complete_files(is_over).and_then(read) {
            Err(error) if !is_over && !matches!(error, Error::Changed { .. }) => {
                self.follow.note_error(&error.to_string());
                Ok(None)
            }
            found => found,
        }
    }

    /// The complete files after those that were found, in order, with the times of a list.
    fn complete_files(&self, is_over: bool) -> Result<Vec<Complete>> {
        let Expanded { files: all, planes } = expand(slice::from_ref(&self.input), &self.options)?;
        let known = &self.files;
        if planes.is_some() {
            return Err(Error::setting("follow", "takes files of whole frames, and these hold a plane each"));
        }
        if !all.paths.starts_with(&known.paths) {
            let what = "files that were read are gone, or new ones come before them in order";
            return Err(Error::changed(&self.input, what));
        }
        if !all.times.starts_with(&known.times) {
            return Err(Error::changed(&self.input, "gives other times to frames that were read"));
        }
        if !known.paths.is_empty() && known.times.is_empty() != all.times.is_empty() {
            return Err(Error::changed(&self.input, "a list of its files has come or gone; give that as the input"));
        }
        let times = all.times.into_iter().map(Some).chain(iter::repeat(None));
        let most = self.follow.ended_with().unwrap_or(usize::MAX);
        let new = all.paths.into_iter().zip(times).take(most).skip(known.paths.len());
        // All are looked at, so that each is known to stay the same from now on.
        let are_complete = new.map(|file| (self.follow.is_complete(&file.0, is_over), file)).collect::<Vec<_>>();
        Ok(are_complete.into_iter().take_while(|(is_complete, _)| *is_complete).map(|(_, file)| file).collect())
    }

    /// Reads the headers of files up to one that cannot be read; an error if that is the first.
    fn read(&self, files: Vec<Complete>) -> Result<Option<Vec<Found>>> {
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
        Ok(Some(found).filter(|found| !found.is_empty()))
    }
}

/// Frames in files that appear one after another.
struct Followed {
    finder: Finder,
    frames: FramesSoFar,
    /// The archive. Its number of frames is known once the run has ended.
    archive: Archive,
}

/// The frames that were found.
enum FramesSoFar {
    Growing(Box<SeriesBuilder>),
    /// The run has ended.
    Whole(Box<dyn FrameSource>),
}

impl Followed {
    /// Waits for the first complete file.
    fn begin(input: &Path, options: &OpenOptions, follow: &Follow) -> Result<Self> {
        let mut finder = Finder::new(input, options, follow);
        let mut found = finder.next()?.into_iter();
        let Some(Found { path, header, .. }) = found.next() else {
            return Err(Error::path(&finder.input, "had no complete frame when the run ended"));
        };
        let mut series = SeriesBuilder::begin(&path, header, false, &finder.options);
        check_grid(&series.so_far().archive().grid, &finder.options, &path)?;
        found.try_for_each(|Found { path, header, .. }| series.add(&path, header))?;
        let times = series.times(&finder.files).to_vec();
        let mut archive = Archive { frames: None, times, ..series.so_far().archive().clone() };
        times::settle(&mut archive, &finder.options)?;
        Ok(Self { finder, frames: FramesSoFar::Growing(Box::new(series)), archive })
    }

    /// Waits until there are `frames` frames, or the run has ended. Returns how many there are.
    fn wait_for(&mut self, frames: usize) -> Result<usize> {
        loop {
            let FramesSoFar::Growing(series) = &mut self.frames else { return Ok(self.archive.frames.unwrap_or(0)) };
            let count = series.so_far().archive().frames.unwrap_or(0);
            if count >= frames {
                return Ok(count);
            }
            let found = self.finder.next()?;
            if found.is_empty() {
                let whole = self.finder.whole(series)?;
                self.archive = described(whole.archive().clone(), self.archive.description.take());
                self.frames = FramesSoFar::Whole(whole);
                continue;
            }
            found.into_iter().try_for_each(|Found { path, header, .. }| series.add(&path, header))?;
            self.finder.take_times(series, &mut self.archive)?;
        }
    }
}

impl Finder {
    /// All frames of the run that has ended, which are those that were found.
    fn whole(&self, found: &SeriesBuilder) -> Result<Box<dyn FrameSource>> {
        found.so_far().check_unchanged()?;
        let notes = expand(slice::from_ref(&self.input), &self.options).map(|all| all.files.notes);
        let FrameFiles { paths, times, .. } = self.files.clone();
        Ok(Box::new(open_series(&FrameFiles { paths, times, notes: notes.unwrap_or_default() }, &self.options)?))
    }

    /// Takes the times of new frames, unless the user gives times or the first frames have none.
    fn take_times(&self, series: &SeriesBuilder, archive: &mut Archive) -> Result<()> {
        if archive.times.is_empty() || archive.regular_times.is_some() {
            return Ok(());
        }
        let times = series.times(&self.files);
        if times.is_empty() {
            let what = "not all of the new files have a time on the clock of the first one";
            return Err(Error::input(&self.input, Note::with(what, Remedy::Set("times"))));
        }
        archive.times = times.to_vec();
        Ok(())
    }
}

/// An archive with a description if its `first` frames have one: files begin with whether there is one.
fn described(whole: Archive, first: Option<Description>) -> Archive {
    let frames = whole.frames.unwrap_or(0) as u64;
    let description = first.map(|first| whole.description.clone().unwrap_or_else(|| extended(first, frames).0));
    Archive { description, ..whole }
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
        let frames = self.wait_for(end)?;
        let (first, count) = (first.min(frames), count.min(frames.saturating_sub(first).div_ceil(step)));
        match &mut self.frames {
            FramesSoFar::Growing(series) => series.so_far_mut().window_of(first, count, step),
            FramesSoFar::Whole(whole) => whole.window_of(first, count, step),
        }
    }
}
