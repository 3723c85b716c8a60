//! Frames that Python gives one after another, as a stream of bytes.

use crate::errors::borrowed;
use crate::job::Caller;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use std::io::{self, Read};
use std::sync::Arc;

/// Reads the bytes of arrays that an iterator gives.
pub(crate) struct FrameReader {
    iterator: Arc<Py<PyAny>>,
    /// The bytes of some frames, and how many of them are read.
    current: Option<(Py<PyArray1<u8>>, usize)>,
    caller: Caller,
}

impl FrameReader {
    pub(crate) fn new(iterator: Py<PyAny>, caller: Caller) -> Self {
        Self { iterator: Arc::new(iterator), current: None, caller }
    }

    /// Copies some bytes of the current frames; none at their end.
    fn copy(&mut self, out: &mut [u8]) -> PyResult<usize> {
        let Some((array, at)) = &mut self.current else { return Ok(0) };
        Python::attach(|py| {
            let array = array.bind(py).try_readonly().map_err(borrowed)?;
            let bytes = &array.as_slice()?[*at..];
            let count = bytes.len().min(out.len());
            out[..count].copy_from_slice(&bytes[..count]);
            *at += count;
            Ok(count)
        })
    }

    /// Asks for the next frames; false after the last ones.
    fn advance(&mut self) -> Result<bool, String> {
        self.current = None; // before the next frames are made
        let iterator = self.iterator.clone();
        let next = move |py: Python<'_>| {
            let next = iterator.bind(py).try_iter()?.next().transpose()?;
            Ok(next.map(Bound::cast_into::<PyArray1<u8>>).transpose()?.map(Bound::unbind))
        };
        self.current = self.caller.call(next)?.map(|array| (array, 0));
        Ok(self.current.is_some())
    }
}

impl Read for FrameReader {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        loop {
            match self.copy(out).map_err(io::Error::other)? {
                0 if !out.is_empty() && self.advance().map_err(io::Error::other)? => {}
                count => return Ok(count),
            }
        }
    }
}
