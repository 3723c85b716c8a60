//! An archive that files are added to one after another.

use super::{FrameFiles, Series, note_once, on_grid_of_user};
use crate::base::description::Description;
use crate::base::error::{Error, Result};
use crate::source::file_header::FileHeader;
use crate::source::{OpenOptions, times};
use std::path::{Path, PathBuf};

/// Files that become an archive one after another.
#[derive(Debug)]
pub struct SeriesBuilder {
    series: Series,
    first: FileHeader,
    /// The name of the first file for messages.
    name: String,
    /// The first file that is placed otherwise than the first of all.
    placed_otherwise: Option<PathBuf>,
    /// Why the times of a file are not on the clock of the first one.
    timed_otherwise: Option<String>,
    /// What later files say of their frames.
    more: Vec<Option<Description>>,
    options: OpenOptions,
}

impl SeriesBuilder {
    /// Begins with the first of several files, or the only one.
    pub fn begin(path: &Path, header: FileHeader, is_alone: bool, options: &OpenOptions) -> Self {
        let mut first = on_grid_of_user(header, options);
        if !is_alone || first.parts.len() > 1 {
            first.stack_frames();
        }
        Self {
            series: Series::starting_with(&mut first, options),
            name: format!("the first frame ({})", path.display()),
            first,
            placed_otherwise: None,
            timed_otherwise: None,
            more: Vec::new(),
            options: options.clone(),
        }
    }

    /// Adds the next file.
    ///
    /// # Errors
    /// It is unlike the first one.
    pub fn add(&mut self, path: &Path, header: FileHeader) -> Result<()> {
        let mut file = on_grid_of_user(header, &self.options);
        let unlike = file.follows(&self.first, &self.name).map_err(|e| Error::input(path, e))?;
        if unlike.grid {
            self.placed_otherwise.get_or_insert_with(|| path.into());
        }
        if unlike.times {
            file.drop_bounds_of_times();
            if let Err(why) = times::onto_clock(&mut file, &self.first.units) {
                self.timed_otherwise.get_or_insert_with(|| format!("{} {why}", path.display()));
            }
        }
        file.stack_frames();
        self.more.push(file.description.take());
        self.series.take(&mut file);
        Ok(())
    }

    /// The frames so far, before the times of the user take the place of their own.
    pub fn so_far(&self) -> &Series {
        &self.series
    }

    /// As [`Self::so_far`], to read them.
    pub fn so_far_mut(&mut self) -> &mut Series {
        &mut self.series
    }

    /// The times of the frames so far by their `files`; empty unless each has a finite one on the clock of the first file.
    pub fn times<'a>(&'a self, files: &'a FrameFiles) -> &'a [f64] {
        let (frames, own) = (self.series.archive.frames.unwrap_or(0), &self.series.archive.times);
        let times = match (files.times.len() == frames, &self.timed_otherwise) {
            (true, _) => &files.times,
            (false, None) if own.len() == frames => own,
            _ => return &[],
        };
        if times.iter().all(|time| time.is_finite()) { times } else { &[] }
    }

    /// The archive of `files`, which were added.
    ///
    /// # Errors
    /// Options of the user that do not fit it.
    pub fn finish(mut self, files: &FrameFiles) -> Result<Series> {
        if let Some(path) = self.placed_otherwise {
            let what = "the spacing and origin are those of the first file";
            note_once(&mut self.series.archive.notes, format!("{what}; {} has others", path.display()));
        }
        self.series.describe_more(self.more);
        self.series.finish(files, self.timed_otherwise, &self.options)
    }
}
