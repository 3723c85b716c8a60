//! Conversions of what Python holds.
#![allow(clippy::needless_pass_by_value, reason = "functions of Python own their arguments")]

use crate::advice;
use crate::described::{GivenValues, given_attributes};
use crate::frames::FrameReader;
use crate::job::{self, Caller};
use crate::named::{GivenArray, PythonArrays};
use pyo3::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use wavesplat::base::progress::Progress;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::shard::{Shard, sharded};
use wavesplat::convert::{Bound as ErrorBound, ConvertConfig, ConvertReport, MissingPolicy, PartialFile, open_partial};
use wavesplat::file::merge::Shards;
use wavesplat::file::resume::{self, Earlier};
use wavesplat::source::{self, FrameSource, GivenTimes, NamedArrays, OpenOptions};
use wavesplat::{Error, Result};

/// Settings of a conversion, and where it goes.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Settings {
    path: PathBuf,
    resume: bool,
    overwrite: bool,
    tolerance: f64,
    max_error: Option<f64>,
    bound: String,
    floor: f64,
    range: Option<(f64, f64)>,
    /// `error`, `mask`, or what the source says.
    missing: Option<String>,
    missing_value: Option<f64>,
    clip: bool,
    window: usize,
    chain: usize,
    /// Which of how many shards, from 1.
    shard: Option<(usize, usize)>,
    block: Option<usize>,
    level: i32,
    memory: usize,
}

/// A window of frames may take one part in this many of the memory.
const SHARE: usize = 4;

impl Settings {
    fn bound(&self) -> Result<ErrorBound> {
        match self.bound.as_str() {
            "pointwise" => Ok(ErrorBound::Pointwise),
            "rms" => Ok(ErrorBound::Rms),
            "relative" => Ok(ErrorBound::Relative { floor: self.floor }),
            other => Err(Error::setting("bound", format!("'pointwise', 'rms' or 'relative', not {other:?}"))),
        }
    }

    fn config(&self, source: &dyn FrameSource) -> Result<ConvertConfig> {
        let archive = source.archive();
        let is_declared = archive.missing.is_some() || self.missing_value.is_some();
        let missing = match self.missing.as_deref() {
            Some("mask") => MissingPolicy::Mask,
            Some("error") => MissingPolicy::Error,
            None if is_declared => MissingPolicy::Mask,
            None => MissingPolicy::Error,
            Some(other) => return Err(Error::setting("missing", format!("'error' or 'mask', not {other:?}"))),
        };
        Ok(ConvertConfig {
            window: self.window,
            chain: self.chain,
            max_error: self.max_error,
            bound: self.bound()?,
            range: self.range,
            missing,
            missing_value: archive.missing_value(self.missing_value),
            clip: self.clip,
            block: self.block,
            level: self.level,
            memory: self.memory,
            ..ConvertConfig::new(self.tolerance)
        })
    }

    /// Converts, and returns the report as JSON and warnings; nothing if the file is complete already.
    fn convert(
        &self,
        source: &mut dyn FrameSource,
        config: &ConvertConfig,
        progress: &dyn Progress,
    ) -> Result<Option<ConvertReport>> {
        if self.resume && !self.overwrite && self.path.is_file() {
            return self.check_complete(source, config).map(|()| None);
        }
        let (mut out, held) = resume::open(&self.path, self.overwrite, Earlier::by(self.overwrite, self.resume))?;
        let begun = held.map(|complete| PartialFile { complete, first_window: 0, description: None });
        let report = wavesplat::convert::resume(source, config, begun, &self.path, &mut out, progress)?;
        out.commit_if(resume::check)?;
        Ok(Some(report))
    }

    /// An error unless the file is what this conversion would make.
    fn check_complete(&self, source: &dyn FrameSource, config: &ConvertConfig) -> Result<()> {
        let archive = source.archive();
        match resume::is_complete(&self.path, &open_partial(config, archive)?, archive)? {
            true => Ok(()),
            false => Err(Error::path(&self.path, "is complete, but with other settings or frames")),
        }
    }

    /// The frames of the shard, if one is meant.
    fn sharded(
        &self,
        source: Box<dyn FrameSource>,
        config: ConvertConfig,
    ) -> Result<(Box<dyn FrameSource>, ConvertConfig)> {
        let Some((number, of)) = self.shard else { return Ok((source, config)) };
        if !(1..=of).contains(&number) {
            return Err(Error::setting(
                "shard",
                format!("takes (I, N), the I-th of N, from (1, {of}) to ({of}, {of})"),
            ));
        }
        if config.range.is_none() && config.max_error.is_none() {
            return Err(Error::setting(
                "shard",
                "needs range=... or max_error=..., since a shard does not know all frames",
            ));
        }
        let (source, settings) = sharded(source, Shard { number, of }, (config.window, config.chain))?;
        Ok((source, ConvertConfig { settings, ..config }))
    }

    /// Opens frames and converts them. `open` may call Python.
    fn run(
        &self,
        py: Python<'_>,
        open: impl FnOnce(Caller) -> Result<Box<dyn FrameSource>> + Send,
        report: Option<&Py<PyAny>>,
    ) -> PyResult<Converted> {
        job::run(py, report, |progress, caller| {
            let source = open(caller)?;
            let config = self.config(source.as_ref())?;
            let (mut source, config) = self.sharded(source, config)?;
            let mut notes: Vec<String> = source.archive().notes.iter().map(advice::of_note).collect();
            let done = self.convert(source.as_mut(), &config, progress)?;
            notes.extend(done.iter().flat_map(|report| report.warnings.iter().map(advice::of_note)));
            Ok((done.map(|report| serde_json::to_string(&report).unwrap_or_default()), notes))
        })
    }
}

/// The report of a conversion as JSON, nothing if the file was complete already; and what is worth knowing.
type Converted = (Option<String>, Vec<String>);

/// What frames are, and where.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Layout {
    /// Voxels along x, y and z; then frames, if their number is known.
    dims: Vec<usize>,
    sample: String,
    spacing: Option<[f64; 3]>,
    origin: Option<[f64; 3]>,
    times: Option<Vec<f64>>,
    time_unit: Option<String>,
}

/// Converts frames that an iterator gives as bytes, x fastest.
#[pyfunction]
#[pyo3(signature = (iterator, layout, settings, report = None))]
pub(crate) fn convert_frames(
    py: Python<'_>,
    iterator: Py<PyAny>,
    layout: Layout,
    settings: Settings,
    report: Option<Py<PyAny>>,
) -> PyResult<Converted> {
    let Layout { dims, sample, spacing, origin, times, time_unit } = layout;
    let sample = SampleType::ALL.into_iter().find(|ty| ty.name() == sample);
    let times = times.map(|times| GivenTimes::List(times.into()));
    let (dims, memory) = (Some(dims), settings.memory / SHARE);
    let options = OpenOptions { dims, sample, spacing, origin, times, time_unit, memory, ..OpenOptions::default() };
    let open = |caller| source::open_stream(FrameReader::new(iterator, caller), &options);
    settings.run(py, open, report.as_ref())
}

/// Which variable is converted.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Chosen {
    /// What the arrays are called in messages.
    source: String,
    variable: Option<String>,
    axes: Option<String>,
}

/// Converts a variable of named arrays.
#[pyfunction]
#[pyo3(signature = (arrays, attributes, read, chosen, settings, report = None))]
pub(crate) fn convert_arrays(
    py: Python<'_>,
    arrays: Vec<GivenArray<'_>>,
    attributes: Vec<(String, GivenValues<'_>)>,
    read: Py<PyAny>,
    chosen: Chosen,
    settings: Settings,
    report: Option<Py<PyAny>>,
) -> PyResult<Converted> {
    let arrays = arrays.iter().map(GivenArray::array).collect::<PyResult<Vec<_>>>()?;
    let attributes = given_attributes(&attributes)?;
    let Chosen { source: name, variable, axes } = chosen;
    let options = OpenOptions { variable, axes, memory: settings.memory / SHARE, ..OpenOptions::default() };
    let open = |caller| {
        let arrays: Arc<dyn NamedArrays> = Arc::new(PythonArrays::new(arrays, attributes, read, caller));
        source::open_arrays(Path::new(&name), &arrays, &options)
    };
    settings.run(py, open, report.as_ref())
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
    job::run(py, report_to.as_ref(), |progress, _| {
        let shards = Shards::open(&shards, false, progress)?;
        let (mut out, begun) = resume::open(&path, overwrite, Earlier::by(overwrite, resume))?;
        let report = shards.merge(begun, false, &path, &mut out, progress)?;
        out.commit_if(resume::check)?;
        Ok(serde_json::to_string(&report).unwrap_or_default())
    })
}
