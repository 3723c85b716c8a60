//! `wavesplat page`

use crate::render::viewer_session;
use crate::{CommonArgs, RemoteArgs, spare_inputs};
use clap::Args;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::STANDARD;
use wavesplat_jobs::picture::{ViewerSession, write_page, write_site};

/// Write a page that shows coefficient files without a server
///
/// The page does what `wavesplat view` does, and has the program in it: browsers turn, play and cut the volume by
/// themselves. It holds the file, so it can be sent by mail; with --beside, it is a folder for any static server, and reads
/// only the parts of the files that it shows.
#[derive(Debug, Args)]
#[command(before_help = "\
Examples:
  wavesplat page run.wspl -o run.html
  wavesplat page run.wspl -o run.html -- --mode composite --range 0,1
  wavesplat page run.wspl other.wspl --beside -o site/
  wavesplat page https://host/run.wspl --beside -o site/")]
pub(crate) struct PageArgs {
    /// Coefficient files, more than one with --beside
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// File to write, or - for standard output; with --beside, a folder
    #[arg(short, long, value_name = "OUT", help_heading = "Output")]
    output: PathBuf,
    /// Write a folder for a static server: a page, the program, and copies of the files. Files at https:// addresses stay
    /// there; their servers must answer ranges of bytes and allow the page to read (CORS)
    #[arg(long, help_heading = "Output")]
    beside: bool,
    /// Replace an existing page, or a folder that this command wrote
    #[arg(long, help_heading = "Output")]
    force: bool,
    /// Options of wavesplat-render for all pictures
    #[arg(last = true, value_name = "OPTIONS")]
    options: Vec<OsString>,
    #[command(flatten)]
    remote: RemoteArgs,
    #[command(flatten)]
    common: CommonArgs,
}

pub(crate) fn run(args: &PageArgs) -> Result<()> {
    args.common.start()?;
    if args.inputs.len() > 1 && !args.beside {
        return Err(Error::usage("a page within one file shows one coefficient file: use --beside for several"));
    }
    let viewers = args.inputs.iter().map(|input| args.viewer(input)).collect::<Result<Vec<_>>>()?;
    spare_inputs(&args.inputs, &args.output)?;
    if args.beside && args.output == Path::new(STANDARD) {
        return Err(Error::usage("--beside writes a folder: name one with -o"));
    }
    if args.beside {
        return write_site(&viewers, &args.output, args.force);
    }
    write_page(&viewers[0], &args.output, args.force)
}

impl PageArgs {
    fn viewer(&self, input: &PathBuf) -> Result<ViewerSession> {
        let options = self.remote.words().into_iter().chain(self.options.iter().cloned());
        viewer_session(std::slice::from_ref(input), self.common.memory.0, options)
    }
}
