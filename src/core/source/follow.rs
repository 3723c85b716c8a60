//! Following a run: its frames are read while it writes them.

use crate::base::mapped::{Access, FileBytes, State};
use std::collections::HashMap;
use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::mpsc::{Receiver, SendError, SyncSender, sync_channel};
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
        let wrong = || format!("{text:?}: takes a time, like 90s, 10min or 2h, or the name of a file");
        let digits = text.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(text.len());
        let (number, unit) = text.split_at(digits);
        if text.is_empty() || text.starts_with('-') {
            return Err(wrong());
        }
        let Ok(number) = number.parse::<f64>() else { return Ok(Self::File(text.into())) };
        let seconds = UNITS.iter().find(|(name, _)| *name == unit.trim()).map(|(_, seconds)| number * seconds);
        let is_name = unit.contains(|c: char| !c.is_alphabetic() && c != ' ');
        match seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()).filter(|time| !time.is_zero()) {
            Some(time) => Ok(Self::Silence(time)),
            None if is_name => Ok(Self::File(text.into())),
            None => Err(wrong()),
        }
    }
}

impl fmt::Display for RunEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Silence(time) => write!(f, "nothing new has come for {time:?}"),
            Self::File(path) => write!(f, "{} exists", path.display()),
        }
    }
}

/// A file is complete when its length and its time of change have stayed the same for so long, or the run has ended.
const SETTLED: Duration = Duration::from_secs(2);

/// After so long, the user is told what cannot be read.
const PATIENCE: Duration = Duration::from_secs(30);

/// How a run is followed. Copies share what they know of it, so that several variables wait once, and end with the same files.
#[derive(Debug, Clone)]
pub struct Follow {
    /// What ends the run.
    end: RunEnd,
    /// Tells the user why nothing is read.
    tell: fn(&str),
    files: Arc<Mutex<Files>>,
}

/// What is known of the files of a run.
#[derive(Debug, Default)]
struct Files {
    /// Their states, and since when they have been in them.
    states: HashMap<PathBuf, (State, Instant)>,
    /// When one of them was last seen to change.
    changed: Option<Instant>,
    /// The number of files that the run ended with.
    ended_with: Option<usize>,
    /// Why nothing can be read, and since when; without a time once it was told.
    unreadable: Option<(String, Option<Instant>)>,
}

impl Follow {
    /// Follows a run until it ends. `tell` gets the reason if nothing can be read for long.
    pub fn new(end: RunEnd, tell: fn(&str)) -> Self {
        Self { end, tell, files: Arc::default() }
    }

    /// The number of files that the run ended with, once it has ended.
    pub fn ended_with(&self) -> Option<usize> {
        self.files.lock().ok().and_then(|files| files.ended_with)
    }

    /// Says that the run has ended with so many files, unless it has ended before.
    pub fn end_with(&self, count: usize) {
        if let Ok(mut files) = self.files.lock() {
            files.ended_with.get_or_insert(count);
        }
    }

    /// Notes an error that may pass. If it lasts, the user is told once.
    pub fn note_error(&self, error: &str) {
        let Ok(mut files) = self.files.lock() else { return };
        match &mut files.unreadable {
            Some((known, since)) if known == error => {
                if since.take_if(|since| since.elapsed() >= PATIENCE).is_some() {
                    (self.tell)(error);
                }
            }
            other => *other = Some((error.into(), Some(Instant::now()))),
        }
    }

    /// Whether a path is the file that ends the run.
    pub fn is_end(&self, path: &Path) -> bool {
        matches!(&self.end, RunEnd::File(end) if end.file_name() == path.file_name())
    }

    /// Whether a file is complete: it has stayed the same for some time, or another file says that the run has ended.
    pub fn is_complete(&self, path: &Path, is_over: bool) -> bool {
        if is_over && matches!(self.end, RunEnd::File(_)) {
            return true;
        }
        let (Ok(file), Ok(mut files)) = (FileBytes::open(path, Access::Read), self.files.lock()) else { return false };
        let (state, now) = (file.state(), Instant::now());
        let known = files.states.insert(path.into(), (state, now));
        match known.filter(|(known, _)| *known == state) {
            Some((_, since)) => {
                files.states.insert(path.into(), (state, since));
                since.elapsed() >= SETTLED
            }
            None => {
                files.changed = Some(now);
                false
            }
        }
    }

    /// Whether the run has ended, if nothing new was seen since `last`.
    fn is_over(&self, last: Instant) -> bool {
        match &self.end {
            _ if self.ended_with().is_some() => true,
            RunEnd::Silence(time) => {
                let changed = self.files.lock().ok().and_then(|files| files.changed);
                let is_silent = |since: Instant| since.elapsed() >= (*time).max(SETTLED);
                is_silent(last) && changed.is_none_or(is_silent)
            }
            RunEnd::File(path) => path.exists(),
        }
    }
}

/// The shortest time between two looks for something new.
const BETWEEN_LOOKS: Duration = Duration::from_millis(300);

/// The longest time between two looks.
const MOST_BETWEEN_LOOKS: Duration = Duration::from_secs(10);

/// Looks until there is something, which is returned, or the run has ended. What came just before the end is seen, since `look`
/// is called once more after it, and told so.
///
/// # Errors
/// Those of `look`.
pub fn wait_for<T, E>(follow: &Follow, mut look: impl FnMut(bool) -> Result<Option<T>, E>) -> Result<Option<T>, E> {
    let last = Instant::now();
    loop {
        let (is_over, began) = (follow.is_over(last), Instant::now());
        if let Some(found) = look(is_over)? {
            return Ok(Some(found));
        }
        if is_over && follow.is_over(last) {
            return Ok(None);
        }
        sleep((10 * began.elapsed()).clamp(BETWEEN_LOOKS, MOST_BETWEEN_LOOKS)); // large folders take long to list
    }
}

/// Reads the bytes that a run writes, until the run has ended.
#[derive(Debug)]
pub struct FollowedReader<R> {
    reader: R,
    follow: Follow,
}

impl<R> FollowedReader<R> {
    /// Reads on until the run has ended. The reader waits for a moment before it says that there is nothing.
    pub fn new(reader: R, follow: Follow) -> Self {
        Self { reader, follow }
    }
}

impl<R: Read> Read for FollowedReader<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let last = Instant::now();
        loop {
            let is_over = self.follow.is_over(last);
            let bytes = self.reader.read(out)?;
            if bytes > 0 || is_over {
                return Ok(bytes);
            }
        }
    }
}

/// A file that grows.
#[derive(Debug)]
pub struct GrowingFile(pub File);

impl Read for GrowingFile {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let bytes = self.0.read(out)?;
        if bytes == 0 {
            sleep(BETWEEN_LOOKS);
        }
        Ok(bytes)
    }
}

/// The most bytes that are read of a pipe at a time.
const PIPED: usize = 1 << 20;

/// A named pipe, read by a thread of its own, since opening and reading it may wait for ever. Each end of a program's bytes is no end.
#[derive(Debug)]
pub struct NamedPipe {
    pieces: Receiver<io::Result<Vec<u8>>>,
    current: Vec<u8>,
    at: usize,
}

impl NamedPipe {
    /// Reads what programs write to the pipe, one after another.
    pub fn open(path: PathBuf) -> Self {
        let (to_reader, pieces) = sync_channel(1);
        std::thread::spawn(move || while send_all(&path, &to_reader).is_ok() {});
        Self { pieces, current: Vec::new(), at: 0 }
    }
}

/// Sends the bytes that one program writes to a pipe. Fails once the reader is gone.
fn send_all(path: &Path, to: &SyncSender<io::Result<Vec<u8>>>) -> Result<(), SendError<io::Result<Vec<u8>>>> {
    let mut pipe = match File::open(path) {
        Ok(pipe) => pipe,
        Err(error) => {
            to.send(Err(error))?;
            sleep(BETWEEN_LOOKS);
            return Ok(());
        }
    };
    loop {
        let mut piece = vec![0; PIPED];
        match pipe.read(&mut piece) {
            Ok(0) => return Ok(()),
            Ok(bytes) => piece.truncate(bytes),
            Err(error) => return to.send(Err(error)),
        }
        to.send(Ok(piece))?;
    }
}

impl Read for NamedPipe {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if self.at == self.current.len() {
            let Ok(piece) = self.pieces.recv_timeout(SETTLED) else { return Ok(0) };
            (self.current, self.at) = (piece?, 0);
        }
        let bytes = out.len().min(self.current.len() - self.at);
        out[..bytes].copy_from_slice(&self.current[self.at..][..bytes]);
        self.at += bytes;
        Ok(bytes)
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
        assert_eq!("2024-01/done".parse(), Ok(RunEnd::File("2024-01/done".into())));
        for wrong in ["", "90", "0s", "-1min", "10m", "30 sec", "1d"] {
            assert!(wrong.parse::<RunEnd>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_reader_goes_on_until_the_run_has_ended() {
        /// Nothing at first, then bytes one by one with nothing between.
        struct Slow(u32);
        impl Read for Slow {
            fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
                self.0 += 1;
                let is_there = self.0.is_multiple_of(2) && self.0 < 8;
                out[..usize::from(is_there)].fill(self.0 as u8);
                if !is_there {
                    sleep(Duration::from_millis(1));
                }
                Ok(is_there.into())
            }
        }
        let follow = Follow::new(RunEnd::Silence(Duration::from_millis(1)), |_| ());
        let mut found = Vec::new();
        FollowedReader::new(Slow(0), follow).read_to_end(&mut found).expect("bytes");
        assert_eq!(found, [2, 4, 6]);
    }

    #[test]
    fn what_came_before_the_end_is_seen() {
        let folder = tempfile::tempdir().expect("a folder");
        let done = folder.path().join("done");
        std::fs::write(&done, "").expect("writing");
        let follow = Follow::new(RunEnd::File(done), |_| ());
        let mut left = vec![2, 1];
        let mut look = |is_over: bool| Ok::<_, ()>(left.pop().filter(|_| is_over));
        assert_eq!([(); 3].map(|()| wait_for(&follow, &mut look)), [Ok(Some(1)), Ok(Some(2)), Ok(None)]);
    }

    #[test]
    fn a_file_that_changes_is_no_silence() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a");
        let follow = Follow::new(RunEnd::Silence(Duration::from_millis(1)), |_| ());
        let begun = Instant::now();
        let mut looks = 0;
        let found = wait_for(&follow, |is_over| {
            looks += 1;
            if looks < 12 {
                std::fs::write(&path, vec![0; looks]).expect("writing");
            }
            Ok::<_, ()>(follow.is_complete(&path, is_over).then_some(looks))
        });
        assert!(found.is_ok_and(|looks| looks > Some(12)) && begun.elapsed() > 12 * BETWEEN_LOOKS);
    }

    #[test]
    fn copies_share_the_end() {
        let follow = Follow::new(RunEnd::Silence(Duration::from_secs(3600)), |_| ());
        follow.clone().end_with(3);
        follow.end_with(4);
        assert_eq!(follow.ended_with(), Some(3));
        assert_eq!(wait_for(&follow, |is_over| Ok::<_, ()>(None::<()>.filter(|()| is_over))), Ok(None));
    }
}
