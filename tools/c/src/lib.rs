//! wavesplat for C, C++ and Fortran. `wavesplat.h` is made of this; it is the reference for users.
//!
//! A program pushes the frames of a run one after another, from its own memory. They are copied and converted by threads of the
//! library while the program goes on. Reading gives samples of any frames and any region.
//!
//! Every function is safe to call from any thread, but only from one at a time for the same writer. Several threads may read the
//! same file. No panic leaves a function, and no signal handler is installed.

mod arithmetic;
mod status;
mod text;
mod frames;
mod incoming;
mod conversion;
mod write;
mod read;

pub use frames::*;
pub use read::*;
pub use status::*;
pub use write::*;
