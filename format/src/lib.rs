//! The bytes of a wavesplat coefficient file (`.wspl`).
//!
//! `FORMAT.md` beside this package specifies them. This package knows bytes only: it starts no thread, opens no path
//! and maps no memory; it reads through [`Storage`] and writes to any `std::io::Write` without a seek.
#![forbid(unsafe_code)]

mod error;
mod sample;

pub use error::{Error, Result};
pub use sample::SampleType;

use std::io;

/// Where a file's bytes are: something of known length from which bytes are copied out.
pub trait Storage {
    /// Length in bytes.
    fn len(&self) -> u64;

    /// Whether there are no bytes.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Copies `out.len()` bytes from `offset`; an error if they are not all there.
    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()>;
}

impl Storage for [u8] {
    fn len(&self) -> u64 {
        <[u8]>::len(self) as u64
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let bytes = usize::try_from(offset).ok().and_then(|o| self.get(o..)?.get(..out.len()));
        let Some(bytes) = bytes else { return Err(io::ErrorKind::UnexpectedEof.into()) };
        out.copy_from_slice(bytes);
        Ok(())
    }
}
