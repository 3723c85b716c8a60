//! Samples in files of other programs' formats.

use super::placed::extract_to_sink;
use super::sink::{Files, Sink};
use super::{Contents, ExtractConfig, ExtractReport, SampleFormat, check_memory, contents};
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::inputs::spare_inputs;
use wavesplat_core::base::progress::Progress;
use wavesplat_engine::file::CoefficientFile;

/// The files of an extraction, not yet written.
pub struct OutputOfExtraction<'a> {
    file: &'a CoefficientFile,
    config: ExtractConfig,
    format: SampleFormat,
    contents: Contents,
    files: Files,
}

impl<'a> OutputOfExtraction<'a> {
    /// Samples of `file` in `output`: a file, a folder, or a pattern if each frame has a file of its own. The order of the samples is
    /// that of the format.
    ///
    /// # Errors
    /// Frames that do not ascend or none, a memory that is too small, a name that does not fit the format or is that of `file`, and
    /// a file that cannot be read.
    pub fn new(file: &'a CoefficientFile, config: ExtractConfig, output: &Path, format: SampleFormat) -> Result<Self> {
        if config.frames.is_empty() || !config.frames.is_sorted_by(|a, b| a < b) {
            return Err(Error::setting("frames", "takes numbers that ascend, at least one"));
        }
        let contents = contents(file, &config)?;
        let config = ExtractConfig { order: format.order(&contents), ..config };
        check_memory(file, &config)?;
        let files = Files::new(output, format, &config.frames)?;
        if file.path().exists() {
            files.paths().try_for_each(|path| spare_inputs(&[file.path().into()], path))?;
        }
        Ok(Self { file, config, format, contents, files })
    }

    /// The files.
    pub fn paths(&self) -> Vec<PathBuf> {
        self.files.paths().map(Path::to_path_buf).collect()
    }

    /// What the format does not hold.
    pub fn notes(&self) -> Vec<String> {
        self.format.notes(&self.contents)
    }

    /// Writes the files.
    ///
    /// # Errors
    /// A file that exists, unless `force` replaces it, that cannot be written, or a damaged block.
    pub fn write(self, force: bool, progress: &dyn Progress) -> Result<ExtractReport> {
        let mut sink = Sink::create(self.files, &self.contents, force)?;
        let report = extract_to_sink(self.file, &self.config, &mut sink, progress)?;
        sink.finish().map(|()| report)
    }
}

/// The format of a file, by the ending of its name.
///
/// # Errors
/// Another ending.
pub fn format_of(path: &Path) -> Result<SampleFormat> {
    let formats = || SampleFormat::all().into_iter().map(|format| format!(".{}", format.name())).collect::<Vec<_>>();
    let unknown = || Error::path(path, format!("the extension is none of {}; rename the file", formats().join(" ")));
    SampleFormat::of_ending(path).ok_or_else(unknown)
}
