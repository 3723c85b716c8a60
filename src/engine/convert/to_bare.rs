//! A conversion with a bare stream as its output (FORMAT.md section 13): for chunks of arrays that other programs store.

use super::{ConvertRequest, convert};
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::progress::Silent;
use wavesplat_core::source::FrameSource;
use wavesplat_format::{Reader, to_bare};

/// Converts all frames of a source as requested into a bare stream, in memory. Messages call it `name`.
///
/// # Errors
/// As [`run`](super::run()); also an error if the source has a description or very many blocks.
pub fn convert_to_bare(source: Box<dyn FrameSource>, request: &ConvertRequest, name: &Path) -> Result<Vec<u8>> {
    let (mut source, config) = request.prepare(source)?;
    let mut file = Vec::new();
    convert(source.as_mut(), &config, name, &mut file, &Silent)?;
    let bare = Reader::open(file).and_then(|file| to_bare(&file));
    bare.map_err(|source| Error::CoefficientFile { path: name.into(), source })
}
