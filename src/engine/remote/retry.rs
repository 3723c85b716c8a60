//! Requests that failed for now are made again, after pauses.

use super::RemoteOptions;
use super::answer::Failure;
use std::hash::{BuildHasher, Hasher, RandomState};
use std::io;
use std::path::Path;
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// How often a request is made before it fails.
const TRIES: u32 = 5;

/// The pause before the second request, if the server asks for none; it doubles with every further one.
const FIRST_PAUSE: Duration = Duration::from_millis(250);

/// Shorter pauses are not worth a note.
const NOTED: Duration = Duration::from_secs(1);

/// Makes requests again, and says why that takes long.
#[derive(Debug)]
pub(super) struct Retries {
    /// The name of the object in notes.
    name: String,
    /// The longest pause that the server may ask for.
    most: Duration,
    note: fn(&str),
    /// The end of the pause that was noted last: requests side by side are told to wait together.
    noted: Mutex<Option<Instant>>,
}

impl Retries {
    pub(super) fn new(name: &Path, options: &RemoteOptions) -> Self {
        let name = name.display().to_string();
        Self { name, most: options.timeout, note: options.note, noted: Mutex::default() }
    }

    /// Makes a request until it succeeds, fails for good, or was made five times.
    pub(super) fn until_answered<T>(&self, request: impl Fn() -> Result<T, Failure>) -> io::Result<T> {
        let mut usual = FIRST_PAUSE;
        for _ in 1..TRIES {
            match request() {
                Ok(answer) => return Ok(answer),
                Err(Failure::Final(error) | Failure::Refused(error)) => return Err(error),
                Err(Failure::Temporary(error, asked)) => self.pause(&error, asked, usual),
            }
            usual *= 2;
        }
        request().map_err(|failure| match failure {
            Failure::Final(error) | Failure::Refused(error) => error,
            Failure::Temporary(error, asked) => io::Error::new(error.kind(), self.given_up(&error, asked)),
        })
    }

    /// Waits: as long as the server asks, but not longer than it may be silent.
    fn pause(&self, error: &io::Error, asked: Option<Duration>, usual: Duration) {
        let Some(asked) = asked else { return thread::sleep(usual.mul_f64(spread())) };
        let pause = asked.min(self.most).mul_f64(spread()).min(self.most);
        if asked >= NOTED && self.is_first_until(Instant::now() + pause) {
            let (asked, pause) = (asked.as_secs(), pause.as_secs_f64());
            (self.note)(&format!("{}: {error}, and asks for {asked} s; asking again in {pause:.1} s", self.name));
        }
        thread::sleep(pause);
    }

    /// Whether no pause that was noted goes on. Then this one is.
    fn is_first_until(&self, end: Instant) -> bool {
        let mut noted = self.noted.lock().unwrap_or_else(PoisonError::into_inner);
        let is_first = noted.is_none_or(|noted| noted <= Instant::now());
        if is_first {
            *noted = Some(end);
        }
        is_first
    }

    fn given_up(&self, error: &io::Error, asked: Option<Duration>) -> String {
        let more = asked.filter(|asked| *asked > self.most).map_or(String::new(), |asked| {
            format!(" and asks for {} s, more than the {} s of `timeout`", asked.as_secs(), self.most.as_secs_f64())
        });
        format!("{error}; it was asked {TRIES} times{more}")
    }
}

/// A random factor between 1 and 1.5 for pauses, so that many clients refused at once do not ask again at once.
fn spread() -> f64 {
    1.0 + RandomState::new().build_hasher().finish() as f64 / u64::MAX as f64 / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    fn retries(most: u64) -> Retries {
        Retries::new(Path::new("x"), &RemoteOptions { timeout: Duration::from_millis(most), ..Default::default() })
    }

    fn busy(asked: u64) -> Failure {
        Failure::Temporary(io::Error::other("busy"), Some(Duration::from_secs(asked)))
    }

    #[test]
    fn no_server_gets_longer_pauses_than_it_may_be_silent() {
        for asked in [1, 3600, u64::MAX] {
            let (count, begin) = (Cell::new(0), Instant::now());
            let failed = retries(20).until_answered::<()>(|| {
                count.set(count.get() + 1);
                Err(busy(asked))
            });
            let (text, took) = (failed.expect_err("busy").to_string(), begin.elapsed());
            assert!(count.get() == 5 && took >= Duration::from_millis(80) && took < Duration::from_secs(2), "{took:?}");
            assert!(text.contains("busy; it was asked 5 times and asks for") && text.contains("0.02 s"), "{text}");
        }
    }

    #[test]
    fn requests_side_by_side_are_noted_once() {
        let retries = retries(1000);
        let later = Instant::now() + Duration::from_millis(30);
        assert!(retries.is_first_until(later) && !retries.is_first_until(later));
        thread::sleep(Duration::from_millis(40));
        assert!(retries.is_first_until(later));
    }
}
