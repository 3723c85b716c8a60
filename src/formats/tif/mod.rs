//! TIFF: the pages of a file are the planes of a volume along z. OME-XML, ImageJ's text or tifffile's JSON in the first
//! page divides them into frames and channels; so does the option `axes`.

#[cfg(feature = "tiff")]
mod imagej;
#[cfg(feature = "tiff")]
mod ome;
#[cfg(feature = "tiff")]
mod pages;
#[cfg(feature = "tiff")]
mod read;
#[cfg(feature = "tiff")]
mod shaped;
#[cfg(feature = "tiff")]
mod stack;
#[cfg(all(test, feature = "tiff"))]
mod tests;

use super::format::{Choices, Format, Reader};

pub(crate) static FORMAT: Format = Format {
    starts: &[b"II\x2a\0", b"MM\0\x2a", b"II\x2b\0", b"MM\0\x2b"], // also of BigTIFF, in either byte order
    ..Format::new("TIFF", &["tif", "tiff"], READER)
};

#[cfg(feature = "tiff")]
const READER: Reader = Reader::Frames(Ok(|path, options, _| read::describe(path, options)), Choices::Components);
#[cfg(not(feature = "tiff"))]
const READER: Reader = Reader::Frames(Err("tiff"), Choices::None);
