//! Samples in files of other programs' formats.

use super::{
    Contents, ExtractConfig, ExtractReport, Files, SampleFormat, Sink, check_memory, contents, extract_to_sink,
};
use std::path::{Path, PathBuf};
use wavesplat_core::base::error::{Error, Result};
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
    /// A memory that is too small, a name that does not fit the format, and a file that cannot be read.
    pub fn new(file: &'a CoefficientFile, config: ExtractConfig, output: &Path, format: SampleFormat) -> Result<Self> {
        let contents = contents(file, &config)?;
        let config = ExtractConfig { order: format.order(&contents), ..config };
        check_memory(file, &config)?;
        let files = Files::new(output, format, &config.frames)?;
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
