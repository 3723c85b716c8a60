//! `wavesplat convert`

mod given;
mod options;
mod several;

use super::results::results_text;
use crate::messages::note;
use crate::{CommonArgs, InputArgs, RemoteArgs, advice, coefficient_name, note_text, spare_inputs};
use clap::{Arg, Args, Command};
pub(crate) use options::ConvertArgs;
use serde::Serialize;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Note, Result};
use wavesplat_core::base::output::{Output, STANDARD};
use wavesplat_core::colour::TransferFunction;
use wavesplat_core::source::FrameSource;
use wavesplat_core::source::follow::Follow;
use wavesplat_engine::convert::{Bound, ConvertReport, ConvertRequest, Failure, Outcome, Task, run as convert};
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::file::repack::{RepackReport, repack};
use wavesplat_engine::file::resume::{self, IfUnfinished};
use wavesplat_jobs::picture::colours_of_source;

/// Converts one variable or several, or rewrites a coefficient file.
pub(crate) fn run(args: &ConvertArgs) -> Result<()> {
    args.common.start()?;
    if let Some(file) = args.input.coefficients(&args.inputs, &RemoteArgs::default())? {
        return args.repack(&file);
    }
    let args = &args.following()?;
    match several::several(args)? {
        Some(several) => several::run(&several),
        None => only(args),
    }
}

/// Converts one variable.
fn only(args: &ConvertArgs) -> Result<()> {
    let Task { source, request, output } = args.task()?;
    let progress = args.common.progress("convert", "blocks");
    let done = convert(source, &request, &output, args.force, args.if_unfinished(), &progress);
    drop(progress); // clears its bar before notes are printed
    args.report(done, &request, Files::One)
}

/// How many files a run writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Files {
    One,
    /// Notes on a file begin with its name, and leave out the seconds of the run.
    Several,
}

/// Reports a finished conversion, or the unfinished file that a failed one left.
pub(crate) fn report(
    done: std::result::Result<ConvertReport, Failure>,
    bound: Bound,
    output: &Path,
    common: &CommonArgs,
    files: Files,
) -> Result<()> {
    let name = if files == Files::Several { format!("{}: ", output.display()) } else { String::new() };
    let report = done.map_err(|failure| error_of(failure, common))?;
    common.note(format_args!("{name}{}", summary(&report, bound, files)));
    report.warnings.iter().for_each(|warning| common.note(format_args!("{name}warning: {}", note_text(warning))));
    common.report(&Reported::new(&report), output == Path::new(STANDARD))
}

/// The error of a conversion. Notes the unfinished file that it left.
fn error_of(Failure { error, kept }: Failure, common: &CommonArgs) -> Error {
    if let Some(part) = kept {
        common.note(format_args!("{}: the finished windows are kept; --resume continues after them", part.display()));
    }
    error
}

/// The keys of `--json`.
#[derive(Serialize)]
struct Reported<'a> {
    #[serde(flatten)]
    report: &'a ConvertReport,
    warnings: Vec<Warning<'a>>,
}

/// A note, with the options that help.
#[derive(Serialize)]
struct Warning<'a> {
    text: &'a str,
    remedy: Option<String>,
}

impl<'a> Reported<'a> {
    fn new(report: &'a ConvertReport) -> Self {
        let warning =
            |note: &'a Note| Warning { text: &note.text, remedy: note.remedy.as_ref().map(|r| advice(r).into()) };
        Self { report, warnings: report.warnings.iter().map(warning).collect() }
    }
}

/// Options of its own that matter for a coefficient file, too.
const OF_COEFFICIENTS: [&str; 4] = ["output", "force", "chain", "level"];

impl ConvertArgs {
    /// These options, with the run that is followed.
    fn following(&self) -> Result<Self> {
        let mut args = self.clone();
        let Some(end) = &self.follow else { return Ok(args) };
        if self.shard.is_some() || self.scan.is_some() {
            return Err(Error::usage("--follow: shards and scans are of runs that have ended"));
        }
        if self.transfer_function.is_some() && self.range.is_none() {
            return Err(Error::usage("--follow: --transfer-function needs --range, since later values are not known"));
        }
        if let Some(frames) = self.select.frames
            && frames.resolve(None)?.2.is_some()
        {
            return Err(Error::usage(format!("--follow: --frames {frames} has an end; a: and a::step go on")));
        }
        self.common.note(format_args!("waits for frames until {end}"));
        args.input.follow = Some(Follow::new(end.clone(), |why| note(format_args!("cannot be read yet: {why}"))));
        Ok(args)
    }

    /// The frames to convert, how, and the output.
    fn task(&self) -> Result<Task> {
        let mut request = self.request()?;
        request.check()?;
        let mut source = self.select.narrow(self.input.open(&self.inputs, &self.common)?)?;
        self.check_output()?;
        let missing_value = source.archive().missing_value(request.missing_value);
        request.transfer_function = self.colours(source.as_mut(), missing_value)?;
        Ok(Task { source, request, output: self.output.clone() })
    }

    fn if_unfinished(&self) -> IfUnfinished {
        IfUnfinished::from_flags(self.force, self.resume)
    }

    /// Reports a conversion, and the errors of results if they were measured.
    fn report(&self, outcome: Outcome, request: &ConvertRequest, files: Files) -> Result<()> {
        let Some(done) = outcome.transpose() else {
            let later = if self.follow.is_some() { "; wavesplat append adds later frames" } else { "" };
            self.common.note(format_args!("{}: is complete already{later}", self.output.display()));
            return Ok(());
        };
        let text = |r: &ConvertReport| {
            Some(results_text(r.results.as_ref()?, &request.keep.sides, r.promise.units.as_deref()))
        };
        let results = done.as_ref().ok().and_then(text);
        report(done, request.bound, &self.output, &self.common, files)?;
        results.iter().for_each(|results| self.common.detail(results));
        Ok(())
    }

    /// An error if the output would replace an input, or has the extension of a format of frames, which would mislead
    /// readers of the file.
    fn check_output(&self) -> Result<()> {
        spare_inputs(&self.inputs, &self.output)?;
        coefficient_name(&self.output)
    }

    /// The colours for samples, if samples are turned into colours.
    fn colours(&self, source: &mut dyn FrameSource, missing_value: Option<f64>) -> Result<Option<TransferFunction>> {
        let Some(name) = &self.transfer_function else { return Ok(None) };
        spare_inputs(&[PathBuf::from(name)], &self.output)?;
        let is_piped = self.inputs == [Path::new(STANDARD)];
        colours_of_source(name, self.range, source, is_piped, missing_value, &self.common).map(Some)
    }

    /// Rewrites a coefficient file in this version's format.
    fn repack(&self, file: &CoefficientFile) -> Result<()> {
        self.refuse_for_coefficients(file.path())?;
        self.check_output()?;
        let mut out = Output::create(&self.output, self.force)?;
        let progress = self.common.progress("convert", "blocks");
        let report = repack(file, self.level, self.common.memory.0, &self.output, &mut out, &progress)?;
        out.commit_if(resume::check)?;
        let RepackReport { frames, input_bytes, output_bytes, .. } = report;
        self.common.note(format_args!("{frames} frames, {input_bytes} -> {output_bytes} bytes, with the same samples"));
        self.common.report(&report, self.output == Path::new(STANDARD))
    }

    /// An error if an option is given that has no effect on a coefficient file.
    fn refuse_for_coefficients(&self, path: &Path) -> Result<()> {
        let others = CommonArgs::augment_args(InputArgs::augment_args(Command::new("")));
        let is_other = |arg: &Arg| others.get_arguments().any(|other| other.get_id() == arg.get_id());
        let command = Self::augment_args(Command::new(""));
        let changed = command.get_arguments().filter(|arg| self.given.changes(arg) && !is_other(arg));
        match changed.filter_map(Arg::get_long).find(|name| !OF_COEFFICIENTS.contains(name)) {
            Some(name) => Err(Error::usage(format!(
                "{}: is a coefficient file, whose samples stay as they are; --{name} is for frames",
                path.display()
            ))),
            None => self.input.refuse_for_coefficients(),
        }
    }
}

fn summary(r: &ConvertReport, bound: Bound, files: Files) -> String {
    let ratio = r.input_bytes as f64 / r.output_bytes as f64;
    let new = (r.frames - r.frames_before) as f64 / r.frames as f64;
    let speed = match files {
        Files::One => speed(new * r.input_bytes as f64, r.seconds),
        Files::Several => String::new(),
    };
    let unit = r.promise.units.as_ref().map_or(String::new(), |unit| format!(" {unit}"));
    let errors = match bound {
        Bound::Pointwise => format!("largest error {:.4e} of {:.4e}{unit} allowed", r.reached, r.delta),
        Bound::Relative { .. } => {
            let tolerance = r.promise.tolerance;
            let relative = r.share * tolerance;
            format!(
                "largest relative error {relative:.4e} of {tolerance:.4e} allowed, largest error {:.4e}{unit}",
                r.reached
            )
        }
        Bound::Rms | Bound::Sampled { .. } => {
            format!("rms error of every series within {:.4e}, largest single error {:.4e}{unit}", r.delta, r.reached)
        }
    };
    let estimate = r.promise.caution();
    let before = if r.frames_before > 0 { format!(", {} of them from before", r.frames_before) } else { String::new() };
    format!(
        "{} frames{before}, {} -> {} bytes ({ratio:.1}x){speed}; {:.4} coefficients per sample; {errors}{estimate}",
        r.frames, r.input_bytes, r.output_bytes, r.coefficients_per_sample
    )
}

/// The seconds of a run, and the bytes that it took in each.
fn speed(bytes: f64, seconds: f64) -> String {
    format!(" in {seconds:.2} s ({:.0} MB/s)", bytes / seconds / 1e6)
}
