//! A storage that counts the bytes that were read of it.

use std::fmt;
use std::io;
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use wavesplat_format::Storage;

/// Any storage that threads may share.
pub(super) struct Counted {
    storage: Box<dyn Storage + Send + Sync>,
    read: AtomicU64,
}

impl Counted {
    pub(super) fn new(storage: Box<dyn Storage + Send + Sync>) -> Self {
        Self { storage, read: AtomicU64::new(0) }
    }

    /// Bytes that were copied out so far.
    pub(super) fn bytes_read(&self) -> u64 {
        self.read.load(Relaxed)
    }
}

impl fmt::Debug for Counted {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Counted").field("len", &self.len()).field("read", &self.read).finish_non_exhaustive()
    }
}

impl Storage for Counted {
    fn len(&self) -> u64 {
        self.storage.len()
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.storage.read_at(offset, out)?;
        self.read.fetch_add(out.len() as u64, Relaxed);
        Ok(())
    }

    fn fetch(&self, ranges: &[Range<u64>]) -> io::Result<()> {
        self.storage.fetch(ranges)
    }

    fn forget(&self, ranges: &[Range<u64>]) -> bool {
        self.storage.forget(ranges)
    }

    fn is_remote(&self) -> bool {
        self.storage.is_remote()
    }
}
