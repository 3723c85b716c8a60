//! Where a file's bytes are.

use std::io;
use std::ops::Range;
use std::sync::Arc;

/// Where a file's bytes are: something of known length from which bytes are copied out.
///
/// The trait is object-safe: a program may open a file over `Box<dyn Storage + Send + Sync>`.
pub trait Storage {
    /// Length in bytes.
    fn len(&self) -> u64;

    /// Whether there are no bytes.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Copies `out.len()` bytes from `offset`; an error if they are not all there.
    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()>;

    /// Copies several ranges, which must lie within the storage. Returns the bytes of each, in the order of `ranges`.
    ///
    /// The default reads one range after another. Storages that pay for every request send requests side by side.
    ///
    /// # Errors
    /// The first range that cannot be read.
    fn read_many(&self, ranges: &[Range<u64>]) -> io::Result<Vec<Vec<u8>>> {
        let read = |range: &Range<u64>| {
            let mut bytes = vec![0; length(range)?];
            self.read_at(range.start, &mut bytes).map(|()| bytes)
        };
        ranges.iter().map(read).collect()
    }

    /// Prepares to read these ranges next. A storage that keeps what it has read may read them now, in few requests: the
    /// first ones, as many as it can keep. By default this does nothing.
    ///
    /// # Errors
    /// A range that cannot be read.
    fn fetch(&self, _ranges: &[Range<u64>]) -> io::Result<()> {
        Ok(())
    }

    /// Drops what it keeps of these ranges, since they fail a check, so that they are read from their source again. Returns
    /// whether other bytes may come then. By default nothing is kept, and the answer is false.
    fn forget(&self, _ranges: &[Range<u64>]) -> bool {
        false
    }

    /// Whether every request is slow, however few bytes it asks for: true for remote storages. Then calling
    /// [`Self::fetch`] saves time, and bytes that were read should be kept.
    fn is_remote(&self) -> bool {
        false
    }
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

impl Storage for Vec<u8> {
    fn len(&self) -> u64 {
        Storage::len(self.as_slice())
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        self.as_slice().read_at(offset, out)
    }
}

/// Storages behind a pointer.
macro_rules! behind {
    ($($pointer:ty),*) => {$(
        impl<S: Storage + ?Sized> Storage for $pointer {
            fn len(&self) -> u64 {
                S::len(self)
            }

            fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
                S::read_at(self, offset, out)
            }

            fn read_many(&self, ranges: &[Range<u64>]) -> io::Result<Vec<Vec<u8>>> {
                S::read_many(self, ranges)
            }

            fn fetch(&self, ranges: &[Range<u64>]) -> io::Result<()> {
                S::fetch(self, ranges)
            }

            fn forget(&self, ranges: &[Range<u64>]) -> bool {
                S::forget(self, ranges)
            }

            fn is_remote(&self) -> bool {
                S::is_remote(self)
            }
        }
    )*};
}

behind!(&S, Box<S>, Arc<S>);

/// Bytes of a range; an error if no memory holds so many.
fn length(range: &Range<u64>) -> io::Result<usize> {
    usize::try_from(range.end.saturating_sub(range.start)).map_err(io::Error::other)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_come_in_the_order_in_which_they_were_asked_for() {
        let bytes: Vec<u8> = (0..100).collect();
        let ranges = [50..60, 0..4, 8..9, 2..6, 90..100, 63..63];
        let expected: Vec<Vec<u8>> = ranges.iter().map(|r| bytes[r.start as usize..r.end as usize].to_vec()).collect();
        assert_eq!(bytes.read_many(&ranges).expect("within"), expected);
    }

    #[test]
    fn a_range_beyond_the_end_is_an_error() {
        assert!(vec![0; 3].read_many(&[0..1, 2..4]).is_err());
        assert!(vec![0; 3].read_many(&[0..1, u64::MAX - 1..u64::MAX]).is_err());
    }
}
