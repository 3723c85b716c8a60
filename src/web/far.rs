//! A file elsewhere. The page reads ranges of it, and needs time for that: a question fails until all that it reads is there,
//! and is asked again.

use crate::host;
use std::io;
use std::ops::Range;
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
        if !host::is_there(offset, out.len()) {
            return Err(missing());
        }
        host::copy(offset, out);
        Ok(())
    }

    /// Asks the page for all ranges before it fails, so that it reads them side by side.
    fn read_many(&self, ranges: &[Range<u64>]) -> io::Result<Vec<Vec<u8>>> {
        let length = |range: &Range<u64>| usize::try_from(range.end - range.start).map_err(io::Error::other);
        let lengths = ranges.iter().map(length).collect::<io::Result<Vec<_>>>()?;
        let are_there = ranges.iter().zip(&lengths).map(|(range, bytes)| host::is_there(range.start, *bytes));
        if !are_there.fold(true, |all, is_there| all & is_there) {
            return Err(missing());
        }
        let copied = |offset: u64, bytes: usize| {
            let mut out = vec![0; bytes];
            host::copy(offset, &mut out);
            out
        };
        Ok(ranges.iter().zip(lengths).map(|(range, bytes)| copied(range.start, bytes)).collect())
    }

    fn is_remote(&self) -> bool {
        true
    }
}

fn missing() -> io::Error {
    io::Error::other("the page has not read this part yet")
}
