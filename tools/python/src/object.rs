//! A coefficient file in an object of Python that reads ranges of bytes.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::io::{self, ErrorKind};
use std::ops::Range;
use wavesplat::format::Storage;

/// Calls an object with the starts and the ends of ranges, which returns a list with the bytes of each.
pub(crate) struct ObjectStorage {
    read: Py<PyAny>,
    length: u64,
}

impl ObjectStorage {
    pub(crate) fn new(read: Py<PyAny>, length: u64) -> Self {
        Self { read, length }
    }

    fn call(&self, py: Python<'_>, ranges: &[Range<u64>]) -> PyResult<Vec<Vec<u8>>> {
        let ends = |end: fn(&Range<u64>) -> u64| ranges.iter().map(end).collect::<Vec<_>>();
        let read: Vec<Bound<'_, PyBytes>> =
            self.read.bind(py).call1((ends(|range| range.start), ends(|range| range.end)))?.extract()?;
        Ok(read.iter().map(|bytes| bytes.as_bytes().to_vec()).collect())
    }
}

impl Storage for ObjectStorage {
    fn len(&self) -> u64 {
        self.length
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let read = self.read_many(std::slice::from_ref(&(offset..offset + out.len() as u64)))?;
        out.copy_from_slice(&read[0]);
        Ok(())
    }

    fn read_many(&self, ranges: &[Range<u64>]) -> io::Result<Vec<Vec<u8>>> {
        let read = Python::attach(|py| self.call(py, ranges)).map_err(io::Error::other)?;
        let lengths = ranges.iter().map(|range| (range.end - range.start) as usize);
        match lengths.eq(read.iter().map(Vec::len)) {
            true => Ok(read),
            false => Err(io::Error::new(ErrorKind::UnexpectedEof, "the object gave other numbers of bytes")),
        }
    }

    fn is_remote(&self) -> bool {
        true // a call takes the interpreter's lock, and may ask a server
    }
}
