//! `wavesplat merge`

use crate::{CommonArgs, coefficient_name, spare_inputs};
use clap::Args;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::STANDARD;
use wavesplat_engine::file::merge::{MergeReport, Merged, Shards};
use wavesplat_engine::file::resume::IfUnfinished;

/// Join shards into one coefficient file
#[derive(Debug, Args)]
#[command(
    before_help = "\
Examples:
  wavesplat merge part-*.wspl -o run.wspl
  wavesplat merge part-*.wspl -o run.wspl --resume",
    after_help = "\
The shards are those of wavesplat convert --shard, in any order. Blocks are copied as they are stored, so nothing is coded anew: \
the file has the bytes of one conversion with the same options. Shards that are missing, given twice, of another archive, made \
otherwise or damaged are named. With --skip-damaged, frames of missing shards are lost, as damaged blocks are."
)]
pub(crate) struct MergeArgs {
    /// Shards, in any order
    #[arg(required = true)]
    shards: Vec<PathBuf>,
    /// Coefficient file to write, or - for standard output
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Replace an existing file; discard what an earlier run left unfinished, unless --resume continues it
    #[arg(long)]
    force: bool,
    /// Continue an unfinished earlier run of this command. The file gets the bytes of an uninterrupted run. Does
    /// nothing if FILE is complete
    #[arg(long)]
    resume: bool,
    /// Keep all undamaged blocks, and mark damaged blocks and those of missing shards as lost. Exit code 3 if any are
    /// lost
    #[arg(long)]
    skip_damaged: bool,
    #[command(flatten)]
    common: CommonArgs,
}

pub(crate) fn run(args: &MergeArgs) -> Result<()> {
    args.common.start()?;
    spare_inputs(&args.shards, &args.output)?;
    coefficient_name(&args.output)?;
    let shards = Shards::open(&args.shards, args.skip_damaged, &args.common.progress("open", "shards"))?;
    let if_unfinished = IfUnfinished::from_flags(args.force, args.resume);
    let progress = args.common.progress("merge", "windows");
    let merged = shards.merge_to_file(&args.output, args.force, if_unfinished, args.skip_damaged, &progress)?;
    let Merged { report, was_complete } = merged;
    for shard in &report.unreadable {
        let what = "cannot be opened; wavesplat recover saves what is whole";
        args.common.note(format_args!("{}: {what}", shard.display()));
    }
    let MergeReport { shards, frames, output_bytes, blocks_lost, windows_lost, .. } = report;
    match was_complete {
        true => args.common.note(format_args!("{}: is complete already", args.output.display())),
        false => args.common.note(format_args!("{shards} shards, {frames} frames, {output_bytes} bytes")),
    }
    args.common.report(&report, args.output == Path::new(STANDARD))?;
    match blocks_lost {
        0 => Ok(()),
        lost if windows_lost > 0 => {
            let what = format!("blocks are lost: {lost}, with all of {windows_lost} windows of missing shards");
            Err(Error::input(&args.output, what))
        }
        lost => Err(Error::input(&args.output, format!("blocks of damaged shards are lost: {lost}"))),
    }
}
