//! Bytes of frames that cannot be read in boxes where they are: in memory, or in a temporary file if they are too many.

use crate::error::{Error, Result};
use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::os::unix::fs::FileExt;
use std::path::Path;

/// A fixed number of bytes, zero at first.
#[derive(Debug)]
pub(super) enum Held {
    Memory(Vec<u8>),
    /// A temporary file without a name.
    Spool(File),
}

impl Held {
    /// Room for `bytes`, in memory if it may take so many. `name` stands for what they are of in messages.
    pub(super) fn new(bytes: usize, memory: usize, name: &Path) -> Result<Self> {
        if bytes > memory {
            let failed = |e| Error::io(std::env::temp_dir(), "making a temporary file", e);
            let file = tempfile::tempfile().map_err(failed)?;
            file.set_len(bytes as u64).map_err(failed)?;
            return Ok(Self::Spool(file));
        }
        let mut held = Vec::new();
        let full = |_| Error::io(name, format!("holding {bytes} bytes"), ErrorKind::OutOfMemory.into());
        held.try_reserve_exact(bytes).map_err(full)?;
        held.resize(bytes, 0);
        Ok(Self::Memory(held))
    }

    /// Bytes that it takes of memory.
    pub(super) fn memory(&self) -> usize {
        if let Self::Memory(held) = self { held.len() } else { 0 }
    }

    /// Puts bytes in their place, which must be there.
    pub(super) fn write_at(&mut self, at: u64, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Memory(held) => held[at as usize..][..bytes.len()].copy_from_slice(bytes),
            Self::Spool(file) => file.write_all_at(bytes, at)?,
        }
        Ok(())
    }

    /// Copies bytes out.
    pub(super) fn read_at(&self, at: u64, out: &mut [u8]) -> io::Result<()> {
        match self {
            Self::Memory(held) => wavesplat_format::Storage::read_at(held.as_slice(), at, out),
            Self::Spool(file) => file.read_exact_at(out, at),
        }
    }
}

/// Some bytes, or none at the end.
pub(super) fn read_some(reader: &mut dyn Read, out: &mut [u8]) -> io::Result<usize> {
    loop {
        match reader.read(out) {
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            result => return result,
        }
    }
}
