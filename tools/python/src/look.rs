//! Pictures, and the viewer in the browser.
#![allow(clippy::needless_pass_by_value, reason = "functions of Python own their arguments")]

use crate::errors::raised;
use crate::fork::Running;
use crate::job;
use pyo3::prelude::*;
use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::sync::Mutex;
use wavesplat::Error;
use wavesplat::picture::{self, Caller, Inputs, PictureRequest, Session, ViewerSession, write_page};
use wavesplat_cli::Size;
use wavesplat_cli::view::{self, Serving};

/// Makes the pictures of a request, given as JSON, from files. `memory` is a size such as 512MiB.
#[pyfunction]
#[pyo3(signature = (inputs, request, output, memory, report = None))]
pub(crate) fn render(
    py: Python<'_>,
    inputs: Vec<PathBuf>,
    request: &str,
    output: PathBuf,
    memory: &str,
    report: Option<Py<PyAny>>,
) -> PyResult<()> {
    let session = Session::new(Inputs { paths: inputs, ..Inputs::default() }, bytes(memory).map_err(raised)?);
    render_from(py, &session, request, output, report)
}

/// Makes the pictures of a request from open inputs.
pub(crate) fn render_from(
    py: Python<'_>,
    session: &Session,
    request: &str,
    output: PathBuf,
    report: Option<Py<PyAny>>,
) -> PyResult<()> {
    let request = PictureRequest { output, ..PictureRequest::from_json(request).map_err(raised)? };
    job::run(py, report.as_ref(), |progress, _| picture::run(session, &request, &Caller(progress))?.end)
}

/// Bytes of a size such as 512MiB.
pub(crate) fn bytes(memory: &str) -> wavesplat::Result<usize> {
    memory.parse().map(|size: Size| size.0).map_err(|what| Error::setting("memory", what))
}

/// Writes a page that holds a file and needs no server.
pub(crate) fn page(py: Python<'_>, session: &Session, request: &str, output: PathBuf) -> PyResult<()> {
    let viewer = ViewerSession::new(session, PictureRequest::from_json(request).map_err(raised)?, Vec::new());
    job::run(py, None, |_, _| write_page(&viewer, &output, true))
}

/// A server that answers.
struct Server {
    serving: Serving,
    running: Running,
}

/// A viewer that answers the browser until it is closed.
#[pyclass(frozen, module = "wavesplat._wavesplat")]
pub(crate) struct Viewer {
    server: Mutex<Option<Server>>,
    #[pyo3(get)]
    address: String,
}

impl Viewer {
    pub(crate) fn new(py: Python<'_>, session: Session, request: &str, port: u16) -> PyResult<Self> {
        let request = PictureRequest::from_json(request).map_err(raised)?;
        let session = ViewerSession::new(&session, request, Vec::new());
        let running = Running::begin()?;
        let localhost = IpAddr::V4(Ipv4Addr::LOCALHOST);
        let viewer = py.detach(|| view::Viewer::new(session, localhost, port, None)).map_err(raised)?;
        let address = viewer.address.clone();
        Ok(Self { server: Mutex::new(Some(Server { serving: viewer.serve_aside(), running })), address })
    }
}

#[pymethods]
impl Viewer {
    fn open_browser(&self) {
        view::open_browser(&self.address);
    }

    fn close(&self, py: Python<'_>) {
        py.detach(|| self.end());
    }
}

impl Viewer {
    /// Ends the server in the process that has it. In another one, it is left alone: its thread cannot be joined.
    fn end(&self) {
        let Some(Server { serving, running }) = self.server.try_lock().ok().and_then(|mut server| server.take()) else {
            return;
        };
        match running.is_here() {
            true => drop(serving),
            false => std::mem::forget(serving),
        }
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        self.end();
    }
}
