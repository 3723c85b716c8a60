//! `wavesplat info`

mod archive;
mod coefficients;
mod collection;
mod description;
mod made_by;
mod variables;

use crate::{CommonArgs, InputArgs, RemoteArgs, SelectArgs};
use clap::Args;
use std::path::{Path, PathBuf};
use wavesplat_core::base::address::public_name;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::values::share;
use wavesplat_engine::file::CoefficientFile;
use wavesplat_format::Keep;

/// Describe a coefficient file: contents, error bound and errors; several as one data set; or an archive of frames, and how it is read
#[derive(Debug, Args)]
#[command(before_help = "\
Examples:
  wavesplat info run.wspl
  wavesplat info run.wspl --json | jq .windows
  wavesplat info converted/
  wavesplat info run.nc
  wavesplat info frames/ --estimate
  wavesplat info frames/ --estimate 0.001
  wavesplat info frames/ --estimate --keep side=0.5")]
pub(crate) struct InfoArgs {
    /// A coefficient file; several, or a folder of them, as one data set; or frames as for convert
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// For frames: convert a few blocks, and estimate the size of the coefficient file at this tolerance [a table of
    /// five tolerances if none is given]
    #[arg(long, value_name = "X", value_parser = tolerance, num_args = 0..=1)]
    estimate: Option<Option<f64>>,
    /// With --estimate: also the bytes with this --keep, as for convert
    #[arg(long, value_name = "WHAT", value_parser = Keep::parse, allow_hyphen_values = true, requires = "estimate")]
    keep: Vec<Keep>,
    #[command(flatten)]
    select: SelectArgs,
    #[command(flatten)]
    input: InputArgs,
    #[command(flatten)]
    remote: RemoteArgs,
    #[command(flatten)]
    common: CommonArgs,
}

/// Reads a tolerance. Where an input follows the option, the message says where the option goes.
fn tolerance(text: &str) -> std::result::Result<f64, String> {
    share(text).map_err(|what| format!("{what}. For a table of five tolerances, write --estimate after the inputs"))
}

pub(crate) fn run(args: &InfoArgs) -> Result<()> {
    args.common.start()?;
    let several = collection::coefficient_files(&args.inputs)?;
    if let Some(first) = several.first() {
        args.refuse_for_coefficients(&public_name(first))?;
        return collection::run(&several, args);
    }
    if let Some(file) = args.coefficients()? {
        return coefficients::run(&file, &args.common);
    }
    match args.input.undecided(&args.inputs, args.common.stream_memory())?.as_slice() {
        [] => archive::run(args),
        several => variables::run(several, &args.common),
    }
}

impl InfoArgs {
    /// The coefficient file, or none if the inputs are frames.
    fn coefficients(&self) -> Result<Option<CoefficientFile>> {
        let Some(file) = self.input.coefficients(&self.inputs, &self.remote)? else { return Ok(None) };
        self.refuse_for_coefficients(file.path())?;
        Ok(Some(file))
    }

    fn refuse_for_coefficients(&self, path: &Path) -> Result<()> {
        let given = [
            (self.estimate.is_some(), "--estimate"),
            (self.select.frames.is_some(), "--frames"),
            (self.select.region.is_some(), "--region"),
        ];
        match given.into_iter().find(|(given, _)| *given) {
            Some((_, name)) => {
                Err(Error::usage(format!("{}: is a coefficient file; {name} is for frames", path.display())))
            }
            None => self.input.refuse_for_coefficients(),
        }
    }
}
