//! Frames that Python gives one after another, as a stream of bytes.

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use std::io::{self, Read};
use std::sync::{Arc, Mutex, PoisonError};

/// The exception that ended the work, kept for the thread that asked for it.
#[derive(Clone, Default)]
pub(crate) struct Raised(Arc<Mutex<Option<PyErr>>>);

impl Raised {
    /// Keeps an exception, and returns its words.
    pub(crate) fn keep(&self, error: PyErr) -> String {
        let words = error.to_string();
        self.0.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        words
    }

    pub(crate) fn take(&self) -> Option<PyErr> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).take()
    }
}

/// Reads the bytes of arrays that an iterator gives.
pub(crate) struct FrameReader {
    iterator: Py<PyAny>,
    /// The bytes of some frames, and how many of them are read.
    current: Option<(Py<PyArray1<u8>>, usize)>,
    raised: Raised,
}

impl FrameReader {
    pub(crate) fn new(iterator: Py<PyAny>, raised: Raised) -> Self {
        Self { iterator, current: None, raised }
    }

    /// Copies some bytes; none at the end.
    fn copy(&mut self, py: Python<'_>, out: &mut [u8]) -> PyResult<usize> {
        loop {
            if let Some((array, at)) = &mut self.current {
                let array = array.bind(py).readonly();
                let bytes = &array.as_slice()?[*at..];
                if !bytes.is_empty() {
                    let count = bytes.len().min(out.len());
                    out[..count].copy_from_slice(&bytes[..count]);
                    *at += count;
                    return Ok(count);
                }
            }
            self.current = None; // before the next frames are made
            match self.iterator.bind(py).try_iter()?.next() {
                Some(array) => self.current = Some((array?.cast_into::<PyArray1<u8>>()?.unbind(), 0)),
                None => return Ok(0),
            }
        }
    }
}

impl Read for FrameReader {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        Python::attach(|py| self.copy(py, out)).map_err(|e| io::Error::other(self.raised.keep(e)))
    }
}
