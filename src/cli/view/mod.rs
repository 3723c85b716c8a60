//! `wavesplat view`: shows a file or frames in the browser.

mod answers;
mod browser;
mod connections;
mod guard;
mod server;

use crate::render::viewer_session;
use crate::{CommonArgs, RemoteArgs};
use clap::Args;
use server::{Server, Stop};
use std::ffi::OsString;
use std::net::{IpAddr, Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::{io, thread};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_jobs::picture::ViewerSession;

/// Look around in a browser: turn, zoom, play, choose colours
///
/// Prints the address of a page, and opens it. The page shows means, largest values, composites, isosurfaces and slices,
/// and gives the wavesplat-render command of what it shows. Ctrl-C ends it. Set WAVESPLAT_TOKEN to fix the last part of
/// the address; otherwise it is random.
#[derive(Debug, Args)]
#[command(before_help = "\
Examples:
  wavesplat view run.wspl
  wavesplat view frames/
  wavesplat view run.wspl --no-open --port 8123
  wavesplat view ocean.wspl -- --exaggerate 50 --sigma 0.5")]
pub struct ViewArgs {
    /// Coefficient file, or frames
    #[arg(required = true)]
    inputs: Vec<PathBuf>,
    /// Port of the server [default: any free one]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    port: u16,
    /// Only print the address
    #[arg(long)]
    no_open: bool,
    /// Address to listen at. Any other than the default lets other machines connect, if they know the whole address
    #[arg(long, value_name = "ADDRESS", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
    /// Options of wavesplat-render for all pictures
    #[arg(last = true, value_name = "OPTIONS")]
    options: Vec<OsString>,
    #[command(flatten)]
    remote: RemoteArgs,
    #[command(flatten)]
    common: CommonArgs,
}

/// Shows the page until the program is interrupted.
pub fn run(args: &ViewArgs) -> Result<()> {
    args.common.start()?;
    let viewer = Viewer::new(args.session()?, args.listen, args.port, std::env::var(guard::TOKEN).ok())?;
    if !args.listen.is_loopback() {
        args.common.note("other machines that know this address can look at these data:");
    }
    crate::print(&format!("{}\n", viewer.address))?;
    if !args.no_open {
        browser::open(&viewer.address);
    }
    viewer.serve(&Stop::default())
}

/// A server of the page that listens already.
pub struct Viewer {
    server: Server,
    listener: TcpListener,
    /// The address of the page.
    pub address: String,
}

impl Viewer {
    /// Opens the scene, and listens at an address and a port, at any free one for port 0. The last part of the address is
    /// `token`, or a new one.
    ///
    /// # Errors
    /// Inputs that cannot be opened, an address that cannot be had, or a token that is too short.
    pub fn new(session: ViewerSession, listen: IpAddr, port: u16, token: Option<String>) -> Result<Self> {
        let facts = session.facts()?;
        let listening = |e| failed(&format!("{listen}:{port}"), e);
        let listener = TcpListener::bind((listen, port)).map_err(listening)?;
        let at = listener.local_addr().map_err(listening)?;
        let token = guard::chosen_token(token)?;
        let address = format!("http://{at}/{token}/");
        Ok(Self { server: Server::new(session, facts, token), listener, address })
    }

    /// Answers requests until it is stopped.
    fn serve(self, stop: &Stop) -> Result<()> {
        self.server.run(self.listener, stop).map_err(|e| failed(&self.address, e))
    }

    /// Answers requests on a separate thread, until the returned viewer is dropped.
    pub fn serve_aside(self) -> Serving {
        let stop = Stop::default();
        let own = stop.clone();
        Serving { stop, thread: Some(thread::spawn(move || self.serve(&own))) }
    }
}

/// A viewer that answers until this is dropped.
pub struct Serving {
    stop: Stop,
    thread: Option<thread::JoinHandle<Result<()>>>,
}

impl Drop for Serving {
    fn drop(&mut self) {
        self.stop.stop();
        let _ = self.thread.take().map(thread::JoinHandle::join); // nobody waits for its answers
    }
}

/// Opens an address in the browser of the desktop, if there is one.
pub fn open_browser(address: &str) {
    browser::open(address);
}

fn failed(at: &str, error: io::Error) -> Error {
    Error::io(Path::new(at), "listening", error)
}

impl ViewArgs {
    fn session(&self) -> Result<ViewerSession> {
        let options = self.remote.words().into_iter().chain(self.options.iter().cloned());
        viewer_session(&self.inputs, self.common.memory.0, options)
    }
}
