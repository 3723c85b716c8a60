//! A merge with a file as its output, resumed or started anew.

use super::{MergeReport, Part, Shards};
use crate::file::CoefficientFile;
use crate::file::resume::{self, IfUnfinished};
use std::path::Path;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::mapped::Access;
use wavesplat_core::base::progress::Progress;

/// The result of a merge into a file.
#[derive(Debug)]
pub struct Merged {
    /// What is in the file.
    pub report: MergeReport,
    /// Whether the run that is to be resumed had completed the file, so that nothing was left to do.
    pub was_complete: bool,
}

impl Shards {
    /// Merges into the file `path`, which gets its name when it is complete. With `replace`, a file of that name is
    /// replaced then.
    ///
    /// # Errors
    /// Those of [`Shards::merge`]; also an error if `path` exists, or is complete but of other shards, or if
    /// `if_unfinished` says so.
    pub fn merge_to_file(
        &self,
        path: &Path,
        replace: bool,
        if_unfinished: IfUnfinished,
        skip_damaged: bool,
        progress: &dyn Progress,
    ) -> Result<Merged> {
        if if_unfinished == IfUnfinished::Resume && !replace && path.is_file() {
            return Ok(Merged { report: self.report_of(path)?, was_complete: true });
        }
        let (mut out, begun) = resume::open(path, replace, if_unfinished)?;
        let report = self.merge(begun, skip_damaged, path, &mut out, progress)?;
        out.commit_if(resume::check)?;
        Ok(Merged { report, was_complete: false })
    }

    /// The report of a complete file; an error unless it was merged from these shards.
    fn report_of(&self, path: &Path) -> Result<MergeReport> {
        let file = CoefficientFile::open_with(path, Access::Read)?;
        if !self.are_in(&file)? {
            let what = "is complete, but not of these shards";
            return Err(Error::path(path, Note::with(what, Remedy::Replace)));
        }
        let windows = file.metadata().windows.len();
        let lost = |window: &u32| file.leaves(*window).iter().all(|leaf| leaf.lost == u64::from(leaf.count));
        let all = 0..windows as u32;
        Ok(MergeReport {
            shards: self.parts.len(),
            frames: file.metadata().frames,
            windows_before: windows,
            blocks_lost: all.clone().flat_map(|window| file.leaves(window)).map(|leaf| leaf.lost).sum(),
            windows_lost: if self.lost.is_some() { all.filter(lost).count() } else { 0 },
            unreadable: self.unreadable.clone(),
            input_bytes: self.parts.iter().map(|part| part.bytes).sum(),
            output_bytes: file.bytes(),
            ..MergeReport::default()
        })
    }

    /// Whether a file has the settings of the shards and, window by window, their frames.
    fn are_in(&self, file: &CoefficientFile) -> Result<bool> {
        let failed = |source| Error::CoefficientFile { path: file.path().into(), source };
        let id = self.start.file_id(self.first_digest, self.features).map_err(failed)?;
        let ends_alike = self.parts.last().is_some_and(|last| last.place.all == file.metadata().frames);
        if file.id() != id || !ends_alike {
            return Ok(false);
        }
        for part in &self.parts {
            if !is_in(part, file)? {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

/// Whether a file has the windows of a shard at its place, judged by their digests.
fn is_in(part: &Part, file: &CoefficientFile) -> Result<bool> {
    let (shard, windows) = (CoefficientFile::open(&part.path)?, &file.metadata().windows);
    let first = windows.partition_point(|window| window.first_frame < part.place.frames.start);
    let own = shard.metadata().windows.iter().map(|window| window.digest);
    Ok(own.eq(windows[first..].iter().take(part.windows).map(|window| window.digest)))
}
