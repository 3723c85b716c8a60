//! Long work beside Python: it reports progress, and Ctrl-C ends it.

use crate::errors::raised;
use pyo3::prelude::*;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;
use std::time::Duration;
use wavesplat::base::progress::Progress;

/// The time between two looks at the work.
const LOOK: Duration = Duration::from_millis(50);

/// How far the work is, and whether its result is wanted.
#[derive(Debug, Default)]
struct Job {
    steps: AtomicU64,
    done: AtomicU64,
    is_cancelled: AtomicBool,
}

impl Progress for Job {
    fn start(&self, steps: Option<u64>) {
        self.done.store(0, Ordering::Relaxed);
        self.steps.store(steps.unwrap_or(0), Ordering::Relaxed);
    }

    fn advance(&self, steps: u64) {
        self.done.fetch_add(steps, Ordering::Relaxed);
    }

    fn finish(&self) {}

    fn is_cancelled(&self) -> bool {
        self.is_cancelled.load(Ordering::Relaxed)
    }
}

/// Does work on another thread without the interpreter's lock. Meanwhile this thread calls `report(done, steps)`, with 0 steps
/// if their number is not known, and lets signals raise their exceptions, which cancel the work.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    report: Option<&Py<PyAny>>,
    work: impl FnOnce(&dyn Progress) -> wavesplat::Result<T> + Send,
) -> PyResult<T> {
    let job = Job::default();
    py.detach(|| {
        thread::scope(|scope| {
            let (ended, end) = channel::<()>();
            let worker = scope.spawn(|| {
                let _ended = ended; // its end ends the loop below, also after a panic
                work(&job)
            });
            let mut raising = None;
            while end.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                if raising.is_none()
                    && let Err(raised) = Python::attach(|py| look(py, &job, report))
                {
                    job.is_cancelled.store(true, Ordering::Relaxed);
                    raising = Some(raised);
                }
            }
            let done = worker.join().unwrap_or_else(|panic| resume_unwind(panic));
            match raising {
                Some(raising) => Err(raising),
                None => Python::attach(|py| {
                    report.map_or(Ok(()), |_| look(py, &job, report))?;
                    done.map_err(raised)
                }),
            }
        })
    })
}

fn look(py: Python<'_>, job: &Job, report: Option<&Py<PyAny>>) -> PyResult<()> {
    py.check_signals()?;
    let [done, steps] = [&job.done, &job.steps].map(|count| count.load(Ordering::Relaxed));
    report.map_or(Ok(()), |report| report.call1(py, (done, steps)).map(drop))
}
