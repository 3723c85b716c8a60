//! `wavesplat verify`

use super::results::results_text;
use crate::{CommonArgs, FrameRange, InputArgs, RemoteArgs, narrow, print, remembered};
use clap::Args;
use serde::Serialize;
use std::path::PathBuf;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::source::FrameSource;
use wavesplat_engine::convert::errors_of_results;
use wavesplat_engine::convert::estimate::EstimatedErrors;
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::file::report::{BoundReport, largest_bound};
use wavesplat_engine::file::shard::frames_of_shard;
use wavesplat_engine::file::verify::{BlockPlace, Comparison, MOST_NAMED, VerifyReport, verify};
use wavesplat_format::Keep;

/// Check a coefficient file for damage, and its error bound against the source
#[derive(Debug, Args)]
#[command(
    before_help = "\
Examples:
  wavesplat verify run.wspl
  wavesplat verify run.wspl --against frames/",
    after_help = "\
Every byte is checked; exit code 3 and a list of damaged places if any byte has changed. With --against, every \
sample is decoded and compared; exit code 4 if an error exceeds the bound, or the largest error stated for its block. A sampled \
bound is an estimate: for it, the rms error of each series is checked. \
The file stores which frames and region were converted, and they are chosen again; --frames chooses other frames."
)]
pub(crate) struct VerifyArgs {
    /// Coefficient file
    file: PathBuf,
    /// The frames that the file was converted from
    #[arg(long, value_name = "INPUT", num_args = 1..)]
    against: Vec<PathBuf>,
    /// The frames of INPUT that the file holds: a:b or a:b:step, without b [default: those that were converted first]
    #[arg(long, value_name = "RANGE", allow_hyphen_values = true, requires = "against")]
    frames: Option<FrameRange>,
    #[command(flatten)]
    input: InputArgs,
    #[command(flatten)]
    remote: RemoteArgs,
    #[command(flatten)]
    common: CommonArgs,
}

/// The keys of `--json`.
#[derive(Serialize)]
struct Reported<'a> {
    #[serde(flatten)]
    report: &'a VerifyReport,
    #[serde(flatten)]
    promise: BoundReport,
    /// The largest error, or root mean square, that any window allows.
    delta: f64,
    /// Errors of what is computed from the samples, estimated from some blocks of an undamaged file and its source.
    #[serde(skip_serializing_if = "Option::is_none")]
    results: Option<EstimatedErrors>,
}

pub(crate) fn run(args: &VerifyArgs) -> Result<()> {
    args.common.start()?;
    let file = args.remote.open(&args.file, args.input.access())?;
    let mut source = args.source(&file)?;
    let compared: Option<&mut dyn FrameSource> = match &mut source {
        Some(source) => Some(source.as_mut()),
        None => None,
    };
    let memory = args.common.memory.0;
    let report = verify(&file, compared, memory, &args.common.progress("verify", "blocks"))?;
    // What cannot be measured, such as a stream, is verified all the same.
    let results = match &mut source {
        Some(source) if report.damaged == 0 && (args.common.json || !args.common.quiet) => {
            errors_of_results(&file, source.as_mut(), memory).unwrap_or_default()
        }
        _ => None,
    };
    let (promise, delta) = (BoundReport::from_metadata(file.metadata()), largest_bound(file.metadata()));
    let keep = file.metadata().keep();
    if args.common.json {
        args.common.report(&Reported { report: &report, promise, delta, results }, false)?;
    } else if !args.common.quiet {
        let text = results.as_ref().map(|results| results_text(results, &keep.sides, promise.units.as_deref()) + "\n");
        print(&(summary(&report, &promise, &keep) + &text.unwrap_or_default()))?;
    }
    if report.damaged > 0 {
        let (count, first) = (report.damaged, &report.damage[0]);
        let what =
            format!("damaged in {}, the first: {first}; wavesplat recover saves the undamaged blocks", places(count));
        return Err(Error::input(&args.file, what));
    }
    match report.against.as_ref().and_then(missed) {
        Some(what) => Err(Error::BoundMissed { path: args.file.clone(), what }),
        None => Ok(()),
    }
}

/// Describes a missed error bound.
fn missed(c: &Comparison) -> Option<String> {
    if c.series_outside > 0 {
        let (outside, share) = (c.series_outside, c.largest_share_of_bound);
        let place = c.worst.map_or(String::new(), |p| format!(" at {p}"));
        return Some(format!("{outside} series outside the bound; the worst{place} is {share:.4} times the bound"));
    }
    if let Some(place) = c.first_not_kept {
        return Some(format!("{} samples or sums do not keep what the file keeps, the first at {place}", c.not_kept));
    }
    let BlockPlace { window, block, channel } = c.first_beyond?;
    let channel = channel.map_or(String::new(), |channel| format!(", {channel}"));
    let blocks = c.blocks_beyond_stated;
    Some(format!(
        "blocks with errors above those stated in the file: {blocks}, the first is block {block} of window {window}{channel}"
    ))
}

impl VerifyArgs {
    fn source(&self, file: &CoefficientFile) -> Result<Option<Box<dyn FrameSource>>> {
        if self.against.is_empty() {
            return Ok(None);
        }
        let source = self.input.open_again(file, &self.against, self.frames, &self.common)?;
        // Appended frames may come from the same archive: then all its frames count, not those converted first.
        let is_all = self.frames.is_some() || source.archive().frames == Some(file.frames());
        if is_all {
            return Ok(Some(source));
        }
        let source = narrow(source, remembered(file, "frames")?, None)?;
        let shard =
            frames_of_shard(file).filter(|(_, all)| source.archive().frames.map(|frames| frames as u64) == Some(*all));
        narrow(source, shard.map(|(frames, _)| frames.into()), None).map(Some)
    }
}

fn places(count: u64) -> String {
    if count == 1 { "1 place".into() } else { format!("{count} places") }
}

fn summary(r: &VerifyReport, promise: &BoundReport, keep: &Keep) -> String {
    let estimate = promise.caution();
    let state = if r.damaged == 0 { "whole".into() } else { format!("DAMAGED in {}", places(r.damaged)) };
    let mut text = format!("{} blocks, {} bytes: {state}\n", r.blocks, r.bytes);
    if r.unchecked > 0 {
        text += &format!("  {} more blocks could not be checked: their directory is damaged\n", r.unchecked);
    }
    if r.undecoded > 0 {
        text += &format!("  {} more blocks could not be decoded, because blocks above them are damaged\n", r.undecoded);
    }
    let shown = r.damage.len().min(MOST_SHOWN);
    r.damage[..shown].iter().for_each(|damage| text += &format!("  {damage}\n"));
    if r.damaged > shown as u64 {
        text += &format!("  and {} more; --json lists up to {MOST_NAMED}\n", r.damaged - shown as u64);
    }
    if let Some(c) = &r.against {
        let held = if missed(c).is_none() { "kept" } else { "MISSED" };
        text += &format!(
            "{} bound {held}: {:.4} of it used ({}); largest sample error {:.4e}, rms error {:.4e}, {} missing samples as they were, \
             {} samples compared{estimate}\n",
            promise.bound,
            c.largest_share_of_bound,
            promise.promise,
            c.largest_error,
            c.rms_error,
            c.missing,
            c.samples
        );
        if !keep.is_empty() {
            let held = if c.not_kept == 0 && c.series_outside == 0 { "kept" } else { "MISSED" };
            text += &format!("{held} besides: {keep}\n");
        }
    }
    text
}

/// The largest number of damaged places listed.
const MOST_SHOWN: usize = 20;
