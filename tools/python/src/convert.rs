//! Conversions of Python's arrays.
#![allow(clippy::needless_pass_by_value, reason = "functions of Python own their arguments")]

use crate::advice;
use crate::described::{GivenValues, given_attributes};
use crate::fork;
use crate::frames::FrameReader;
use crate::job::{self, Caller};
use crate::named::{GivenArray, PythonArrays};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use wavesplat::base::memory::for_reading;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{ConvertRequest, append, run};
use wavesplat::file::merge::Shards;
use wavesplat::file::resume::{IfUnfinished, ends_with, is_begun};
use wavesplat::file::{CoefficientFile, units};
use wavesplat::formats::{self, NamedArrays, extension_of_frames};
use wavesplat::source::{Archive, FrameSource, GivenTimes, OpenOptions};
use wavesplat::{Error, Result};

/// The request for a conversion, and its output.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Conversion {
    /// A [`ConvertRequest`] as JSON.
    request: String,
    path: PathBuf,
    resume: bool,
    overwrite: bool,
}

impl Conversion {
    fn request(&self) -> PyResult<ConvertRequest> {
        serde_json::from_str(&self.request).map_err(|e| PyValueError::new_err(e.to_string()))
    }

    /// Opens frames and converts them. `open` may call Python.
    fn run(
        &self,
        py: Python<'_>,
        request: &ConvertRequest,
        open: impl FnOnce(Caller) -> Result<Box<dyn FrameSource>> + Send,
        report: Option<&Py<PyAny>>,
    ) -> PyResult<Converted> {
        coefficient_name(&self.path)?;
        fork::refuse()?;
        let if_unfinished = IfUnfinished::from_flags(self.overwrite, self.resume);
        job::run(py, report, |progress, caller| {
            let source = open(caller)?;
            let mut notes: Vec<String> = source.archive().notes.iter().map(advice::of_note).collect();
            let done = run(source, request, &self.path, self.overwrite, if_unfinished, progress);
            let done = done.map_err(|failure| failure.error)?;
            notes.extend(done.iter().flat_map(|report| report.warnings.iter().map(advice::of_note)));
            Ok((done.map(|report| serde_json::to_string(&report).unwrap_or_default()), notes))
        })
    }
}

/// A file that frames are added to.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Appended {
    path: PathBuf,
    memory: usize,
    resume: bool,
    overwrite: bool,
}

impl Appended {
    /// Opens frames and adds them. `open` may call Python; the times are put on the clock of the file. Frames that can be read
    /// `again` are compared with the file's last ones.
    fn run(
        &self,
        py: Python<'_>,
        options: &OpenOptions,
        again: bool,
        open: impl FnOnce(Caller, &OpenOptions) -> Result<Box<dyn FrameSource>> + Send,
        report: Option<&Py<PyAny>>,
    ) -> PyResult<Converted> {
        fork::refuse()?;
        let if_unfinished = IfUnfinished::from_flags(self.overwrite, self.resume);
        job::run(py, report, |progress, caller| {
            let file = CoefficientFile::open(&self.path)?;
            let clock = Some(units(file.metadata()));
            let mut source = open(caller, &OpenOptions { clock, memory: for_reading(self.memory), ..options.clone() })?;
            let mut notes: Vec<String> = source.archive().notes.iter().map(advice::of_note).collect();
            let is_new = self.overwrite || is_begun(&self.path);
            if !is_new && again && ends_with(&file, source.as_mut())? {
                let what = "ends with these frames already; overwrite=True adds them once more";
                return if self.resume { Ok((None, notes)) } else { Err(Error::input(&self.path, what)) };
            }
            self.check_times(&file, source.archive())?;
            let done = append(source.as_mut(), &file, self.memory, if_unfinished, progress);
            let done = done.map_err(|failure| failure.error)?;
            notes.extend(done.warnings.iter().map(advice::of_note));
            Ok((Some(serde_json::to_string(&done).unwrap_or_default()), notes))
        })
    }
}

impl Appended {
    /// An error unless the frames come after those of the file.
    fn check_times(&self, file: &CoefficientFile, archive: &Archive) -> Result<()> {
        match (file.metadata().times.last(), archive.times.first()) {
            (Some(last), Some(first)) if first <= last && !self.overwrite => {
                let what = format!("has frames up to the time {last}, and the new ones begin at {first}");
                Err(Error::input(&self.path, what))
            }
            _ => Ok(()),
        }
    }
}

/// An error if a coefficient file would have the extension of another format.
fn coefficient_name(path: &Path) -> PyResult<()> {
    let Some(extension) = extension_of_frames(path) else { return Ok(()) };
    let what = format!("a coefficient file is named .wspl, not .{extension}; wavesplat extract writes other formats");
    Err(PyValueError::new_err(format!("{}: {what}", path.display())))
}

/// The report of a conversion as JSON, `None` if the file was complete already; and notes.
type Converted = (Option<String>, Vec<String>);

/// The meaning and the positions of frames.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Layout {
    /// Voxels along x, y and z; then frames, if their number is known.
    dims: Vec<usize>,
    /// What messages call the frames.
    name: String,
    sample: String,
    spacing: Option<[f64; 3]>,
    origin: Option<[f64; 3]>,
    times: Option<Vec<f64>>,
    time_unit: Option<String>,
    calendar: Option<String>,
}

/// Converts frames that an iterator gives as bytes, x fastest.
#[pyfunction]
#[pyo3(signature = (iterator, layout, conversion, report = None))]
pub(crate) fn convert_frames(
    py: Python<'_>,
    iterator: Py<PyAny>,
    layout: Layout,
    conversion: Conversion,
    report: Option<Py<PyAny>>,
) -> PyResult<Converted> {
    let request = conversion.request()?;
    let options = OpenOptions { memory: for_reading(request.memory), ..layout.options() };
    let open = |caller| formats::open_named_stream(layout.name, FrameReader::new(iterator, caller), &options);
    conversion.run(py, &request, open, report.as_ref())
}

/// Adds frames that an iterator gives as bytes, x fastest, to a file.
#[pyfunction]
#[pyo3(signature = (iterator, layout, appended, report = None))]
pub(crate) fn append_frames(
    py: Python<'_>,
    iterator: Py<PyAny>,
    layout: Layout,
    appended: Appended,
    report: Option<Py<PyAny>>,
) -> PyResult<Converted> {
    let options = layout.options();
    let open = |caller, options: &OpenOptions| {
        formats::open_named_stream(layout.name, FrameReader::new(iterator, caller), options)
    };
    appended.run(py, &options, false, open, report.as_ref())
}

impl Layout {
    fn options(&self) -> OpenOptions {
        OpenOptions {
            dims: Some(self.dims.clone()),
            sample: SampleType::ALL.into_iter().find(|ty| ty.name() == self.sample),
            spacing: self.spacing,
            origin: self.origin,
            times: self.times.clone().map(|times| GivenTimes::List(times.into())),
            time_unit: self.time_unit.clone(),
            calendar: self.calendar.clone(),
            ..OpenOptions::default()
        }
    }
}

/// Which variable is converted.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Chosen {
    /// The name of the arrays in messages.
    source: String,
    variable: Option<String>,
    axes: Option<String>,
}

/// The arrays that Python describes, once there is a caller of Python.
fn held(
    arrays: &[GivenArray<'_>],
    attributes: &[(String, GivenValues<'_>)],
    read: Py<PyAny>,
) -> PyResult<impl FnOnce(Caller) -> Arc<dyn NamedArrays> + Send + use<>> {
    let arrays = arrays.iter().map(GivenArray::array).collect::<PyResult<Vec<_>>>()?;
    let attributes = given_attributes(attributes)?;
    Ok(|caller| -> Arc<dyn NamedArrays> { Arc::new(PythonArrays::new(arrays, attributes, read, caller)) })
}

/// Converts a variable of named arrays.
#[pyfunction]
#[pyo3(signature = (arrays, attributes, read, chosen, conversion, report = None))]
pub(crate) fn convert_arrays(
    py: Python<'_>,
    arrays: Vec<GivenArray<'_>>,
    attributes: Vec<(String, GivenValues<'_>)>,
    read: Py<PyAny>,
    chosen: Chosen,
    conversion: Conversion,
    report: Option<Py<PyAny>>,
) -> PyResult<Converted> {
    let arrays = held(&arrays, &attributes, read)?;
    let Chosen { source: name, variable, axes } = chosen;
    let request = conversion.request()?;
    let options = OpenOptions { variable, axes, memory: for_reading(request.memory), ..OpenOptions::default() };
    let open = |caller| formats::open_arrays(Path::new(&name), &arrays(caller), &options);
    conversion.run(py, &request, open, report.as_ref())
}

/// Adds the frames of a variable of named arrays to a file.
#[pyfunction]
#[pyo3(signature = (arrays, attributes, read, chosen, appended, report = None))]
pub(crate) fn append_arrays(
    py: Python<'_>,
    arrays: Vec<GivenArray<'_>>,
    attributes: Vec<(String, GivenValues<'_>)>,
    read: Py<PyAny>,
    chosen: Chosen,
    appended: Appended,
    report: Option<Py<PyAny>>,
) -> PyResult<Converted> {
    let arrays = held(&arrays, &attributes, read)?;
    let Chosen { source: name, variable, axes } = chosen;
    let options = OpenOptions { variable, axes, ..OpenOptions::default() };
    let open = |caller, options: &OpenOptions| formats::open_arrays(Path::new(&name), &arrays(caller), options);
    appended.run(py, &options, true, open, report.as_ref())
}

/// Joins shards to one file, and returns a report as JSON.
#[pyfunction]
#[pyo3(signature = (shards, path, resume, overwrite, report_to = None))]
pub(crate) fn merge(
    py: Python<'_>,
    shards: Vec<PathBuf>,
    path: PathBuf,
    resume: bool,
    overwrite: bool,
    report_to: Option<Py<PyAny>>,
) -> PyResult<String> {
    coefficient_name(&path)?;
    job::run(py, report_to.as_ref(), |progress, _| {
        let shards = Shards::open(&shards, false, progress)?;
        let if_unfinished = IfUnfinished::from_flags(overwrite, resume);
        let merged = shards.merge_to_file(&path, overwrite, if_unfinished, false, progress)?;
        Ok(serde_json::to_string(&merged.report).unwrap_or_default())
    })
}
