//! What a forked process can still do. Threads do not follow a fork, so those of the parent's pool are gone, and whoever
//! waits for them waits for ever; a lock that another thread held stays locked.
//!
//! Reads and pictures get threads of their own there, one call at a time. All else raises an exception.

use crate::errors::raised;
use crate::object;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst};
use std::sync::{Mutex, PoisonError};
use wavesplat::base::workers::Workers;

/// Calls that work now.
static RUNNING: AtomicUsize = AtomicUsize::new(0);
/// Whether the pool of this process, or of the one that it was forked from, may have begun.
static BEGUN: AtomicBool = AtomicBool::new(false);
/// Whether this process was forked after that.
static FORKED: AtomicBool = AtomicBool::new(false);
/// Whether calls worked at the fork, which may have held locks.
static AMID_WORK: AtomicBool = AtomicBool::new(false);
/// The threads of a forked process.
static OWN: Mutex<Option<Workers>> = Mutex::new(None);

const ADVICE: &str = "start processes by multiprocessing.set_start_method(\"spawn\"), or for PyTorch's DataLoader by \
                      multiprocessing_context=\"spawn\"";

/// To be called in a process that has just been forked.
#[pyfunction]
pub(crate) fn after_fork() {
    object::after_fork();
    let amid_work = RUNNING.swap(0, SeqCst) > 0;
    AMID_WORK.fetch_or(amid_work, SeqCst);
    FORKED.fetch_or(BEGUN.load(SeqCst), SeqCst);
    if let Ok(mut own) = OWN.try_lock() {
        std::mem::forget(own.take()); // its threads are gone, too: they cannot be joined
    }
}

/// A call that works, until this is dropped.
pub(crate) struct Running(u32);

impl Running {
    /// Begins a call.
    ///
    /// # Errors
    /// This process was forked while calls worked.
    pub(crate) fn begin() -> PyResult<Self> {
        if AMID_WORK.load(SeqCst) {
            let what = "this process was forked while wavesplat worked in another thread, or showed a viewer";
            return Err(PyRuntimeError::new_err(format!("{what}; {ADVICE}")));
        }
        BEGUN.store(true, SeqCst);
        RUNNING.fetch_add(1, SeqCst);
        Ok(Self(std::process::id()))
    }

    /// Whether this process began the call, and was not forked since.
    pub(crate) fn is_here(&self) -> bool {
        self.0 == std::process::id()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if self.is_here() {
            RUNNING.fetch_sub(1, SeqCst);
        }
    }
}

/// An error in a forked process, for work that starts threads which need the pool.
pub(crate) fn refuse() -> PyResult<()> {
    if !FORKED.load(SeqCst) {
        return Ok(());
    }
    let what = "a process that was forked after wavesplat worked cannot convert";
    Err(PyRuntimeError::new_err(format!("{what}; {ADVICE}")))
}

/// The result of work; in a forked process by threads of its own.
pub(crate) fn answer<T: Send>(work: impl FnOnce() -> wavesplat::Result<T> + Send) -> wavesplat::Result<T> {
    if !FORKED.load(SeqCst) {
        return work();
    }
    let mut own = OWN.lock().unwrap_or_else(PoisonError::into_inner);
    let workers = match own.take() {
        Some(workers) => workers,
        None => Workers::new()?,
    };
    own.insert(workers).run(work)
}

/// As [`answer`], for a short call without the interpreter's lock.
pub(crate) fn call<T: Send>(py: Python<'_>, work: impl FnOnce() -> wavesplat::Result<T> + Send) -> PyResult<T> {
    let _running = Running::begin()?;
    py.detach(|| answer(work)).map_err(raised)
}
