//! Conversions into a file that gets its name when it is complete, resumed or started anew.

use super::coded_input::CodedInput;
use super::plan::Plan;
use super::{Conversion, ConvertConfig, ConvertReport, ConvertRequest, ResumePoint, Target};
use super::{convert_into, convert_together, errors_of_results};
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
/// Those of [`convert`](super::convert()) and of [`ConvertRequest::check`]; also an error if `output` exists, or is
/// complete but with other settings or frames, or if `if_unfinished` says so.
pub fn run(
    source: Box<dyn FrameSource>,
    request: &ConvertRequest,
    output: &Path,
    replace: bool,
    if_unfinished: IfUnfinished,
    progress: &dyn Progress,
) -> Outcome {
    let task = Task { source, request: request.clone(), output: output.into() };
    run_together(vec![task], replace, if_unfinished, progress)?.pop().expect("one outcome for each task")
}

/// The report of a conversion; none if nothing was left to do.
pub type Outcome = std::result::Result<Option<ConvertReport>, Failure>;

/// A source, and the file to convert it to.
pub struct Task {
    /// The frames.
    pub source: Box<dyn FrameSource>,
    /// How they are converted. The settings of memory of all tasks that run together must be equal.
    pub request: ConvertRequest,
    /// The coefficient file.
    pub output: PathBuf,
}

/// As [`run`], several conversions [side by side](convert_together). The outcomes are those of the tasks, in order.
///
/// # Errors
/// What prevents one of them from beginning, or ends all of them.
pub fn run_together(
    tasks: Vec<Task>,
    replace: bool,
    if_unfinished: IfUnfinished,
    progress: &dyn Progress,
) -> std::result::Result<Vec<Outcome>, Failure> {
    let begin = |task| Begun::new(task, replace, if_unfinished);
    let mut all = tasks.into_iter().map(begin).collect::<Result<Vec<_>>>()?;
    let conversions = all.iter_mut().filter_map(Begun::conversion).collect();
    let results = convert_together(conversions, progress);
    let mut results = match results {
        Ok(results) => results.into_iter(),
        Err(error) => {
            let kept = all.iter().filter_map(|begun| kept(begun.out.as_ref()?, &error)).next();
            return Err(Failure { kept, error });
        }
    };
    let result = |begun: &Begun| begun.out.is_some().then(|| results.next().expect("one result for each conversion"));
    let results: Vec<_> = all.iter().map(result).collect();
    Ok(all.into_iter().zip(results).map(|(begun, result)| begun.finish(result)).collect())
}

/// A task whose output is open.
struct Begun {
    task: Task,
    config: ConvertConfig,
    /// None if the file is complete.
    out: Option<Output>,
    resume_from: Option<ResumePoint>,
    /// The notes on the source before it was read.
    notes: Vec<Note>,
}

impl Begun {
    fn new(Task { source, request, output }: Task, replace: bool, if_unfinished: IfUnfinished) -> Result<Self> {
        let (source, config) = request.prepare(source)?;
        let notes = source.archive().notes.clone();
        let task = Task { source, request, output };
        if if_unfinished == IfUnfinished::Resume && !replace && task.output.is_file() {
            check_complete(&task.output, &config, task.source.archive())?;
            return Ok(Self { task, config, out: None, resume_from: None, notes });
        }
        let (out, complete) = resume::open(&task.output, replace, if_unfinished)?;
        let resume_from = complete.map(|complete| ResumePoint { complete, first_window: 0, description: None });
        Ok(Self { task, config, out: Some(out), resume_from, notes })
    }

    /// The conversion; none if the file is complete.
    fn conversion(&mut self) -> Option<Conversion<'_, &mut Output>> {
        let target = Target { name: &self.task.output, out: self.out.as_mut()?, resume_from: self.resume_from.take() };
        Some(Conversion { source: self.task.source.as_mut(), config: &self.config, target })
    }

    /// Gives the file its name if it was converted.
    fn finish(self, result: Option<Result<ConvertReport>>) -> Outcome {
        let (Some(result), Some(out)) = (result, self.out) else { return Ok(None) };
        let Task { mut source, request, output } = self.task;
        let mut report = commit(result, out, || Ok(()))?;
        let is_new = |note: &&Note| !self.notes.contains(note);
        report.warnings.extend(source.archive().notes.iter().filter(is_new).cloned());
        // What cannot be measured, such as a stream, is converted all the same.
        let mut errors = || errors_of_results(&CoefficientFile::open(&output)?, source.as_mut(), request.memory);
        let results = if request.measures { errors().unwrap_or_default() } else { None };
        Ok(Some(ConvertReport { results, ..report }))
    }
}

/// Adds frames to a finished file, in windows after its own. Its successor replaces it when it is complete, and only if
/// it has not changed meanwhile. They are coded with the file's settings, in `memory` bytes.
///
/// # Errors
/// Those of [`run`]; also a file without its settings, and frames with times if the file has none, or without them if it has some.
pub fn append(
    source: &mut dyn FrameSource,
    file: &CoefficientFile,
    memory: usize,
    if_unfinished: IfUnfinished,
    progress: &dyn Progress,
) -> std::result::Result<ConvertReport, Failure> {
    let refused = |what: Note| Error::input(file.path(), what);
    let Some(config) = &ConvertConfig::from_file(file.metadata(), memory) else {
        return Err(refused("has no settings of its conversion, so nothing can be appended".into()).into());
    };
    match (source.archive().has_times(), !file.metadata().times.is_empty()) {
        (true, false) => return Err(refused("has no times, but the new frames have some".into()).into()),
        (false, true) => {
            let what = "has times, but the new frames have none";
            return Err(refused(Note::with(what, Remedy::Set("times"))).into());
        }
        _ => {}
    }
    let (out, complete) = resume::open_successor(file, if_unfinished)?;
    let (first_window, description) = (file.metadata().windows.len(), file.description()?);
    let resume_from = Some(ResumePoint { complete, first_window, description });
    let (name, mut out) = (file.path(), out);
    let result = convert_into(source, config, Target { name, out: &mut out, resume_from }, progress);
    commit(result, out, || file.check_unchanged())
}

/// Commits the output of a conversion if `still` confirms that the file it replaces is unchanged.
fn commit(
    result: Result<ConvertReport>,
    out: Output,
    still: impl FnOnce() -> Result<()>,
) -> std::result::Result<ConvertReport, Failure> {
    let report = result.map_err(|error| Failure { kept: kept(&out, &error), error })?;
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
