//! `wavesplat scan`

use crate::{CommonArgs, InputArgs, SelectArgs, spare_inputs};
use clap::Args;
use std::io::Write;
use std::path::PathBuf;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::Output;
use wavesplat_engine::convert::shard::{ArchiveScan, Shard};

/// Find the value range of all frames, which conversions of shards need
#[derive(Debug, Args)]
#[command(
    before_help = "\
Examples:
  wavesplat scan frames/ -o scan.json
  wavesplat scan frames/ --shard 3/16 -o scan-3.json
  wavesplat scan --merge scan-*.json -o scan.json
  wavesplat convert frames/ --scan scan.json --shard 3/16 -o part-3.wspl",
    after_help = "\
The output is a small text in JSON. Options that choose samples (--variable, --frames, --region and so on) must be those of the \
conversions."
)]
pub(crate) struct ScanArgs {
    /// Frames as for convert; with --merge, scans of all shards
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// File to write, or - for standard output
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Read only the I-th of N parts of the frames
    #[arg(long, value_name = "I/N", conflicts_with = "merge")]
    shard: Option<Shard>,
    /// Combine the scans of all shards into one
    #[arg(long)]
    merge: bool,
    /// Replace an existing file
    #[arg(long)]
    force: bool,
    /// A value that means "missing"
    #[arg(long, value_name = "V", allow_hyphen_values = true)]
    missing_value: Option<f64>,
    #[command(flatten)]
    select: SelectArgs,
    #[command(flatten)]
    input: InputArgs,
    #[command(flatten)]
    common: CommonArgs,
}

pub(crate) fn run(args: &ScanArgs) -> Result<()> {
    args.common.start()?;
    spare_inputs(&args.inputs, &args.output)?;
    let mut out = Output::create(&args.output, args.force)?;
    let scan = if args.merge { args.merged()? } else { args.scan()? };
    let failed = |e| Error::io(&args.output, "writing", e);
    out.write_all(scan.to_json().as_bytes()).map_err(failed)?;
    out.commit()
}

impl ScanArgs {
    fn scan(&self) -> Result<ArchiveScan> {
        let mut source = self.select.narrow(self.input.open(&self.inputs, &self.common)?)?;
        let missing_value = source.archive().missing_value(self.missing_value);
        ArchiveScan::scan(source.as_mut(), self.shard, missing_value, &self.common.progress("scan", "frames"))
    }

    fn merged(&self) -> Result<ArchiveScan> {
        let named = |path: &PathBuf| Ok((path.display().to_string(), ArchiveScan::open(path)?));
        ArchiveScan::merged(&self.inputs.iter().map(named).collect::<Result<Vec<_>>>()?)
    }
}
