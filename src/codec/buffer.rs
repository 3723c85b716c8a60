//! Large buffers that are reused: fresh memory from the system costs about as much as decoding a block into it.

use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

/// A slice that returns its memory to a pool when dropped, for the next buffer of its type on any thread. So the pool
/// never holds more buffers than were in use at one time. Only blocks use buffers, so none is much larger than the
/// others.
#[derive(Debug, Default)]
pub struct Buffer<T: Pooled>(Vec<T>);

impl<T: Pooled> Buffer<T> {
    /// Creates a slice of `len` entries with arbitrary values.
    pub fn of(len: usize) -> Self {
        let mut values = spare::<T>().pop().unwrap_or_default();
        if values.capacity() < len {
            values = Vec::new(); // avoids copying old values
        }
        values.resize(len, T::default());
        Self(values)
    }
}

impl<T: Pooled> FromIterator<T> for Buffer<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Self {
        Self(values.into_iter().collect())
    }
}

impl<T: Pooled> Drop for Buffer<T> {
    fn drop(&mut self) {
        if self.0.capacity() > 0 {
            spare::<T>().push(std::mem::take(&mut self.0));
        }
    }
}

impl<T: Pooled> Deref for Buffer<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.0
    }
}

impl<T: Pooled> DerefMut for Buffer<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.0
    }
}

fn spare<T: Pooled>() -> std::sync::MutexGuard<'static, Vec<Vec<T>>> {
    T::spare().lock().unwrap_or_else(PoisonError::into_inner)
}

/// Empties a buffer and keeps its memory.
pub(super) fn clear<T>(buffer: &mut Vec<T>) -> &mut Vec<T> {
    buffer.clear();
    buffer
}

/// A type that buffers can hold.
pub trait Pooled: Copy + Default + 'static {
    /// The unused buffers.
    fn spare() -> &'static Mutex<Vec<Vec<Self>>>;
}

macro_rules! pooled {
    ($($t:ty),*) => {
        $(impl Pooled for $t {
            fn spare() -> &'static Mutex<Vec<Vec<Self>>> {
                static SPARE: Mutex<Vec<Vec<$t>>> = Mutex::new(Vec::new());
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
        let first = Buffer::of(1 << 12);
        let memory = address(&first);
        drop(first);
        let again = Buffer::of(1 << 10);
        assert_eq!((address(&again), again.len()), (memory, 1 << 10));
        assert_eq!(Buffer::<u64>::of(1 << 14).len(), 1 << 14);
    }
}
