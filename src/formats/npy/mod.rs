//! NumPy's `.npy`: one array, (z, y, x), (t, z, y, x) or with the axes that the user names, in C or Fortran order.
//! `base::npy` has its header.

mod read;

pub(crate) use read::{Array, read_any, read_header};
pub use read::{ArrayHeader, array_header};

use super::format::{Choices, Format, Reader};
use super::writer::Writer;
use wavesplat_core::base::npy::{MAGIC, write_header};

pub(crate) static FORMAT: Format = Format {
    name: "NumPy array",
    extensions: &["npy"],
    starts: &[MAGIC],
    reader: Reader::Frames(Ok(|path, options, _| read::describe(path, options)), Choices::None),
    // one array (frames, z, y, x)
    writers: &[Writer {
        name: "npy",
        place: 0,
        has_halves: true,
        before: |contents, samples, mut out| {
            let [x, y, z] = contents.grid.dims;
            write_header(samples.ty, &[contents.frames.len(), z, y, x], &mut out)
        },
        ..Writer::PLAIN
    }],
};
