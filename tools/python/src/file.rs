//! An open coefficient file.
#![allow(clippy::needless_pass_by_value, reason = "functions of Python own their arguments")]

use crate::errors::raised;
use crate::{described, job};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use wavesplat::Region;
use wavesplat::base::address::is_address;
use wavesplat::base::progress::Silent;
use wavesplat::extract::{ExtractConfig, extract_to};
use wavesplat::file::report::BoundReport;
use wavesplat::file::{CoefficientFile, setting};
use wavesplat::remote::{Cache, RemoteOptions};

/// Reads of fewer bytes end so soon that they need not be interruptible.
const SHORT: usize = 16 << 20;

/// Opens a file by its path or address.
fn opened(path: &Path, cache_dir: Option<PathBuf>) -> wavesplat::Result<CoefficientFile> {
    if !is_address(path) {
        return CoefficientFile::open(path);
    }
    let cache = cache_dir.map(|folder| Cache::new(folder, Cache::ROOM)).transpose()?;
    CoefficientFile::open_remote(path, &RemoteOptions { cache, ..RemoteOptions::default() })
}

/// An open coefficient file; several threads may read it. Triples are in the order x, y, z.
#[pyclass(frozen, module = "wavesplat._wavesplat")]
pub(crate) struct File {
    file: CoefficientFile,
}

#[pymethods]
impl File {
    #[new]
    #[pyo3(signature = (path, lod = 0, cache_dir = None))]
    fn new(py: Python<'_>, path: PathBuf, lod: u32, cache_dir: Option<PathBuf>) -> PyResult<Self> {
        let file = py.detach(|| opened(&path, cache_dir)?.with_detail(lod)).map_err(raised)?;
        Ok(Self { file })
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

    /// What is promised, as JSON.
    fn promise(&self) -> String {
        serde_json::to_string(&BoundReport::from_metadata(self.file.metadata())).unwrap_or_default()
    }

    /// The largest error of any sample.
    #[getter]
    fn reached(&self) -> f64 {
        self.file.metadata().windows.iter().map(|window| window.reached).fold(0.0, f64::max)
    }

    /// What the source says beside its samples; None if nothing is kept.
    fn description<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let description = self.file.description().map_err(raised)?;
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
        let is_short = out.len() < SHORT;
        let mut at = 0;
        let mut write = |samples: &[u8]| {
            let room = out.get_mut(at..at + samples.len());
            at += samples.len();
            room.map(|room| room.copy_from_slice(samples)).ok_or(wavesplat::Error::setting("out", "is too small"))
        };
        match is_short {
            true => py.detach(|| extract_to(&self.file, &config, &mut write, &Silent)).map_err(raised)?,
            false => job::run(py, None, |progress, _| extract_to(&self.file, &config, &mut write, progress))?,
        };
        Ok(())
    }
}
