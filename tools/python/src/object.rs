//! A coefficient file in an object of Python that reads ranges of bytes.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use std::io::{self, ErrorKind};
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst};
use std::thread::sleep;
use std::time::{Duration, Instant};
use wavesplat::format::Storage;

/// Calls of objects that go on.
static CALLS: AtomicUsize = AtomicUsize::new(0);
/// Whether the interpreter is about to end: a thread that then takes its lock ends the process by a signal.
static IS_ENDING: AtomicBool = AtomicBool::new(false);
/// The longest wait for calls at the end.
const MOST_AT_END: Duration = Duration::from_secs(5);

/// Refuses new calls of objects, and waits for those that go on. To be called before the interpreter ends.
#[pyfunction]
pub(crate) fn before_end(py: Python<'_>) {
    IS_ENDING.store(true, SeqCst);
    let began = Instant::now();
    py.detach(|| {
        while CALLS.load(SeqCst) > 0 && began.elapsed() < MOST_AT_END {
            sleep(Duration::from_millis(1));
        }
    });
}

/// A forked process has none of the threads of its parent, and goes on.
pub(crate) fn after_fork() {
    CALLS.store(0, SeqCst);
    IS_ENDING.store(false, SeqCst);
}

/// A call of an object, until this is dropped.
struct Calling;

impl Calling {
    fn begin() -> io::Result<Self> {
        CALLS.fetch_add(1, SeqCst);
        let calling = Self;
        if IS_ENDING.load(SeqCst) { Err(io::Error::other("the interpreter is about to end")) } else { Ok(calling) }
    }
}

impl Drop for Calling {
    fn drop(&mut self) {
        CALLS.fetch_sub(1, SeqCst);
    }
}

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
        let _calling = Calling::begin()?;
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
