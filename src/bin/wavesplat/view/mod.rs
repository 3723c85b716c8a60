//! `wavesplat view`: shows a file or frames in the browser.

mod browser;
mod guard;
mod server;

use clap::Args;
use server::Server;
use std::ffi::OsString;
use std::net::{IpAddr, Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Result};
use wavesplat::cli::render::live::Scenery;
use wavesplat::cli::{self, CommonArgs};

/// Look around in a browser: turn, zoom, play, choose colours
///
/// Prints the address of a page, and opens it. The page shows means, largest values, composites, isosurfaces and slices,
/// and gives the wavesplat-render command of what it shows. Ctrl-C ends it. The environment variable WAVESPLAT_TOKEN sets
/// the last part of the address, which is else new every time.
#[derive(Debug, Args)]
#[command(before_help = "\
Examples:
  wavesplat view run.wspl
  wavesplat view frames/
  wavesplat view run.wspl --no-open --port 8123
  wavesplat view ocean.wspl -- --exaggerate 50 --sigma 0.5")]
pub(crate) struct ViewArgs {
    /// Coefficient file, or frames
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Port of the server [default: any free one]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Only print the address
    #[arg(long)]
    no_open: bool,
    /// Address to listen at. Others than the default let other machines look, if they know the whole address
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
    /// Options of wavesplat-render for all pictures
    #[arg(last = true, value_name = "OPTIONS")]
    options: Vec<OsString>,
    #[command(flatten)]
    common: CommonArgs,
}

/// Shows the page until the program is interrupted.
pub(crate) fn run(args: &ViewArgs) -> Result<()> {
    args.common.start()?;
    let scenery = args.scenery();
    let facts = scenery.facts()?;
    let at = format!("{}:{}", args.listen, args.port);
    let listening = |e| Error::io(Path::new(&at), "listening", e);
    let listener = TcpListener::bind((args.listen, args.port)).map_err(listening)?;
    let address = listener.local_addr().map_err(listening)?;
    let token = guard::chosen_token(std::env::var(guard::TOKEN).ok())?;
    let page = format!("http://{address}/{token}/");
    if !args.listen.is_loopback() {
        args.common.note("other machines that know this address can look at these data:");
    }
    cli::print(&format!("{page}\n"))?;
    if !args.no_open {
        browser::open(&page);
    }
    Server::new(scenery, facts, token).run(listener).map_err(listening)
}

impl ViewArgs {
    fn scenery(&self) -> Scenery {
        let is_file = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "wspl");
        let method = if self.inputs.iter().all(is_file) { "coefficients" } else { "direct" };
        let mut options =
            vec![format!("--method={method}").into(), format!("--memory={}", self.common.memory.0).into()];
        options.extend(self.options.iter().cloned());
        Scenery { inputs: self.inputs.iter().map(OsString::from).collect(), options }
    }
}
