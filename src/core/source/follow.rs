//! Following a run: its frames are read while it writes them.

use crate::base::mapped::{Access, FileBytes, State};
use std::collections::HashMap;
use std::fmt;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::{Arc, Mutex};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// What ends a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RunEnd {
    /// Nothing new has come for so long.
    Silence(Duration),
    /// A file exists.
    File(PathBuf),
}

/// The units of a silence, in seconds.
const UNITS: [(&str, f64); 3] = [("min", 60.0), ("s", 1.0), ("h", 3600.0)];

impl FromStr for RunEnd {
    type Err = String;

    /// Reads a time, like `90s`, `10min` or `2h`, or else the path of a file.
    fn from_str(text: &str) -> Result<Self, String> {
        let unit = UNITS
            .iter()
            .find_map(|(unit, seconds)| Some((text.strip_suffix(unit)?.trim().parse::<f64>().ok()?, seconds)));
        if text.is_empty() || text.parse::<f64>().is_ok() {
            return Err("takes a time with its unit, like 90s, 10min or 2h, or the name of a file".into());
        }
        let Some((number, seconds)) = unit else { return Ok(Self::File(text.into())) };
        let silence = Duration::try_from_secs_f64(number * seconds).ok().filter(|silence| !silence.is_zero());
        silence.map(Self::Silence).ok_or_else(|| format!("{text} is no time that can be waited for"))
    }
}

impl fmt::Display for RunEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silence(time) => write!(f, "nothing new has come for {:?}", time),
            Self::File(path) => write!(f, "{} exists", path.display()),
        }
    }
}

/// A file is complete when its length and its time of change have stayed the same for so long, or the run has ended.
const SETTLED: Duration = Duration::from_secs(2);

/// How a run is followed. Copies share what they know of its files, so that several variables need not wait one after another.
#[derive(Debug, Clone)]
pub struct Follow {
    /// What ends the run.
    pub end: RunEnd,
    /// The states of files, and since when they have been in them.
    files: Arc<Mutex<HashMap<PathBuf, (State, Instant)>>>,
}

impl Follow {
    /// Follows a run until it ends.
    pub fn new(end: RunEnd) -> Self {
        Self { end, files: Arc::default() }
    }

    /// Whether a file has stayed the same for some time.
    pub fn is_settled(&self, path: &Path) -> bool {
        let (Ok(file), Ok(mut files)) = (FileBytes::open(path, Access::Read), self.files.lock()) else { return false };
        let (state, now) = (file.state(), Instant::now());
        let known = files.entry(path.into()).or_insert((state, now));
        if known.0 != state {
            *known = (state, now);
        }
        known.1.elapsed() >= SETTLED
    }
}

/// The shortest time between two looks for something new.
const BETWEEN_LOOKS: Duration = Duration::from_millis(300);

/// Waits for what a run writes.
#[derive(Debug)]
pub struct Watch {
    end: RunEnd,
    /// When something new was last seen.
    last: Instant,
}

impl Watch {
    /// Begins to watch a run.
    pub fn new(end: RunEnd) -> Self {
        Self { end, last: Instant::now() }
    }

    /// Looks until there is something, which is returned, or the run has ended. What came just before the end is seen, since `look`
    /// is called once more after it, and told so.
    ///
    /// # Errors
    /// Those of `look`.
    pub fn wait_for<T, E>(&mut self, mut look: impl FnMut(bool) -> Result<Option<T>, E>) -> Result<Option<T>, E> {
        loop {
            let (is_over, began) = (self.is_over(), Instant::now());
            if let Some(found) = look(is_over)? {
                self.last = Instant::now();
                return Ok(Some(found));
            }
            if is_over {
                return Ok(None);
            }
            sleep(BETWEEN_LOOKS.max(10 * began.elapsed())); // large folders take long to list
        }
    }

    fn is_over(&self) -> bool {
        match &self.end {
            RunEnd::Silence(time) => self.last.elapsed() >= *time,
            RunEnd::File(path) => path.exists(),
        }
    }
}

/// A file or pipe that a run writes to: it ends with the run.
#[derive(Debug)]
pub struct FollowedReader<R> {
    reader: R,
    watch: Watch,
}

impl<R> FollowedReader<R> {
    /// Reads on until the run has ended.
    pub fn new(reader: R, end: RunEnd) -> Self {
        Self { reader, watch: Watch::new(end) }
    }
}

impl<R: Read> Read for FollowedReader<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let reader = &mut self.reader;
        let found = self.watch.wait_for(|_| match reader.read(out) {
            Ok(0) => Ok(None),
            Ok(bytes) => Ok(Some(bytes)),
            Err(e) => Err(e),
        });
        Ok(found?.unwrap_or(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_files_are_read() {
        let seconds = |text: &str| match text.parse() {
            Ok(RunEnd::Silence(time)) => time.as_secs_f64(),
            other => panic!("{text}: {other:?}"),
        };
        assert_eq!(["90s", "1.5 min", "2h"].map(seconds), [90.0, 90.0, 7200.0]);
        assert_eq!("done".parse(), Ok(RunEnd::File("done".into())));
        assert_eq!("run/ends".parse(), Ok(RunEnd::File("run/ends".into())));
        for wrong in ["", "90", "0s", "-1min", "1e300h", "nans"] {
            assert!(wrong.parse::<RunEnd>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_reader_goes_on_until_the_run_has_ended() {
        /// Nothing at first, then bytes one by one with nothing between.
        struct Slow(u8);
        impl Read for Slow {
            fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
                self.0 += 1;
                let is_there = self.0.is_multiple_of(2) && self.0 < 8;
                out[..usize::from(is_there)].fill(self.0);
                Ok(is_there.into())
            }
        }
        let end = RunEnd::Silence(2 * BETWEEN_LOOKS);
        let mut found = Vec::new();
        FollowedReader::new(Slow(0), end).read_to_end(&mut found).expect("bytes");
        assert_eq!(found, [2, 4, 6]);
    }

    #[test]
    fn what_came_before_the_end_is_seen() {
        let folder = tempfile::tempdir().expect("a folder");
        let done = folder.path().join("done");
        std::fs::write(&done, "").expect("writing");
        let mut watch = Watch::new(RunEnd::File(done));
        let mut left = vec![2, 1];
        let mut look = |is_over: bool| Ok::<_, ()>(left.pop().filter(|_| is_over));
        assert_eq!([(); 3].map(|()| watch.wait_for(&mut look)), [Ok(Some(1)), Ok(Some(2)), Ok(None)]);
    }
}
