//! `wavesplat verify`

use clap::Args;
use std::path::PathBuf;
use wavesplat::cli::{CommonArgs, InputArgs, narrow, print};
use wavesplat::error::{Error, Result};
use wavesplat::file::CoefficientFile;
use wavesplat::report::PromiseReport;
use wavesplat::source::FrameSource;
use wavesplat::verify::{BlockPlace, Comparison, VerifyReport, verify};

/// Check a coefficient file, and its promise against the source
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  wavesplat verify run.wspl
  wavesplat verify run.wspl --against frames/
Every byte is checked. With --against, every sample is decoded and compared; exit code 4 if any is outside the bound, or
further off than its block says. Of a file with a sampled bound, an estimate, what is checked is the rms of each series.
The frames and the region that were converted are remembered and chosen again.")]
pub(crate) struct VerifyArgs {
    /// Coefficient file
    file: PathBuf,
    /// The frames it was made from
    #[arg(long, value_name = "INPUT", num_args = 1..)]
    against: Vec<PathBuf>,
    #[command(flatten)]
    input: InputArgs,
    #[command(flatten)]
    common: CommonArgs,
}

pub(crate) fn run(args: &VerifyArgs) -> Result<()> {
    args.common.start()?;
    let file = CoefficientFile::open(&args.file, args.input.access())?;
    let mut source = args.source(&file)?;
    let source: Option<&mut dyn FrameSource> = match &mut source {
        Some(source) => Some(source.as_mut()),
        None => None,
    };
    let report = verify(&file, source, args.common.memory.0, &args.common.progress("blocks"))?;
    if args.common.json {
        args.common.report(&report, false)?;
    } else if !args.common.quiet {
        let m = file.metadata();
        print(&summary(&report, &PromiseReport::new(m.bound, m.tolerance, m.range)))?;
    }
    match report.against.as_ref().and_then(missed) {
        Some(what) => Err(Error::BoundMissed { path: args.file.clone(), what }),
        None => Ok(()),
    }
}

/// What was promised and not kept.
fn missed(c: &Comparison) -> Option<String> {
    if c.series_outside > 0 {
        let (outside, share) = (c.series_outside, c.largest_share_of_bound);
        let place = c.worst.map_or(String::new(), |p| format!(" at {p}"));
        return Some(format!("{outside} series outside the bound; the worst{place} is {share:.4} times the bound"));
    }
    let BlockPlace { window, block } = c.first_beyond?;
    let blocks = c.blocks_beyond_stated;
    Some(format!("blocks further off than the file says: {blocks}, the first of them block {block} of window {window}"))
}

impl VerifyArgs {
    fn source(&self, file: &CoefficientFile) -> Result<Option<Box<dyn FrameSource>>> {
        if self.against.is_empty() {
            return Ok(None);
        }
        let setting = |name: &str| file.metadata().settings.iter().find(|(n, _)| n == name).map(|(_, v)| v.clone());
        let parsed = |what: String| Error::input(&self.file, format!("its settings are not understood: {what}"));
        let frames = setting("frames").map(|f| f.parse()).transpose().map_err(parsed)?;
        let region = setting("region").map(|r| r.parse()).transpose().map_err(parsed)?;
        let mut input = self.input.clone();
        input.variable = input.variable.or_else(|| setting("variable"));
        narrow(input.open(&self.against, &self.common)?, frames, region).map(Some)
    }
}

fn summary(r: &VerifyReport, promise: &PromiseReport) -> String {
    let estimate = promise.caution();
    let mut text = format!("{} blocks, {} bytes: whole\n", r.blocks, r.bytes);
    if let Some(c) = &r.against {
        let held = if missed(c).is_none() { "kept" } else { "MISSED" };
        text += &format!(
            "{} bound {held}: {:.4} of it used; largest sample error {:.4e}, rms error {:.4e}, {} missing samples as they were, \
             {} samples compared{estimate}\n",
            promise.bound, c.largest_share_of_bound, c.largest_error, c.rms_error, c.missing, c.samples
        );
    }
    text
}
