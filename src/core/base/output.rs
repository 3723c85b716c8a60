//! Writes results to standard output, or to a file that gets its final name when it is complete.

mod folder;
mod lock;
mod names;
mod unfinished;

pub use folder::{OutputFolder, Takes, commit_together};
pub use names::Numbered;
pub use names::names_of_views;
pub use unfinished::{Helper, abandon};

use crate::base::address::refuse_output;
use crate::base::error::{Error, Note, Remedy, Result};
use crate::base::system::{FileExt, Instant, MetadataExt, PermissionsExt};
use lock::locked;
use std::ffi::OsString;
use std::fs::{self, File};
use std::io::{self, BufWriter, IsTerminal, Seek, SeekFrom, Stdout, Write};
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;
use unfinished::AllUnfinished;

/// The name that stands for a standard stream.
pub const STANDARD: &str = "-";

/// A file or stream to write. If it is dropped before [`Output::commit`], no file has the final name.
#[derive(Debug)]
pub struct Output {
    path: PathBuf,
    target: Target,
}

/// A file that takes bytes at any place.
#[derive(Debug)]
pub struct Placed<'a> {
    path: &'a Path,
    file: &'a File,
    /// The place of byte 0.
    start: u64,
}

impl Placed<'_> {
    /// Writes bytes from a place on.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write(&self, at: u64, bytes: &[u8]) -> Result<()> {
        self.file.write_all_at(bytes, self.start + at).map_err(|e| Error::io(self.path, "writing", e))
    }
}

#[derive(Debug)]
enum Target {
    Stdout(BufWriter<Stdout>),
    /// A device or a pipe, written directly.
    Special(BufWriter<File>),
    /// The bytes that are committed go to the receiver.
    Memory(InMemory, Sender<Vec<u8>>),
    File(Part, BufWriter<File>), // in this order: the file is removed before it is unlocked
}

/// The unfinished file. Dropping it removes the file, unless it is to be kept.
#[derive(Debug)]
struct Part {
    pub path: PathBuf,
    replace: bool,
    /// Whether a later run can continue the flushed bytes, so that they must be kept.
    resumable: bool,
    /// Whether dropping keeps the file.
    keep: Arc<AtomicBool>,
    synced: Instant,
}

/// The work of at most this long is lost from a resumable file in a power failure.
const BETWEEN_SYNCS: Duration = Duration::from_secs(2);

impl Drop for Part {
    fn drop(&mut self) {
        unfinished::forget(&self.path);
        if !self.is_kept() {
            let _ = fs::remove_file(&self.path); // a failure cannot be reported here
        }
    }
}

impl Output {
    /// Bytes that are collected before they are written.
    pub const BUFFER: usize = 256 << 10;

    /// Opens `path`, or standard output for `-`. An existing file is an error unless `force` replaces it.
    pub fn create(path: &Path, force: bool) -> Result<Self> {
        Self::create_after(path, force, |file| file.set_len(0))
    }

    /// Writes up to `most` bytes to memory. They come from the receiver when the output is committed. `name` stands for it
    /// in messages.
    pub fn to_memory(name: &str, most: usize) -> (Self, Receiver<Vec<u8>>) {
        let (committed, received) = channel();
        let target = Target::Memory(InMemory { bytes: Vec::new(), most }, committed);
        (Self { path: name.into(), target }, received)
    }

    fn create_after(path: &Path, force: bool, begin: impl FnOnce(&File) -> io::Result<()>) -> Result<Self> {
        let real = path.is_symlink().then(|| path.canonicalize().ok()).flatten(); // writes to the target of a link
        let path = real.as_deref().unwrap_or(path);
        let target = if path == Path::new(STANDARD) {
            if io::stdout().is_terminal() {
                return Err(Error::path(STANDARD, "binary data is not written to a terminal; redirect or pipe it"));
            }
            Target::Stdout(BufWriter::with_capacity(Self::BUFFER, io::stdout()))
        } else if fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
            let file = File::options().write(true).open(path).map_err(|e| Error::io(path, "opening", e))?;
            Target::Special(BufWriter::with_capacity(Self::BUFFER, file))
        } else {
            Self::check(path, force)?;
            let (file, part) = Part::create(path, force)?;
            begin(&file).map_err(|e| Error::io(path, "creating", e))?;
            Target::File(part, BufWriter::with_capacity(Self::BUFFER, file))
        };
        Ok(Self { path: path.into(), target })
    }

    /// As [`Self::create`], but flushed bytes of a file are always kept, so that a later run can continue it. The bytes
    /// of an earlier run stay until [`Self::begin_at`] chooses where to continue.
    pub fn resumable(path: &Path, force: bool) -> Result<Self> {
        let mut out = Self::create_after(path, force, |_| Ok(()))?;
        if let Target::File(part, file) = &mut out.target {
            let held = file.get_ref().metadata().map_or(0, |m| m.len());
            part.resumable = true;
            part.set_kept(held > 0);
        }
        Ok(out)
    }

    /// The path of the unfinished file; None for other outputs.
    pub fn part(&self) -> Option<&Path> {
        match &self.target {
            Target::File(part, _) => Some(&part.path),
            _ => None,
        }
    }

    /// Starts a program that writes the unfinished file. It is ended before the file is removed. None if the
    /// output is not a file.
    pub fn start_helper(&self, start: impl FnOnce(&Path) -> io::Result<Child>) -> Option<io::Result<Helper>> {
        self.part().map(|part| unfinished::start_helper(part, || start(part)))
    }

    /// Cuts an unfinished file to its first `bytes`, and continues writing after them.
    pub fn begin_at(&mut self, bytes: u64) -> Result<()> {
        let Target::File(part, file) = &mut self.target else { return Ok(()) };
        part.set_kept(bytes > 0);
        let cut = file.get_mut().set_len(bytes).and_then(|()| file.seek(SeekFrom::Start(bytes)));
        cut.map(drop).map_err(|e| Error::io(&part.path, "cutting", e))
    }

    /// The unfinished file, for bytes at other places than the next, and the place of the next. None if the output is not a file.
    ///
    /// # Errors
    /// What was written before cannot be written to the file.
    pub fn placed(&mut self) -> Result<Option<Placed<'_>>> {
        let Target::File(part, file) = &mut self.target else { return Ok(None) };
        let start = file.flush().and_then(|()| file.stream_position());
        let start = start.map_err(|e| Error::io(&part.path, "writing", e))?;
        Ok(Some(Placed { path: &self.path, file: file.get_ref(), start }))
    }

    /// Continues so many bytes further on in a file.
    ///
    /// # Errors
    /// As [`Self::placed`].
    pub fn skip(&mut self, bytes: u64) -> Result<()> {
        let Target::File(part, file) = &mut self.target else { return Ok(()) };
        let moved = file.seek_relative(bytes as i64);
        moved.map_err(|e| Error::io(&part.path, "writing", e))
    }

    /// Whether dropping the output keeps the bytes written so far.
    pub fn is_kept(&self) -> bool {
        matches!(&self.target, Target::File(part, _) if part.is_kept())
    }

    /// An error if a file clearly cannot be created at `path`. Creates nothing.
    pub fn check(path: &Path, force: bool) -> Result<()> {
        refuse_output(path)?;
        if path.is_dir() {
            return Err(Error::path(path, "is a folder; name a file"));
        }
        if path.exists() && !force {
            return Err(exists(path));
        }
        match path.parent().filter(|folder| !folder.as_os_str().is_empty() && !folder.is_dir()) {
            Some(folder) => {
                let missing =
                    io::Error::new(io::ErrorKind::NotFound, format!("there is no folder {}", folder.display()));
                Err(Error::io(path, "creating", missing))
            }
            None => Ok(()),
        }
    }

    /// The name for messages.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Flushes everything and gives the file its final name.
    pub fn commit(self) -> Result<()> {
        self.commit_if(|_| Ok(()))
    }

    /// As [`Self::commit`], but first calls `right` with the unfinished file, which is then on disk. Its error prevents
    /// the commit.
    pub fn commit_if(mut self, right: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
        self.complete()?;
        if let Some(part) = self.part() {
            right(part)?;
        }
        self.rename(&unfinished::all())?;
        self.sync_name()
    }

    /// Writes all that is held to the disk or the stream.
    fn complete(&mut self) -> Result<()> {
        self.writer().flush().map_err(|e| Error::io(&self.path, "writing", e))?;
        if let Target::Memory(bytes, committed) = &mut self.target {
            let _ = committed.send(std::mem::take(&mut bytes.bytes)); // a receiver that is gone needs no bytes
        }
        let Target::File(_, file) = &mut self.target else { return Ok(()) };
        file.get_ref().sync_all().map_err(|e| Error::io(&self.path, "writing", e))
    }

    /// Gives a complete file its name.
    fn rename(&self, all: &AllUnfinished) -> Result<()> {
        let Target::File(part, _) = &self.target else { return Ok(()) };
        part.set_kept(true); // if renaming fails, the work must not be lost
        let doing = || format!("renaming the finished {} to this", part.path.display());
        part.rename(&self.path, all).map_err(|e| Error::io(&self.path, doing(), e))
    }

    fn sync_name(&self) -> Result<()> {
        let Target::File(..) = &self.target else { return Ok(()) };
        let folder = self.path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let synced = File::open(folder).and_then(|folder| folder.sync_all());
        synced.map_err(|e| Error::io(&self.path, "writing the name of the finished file to the disk", e))
    }
}

impl Part {
    fn new(path: PathBuf, replace: bool, mut unfinished: AllUnfinished) -> Self {
        let keep = unfinished::add(&path, &mut unfinished);
        Self { path, replace, resumable: false, keep, synced: Instant::now() }
    }

    fn is_kept(&self) -> bool {
        self.keep.load(Ordering::Relaxed)
    }

    fn set_kept(&self, keep: bool) {
        self.keep.store(keep, Ordering::Relaxed);
    }

    /// Opens and locks `NAME.part`. A file that is not locked was left by a run that was killed.
    fn create(path: &Path, replace: bool) -> Result<(File, Self)> {
        let part = part_of(path);
        let failed = |e| Error::io(path, "creating", e);
        let open = || File::options().read(true).write(true).create(true).truncate(false).open(&part);
        loop {
            let (file, unfinished) = locked(path, &part, open)?;
            let own = file.metadata().map_err(failed)?;
            if own.nlink() > 1 {
                // Its owner was killed after it had linked the final name, but before it removed this one.
                fs::remove_file(&part).map_err(failed)?;
                continue;
            }
            if path.exists() && !replace {
                if own.len() == 0 {
                    let _ = fs::remove_file(&part); // created here, and empty
                }
                return Err(exists(path));
            }
            if let Ok(replaced) = fs::metadata(path) {
                let mode = replaced.permissions().mode() | 0o200; // it must be writable
                let mut permissions = replaced.permissions();
                permissions.set_mode(mode);
                file.set_permissions(permissions).map_err(failed)?;
            }
            return Ok((file, Self::new(part, replace, unfinished)));
        }
    }

    /// Keeps the written bytes of a resumable file, and syncs them to disk from time to time.
    fn keep(&mut self, file: &File) -> io::Result<()> {
        if self.resumable {
            self.set_kept(true);
            if self.synced.elapsed() >= BETWEEN_SYNCS {
                file.sync_data()?;
                self.synced = Instant::now();
            }
        }
        Ok(())
    }

    /// `abandon` must not run during this, nor this after it.
    fn rename(&self, path: &Path, _all: &AllUnfinished) -> io::Result<()> {
        if self.replace {
            return fs::rename(&self.path, path);
        }
        match fs::hard_link(&self.path, path) {
            Ok(()) => fs::remove_file(&self.path),
            Err(e) if e.kind() == io::ErrorKind::AlreadyExists => Err(e),
            Err(_) if path.exists() => Err(io::ErrorKind::AlreadyExists.into()),
            Err(_) => fs::rename(&self.path, path), // the file system has no hard links
        }
    }
}

impl Output {
    fn writer(&mut self) -> &mut dyn Write {
        match &mut self.target {
            Target::Stdout(out) => out,
            Target::Memory(bytes, _) => bytes,
            Target::Special(out) | Target::File(_, out) => out,
        }
    }
}

/// Bytes in memory, up to a number.
#[derive(Debug)]
struct InMemory {
    bytes: Vec<u8>,
    most: usize,
}

impl Write for InMemory {
    fn write(&mut self, more: &[u8]) -> io::Result<usize> {
        if more.len() > self.most - self.bytes.len() {
            return Err(io::Error::other(format!("takes more than the {} bytes of memory", self.most)));
        }
        self.bytes.write(more)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer().flush()?;
        match &mut self.target {
            Target::File(part, file) => part.keep(file.get_ref()),
            _ => Ok(()),
        }
    }
}

/// The name of the unfinished file of `path`.
pub fn part_of(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(".part");
    name.into()
}

fn exists(path: &Path) -> Error {
    Error::path(path, Note::with("exists already", Remedy::Replace))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dropped_output_leaves_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.bin");
        let mut out = Output::create(&path, false).expect("created");
        out.write_all(b"half").expect("written");
        drop(out);
        assert_eq!(fs::read_dir(folder.path()).expect("listed").count(), 0);
    }

    #[test]
    fn only_a_committed_output_has_its_name_and_is_not_replaced_unasked() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.bin");
        let mut out = Output::create(&path, false).expect("created");
        out.write_all(b"whole").expect("written");
        assert!(!path.exists());
        assert!(Output::create(&path, false).is_err(), "someone is writing it");
        out.commit().expect("committed");
        assert_eq!(fs::read(&path).expect("read"), b"whole");
        assert!(Output::create(&path, false).is_err(), "it exists");
        Output::create(&path, true).expect("forced").commit().expect("committed");
        assert_eq!(fs::read(&path).expect("read"), b"");
    }
}
