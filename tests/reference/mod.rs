//! A slow and obvious reference implementation against which the library is tested.
//!
//! Written from `src/method.md` alone, and `decode` from `format/FORMAT.md`: nothing here calls the library, and only
//! `std` arithmetic is used.

pub(crate) mod camera;
pub(crate) mod colour;
pub(crate) mod decode;
pub(crate) mod ray;
pub(crate) mod sampled;
pub(crate) mod splat;
pub(crate) mod transform;
pub(crate) mod truncate;
