//! Pictures, and the viewer in the browser.
#![allow(clippy::needless_pass_by_value, reason = "functions of Python own their arguments")]

use crate::errors::raised;
use crate::job;
use pyo3::prelude::*;
use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use wavesplat::Error;
use wavesplat::picture::{self, Caller, Inputs, PictureRequest, Session, ViewerSession};
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

/// A viewer that answers the browser until it is closed.
#[pyclass(frozen, module = "wavesplat._wavesplat")]
pub(crate) struct Viewer {
    serving: Mutex<Option<Serving>>,
    #[pyo3(get)]
    address: String,
}

impl Viewer {
    pub(crate) fn new(py: Python<'_>, session: Session, request: &str, port: u16) -> PyResult<Self> {
        let request = PictureRequest::from_json(request).map_err(raised)?;
        let session = ViewerSession::new(&session, request, Vec::new());
        let localhost = IpAddr::V4(Ipv4Addr::LOCALHOST);
        let viewer = py.detach(|| view::Viewer::new(session, localhost, port, None)).map_err(raised)?;
        let address = viewer.address.clone();
        Ok(Self { serving: Mutex::new(Some(viewer.serve_aside())), address })
    }
}

#[pymethods]
impl Viewer {
    fn open_browser(&self) {
        view::open_browser(&self.address);
    }

    fn close(&self, py: Python<'_>) {
        let serving = self.serving.lock().unwrap_or_else(PoisonError::into_inner).take();
        py.detach(|| drop(serving));
    }
}
