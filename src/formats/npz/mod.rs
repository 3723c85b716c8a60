//! NumPy's `.npz`: a zip archive of `.npy` files. Arrays whose names differ only in a number are consecutive frames;
//! otherwise the user chooses one array. Uncompressed arrays are read in place.

mod directory;
mod read;
#[cfg(test)]
mod tests;

use super::format::{Choices, Format, Reader};

pub(crate) static FORMAT: Format = Format::new("NumPy arrays (.npz)", &["npz"], READER);

const READER: Reader =
    Reader::Frames(Ok(|path, options, _| read::describe(path, options)), Choices::Variables(read::offer));
