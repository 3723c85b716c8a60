//! Pictures, and the viewer in the browser.
#![allow(clippy::needless_pass_by_value, reason = "functions of Python own their arguments")]

use crate::errors::raised;
use crate::job;
use pyo3::prelude::*;
use std::ffi::OsString;
use std::net::{IpAddr, Ipv4Addr};
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};
use wavesplat::cli::render::run_within;
use wavesplat::cli::view::{self, Serving};

/// Does what words after `wavesplat-render` ask for.
#[pyfunction]
#[pyo3(signature = (words, report = None))]
pub(crate) fn render(py: Python<'_>, words: Vec<OsString>, report: Option<Py<PyAny>>) -> PyResult<()> {
    job::run(py, report.as_ref(), |progress, _| run_within(words, progress))
}

/// A viewer that answers the browser until it is closed.
#[pyclass(frozen, module = "wavesplat._wavesplat")]
pub(crate) struct Viewer {
    serving: Mutex<Option<Serving>>,
    #[pyo3(get)]
    address: String,
}

#[pymethods]
impl Viewer {
    #[new]
    fn new(py: Python<'_>, path: PathBuf, port: u16, memory: usize, options: Vec<OsString>) -> PyResult<Self> {
        let scenery = view::scenery(&[path], memory, options);
        let at = (IpAddr::V4(Ipv4Addr::LOCALHOST), port);
        let viewer = py.detach(|| view::Viewer::new(scenery, at, None)).map_err(raised)?;
        let address = viewer.address.clone();
        Ok(Self { serving: Mutex::new(Some(viewer.serve_aside())), address })
    }

    fn open_browser(&self) {
        view::open_browser(&self.address);
    }

    fn close(&self, py: Python<'_>) {
        let serving = self.serving.lock().unwrap_or_else(PoisonError::into_inner).take();
        py.detach(|| drop(serving));
    }
}
