//! A format: its names, how its files are recognised, and how they are read and written.

use super::arrays::ArrayArchive;
use super::shared::offer::Offer;
use super::writer::Writer;
use std::path::Path;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::source::file_header::FileHeader;
use wavesplat_core::source::series::FrameFiles;
use wavesplat_core::source::{Extent, OpenOptions};

/// A format of files.
pub(crate) struct Format {
    /// What people call it.
    pub(crate) name: &'static str,
    /// The extensions by which it is known, in lower case.
    pub(crate) extensions: &'static [&'static str],
    /// How its files start, if they are known by that.
    pub(crate) starts: &'static [&'static [u8]],
    pub(crate) reader: Reader,
    /// How samples are written in it, perhaps in several ways.
    pub(crate) writers: &'static [Writer],
}

/// How files of a format are read.
pub(crate) enum Reader {
    /// A header describes the frames.
    Frames(BuiltIn<Describe>, Choices),
    /// One of several arrays with names has the frames. The option `axes` may say what its axes count.
    Arrays(BuiltIn<OpenArrays>),
    /// As a list of files, not frames itself.
    List(fn(&Path) -> Result<FrameFiles>),
    /// Not at all, and why.
    Nothing(&'static str),
}

/// A function, or the feature that it takes and that is not built in.
type BuiltIn<F> = std::result::Result<F, &'static str>;

/// Reads the header of a file, and checks the file's size; beside the samples, what the extent says.
pub(crate) type Describe = fn(&Path, &OpenOptions, Extent) -> Result<FileHeader>;

/// Opens a file of arrays.
pub(crate) type OpenArrays = fn(&Path, &OpenOptions) -> Result<ArrayArchive>;

/// The variables or components of a file, from which the user may have to choose.
pub(crate) enum Choices {
    /// Nothing: it has one array without a name.
    None,
    /// The components of its only array.
    Components,
    /// What this function lists.
    Variables(fn(&Path) -> Result<Offer>),
}

impl Format {
    /// A format that is known by its extensions alone, and not written.
    pub(crate) const fn new(name: &'static str, extensions: &'static [&'static str], reader: Reader) -> Self {
        Self { name, extensions, starts: &[], reader, writers: &[] }
    }

    /// Whether it is this entry of the table.
    pub(crate) fn is(&self, other: &Self) -> bool {
        std::ptr::eq(self, other)
    }

    /// Whether a file of this format holds frames and describes them in a header.
    pub(crate) fn holds_frames(&self) -> bool {
        matches!(self.reader, Reader::Frames(..) | Reader::Arrays(_))
    }

    /// Reads the header of a file of this format.
    pub(crate) fn describe(&self, path: &Path, options: &OpenOptions, extent: Extent) -> Result<FileHeader> {
        let missing = |feature| self.not_built_in(path, feature);
        let described = match &self.reader {
            Reader::Frames(describe, _) => describe.map_err(missing)?(path, options, extent),
            Reader::Arrays(open) => open.map_err(missing)?(path, options)?.describe(options, extent),
            Reader::List(_) => Err(Error::path(path, "a list of files must be the only input")),
            Reader::Nothing(why) => Err(Error::path(path, *why)),
        };
        Ok(FileHeader { format: self.name, ..described? })
    }

    /// The error of a file whose format takes a feature that this build does not have.
    pub(crate) fn not_built_in(&self, path: &Path, feature: &'static str) -> Error {
        Error::input(path, Note::with(format!("{} is not built in", self.name), Remedy::BuildWith(feature)))
    }
}
