//! The output of a conversion, and the windows that it has already.

use super::plan::Plan;
use super::settings;
use std::path::{Path, PathBuf};
use wavesplat_core::base::description::Description;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::source::Archive;
use wavesplat_format::{CompletePrefix, Features, FileId, Window};

/// Where a conversion goes on: the complete windows of a file that more frames are added to.
#[derive(Debug)]
pub struct ResumePoint {
    /// The file's complete windows.
    pub complete: CompletePrefix,
    /// Number of the window at which the source begins. Earlier windows are not compared with the source.
    pub first_window: usize,
    /// The description of the windows before it, if there are any and the file has one.
    pub description: Option<Description>,
}

/// The output of a conversion.
#[derive(Debug)]
pub struct Target<'a, W> {
    /// What messages call it.
    pub name: &'a Path,
    /// The stream, at the end of the windows that it has already.
    pub out: W,
    /// The windows that it has already; `None` begins a file.
    pub resume_from: Option<ResumePoint>,
}

/// The windows that a file already has, and their relation to the source's frames.
#[derive(Debug, Default)]
pub(super) struct WindowsDone {
    pub(super) id: Option<FileId>,
    /// Those of the file that is continued.
    pub(super) features: Option<Features>,
    pub(super) windows: Vec<Window>,
    /// The times of their frames, if the file has times.
    pub(super) times: Vec<f64>,
    /// [`ResumePoint::first_window`]
    pub(super) first_window: usize,
    pub(super) name: PathBuf,
}

impl WindowsDone {
    pub(super) fn new(
        resume_from: Option<&ResumePoint>,
        plan: &Plan<'_>,
        archive: &Archive,
        name: &Path,
    ) -> Result<Self> {
        let Some(ResumePoint { complete, first_window, .. }) = resume_from else { return Ok(Self::default()) };
        let held = complete.metadata();
        if let Some(what) = settings::difference(&held.start(), &plan.start, *first_window == 0) {
            return Err(Error::path(name, format!("was begun with another {what}")));
        }
        if *first_window == 0 && held.start() != plan.start {
            return Err(Error::path(name, "was begun with other settings"));
        }
        let first = held.windows.get(*first_window).map_or(held.frames, |window| window.first_frame);
        let frames = held.frames.saturating_sub(first) as usize;
        if !archive.begins_with_times(held.times.get(first as usize..).unwrap_or_default(), frames) {
            return Err(Error::path(name, "was begun with other times"));
        }
        Ok(Self {
            id: Some(complete.id()),
            features: Some(complete.features()),
            windows: held.windows.clone(),
            times: held.times.clone(),
            first_window: *first_window,
            name: name.into(),
        })
    }
}
