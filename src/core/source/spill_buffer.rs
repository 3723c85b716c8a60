//! Bytes of decoded or piped frames: in memory, or in a temporary file if they are too many.

use crate::base::error::{Error, Result};
use crate::base::system::FileExt;
use std::fs::File;
use std::io::{self, ErrorKind, Read};
use std::path::Path;
use std::sync::Arc;

/// A fixed number of bytes, zero at first.
#[derive(Debug)]
pub enum SpillBuffer {
    /// In memory.
    Memory(Vec<u8>),
    /// In a temporary file, from a byte on.
    Spool {
        /// The file, which may have other buffers, too.
        file: Arc<File>,
        /// Its first byte.
        start: u64,
        /// The number of bytes.
        len: u64,
    },
}

/// A temporary file without a name, created at first use. The frames of a window share it, since the number of open
/// files is limited.
#[derive(Debug, Default)]
pub(crate) struct Spool {
    file: Option<Arc<File>>,
    len: u64,
}

impl Spool {
    /// Room for `bytes` more.
    fn room(&mut self, bytes: usize) -> io::Result<SpillBuffer> {
        let file = match &self.file {
            Some(file) => file.clone(),
            None => self.file.insert(Arc::new(tempfile::tempfile()?)).clone(),
        };
        let (start, len) = (self.len, bytes as u64);
        self.len = start.checked_add(len).ok_or(ErrorKind::FileTooLarge)?;
        file.set_len(self.len)?;
        Ok(SpillBuffer::Spool { file, start, len })
    }
}

impl SpillBuffer {
    /// Allocates `bytes`, in memory if at most `memory` are needed, else in a temporary file. Messages call the input
    /// `name`.
    pub fn new(bytes: usize, memory: usize, name: &Path) -> Result<Self> {
        Self::within(bytes, memory, &mut Spool::default(), name)
    }

    /// As [`Self::new`], with a file that others share.
    pub(crate) fn within(bytes: usize, memory: usize, spool: &mut Spool, name: &Path) -> Result<Self> {
        if bytes > memory {
            return spool.room(bytes).map_err(|e| Error::io(std::env::temp_dir(), "making a temporary file", e));
        }
        let mut held = Vec::new();
        let full = |_| Error::io(name, format!("holding {bytes} bytes"), ErrorKind::OutOfMemory.into());
        held.try_reserve_exact(bytes).map_err(full)?;
        held.resize(bytes, 0);
        Ok(Self::Memory(held))
    }

    /// Bytes that it takes of memory.
    pub(crate) fn memory(&self) -> usize {
        if let Self::Memory(held) = self { held.len() } else { 0 }
    }

    /// Puts bytes in their place, which must be there.
    pub fn write_at(&mut self, at: u64, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Memory(held) => held[at as usize..][..bytes.len()].copy_from_slice(bytes),
            Self::Spool { file, start, len } => file.write_all_at(bytes, place(*start, *len, at, bytes.len())?)?,
        }
        Ok(())
    }

    /// Copies bytes out.
    pub fn read_at(&self, at: u64, out: &mut [u8]) -> io::Result<()> {
        match self {
            Self::Memory(held) => wavesplat_format::Storage::read_at(held.as_slice(), at, out),
            Self::Spool { file, start, len } => file.read_exact_at(out, place(*start, *len, at, out.len())?),
        }
    }
}

/// Position in the file of bytes that must be within a part of it. The bytes after the part belong to other frames.
fn place(start: u64, len: u64, at: u64, bytes: usize) -> io::Result<u64> {
    let is_there = at.checked_add(bytes as u64).is_some_and(|end| end <= len);
    if is_there { Ok(start + at) } else { Err(ErrorKind::UnexpectedEof.into()) }
}

/// Some bytes, or none at the end.
pub fn read_some(reader: &mut dyn Read, out: &mut [u8]) -> io::Result<usize> {
    loop {
        match reader.read(out) {
            Err(e) if e.kind() == ErrorKind::Interrupted => {}
            result => return result,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_shares_a_file_stays_apart() {
        let (mut spool, name) = (Spool::default(), Path::new("a"));
        let mut held = [3, 5].map(|bytes| SpillBuffer::within(bytes, 0, &mut spool, name).expect("room"));
        held[1].write_at(0, b"vwxyz").expect("writing");
        held[0].write_at(1, b"bc").expect("writing");
        let (mut first, mut second) = ([1; 3], [1; 2]);
        held[0].read_at(0, &mut first).expect("reading");
        held[1].read_at(3, &mut second).expect("reading");
        assert_eq!((&first, &second), (b"\0bc", b"yz"));
        assert!(held[0].read_at(1, &mut first).is_err() && held[0].write_at(2, b"de").is_err(), "of the other");
        let files =
            held.map(|held| if let SpillBuffer::Spool { file, .. } = held { file } else { panic!("in memory") });
        assert!(Arc::ptr_eq(&files[0], &files[1]));
    }
}
