//! Chunks of arrays as bare streams, for the codec of Zarr. Samples are little-endian, x fastest, then y, z and frames.
#![allow(clippy::needless_pass_by_value, reason = "functions of Python own their arguments")]

use crate::errors::{DamagedError, borrowed, raised};
use crate::fork;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::path::Path;
use wavesplat::Error;
use wavesplat::base::grid::Grid;
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{ConvertRequest, convert_to_bare};
use wavesplat::extract::{ExtractConfig, extract_into};
use wavesplat::file::CoefficientFile;
use wavesplat::source::ArraySource;

/// What messages call a chunk: a codec does not know its key.
const NAME: &str = "a chunk";

/// The stream of whole frames of `dims` voxels along x, y and z. The request is a [`ConvertRequest`] as JSON.
#[pyfunction]
pub(crate) fn encode<'py>(
    py: Python<'py>,
    samples: &Bound<'py, PyArray1<u8>>,
    dims: [usize; 3],
    sample: &str,
    request: &str,
) -> PyResult<Bound<'py, PyBytes>> {
    fork::refuse()?;
    let (request, sample) = (parsed(request)?, named(sample)?);
    let samples = samples.try_readonly().map_err(borrowed)?.as_slice()?.to_vec();
    let convert = || {
        let source = ArraySource::new(Grid::unit(dims), sample, samples)?;
        convert_to_bare(Box::new(source), &request, Path::new(NAME))
    };
    Ok(PyBytes::new(py, &fork::call(py, convert)?))
}

/// Checks a request.
#[pyfunction]
pub(crate) fn check(request: &str) -> PyResult<()> {
    parsed(request)?.check().map_err(raised)
}

/// A decoded stream: its samples, its voxels along x, y and z, and frames, and where the next one begins.
type Decoded<'py> = (Bound<'py, PyArray1<u8>>, [usize; 4], usize);

/// The stream that begins at `at`, of at most so many voxels and frames.
#[pyfunction]
pub(crate) fn decode<'py>(
    py: Python<'py>,
    bytes: &[u8],
    at: usize,
    most: [usize; 4],
    sample: &str,
) -> PyResult<Decoded<'py>> {
    let sample = named(sample)?;
    let stream = bytes.get(at..).unwrap_or_default();
    let decode = || {
        let (file, rest) = CoefficientFile::from_bare(NAME, stream)?;
        let [x, y, z] = file.grid.dims;
        let found = [x, y, z, file.frames()];
        if file.sample() != sample || file.channels() > 1 || found.iter().zip(most).any(|(found, most)| *found > most) {
            let what =
                format!("holds {} samples of {found:?}; the array has {sample}, at most {most:?}", file.sample());
            return Err(Error::input(NAME, what));
        }
        let mut samples = vec![0; found.iter().product::<usize>() * sample.size()];
        extract_into(&file, &ExtractConfig::new(&file), &mut samples, &Silent)?;
        Ok((samples, found, bytes.len() - rest.len()))
    };
    // What mends a file is of no help here.
    let plain = |error| match error {
        Error::CoefficientFile { path, source } => Ok(Err(format!("{}: {source}", path.display()))),
        other => Err(other),
    };
    let (samples, found, next) = fork::call(py, || decode().map(Ok).or_else(plain))?.map_err(DamagedError::new_err)?;
    Ok((PyArray1::from_vec(py, samples), found, next))
}

fn named(sample: &str) -> PyResult<SampleType> {
    sample.parse().map_err(PyValueError::new_err::<String>)
}

fn parsed(request: &str) -> PyResult<ConvertRequest> {
    serde_json::from_str(request).map_err(|e| PyValueError::new_err(e.to_string()))
}
