//! Conversions into a file that gets its name when it is complete, resumed or started anew.

use super::coded_input::CodedInput;
use super::plan::Plan;
use super::{ConvertConfig, ConvertReport, ConvertRequest, ResumePoint, Target, convert_into, errors_of_results};
use crate::file::CoefficientFile;
use crate::file::resume::{self, IfUnfinished};
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::output::Output;
use wavesplat_core::base::progress::Progress;
use wavesplat_core::source::{Archive, FrameSource};
use wavesplat_format::Metadata;

/// The error of a conversion, and whether its unfinished file stays.
#[derive(Debug)]
pub struct Failure {
    /// Why it failed.
    pub error: Error,
    /// The unfinished file, if a later run can continue after its windows.
    pub kept: Option<PathBuf>,
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self { error, kept: None }
    }
}

/// Converts frames as requested. With `replace`, a file named `output` is replaced once its successor is complete.
///
/// Returns no report if nothing was left to do: the run that is to be resumed had completed the file.
///
/// # Errors
/// Those of [`convert`](super::convert) and of [`ConvertRequest::check`]; also an error if `output` exists, or is
/// complete but with other settings or frames, or if `if_unfinished` says so.
pub fn run(
    source: Box<dyn FrameSource>,
    request: &ConvertRequest,
    output: &Path,
    replace: bool,
    if_unfinished: IfUnfinished,
    progress: &dyn Progress,
) -> std::result::Result<Option<ConvertReport>, Failure> {
    let (mut source, config) = request.prepare(source)?;
    if if_unfinished == IfUnfinished::Resume && !replace && output.is_file() {
        check_complete(output, &config, source.archive())?;
        return Ok(None);
    }
    let (out, complete) = resume::open(output, replace, if_unfinished)?;
    let resume_from = complete.map(|complete| ResumePoint { complete, first_window: 0, description: None });
    let target = Target { name: output, out, resume_from };
    let report = finish(source.as_mut(), &config, target, progress, || Ok(()))?;
    // What cannot be measured, such as a stream, is converted all the same.
    let mut errors = || errors_of_results(&CoefficientFile::open(output)?, source.as_mut(), request.memory);
    let results = if request.measures { errors().unwrap_or_default() } else { None };
    Ok(Some(ConvertReport { results, ..report }))
}

/// Adds frames to a finished file, in windows after its own. Its successor replaces it when it is complete, and only if
/// it has not changed meanwhile.
///
/// # Errors
/// Those of [`run`].
pub fn append(
    source: &mut dyn FrameSource,
    config: &ConvertConfig,
    file: &CoefficientFile,
    if_unfinished: IfUnfinished,
    progress: &dyn Progress,
) -> std::result::Result<ConvertReport, Failure> {
    let (out, complete) = resume::open_successor(file, if_unfinished)?;
    let (first_window, description) = (file.metadata().windows.len(), file.description()?);
    let resume_from = Some(ResumePoint { complete, first_window, description });
    let target = Target { name: file.path(), out, resume_from };
    finish(source, config, target, progress, || file.check_unchanged())
}

/// Converts the remaining frames, and commits the output if `still` confirms that the file it replaces is unchanged.
fn finish(
    source: &mut dyn FrameSource,
    config: &ConvertConfig,
    target: Target<'_, Output>,
    progress: &dyn Progress,
    still: impl FnOnce() -> Result<()>,
) -> std::result::Result<ConvertReport, Failure> {
    let Target { name, mut out, resume_from } = target;
    let report = convert_into(source, config, Target { name, out: &mut out, resume_from }, progress);
    let report = report.map_err(|error| Failure { kept: kept(&out, &error), error })?;
    out.commit_if(|part| resume::check(part).and_then(|()| still()))?;
    Ok(report)
}

/// The unfinished file, unless the error is one that resuming would meet again.
fn kept(out: &Output, error: &Error) -> Option<PathBuf> {
    let helps = out.is_kept() && !error.is_usage() && !matches!(error, Error::Changed { .. });
    out.part().filter(|_| helps).map(PathBuf::from)
}

/// An error unless the file is what this conversion would make.
fn check_complete(path: &Path, config: &ConvertConfig, archive: &Archive) -> Result<()> {
    match resume::is_complete(path, &metadata_before_first_frame(config, archive)?, archive)? {
        true => Ok(()),
        false => {
            let what = "is complete, but with other settings or frames";
            Err(Error::path(path, Note::with(what, Remedy::ReplaceOrAppend)))
        }
    }
}

/// The metadata of a file of `archive` before its first frame: all that is decided without reading samples.
fn metadata_before_first_frame(config: &ConvertConfig, archive: &Archive) -> Result<Metadata> {
    Plan::new(&CodedInput::new(config, archive)).map(|plan| plan.start)
}
