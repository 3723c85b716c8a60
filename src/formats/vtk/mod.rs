//! VTK's legacy files, `.vtk`: one array of STRUCTURED_POINTS, binary or as text.

mod header;
mod lines;
mod read;
#[cfg(test)]
mod tests;

use super::format::{Choices, Format, Reader};
use super::shared::relabelled::relabelled;

pub(crate) static FORMAT: Format = Format { starts: &[header::MAGIC], ..Format::new("legacy VTK", &["vtk"], READER) };

const READER: Reader = Reader::Frames(
    Ok(|path, options, _| {
        let header = read::describe(path, options.variable.as_deref())?;
        relabelled(path, header, options.axes.as_deref())
    }),
    Choices::Variables(read::offer),
);
