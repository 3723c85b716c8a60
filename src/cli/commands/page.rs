//! `wavesplat page`

use crate::render::file_session;
use crate::{CommonArgs, RemoteArgs, spare_inputs};
use clap::Args;
use serde::Serialize;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::STANDARD;
use wavesplat_jobs::picture::{ViewerSession, write_page, write_site};

/// Write a page that shows coefficient files without a server
///
/// The page does what `wavesplat view` does, except for movies and files of colours: turning, playing and cutting run in the
/// browser. (`wavesplat-render -o run.html` writes finished pictures of chosen views instead.) The page holds the file, so it
/// can be sent by mail. With --beside, it is a folder for a static server, and reads only the parts of the files that it shows.
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
    /// Write a folder for a static server, from which alone it opens: a page, the program, and copies of the files. Files at
    /// https:// addresses stay there; their servers must answer ranges of bytes and allow the page to read (CORS)
    #[arg(long, help_heading = "Output")]
    beside: bool,
    /// Replace an existing file, or a folder that this command wrote
    #[arg(long, help_heading = "Output")]
    force: bool,
    /// Options of wavesplat-render for all pictures
    #[arg(last = true, value_name = "RENDER-OPTIONS")]
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
    match args.beside {
        true => write_site(&viewers, &args.output, args.force)?,
        false => write_page(&viewers[0], &args.output, args.force)?,
    }
    args.common.report(&Written { output: &args.output }, args.output == Path::new(STANDARD))
}

/// The report of `--json`.
#[derive(Serialize)]
struct Written<'a> {
    /// The file or the folder; `-` is standard output.
    output: &'a Path,
}

impl PageArgs {
    fn viewer(&self, input: &Path) -> Result<ViewerSession> {
        let options = self.remote.words().into_iter().chain(self.options.iter().cloned());
        file_session(input, self.common.memory.0, options)
    }
}
