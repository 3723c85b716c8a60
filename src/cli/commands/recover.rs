//! `wavesplat recover`

use crate::{CommonArgs, coefficient_name, print, spare_inputs};
use clap::Args;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::output::{Output, STANDARD};
use wavesplat_engine::file::recover::{RecoverReport, recover};
use wavesplat_engine::file::resume;

/// Save the undamaged blocks of a damaged coefficient file
#[derive(Debug, Args)]
#[command(
    before_help = "\
Examples:
  wavesplat recover damaged.wspl -o saved.wspl
  wavesplat recover run.wspl.part -o run-so-far.wspl",
    after_help = "\
The damaged file is not changed; a new file is written. Any damage to a block loses the whole block: lost blocks are listed, \
and reading them is an error (--skip-damaged leaves them out). If no block is lost, the new file has the bytes of the original \
(if the end of the file is missing, some statistics are recomputed). Exit code 3 if anything is lost."
)]
pub(crate) struct RecoverArgs {
    /// Damaged or unfinished coefficient file
    file: PathBuf,
    /// File to write, or - for standard output
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
    /// Read the file instead of mapping it
    #[arg(long)]
    no_mmap: bool,
    #[command(flatten)]
    common: CommonArgs,
}

pub(crate) fn run(args: &RecoverArgs) -> Result<()> {
    args.common.start()?;
    let damaged = FileBytes::open(&args.file, Access::unless(args.no_mmap))?;
    spare_inputs(std::slice::from_ref(&args.file), &args.output)?;
    coefficient_name(&args.output)?;
    let mut out = Output::create(&args.output, args.force)?;
    let report = recover(
        &damaged,
        &args.output,
        &mut out,
        [&args.common.progress("search", "bytes"), &args.common.progress("recover", "blocks")],
    )?;
    out.commit_if(resume::check)?;
    let to_stdout = args.output == Path::new(STANDARD);
    if !args.common.json && !args.common.quiet {
        if to_stdout { args.common.note(text(&report).trim_end()) } else { print(&text(&report))? }
    }
    args.common.report(&report, to_stdout)?;
    match lost(&report) {
        Some(what) => Err(Error::input(&args.file, what)),
        None => Ok(()),
    }
}

fn lost(r: &RecoverReport) -> Option<String> {
    let (blocks, behind) = (r.blocks_lost, r.blocks_left_behind);
    let more = if behind > 0 { format!(", and {behind} more of windows without a record") } else { String::new() };
    let what = format!("{blocks} of {} blocks are lost{more}", r.blocks);
    let end = "its end is missing, with any later frames";
    match (blocks + behind > 0, r.all_known) {
        (false, true) => None,
        (false, false) => Some(end.into()),
        (true, true) => Some(what),
        (true, false) => Some(format!("{what}; {end}")),
    }
}

fn text(r: &RecoverReport) -> String {
    let mut text =
        format!("{} frames in {} windows, {} blocks, {} bytes: saved\n", r.frames, r.windows, r.blocks, r.bytes);
    for run in &r.lost {
        let (from, to) = run.frames;
        let (window, first, last) = (run.window, run.first, run.last);
        let channel = run.channel.map_or(String::new(), |channel| format!(" of {channel}"));
        let tier = if run.tier > 0 { format!(" of tier {}", run.tier) } else { String::new() };
        text += &format!("  lost: window {window} (frames {from}..{to}), blocks {first} to {last}{tier}{channel}\n");
    }
    for window in &r.windows_undescribed {
        text += &format!("  the record of window {window} is lost\n");
    }
    if r.description_lost {
        text += "  lost: the coordinates and attributes of the source, which are written at the end of a conversion\n";
    }
    if r.blocks_left_behind > 0 {
        text += &format!("  left out: {} blocks of later windows without a record\n", r.blocks_left_behind);
    }
    text
}
