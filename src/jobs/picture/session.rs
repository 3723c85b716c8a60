//! The inputs of pictures, kept open for many pictures.

use super::distributions::{Distributions, Kept};
use super::reporter::Reporter;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use wavesplat_core::base::address::{is_address, public_name};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::output::STANDARD;
use wavesplat_core::source::{FrameSource, OpenOptions};
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::remote::RemoteOptions;
use wavesplat_engine::render::SplatSource;
use wavesplat_engine::render::partial::is_partial;
use wavesplat_formats as formats;

/// One part in so many of a session's memory holds decoded blocks.
const KEPT_SHARE: usize = 4;

/// The inputs of pictures, and how they are opened.
#[derive(Debug, Clone, Default)]
pub struct Inputs {
    /// A coefficient file or its address, frames, or partial sums.
    pub paths: Vec<PathBuf>,
    /// How frames are read. Its access is that of coefficient files too.
    pub frames: OpenOptions,
    /// How remote files are read.
    pub remote: RemoteOptions,
}

/// The inputs of pictures. A coefficient file is opened once for all pictures, and again if it has changed.
#[derive(Debug, Clone)]
pub struct Session {
    shared: Arc<Shared>,
    /// Bytes of memory that pictures may take.
    pub(super) memory: usize,
    /// Whether pictures are drawn before a user asks for them.
    is_ahead: bool,
}

#[derive(Debug)]
struct Shared {
    inputs: Inputs,
    /// Bytes of blocks that stay decoded.
    room: usize,
    open: Mutex<Option<CoefficientFile>>,
    /// The same, with damaged blocks taken for missing samples.
    repaired: Mutex<Option<CoefficientFile>>,
    distribution: Kept,
}

impl Shared {
    fn new(inputs: Inputs, open: Option<CoefficientFile>, room: usize) -> Self {
        let (open, repaired) = (Mutex::new(open), Mutex::default());
        Self { inputs, room, open, repaired, distribution: Kept::default() }
    }
}

impl Session {
    /// A session that opens these inputs when it needs them. Pictures take up to `memory` bytes.
    pub fn new(inputs: Inputs, memory: usize) -> Self {
        Self { shared: Shared::new(inputs, None, 0).into(), memory, is_ahead: false }
    }

    /// A session of a file that is open, opened from `inputs`.
    pub fn from_file(file: CoefficientFile, inputs: Inputs, memory: usize) -> Self {
        Self { shared: Shared::new(inputs, Some(file), 0).into(), memory, is_ahead: false }
    }

    /// The same inputs, for many pictures: up to a quarter of the memory holds blocks that stay decoded from one to the next,
    /// unless the open file keeps some already.
    pub fn keeping_decoded(&self) -> Self {
        let open = self.shared.open.lock().unwrap_or_else(PoisonError::into_inner).clone();
        if open.as_ref().is_some_and(CoefficientFile::keeps_decoded) {
            return self.clone();
        }
        let room = self.memory / KEPT_SHARE;
        let open = open.map(|file| file.keeping_decoded(room));
        let shared = Shared::new(self.shared.inputs.clone(), open, room).into();
        Self { shared, memory: self.memory - room, is_ahead: self.is_ahead }
    }

    /// The same inputs for pictures that take up to `memory` bytes.
    pub fn with_memory(&self, memory: usize) -> Self {
        Self { memory, ..self.clone() }
    }

    /// The same inputs, for pictures that are made ahead: they take nothing from what others keep decoded.
    pub(super) fn ahead(&self) -> Self {
        Self { is_ahead: true, ..self.clone() }
    }

    /// The paths or addresses of the inputs.
    pub fn paths(&self) -> &[PathBuf] {
        &self.shared.inputs.paths
    }

    /// Whether frames come from standard input.
    pub(super) fn is_piped(&self) -> bool {
        self.paths() == [Path::new(STANDARD)]
    }

    /// The path of the coefficient file, if that is the input for this method.
    pub fn coefficient_path(&self, method: SplatSource) -> Option<&Path> {
        match self.paths() {
            [only] if method == SplatSource::Coefficients || is_coefficient_name(only) => Some(only),
            _ => None,
        }
    }

    /// The coefficient file, at full detail.
    ///
    /// # Errors
    /// Those of opening it.
    pub(super) fn file(&self, skips_damaged: bool) -> Result<CoefficientFile> {
        let file = kept(&self.shared.open, || self.open_file())?;
        if self.is_ahead {
            file.begin_run_ahead();
        } else {
            file.begin_run();
        }
        if !skips_damaged {
            return Ok(file);
        }
        kept(&self.shared.repaired, || file.clone().skip_damaged())
    }

    /// The distributions of samples of the file, at its level of detail.
    pub(super) fn distributions(&self, file: &CoefficientFile, skips_damaged: bool) -> Distributions {
        Distributions::of_file(&self.shared.distribution, (file.id(), file.lod(), skips_damaged))
    }

    fn open_file(&self) -> Result<CoefficientFile> {
        let path = &self.shared.inputs.paths[0];
        let file = match is_address(path) {
            true => CoefficientFile::open_remote(path, &self.shared.inputs.remote),
            false => CoefficientFile::open_with(path, self.shared.inputs.frames.access),
        };
        let file = file.map_err(|e| hint_at_frames(path, e))?;
        Ok(if self.shared.room > 0 { file.keeping_decoded(self.shared.room) } else { file })
    }

    /// Opens the file again for the next picture.
    pub fn reopen(&self) {
        for open in [&self.shared.open, &self.shared.repaired] {
            *open.lock().unwrap_or_else(PoisonError::into_inner) = None;
        }
    }

    /// Opens the frames, and reports how they are read.
    pub(super) fn open_frames(&self, reporter: &dyn Reporter) -> Result<Box<dyn FrameSource>> {
        if cfg!(target_family = "wasm") {
            return Err(Error::input(&self.paths()[0], "this page reads coefficient files only"));
        }
        let source = formats::open(&self.shared.inputs.paths, &self.shared.inputs.frames)?;
        source.archive().notes.iter().for_each(|note| reporter.note_source(note));
        Ok(source)
    }
}

/// The file that is open, unless it has changed; else what `open` gives.
fn kept(
    open: &Mutex<Option<CoefficientFile>>,
    again: impl FnOnce() -> Result<CoefficientFile>,
) -> Result<CoefficientFile> {
    let mut open = open.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(file) = open.as_ref().filter(|file| file.check_unchanged().is_ok()) {
        return Ok(file.clone());
    }
    let file = again()?;
    *open = Some(file.clone());
    Ok(file)
}

/// What to do with frames instead of opening them as a coefficient file.
pub(super) const FRAMES_HINT: &str = "convert frames first, or render them with `method` direct";

/// Adds a hint to the error for a file without coefficients.
fn hint_at_frames(path: &Path, error: Error) -> Error {
    if is_partial(path) {
        return Error::path(path, "is a part of a picture; `sum` makes pictures of parts");
    }
    let foreign = matches!(&error, Error::CoefficientFile { source: wavesplat_format::Error::Foreign(_), .. });
    if !is_coefficient_name(path) && (foreign || path.is_dir()) {
        return Error::path(public_name(path), format!("not a coefficient file; {FRAMES_HINT}"));
    }
    error
}

/// Whether a path has the name of a coefficient file: on a server, any that is not one of frames.
pub fn is_coefficient_name(path: &Path) -> bool {
    if cfg!(target_family = "wasm") {
        return true; // a browser reads no frames
    }
    let name = public_name(path);
    let ending = name.extension().and_then(OsStr::to_str).unwrap_or_default();
    ending == "wspl" || is_address(path) && !formats::extensions().any(|of_frames| of_frames == ending)
}
