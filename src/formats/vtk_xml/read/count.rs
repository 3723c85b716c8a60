//! The numbers that VTK writes before the samples of an array.

use crate::shared::words::wrong;
use std::io::{self, ErrorKind, Read};

/// A count that VTK puts before the samples of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Count {
    /// Whether it has 64 bits, not 32.
    pub(super) wide: bool,
    /// Whether its most significant byte comes first.
    pub(super) big_endian: bool,
}

impl Count {
    /// Bytes of the count itself.
    pub(super) fn size(self) -> usize {
        if self.wide { 8 } else { 4 }
    }

    /// The next count.
    pub(super) fn read(self, reader: &mut dyn Read) -> io::Result<u64> {
        let mut bytes = [0; 8];
        let stored = &mut bytes[..self.size()];
        reader.read_exact(stored).map_err(|e| match e.kind() {
            ErrorKind::UnexpectedEof => wrong("is cut short: its array ends early, before its samples".into()),
            _ => e,
        })?;
        if self.big_endian {
            stored.reverse();
        }
        Ok(u64::from_le_bytes(bytes))
    }
}
