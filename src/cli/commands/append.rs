//! `wavesplat append`

use super::convert::{Files, report};
use crate::{CommonArgs, FrameRange, InputArgs, narrow, spare_inputs};
use clap::Args;
use std::path::{Path, PathBuf};
use wavesplat_core::base::address::refuse_output;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::STANDARD;
use wavesplat_core::source::FrameSource;
use wavesplat_engine::convert::append;
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::file::merge::Shards;
use wavesplat_engine::file::resume::{self, IfUnfinished, begins_with, ends_with, is_begun, open_successor};
use wavesplat_engine::file::shard::frames_of_shard;

/// Add later frames to a coefficient file
#[derive(Debug, Args)]
#[command(
    before_help = "\
Examples:
  wavesplat append run.wspl more/
  wavesplat append run.wspl frames/ --frames 400:
  wavesplat append run.wspl part-3.wspl",
    after_help = "\
The new frames are coded with the file's settings and region, in windows after the existing ones. Full windows are the same as \
if all frames had been converted at once. The command works on a copy that replaces the file when it is complete: programs that \
read the old file are not disturbed, and a killed run loses nothing. If --frames begins at the end of the frames that exist so \
far, the command does nothing and succeeds. Shards of the same archive that follow the file's frames are copied, not coded \
again."
)]
pub(crate) struct AppendArgs {
    /// Coefficient file
    file: PathBuf,
    /// The next frames: files in order, a folder, a pattern in quotes, one 4-D file, shards, or - for standard input
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Add only these frames of INPUTS: a:b or a:b:step, without b
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true)]
    frames: Option<FrameRange>,
    /// Continue an unfinished earlier run of this command. The file gets the bytes of an uninterrupted run. Does
    /// nothing if FILE already ends with these frames
    #[arg(long)]
    resume: bool,
    /// Start over, and discard what an earlier run left unfinished
    #[arg(long, conflicts_with = "resume")]
    force: bool,
    #[command(flatten)]
    input: InputArgs,
    #[command(flatten)]
    common: CommonArgs,
}

pub(crate) fn run(args: &AppendArgs) -> Result<()> {
    args.common.start()?;
    let linked = args.file.is_symlink().then(|| args.file.canonicalize()).transpose();
    let linked = linked.map_err(|e| Error::io(&args.file, "opening", e))?;
    let path = linked.unwrap_or(args.file.clone()); // replaces the file, not the link to it
    refuse_output(&path)?;
    let file = CoefficientFile::open_with(&path, args.input.access())?;
    if are_shards(&args.inputs)? {
        return args.append_shards(&file);
    }
    let source = args.input.open_again(&file, &args.inputs, None, &args.common)?;
    if let (Some(asked), Some(all)) = (args.frames, source.archive().frames)
        && asked.begins_at_end(all)
    {
        args.common.note(format_args!("{}: there are no frames after {all} yet, nothing to add", args.file.display()));
        return Ok(());
    }
    let source = narrow(source, args.frames, None)?;
    let mut source = args.input.go_on_in_time(&file, source, args.frames.map_or(1, |frames| frames.step()))?;
    spare_inputs(&args.inputs, &path)?;
    if !args.force && !is_begun(&path) && args.has_them(&file, source.as_mut())? {
        args.common.note(format_args!("{}: ends with these frames already", args.file.display()));
        return Ok(());
    }
    let if_unfinished = IfUnfinished::from_flags(args.force, args.resume);
    let progress = args.common.progress("convert", "blocks");
    let done = append(source.as_mut(), &file, args.common.memory.0, if_unfinished, &progress);
    drop(progress); // clears its bar before notes are printed
    report(done, file.metadata().bound, &path, &args.common, Files::One)
}

/// Whether all inputs are shards, which are copied; other coefficient files are sources like any other.
fn are_shards(inputs: &[PathBuf]) -> Result<bool> {
    for input in inputs {
        let is_named = input.extension().is_some_and(|extension| extension == "wspl");
        if !is_named || frames_of_shard(&CoefficientFile::open(input)?).is_none() {
            return Ok(false);
        }
    }
    Ok(true)
}

impl AppendArgs {
    /// Copies the windows of shards.
    fn append_shards(&self, file: &CoefficientFile) -> Result<()> {
        if self.frames.is_some() {
            return Err(Error::usage("--frames: shards are appended whole"));
        }
        spare_inputs(&self.inputs, file.path())?;
        if self.resume && self.has_shards(file)? {
            self.common.note(format_args!("{}: ends with these frames already", self.file.display()));
            return Ok(());
        }
        let shards = Shards::after(file, &self.inputs, &self.common.progress("open", "shards"))?;
        let (mut out, begun) = open_successor(file, IfUnfinished::from_flags(self.force, self.resume))?;
        let progress = self.common.progress("merge", "windows");
        let report = shards.merge(Some(begun), false, file.path(), &mut out, &progress)?;
        file.check_unchanged()?;
        out.commit_if(resume::check)?;
        let (frames, bytes) = (report.frames, report.output_bytes);
        self.common.note(format_args!("{frames} frames, {} of them from before, {bytes} bytes", file.frames()));
        self.common.report(&report, false)
    }

    /// Whether the file ends where the last of the shards ends.
    fn has_shards(&self, file: &CoefficientFile) -> Result<bool> {
        let end = |input| Ok(frames_of_shard(&CoefficientFile::open(input)?).map_or(0, |(frames, _)| frames.end));
        let ends = self.inputs.iter().map(end).collect::<Result<Vec<u64>>>()?;
        Ok(ends.iter().max() == Some(&(file.frames() as u64)))
    }

    /// Whether the file ends with these frames, if `--resume` allows that; without it, an error.
    fn has_them(&self, file: &CoefficientFile, source: &mut dyn FrameSource) -> Result<bool> {
        if self.is_streamed() {
            let what =
                "--resume: a stream cannot be compared with the file's last frames; leave --resume out to append it";
            return if self.resume { Err(Error::usage(what)) } else { Ok(false) }; // a stream can be read only once
        }
        let refused = |what: String| Err(Error::usage(format!("{}: {what}", self.file.display())));
        match ends_with(file, source)? {
            true if self.resume => Ok(true),
            true => refused("ends with these frames already; --force adds them once more".into()),
            false if begins_with(file, source)? => {
                let frames = file.frames();
                refused(format!("begins with these frames; --frames {frames}: takes those after its own, --force all"))
            }
            false => Ok(false),
        }
    }

    fn is_streamed(&self) -> bool {
        self.inputs == [Path::new(STANDARD)]
    }
}
