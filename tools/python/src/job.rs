//! Long work beside Python: it reports progress, and Ctrl-C ends it.

use crate::errors::raised;
use crate::fork::{self, Running};
use pyo3::prelude::*;
use std::panic::resume_unwind;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};
use wavesplat::base::cancel::CancelToken;
use wavesplat::base::progress::Progress;

/// The time between two looks at the work.
const LOOK: Duration = Duration::from_millis(50);

/// A call of Python.
type Call = Box<dyn FnOnce(Python<'_>) + Send>;

/// Calls Python on the thread that asked for the work. So Ctrl-C ends a call, and frames need not be made on other threads.
#[derive(Clone)]
pub(crate) struct Caller {
    calls: Sender<Call>,
    /// The first exception of a call.
    raised: Arc<Mutex<Option<PyErr>>>,
}

impl Caller {
    /// The result of a call.
    ///
    /// # Errors
    /// The words of the exception, which [`run`] raises again; or that the work is cancelled.
    pub(crate) fn call<T: Send + 'static>(
        &self,
        call: impl FnOnce(Python<'_>) -> PyResult<T> + Send + 'static,
    ) -> Result<T, String> {
        let (answer, answered) = channel();
        let send = move |py: Python<'_>| drop(answer.send(call(py)));
        let cancelled = "cancelled".to_string();
        if self.calls.send(Box::new(send)).is_err() {
            return Err(cancelled);
        }
        answered.recv().map_or(Err(cancelled), |answer| answer.map_err(|error| self.keep(error)))
    }

    fn keep(&self, error: PyErr) -> String {
        let words = error.to_string();
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        words
    }
}

/// Does work on another thread without the interpreter's lock. Meanwhile this thread makes the calls that the work asks for,
/// calls `report(done, steps)`, with 0 steps if their number is not known, and lets signals raise their exceptions, which
/// cancel the work.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    report: Option<&Py<PyAny>>,
    work: impl FnOnce(&dyn Progress, Caller) -> wavesplat::Result<T> + Send,
) -> PyResult<T> {
    let _running = Running::begin()?;
    let (job, (calls, called)) = (CancelToken::default(), channel());
    let caller = Caller { calls, raised: Arc::default() };
    let raised_by_calls = caller.raised.clone();
    let (done, raising) = py.detach(|| {
        thread::scope(|scope| {
            let worker = scope.spawn(|| fork::answer(|| work(&job, caller))); // when it ends, nobody can call
            let raising = serve(&called, &job, report);
            drop(called);
            (worker.join().unwrap_or_else(|panic| resume_unwind(panic)), raising)
        })
    });
    if let Some(raising) = raising {
        return Err(raising);
    }
    let first = || raised_by_calls.lock().unwrap_or_else(PoisonError::into_inner).take();
    let done = done.map_err(|error| first().unwrap_or_else(|| raised(error)))?;
    look(py, &job, report)?;
    Ok(done)
}

/// Makes calls and reports progress until the work has ended. Returns the exception that cancelled it.
fn serve(called: &Receiver<Call>, job: &CancelToken, report: Option<&Py<PyAny>>) -> Option<PyErr> {
    let (mut raising, mut looked) = (None, Instant::now());
    loop {
        match called.recv_timeout(LOOK) {
            Ok(call) if raising.is_none() => Python::attach(call),
            Ok(_) | Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return raising,
        }
        if raising.is_none() && looked.elapsed() >= LOOK {
            raising = Python::attach(|py| look(py, job, report)).err();
            raising.iter().for_each(|_| job.cancel());
            looked = Instant::now();
        }
    }
}

fn look(py: Python<'_>, job: &CancelToken, report: Option<&Py<PyAny>>) -> PyResult<()> {
    py.check_signals()?;
    report.map_or(Ok(()), |report| report.call1(py, job.counts()).map(drop))
}
