//! Large buffers that are reused: fresh memory from the system costs about as much as decoding a block into it.

use crate::base::zeroed::{Pod, Zeroed};
use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

/// A slice that returns its memory to a pool when dropped, for a later buffer of its type on any thread. A buffer takes
/// a spare one of at most four times its length, so that blocks at far faces, which are smaller, need no buffers of their own. Only
/// blocks and boxes of trials use buffers, so their sizes are few. Copies that are kept, and parts, go back to the system.
#[derive(Debug, Default)]
pub struct Buffer<T: Pooled> {
    /// At least `len` values; the rest has been used before.
    values: Zeroed<T>,
    len: usize,
    /// Whether the memory goes back to the system and not to the pool.
    is_single: bool,
}

impl<T: Pooled> Buffer<T> {
    /// Creates a slice of `len` entries with arbitrary values: the smallest spare one that is long enough and at most four times
    /// as long, or a new one.
    pub fn with_len(len: usize) -> Self {
        Self::take_spare(len).unwrap_or_else(|| Self::new(Zeroed::new(len), len, false))
    }

    /// Creates a slice for a user of few entries. It is a spare one, or fresh memory in small pages that later goes back to the system.
    pub fn for_part(len: usize) -> Self {
        Self::take_spare(len).unwrap_or_else(|| Self::new(Zeroed::in_small_pages(len), len, true))
    }

    /// A copy that is kept for long: its memory has just its length, and goes back to the system.
    pub fn to_keep(values: &[T]) -> Self {
        let mut copy = Self::new(Zeroed::new(values.len()), values.len(), true);
        copy.copy_from_slice(values);
        copy
    }

    fn take_spare(len: usize) -> Option<Self> {
        let mut spare = spare::<T>();
        let fits = (0..spare.len()).filter(|n| (len..=4 * len).contains(&spare[*n].len()));
        let values = fits.min_by_key(|n| spare[*n].len()).map(|n| spare.swap_remove(n));
        drop(spare);
        values.map(|values| Self::new(values, len, false))
    }

    fn new(mut values: Zeroed<T>, len: usize, is_single: bool) -> Self {
        if cfg!(debug_assertions) {
            values.bytes_mut().fill(0xFF); // tests then fail if they use a value that was not written: NaN or -1
        }
        Self { values, len, is_single }
    }

    /// Bytes of memory that it takes: it may be longer than what is used of it.
    pub fn held_bytes(&self) -> usize {
        size_of_val(&self.values[..])
    }

    /// Keeps the first `len` entries, and all of the memory.
    pub(super) fn shorten(&mut self, len: usize) {
        self.len = self.len.min(len);
    }

    /// Gives the memory back, and takes some for `len` entries with arbitrary values.
    pub fn renew(&mut self, len: usize) {
        *self = Self::default();
        *self = Self::with_len(len);
    }
}

impl<T: Pooled> From<&[T]> for Buffer<T> {
    fn from(values: &[T]) -> Self {
        let mut copy = Self::with_len(values.len());
        copy.copy_from_slice(values);
        copy
    }
}

impl<T: Pooled> Clone for Buffer<T> {
    fn clone(&self) -> Self {
        self[..].into()
    }
}

impl<T: Pooled> Drop for Buffer<T> {
    fn drop(&mut self) {
        if !(self.values.is_empty() || self.is_single) {
            spare::<T>().push(std::mem::take(&mut self.values));
        }
    }
}

impl<T: Pooled> Deref for Buffer<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.values[..self.len]
    }
}

impl<T: Pooled> DerefMut for Buffer<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.values[..self.len]
    }
}

fn spare<T: Pooled>() -> std::sync::MutexGuard<'static, Vec<Zeroed<T>>> {
    T::spare().lock().unwrap_or_else(PoisonError::into_inner)
}

/// Empties a buffer and keeps its memory.
pub(super) fn clear<T>(buffer: &mut Vec<T>) -> &mut Vec<T> {
    buffer.clear();
    buffer
}

/// A type that buffers can hold.
pub trait Pooled: Pod + Default {
    /// The unused buffers.
    fn spare() -> &'static Mutex<Vec<Zeroed<Self>>>;
}

/// Returns the memory of unused buffers with fewer than `least` entries to the system.
pub(super) fn release_spare<T: Pooled>(least: usize) {
    let unused: Vec<Zeroed<T>> = spare::<T>().extract_if(.., |values| values.len() < least).collect();
    drop(unused); // others may take buffers meanwhile
}

macro_rules! pooled {
    ($($t:ty),*) => {
        $(impl Pooled for $t {
            fn spare() -> &'static Mutex<Vec<Zeroed<Self>>> {
                static SPARE: Mutex<Vec<Zeroed<$t>>> = Mutex::new(Vec::new());
                &SPARE
            }
        })*
    };
}

pooled!(u8, i32, f32, f64);
#[cfg(test)]
pooled!(u64);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_used_again_and_grows() {
        let address = |buffer: &Buffer<u64>| buffer.as_ptr();
        let (small, large) = (Buffer::with_len(1 << 8), Buffer::with_len(1 << 12));
        let memory = [address(&small), address(&large)];
        drop((small, large));
        let again = Buffer::with_len(1 << 11);
        assert_eq!((address(&again), again.len()), (memory[1], 1 << 11));
        let small = Buffer::with_len(1 << 7);
        assert_eq!((address(&small), small.len()), (memory[0], 1 << 7));
        drop((again, small));
        let few = Buffer::with_len(3);
        assert!(few.len() == 3 && !memory.contains(&address(&few)), "much larger ones are left to others");
        assert_eq!(Buffer::<u64>::with_len(1 << 14).len(), 1 << 14);
    }
}
