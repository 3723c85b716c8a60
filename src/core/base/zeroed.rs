//! Large buffers of zeros. They lie in huge pages where the system offers them: fresh memory in small pages costs as
//! much as the work done in it.

pub use bytemuck::Pod;
use memmap2::MmapMut;
use std::fmt;
use std::ops::{Deref, DerefMut};

/// A buffer of numbers, zero at first.
pub enum Zeroed<T> {
    /// A small buffer.
    Heap(Vec<T>),
    /// The map and the length in numbers. Pages that are never written take no memory.
    Map(MmapMut, usize),
}

/// Smaller buffers come from the heap.
const LARGE: usize = 4 << 20;

impl<T: Pod> Zeroed<T> {
    /// A buffer of `len` zeros.
    pub fn new(len: usize) -> Self {
        Self::in_pages(len, true)
    }

    /// A buffer of `len` zeros in small pages. If its user writes little, it takes little memory.
    pub fn in_small_pages(len: usize) -> Self {
        Self::in_pages(len, false)
    }

    fn in_pages(len: usize, are_huge: bool) -> Self {
        Self::try_in_pages(len, are_huge).unwrap_or_else(|| Self::Heap(vec![T::zeroed(); len]))
    }

    /// As [`Self::in_small_pages`]; none if the system has no memory for a large buffer.
    pub fn try_in_small_pages(len: usize) -> Option<Self> {
        Self::try_in_pages(len, false)
    }

    fn try_in_pages(len: usize, are_huge: bool) -> Option<Self> {
        let bytes = len.checked_mul(size_of::<T>())?;
        if bytes < LARGE {
            return Some(Self::Heap(vec![T::zeroed(); len]));
        }
        let map = MmapMut::map_anon(bytes).ok()?;
        advise(&map, are_huge);
        Some(Self::Map(map, len))
    }

    /// The bytes of all numbers.
    pub fn bytes(&self) -> &[u8] {
        bytemuck::cast_slice(self)
    }

    /// As [`Self::bytes`], to write them.
    pub fn bytes_mut(&mut self) -> &mut [u8] {
        bytemuck::cast_slice_mut(self)
    }
}

/// Asks for huge or small pages. A system that does not take the advice is slower.
#[cfg(target_os = "linux")]
fn advise(map: &MmapMut, are_huge: bool) {
    use memmap2::Advice;
    let _ = map.advise(if are_huge { Advice::HugePage } else { Advice::NoHugePage });
}

#[cfg(not(target_os = "linux"))]
fn advise(_: &MmapMut, _: bool) {}

impl<T> Default for Zeroed<T> {
    fn default() -> Self {
        Self::Heap(Vec::new())
    }
}

impl<T: Pod> Deref for Zeroed<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        match self {
            Self::Heap(numbers) => numbers,
            Self::Map(map, len) => &bytemuck::cast_slice(&map[..len * size_of::<T>()])[..*len],
        }
    }
}

impl<T: Pod> DerefMut for Zeroed<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        match self {
            Self::Heap(numbers) => numbers,
            Self::Map(map, len) => &mut bytemuck::cast_slice_mut(&mut map[..*len * size_of::<T>()])[..*len],
        }
    }
}

impl<T: Pod> fmt::Debug for Zeroed<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} numbers", self.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_and_large_buffers_hold_zeros_until_written() {
        for len in [0, 5, LARGE / 4 - 1, LARGE / 4, LARGE] {
            let mut buffer = Zeroed::<f32>::new(len);
            assert!(buffer.len() == len && buffer.iter().all(|n| *n == 0.0));
            let numbers = || (0..len).map(|n| (n % 1000) as f32);
            buffer.iter_mut().zip(numbers()).for_each(|(to, n)| *to = n);
            assert!(buffer.iter().copied().eq(numbers()));
        }
        assert!(
            Zeroed::<u64>::try_in_small_pages(LARGE).is_some_and(|mut buffer| buffer.bytes_mut().len() == 8 * LARGE)
        );
        assert!(
            Zeroed::<u64>::try_in_small_pages(usize::MAX / 16).is_none()
                && Zeroed::<u64>::try_in_small_pages(usize::MAX).is_none()
        );
    }
}
