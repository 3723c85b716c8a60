//! A conversion with a file as its output.

use super::{ConvertConfig, ConvertReport, convert};
use crate::file::resume::check;
use std::path::Path;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::output::Output;
use wavesplat_core::base::progress::Silent;
use wavesplat_core::source::FrameSource;

/// Converts all frames of `source` into the coefficient file `path`.
///
/// The file gets its name once it is complete and all its checksums hold; a file that had this name is replaced then. For
/// progress, other outputs or interrupted conversions see [`super::run()`].
///
/// # Errors
/// As [`convert`], and [`Error::Io`](wavesplat_core::base::error::Error::Io) where the file cannot be written.
pub fn convert_to_file(
    source: &mut dyn FrameSource,
    config: &ConvertConfig,
    path: impl AsRef<Path>,
) -> Result<ConvertReport> {
    let path = path.as_ref();
    let mut out = Output::create(path, true)?;
    let report = convert(source, config, path, &mut out, &Silent)?;
    out.commit_if(check)?;
    Ok(report)
}
