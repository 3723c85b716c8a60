//! An open coefficient file.
#![allow(clippy::needless_pass_by_value, reason = "functions of Python own their arguments")]

use crate::errors::raised;
use crate::look::{Viewer, bytes, page, render_from};
use crate::object::ObjectStorage;
use crate::{described, fork, job};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ffi::OsString;
use std::path::PathBuf;
use wavesplat::Region;
use wavesplat::base::address::is_address;
use wavesplat::base::progress::Silent;
use wavesplat::extract::{ExtractConfig, OutputOfExtraction, extract_into, format_of};
use wavesplat::file::report::BoundReport;
use wavesplat::file::{CoefficientFile, setting};
use wavesplat::picture::{Inputs, Session};
use wavesplat::remote::{Cache, RemoteOptions};

/// Reads of fewer bytes end so soon that they need not be interruptible.
const SHORT: usize = 16 << 20;

/// How a file is opened by its path or address.
fn inputs(path: PathBuf, cache_dir: Option<PathBuf>) -> wavesplat::Result<Inputs> {
    let cache = cache_dir.filter(|_| is_address(&path)).map(|folder| Cache::new(folder, Cache::ROOM)).transpose()?;
    let remote = RemoteOptions { cache, ..RemoteOptions::default() };
    Ok(Inputs { paths: vec![path], remote, ..Inputs::default() })
}

/// An open coefficient file; several threads may read it. Triples are in the order x, y, z.
#[pyclass(frozen, module = "wavesplat._wavesplat")]
pub(crate) struct File {
    file: CoefficientFile,
    /// The same file at full detail, for pictures.
    session: Session,
}

#[pymethods]
impl File {
    #[new]
    #[pyo3(signature = (path, lod = 0, cache_dir = None, cache = 0))]
    fn new(py: Python<'_>, path: PathBuf, lod: u32, cache_dir: Option<PathBuf>, cache: usize) -> PyResult<Self> {
        let open = || {
            let inputs = inputs(path, cache_dir)?;
            let whole = match is_address(&inputs.paths[0]) {
                true => CoefficientFile::open_remote(&inputs.paths[0], &inputs.remote)?,
                false => CoefficientFile::open(&inputs.paths[0])?,
            };
            Self::of(whole, inputs, lod, cache)
        };
        fork::call(py, open)
    }

    /// Opens a file of so many bytes in an object that `read` reads: called with the starts and the ends of ranges, it returns a list
    /// with the bytes of each. Messages call it `name`.
    #[staticmethod]
    fn of_object(
        py: Python<'_>,
        name: PathBuf,
        read: Py<PyAny>,
        length: u64,
        lod: u32,
        cache: usize,
    ) -> PyResult<Self> {
        let open = || {
            let whole = CoefficientFile::from_storage(&name, ObjectStorage::new(read, length))?;
            Self::of(whole, inputs(name, None)?, lod, cache)
        };
        fork::call(py, open)
    }

    /// Makes the pictures of a request, given as JSON. `memory` is a size such as 512MiB.
    #[pyo3(signature = (request, output, memory, report = None))]
    fn render(
        &self,
        py: Python<'_>,
        request: &str,
        output: PathBuf,
        memory: &str,
        report: Option<Py<PyAny>>,
    ) -> PyResult<()> {
        let session = self.session.with_memory(bytes(memory).map_err(raised)?);
        render_from(py, &session, request, output, report)
    }

    /// Writes a page that holds the file, and whose pictures have the settings of a request.
    fn page(&self, py: Python<'_>, request: &str, output: PathBuf, memory: &str) -> PyResult<()> {
        let session = self.session.with_memory(bytes(memory).map_err(raised)?);
        page(py, &session, request, output)
    }

    /// Starts a viewer, whose pictures have the settings of a request.
    fn view(&self, py: Python<'_>, request: &str, port: u16, memory: &str) -> PyResult<Viewer> {
        let session = self.session.with_memory(bytes(memory).map_err(raised)?);
        Viewer::new(py, session, request, port)
    }

    #[getter]
    fn path(&self) -> OsString {
        self.file.path().into()
    }

    #[getter]
    fn id(&self) -> String {
        self.file.id().to_string()
    }

    #[getter]
    fn dims(&self) -> [usize; 3] {
        self.file.grid.dims
    }

    #[getter]
    fn frames(&self) -> usize {
        self.file.frames()
    }

    #[getter]
    fn sample(&self) -> &'static str {
        self.file.sample().name()
    }

    #[getter]
    fn channels(&self) -> usize {
        self.file.channels()
    }

    /// Voxels of a block along each axis.
    #[getter]
    fn block(&self) -> [usize; 3] {
        self.file.blocks.edges
    }

    /// Frames of each window.
    #[getter]
    fn windows(&self) -> Vec<u32> {
        self.file.metadata().windows.iter().map(|window| window.frames).collect()
    }

    #[getter]
    fn times(&self) -> Vec<f64> {
        self.file.metadata().times.clone()
    }

    #[getter]
    fn spacing(&self) -> [f64; 3] {
        self.file.grid.spacing
    }

    #[getter]
    fn origin(&self) -> [f64; 3] {
        self.file.grid.origin
    }

    #[getter]
    fn variable(&self) -> Option<String> {
        self.file.metadata().variable.clone()
    }

    #[getter]
    fn missing_value(&self) -> Option<f64> {
        self.file.metadata().missing_value
    }

    #[getter]
    fn value_range(&self) -> (f64, f64) {
        self.file.source_range()
    }

    #[getter]
    fn coarsest(&self) -> u32 {
        self.file.coarsest_detail()
    }

    #[getter]
    fn bytes(&self) -> u64 {
        self.file.bytes()
    }

    #[getter]
    fn bytes_read(&self) -> u64 {
        self.file.bytes_read()
    }

    /// A stored setting of the conversion.
    fn setting(&self, name: &str) -> Option<String> {
        setting(self.file.metadata(), name).map(String::from)
    }

    /// The error bound, as JSON.
    fn promise(&self) -> String {
        serde_json::to_string(&BoundReport::from_metadata(self.file.metadata())).unwrap_or_default()
    }

    /// The largest error of any sample.
    #[getter]
    fn reached(&self) -> f64 {
        self.file.metadata().windows.iter().map(|window| window.reached).fold(0.0, f64::max)
    }

    /// The source's description; None if the file has none.
    fn description<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let description = fork::call(py, || self.file.description())?;
        description.map(|description| described::to_python(py, &description)).transpose()
    }

    /// Checks every byte of the file.
    #[pyo3(signature = (report = None))]
    fn check(&self, py: Python<'_>, report: Option<Py<PyAny>>) -> PyResult<()> {
        job::run(py, report.as_ref(), |_, _| self.file.check_stored())
    }

    /// Writes the samples of a box of some ascending frames into the bytes of an array, frame after frame, x fastest.
    #[allow(clippy::too_many_arguments, reason = "a method of Python takes them one by one")]
    fn read(
        &self,
        py: Python<'_>,
        frames: Vec<usize>,
        region: ([usize; 3], [usize; 3]),
        channel: usize,
        memory: usize,
        out: &Bound<'_, PyArray1<u8>>,
    ) -> PyResult<()> {
        let region = Region { start: region.0, end: region.1 };
        let config = ExtractConfig { frames, region, channel, memory, ..ExtractConfig::new(&self.file) };
        let mut out = out.try_readwrite().map_err(|e| PyValueError::new_err(format!("out: {e}")))?;
        let out = out.as_slice_mut()?;
        match out.len() < SHORT {
            true => fork::call(py, || extract_into(&self.file, &config, out, &Silent))?,
            false => job::run(py, None, |progress, _| extract_into(&self.file, &config, out, progress))?,
        };
        Ok(())
    }

    /// Writes the samples of a box of some ascending frames to files, whose format the ending of `output` says. Returns the report as
    /// JSON, and notes.
    #[allow(clippy::too_many_arguments, reason = "a method of Python takes them one by one")]
    #[pyo3(signature = (output, frames, region, channel, memory, overwrite, report = None))]
    fn extract(
        &self,
        py: Python<'_>,
        output: PathBuf,
        frames: Vec<usize>,
        region: ([usize; 3], [usize; 3]),
        channel: usize,
        memory: usize,
        overwrite: bool,
        report: Option<Py<PyAny>>,
    ) -> PyResult<(String, Vec<String>)> {
        let region = Region { start: region.0, end: region.1 };
        let config = ExtractConfig { frames, region, channel, memory, ..ExtractConfig::new(&self.file) };
        job::run(py, report.as_ref(), |progress, _| {
            let output = OutputOfExtraction::new(&self.file, config, &output, format_of(&output)?)?;
            let notes = output.notes();
            let report = output.write(overwrite, progress)?;
            Ok((serde_json::to_string(&report).unwrap_or_default(), notes))
        })
    }
}

impl File {
    /// A file at a level of detail, whose decoded blocks are kept.
    fn of(whole: CoefficientFile, inputs: Inputs, lod: u32, cache: usize) -> wavesplat::Result<Self> {
        let whole = whole.keeping_decoded(cache);
        let session = Session::from_file(whole.clone(), inputs, 0);
        Ok(Self { file: whole.with_detail(lod)?, session })
    }
}
