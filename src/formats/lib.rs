//! Formats of files, each in a folder of its own for both directions, and how inputs are opened.
//!
//! A format's `layout` has what reading and writing share: offsets, names and codes of types, orientation and units. `read`
//! makes a `FileHeader` of a file, which says where the frames are or how to decode them; `write` writes the header of
//! extracted samples. [`open()`] chooses the format by name and content.
//!
//! To add a format:
//!
//! 1. Make a folder with its `Format`. The folder `shared` has what formats have in common.
//! 2. Add its line to `FORMATS`.
//! 3. Name it in `tools/guide/formats.md` and the README, and add it to the tests of inputs. If it needs a crate of its
//!    own, make a feature of it in the manifests of `formats` and of the root, check it alone in `.ci/run`, and list the
//!    folder in `tests/layering.rs`.
//! 4. If it is written, too, add its name to the help of `wavesplat extract` (`cli/commands/extract.rs`).

mod order;
mod contents;
#[doc(hidden)]
pub mod encoding;
#[doc(hidden)]
pub mod writer;
mod numbering;
mod shared;
mod arrays;
mod format;
mod raw;
mod npy;
mod npz;
mod nrrd;
mod nifti;
mod metaimage;
mod vtk_xml;
mod vtk;
mod tif;
mod file_series;
mod netcdf;
mod hdf5;
mod zarr;
mod open;
#[cfg(test)]
mod testing;

pub use arrays::held::{ArrayType, NamedArray, NamedArrays};
pub use contents::Contents;
pub use contents::plain;
#[doc(hidden)]
pub use npy::{ArrayHeader, array_header};
#[doc(hidden)]
pub use open::inputs::files;
pub use open::{open, open_arrays, open_named_stream, open_stream, undecided, variables};
pub use order::{Direction, OutputAxis, SampleOrder};
pub use writer::SampleFormat;

use format::{Format, Reader};
use std::path::Path;

/// All formats. Help and messages list their extensions in this order.
static FORMATS: [&Format; 16] = [
    &npy::FORMAT,
    &npz::FORMAT,
    &nrrd::FORMAT,
    &nifti::FORMAT,
    &metaimage::FORMAT,
    &vtk_xml::VTI,
    &vtk_xml::VTR,
    &vtk::FORMAT,
    &tif::FORMAT,
    &vtk_xml::PVD,
    &file_series::FORMAT,
    &netcdf::FORMAT,
    &hdf5::FORMAT,
    &zarr::FORMAT,
    &raw::FORMAT,
    &COEFFICIENTS,
];

/// A coefficient file, which is no input.
static COEFFICIENTS: Format =
    Format::new("coefficient file", &["wspl"], Reader::Nothing("is a coefficient file already, not frames to convert"));

/// Extensions of inputs with headers.
#[doc(hidden)]
pub fn extensions() -> impl Iterator<Item = &'static str> {
    let inputs = FORMATS.iter().filter(|format| !format.is(&COEFFICIENTS));
    inputs.flat_map(|format| format.extensions).copied()
}

/// The extension of a path, if files of frames have it. A coefficient file of such a name would mislead readers.
pub fn extension_of_frames(path: &Path) -> Option<String> {
    let extension = path.extension()?.to_str()?.to_lowercase();
    extensions().any(|known| known == extension).then_some(extension)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_ending_is_known_once() {
        for format in FORMATS {
            for ending in format.extensions {
                let path = format!("a.b.{}", ending.to_uppercase());
                assert!(open::by_name(Path::new(&path)).is_some_and(|found| found.is(format)), "{ending}");
            }
        }
        let known: Vec<&str> = extensions().collect();
        assert!(
            known.starts_with(&["npy", "npz", "nrrd"]) && known.contains(&"hdf5") && !known.contains(&"wspl"),
            "{known:?}"
        );
    }

    #[test]
    fn formats_are_written_under_names_in_the_order_of_messages() {
        let names: Vec<&str> = SampleFormat::all().into_iter().map(SampleFormat::name).collect();
        assert_eq!(names.join(" "), "npy raw nrrd nhdr vti pvd nc nii nii.gz mha vtr zarr");
        assert!(names.iter().all(|name| SampleFormat::named(name).is_some_and(|format| format.name() == *name)));
    }
}
