//! Values that are used again.

use std::sync::Mutex;

/// A pool of reusable values: new memory costs about as much as the work done with it.
#[derive(Debug)]
pub(super) struct Pool<T>(Mutex<Vec<T>>);

impl<T> Default for Pool<T> {
    fn default() -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

impl<T> Pool<T> {
    pub(super) fn take(&self) -> Option<T> {
        self.0.lock().ok().and_then(|mut idle| idle.pop())
    }

    pub(super) fn put(&self, value: T) {
        if let Ok(mut idle) = self.0.lock() {
            idle.push(value);
        }
    }
}
