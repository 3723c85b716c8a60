//! Where a file's bytes are, and how several ranges of them are read at once.

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

    /// Copies several ranges, each of which lies within the storage; the bytes of each, in the order of `ranges`.
    ///
    /// The default reads one range after another. Storages that pay for every request should join ranges
    /// ([`read_joined`]) or send requests side by side.
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

    /// Whether one call of [`Self::read_many`] is cheaper than many of [`Self::read_at`]: true for remote storages.
    fn prefers_batches(&self) -> bool {
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

            fn prefers_batches(&self) -> bool {
                S::prefers_batches(self)
            }
        }
    )*};
}

behind!(&S, Box<S>, Arc<S>);

/// Reads ranges with few calls of `read`: those at most `gap` bytes apart come with one. For implementations of
/// [`Storage::read_many`]; `read` is given a range and returns exactly its bytes.
///
/// # Errors
/// Those of `read`, and one that returned another number of bytes.
pub fn read_joined(
    ranges: &[Range<u64>],
    gap: u64,
    mut read: impl FnMut(Range<u64>) -> io::Result<Vec<u8>>,
) -> io::Result<Vec<Vec<u8>>> {
    let mut found = vec![Vec::new(); ranges.len()];
    let mut order: Vec<usize> = (0..ranges.len()).collect();
    order.sort_by_key(|i| ranges[*i].start);
    let mut rest = order.as_slice();
    while let Some(first) = rest.first() {
        let (joined, count) = joined(ranges, rest, gap);
        let bytes = read(joined.clone())?;
        if bytes.len() != length(&joined)? {
            return Err(io::Error::new(
                io::ErrorKind::UnexpectedEof,
                format!("bytes {joined:?}: {} read", bytes.len()),
            ));
        }
        let base = ranges[*first].start;
        for i in &rest[..count] {
            found[*i] = bytes[(ranges[*i].start - base) as usize..][..length(&ranges[*i])?].to_vec();
        }
        rest = &rest[count..];
    }
    Ok(found)
}

/// The first of some ranges, in ascending `order`, with all that follow closely; and how many these are.
fn joined(ranges: &[Range<u64>], order: &[usize], gap: u64) -> (Range<u64>, usize) {
    let mut all = ranges[order[0]].clone();
    let near = |i: &&usize| {
        let range = &ranges[**i];
        let near = range.start <= all.end.saturating_add(gap);
        if near {
            all.end = all.end.max(range.end);
        }
        near
    };
    let count = order.iter().take_while(near).count();
    (all, count)
}

/// Bytes of a range; an error if no memory holds so many.
fn length(range: &Range<u64>) -> io::Result<usize> {
    usize::try_from(range.end.saturating_sub(range.start)).map_err(io::Error::other)
}

/// A storage with some ranges read in advance, in one call of [`Storage::read_many`]. Everything else is read from the
/// storage itself.
#[derive(Debug)]
pub struct ReadAhead<'a, S: Storage + ?Sized> {
    storage: &'a S,
    /// Where each range begins, ascending, and its bytes.
    ranges: Vec<(u64, Vec<u8>)>,
}

impl<'a, S: Storage + ?Sized> ReadAhead<'a, S> {
    /// Reads the ranges that lie within the storage.
    pub(crate) fn new(storage: &'a S, mut ranges: Vec<Range<u64>>) -> io::Result<Self> {
        ranges.retain(|range| range.start < range.end && range.end <= storage.len());
        ranges.sort_by_key(|range| range.start);
        let bytes = storage.read_many(&ranges)?;
        Ok(Self { storage, ranges: ranges.into_iter().map(|range| range.start).zip(bytes).collect() })
    }

    /// Bytes from `offset` on, if they were read in advance.
    fn held(&self, offset: u64, len: usize) -> Option<&[u8]> {
        let (start, bytes) = self.ranges[..self.ranges.partition_point(|(start, _)| *start <= offset)].last()?;
        bytes.get(usize::try_from(offset - start).ok()?..)?.get(..len)
    }
}

impl<S: Storage + ?Sized> Storage for ReadAhead<'_, S> {
    fn len(&self) -> u64 {
        self.storage.len()
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        match self.held(offset, out.len()) {
            Some(bytes) => out.copy_from_slice(bytes),
            None => self.storage.read_at(offset, out)?,
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_ranges_are_read_together() {
        let bytes: Vec<u8> = (0..100).collect();
        let ranges = [50..60, 0..4, 8..9, 2..6, 90..100, 63..63];
        let expected: Vec<Vec<u8>> = ranges.iter().map(|r| bytes[r.start as usize..r.end as usize].to_vec()).collect();
        for (gap, calls) in [(0, vec![0..6, 8..9, 50..60, 63..63, 90..100]), (2, vec![0..9, 50..60, 63..63, 90..100])] {
            let mut asked = Vec::new();
            let found = read_joined(&ranges, gap, |range| {
                asked.push(range.clone());
                Ok(bytes[range.start as usize..range.end as usize].to_vec())
            });
            assert_eq!((found.expect("within"), asked), (expected.clone(), calls), "{gap}");
        }
        assert_eq!(bytes.read_many(&ranges).expect("within"), expected);
    }

    #[test]
    fn a_short_answer_is_an_error() {
        assert!(read_joined(&[0..4, 6..8], 2, |_| Ok(vec![0; 7])).is_err());
        assert!(vec![0; 3].read_many(&[0..1, 2..4]).is_err());
    }

    #[test]
    fn what_was_read_in_advance_is_not_read_again() {
        let bytes: Vec<u8> = (0..100).collect();
        let ahead = ReadAhead::new(&bytes, vec![40..50, 10..20, 95..105]).expect("within");
        assert_eq!(ahead.ranges.len(), 2, "one lies beyond the end");
        for range in [10..20, 12..15, 45..50, 15..25, 0..100, 99..100] {
            let mut out = vec![0; range.len()];
            ahead.read_at(range.start as u64, &mut out).expect("within");
            assert_eq!(out, bytes[range.clone()], "{range:?}");
        }
        assert!(ahead.held(45, 5).is_some() && ahead.held(45, 6).is_none());
        assert!(ahead.read_at(96, &mut [0; 5]).is_err());
    }
}
