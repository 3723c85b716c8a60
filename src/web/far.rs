//! A file elsewhere: the page reads ranges of it.

use crate::host;
use std::io;
use wavesplat_format::Storage;

/// A file of known length that the page reads.
#[derive(Debug)]
pub(crate) struct FarFile {
    pub(crate) len: u64,
}

impl Storage for FarFile {
    fn len(&self) -> u64 {
        self.len
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        host::read(offset, out)
    }

    fn is_remote(&self) -> bool {
        true
    }
}
