//! Results out: to standard output, or to a file whose final name exists only when it is complete.

use crate::error::{Error, Result};
use std::ffi::OsString;
use std::fs::{self, File, TryLockError};
use std::io::{self, BufWriter, IsTerminal, Stdout, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// The name that stands for a standard stream.
pub const STANDARD: &str = "-";

/// Where a result goes. Dropped before [`Output::commit`], it leaves nothing behind under the final name.
#[derive(Debug)]
pub struct Output {
    path: PathBuf,
    target: Target,
}

#[derive(Debug)]
enum Target {
    Stdout(BufWriter<Stdout>),
    /// A device or a pipe, written as it is.
    Special(BufWriter<File>),
    File(BufWriter<File>, Part),
}

/// The unfinished file; removed when dropped.
#[derive(Debug)]
struct Part {
    path: PathBuf,
    replace: bool,
    /// Complete, or renamed: no longer to be removed.
    keep: bool,
}

impl Drop for Part {
    fn drop(&mut self) {
        if !self.keep {
            let _ = fs::remove_file(&self.path); // nobody is left to hear of a failure
        }
    }
}

impl Output {
    /// Bytes that are collected before they are written.
    pub const BUFFER: usize = 256 << 10;

    /// Opens `path`, or standard output for `-`. An existing file is an error unless `force` replaces it.
    pub fn create(path: &Path, force: bool) -> Result<Self> {
        let target = if path == Path::new(STANDARD) {
            if io::stdout().is_terminal() {
                return Err(Error::usage("-o -: binary data is not written to a terminal; redirect or pipe it"));
            }
            Target::Stdout(BufWriter::with_capacity(Self::BUFFER, io::stdout()))
        } else if fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir()) {
            let file = File::options().write(true).open(path).map_err(|e| Error::io(path, "opening", e))?;
            Target::Special(BufWriter::with_capacity(Self::BUFFER, file))
        } else {
            Self::check(path, force)?;
            let (file, part) = Part::create(path, force)?;
            Target::File(BufWriter::with_capacity(Self::BUFFER, file), part)
        };
        Ok(Self { path: path.into(), target })
    }

    /// An error if a file cannot be made at `path`, as far as can be told without making it.
    pub fn check(path: &Path, force: bool) -> Result<()> {
        if path.is_dir() {
            return Err(Error::usage(format!("{}: is a folder; name a file", path.display())));
        }
        if path.exists() && !force {
            return Err(Error::usage(format!("{}: exists already; --force replaces it", path.display())));
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
    pub fn commit(mut self) -> Result<()> {
        self.flush().map_err(|e| Error::io(&self.path, "writing", e))?;
        let Target::File(file, part) = &mut self.target else { return Ok(()) };
        file.get_ref().sync_all().map_err(|e| Error::io(&self.path, "writing", e))?;
        part.keep = true; // if its name cannot be given, the work must not be lost
        let doing = || format!("giving the finished {} this name", part.path.display());
        part.rename(&self.path).map_err(|e| Error::io(&self.path, doing(), e))
    }
}

impl Part {
    /// Creates and locks `NAME.part`; one that nobody holds is left over from a run that died.
    fn create(path: &Path, replace: bool) -> Result<(File, Self)> {
        let mut name = OsString::from(path);
        name.push(".part");
        let part_path = PathBuf::from(name);
        let failed = |e| Error::io(path, "creating", e);
        loop {
            let file = File::options().write(true).create(true).truncate(false).open(&part_path).map_err(failed)?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    return Err(Error::usage(format!("{}: another program is writing it", path.display())));
                }
                Err(TryLockError::Error(e)) if e.kind() == io::ErrorKind::Unsupported => {}
                Err(TryLockError::Error(e)) => return Err(failed(e)),
            }
            // Between opening and locking, its last owner may have given the file its final name.
            let is_it = |now: fs::Metadata| file.metadata().is_ok_and(|m| (m.dev(), m.ino()) == (now.dev(), now.ino()));
            if fs::metadata(&part_path).is_ok_and(is_it) {
                file.set_len(0).map_err(failed)?;
                return Ok((file, Self { path: part_path, replace, keep: false }));
            }
        }
    }

    fn rename(&self, path: &Path) -> io::Result<()> {
        if self.replace {
            fs::rename(&self.path, path)?;
        } else {
            match fs::hard_link(&self.path, path) {
                Err(e) if e.kind() != io::ErrorKind::AlreadyExists => fs::rename(&self.path, path)?, // no hard links here
                Err(e) => return Err(e),
                Ok(()) => fs::remove_file(&self.path)?,
            }
        }
        match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => File::open(folder)?.sync_all(),
            _ => File::open(".")?.sync_all(),
        }
    }
}

impl Output {
    fn writer(&mut self) -> &mut dyn Write {
        match &mut self.target {
            Target::Stdout(out) => out,
            Target::Special(out) | Target::File(out, _) => out,
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.writer().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.writer().flush()
    }
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
