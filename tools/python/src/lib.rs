//! `wavesplat._wavesplat`, the native half of the Python package: files, conversions, pictures and the viewer.
//!
//! Python names axes, chooses items and builds objects. This half moves numbers: it reads into arrays of numpy, takes frames
//! from Python, and releases the interpreter's lock meanwhile.

mod advice;
mod chunk;
mod convert;
mod described;
mod errors;
mod file;
mod fork;
mod frames;
mod job;
mod look;
mod named;
mod object;

use pyo3::prelude::*;

#[pymodule]
mod _wavesplat {
    #[pymodule_export]
    use super::chunk::{check, decode, encode};
    #[pymodule_export]
    use super::convert::{append_arrays, append_frames, convert_arrays, convert_frames, merge};
    #[pymodule_export]
    use super::errors::{BoundMissedError, ChangedError, DamagedError, InputError, UnsupportedError, WavesplatError};
    #[pymodule_export]
    use super::file::File;
    #[pymodule_export]
    use super::fork::after_fork;
    #[pymodule_export]
    use super::look::{Viewer, render};
    #[pymodule_export]
    use super::object::before_end;

    #[pymodule_export]
    #[allow(non_upper_case_globals)]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
