//! Folders of results, and files that belong together: all of them get their final names at once.

use super::lock::locked;
use super::unfinished::{self, AllUnfinished, add, all};
use super::{Output, exists, part_of};
use crate::base::error::{Error, Result};
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// A folder that is being written, under another name. If it is dropped before it is committed, nothing remains.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    part: PathBuf,
    /// A file that is written first and removed last: it says that the folder is ours.
    marker: &'static str,
    takes: Takes,
    /// Whether to replace what has the final name.
    replace: bool,
    /// Holds the lock.
    _lock: File,
}

/// What gets its final name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Takes {
    /// The whole folder, in place of another with the same marker.
    Whole,
    /// Its files one by one, in the folder of that name, which may have others.
    Files,
}

impl OutputFolder {
    /// The unfinished folder for `path`. One that a killed run left is cleared: it has the file `marker`, which the
    /// caller writes first.
    pub fn create(path: &Path, marker: &'static str, takes: Takes, replace: bool) -> Result<Self> {
        let part = part_of(path);
        if part.is_symlink() || part.exists() && !part.is_dir() {
            return Err(in_the_way(&part));
        }
        let open = || {
            let made = fs::create_dir(&part);
            made.or_else(|e| if e.kind() == io::ErrorKind::AlreadyExists { Ok(()) } else { Err(e) })?;
            File::open(&part)
        };
        let (lock, mut unfinished) = locked(path, &part, open)?;
        let failed = |e| Error::io(&part, "clearing", e);
        if !part.join(marker).is_file() && fs::read_dir(&part).map_err(failed)?.next().is_some() {
            return Err(in_the_way(&part));
        }
        clear(&part, marker).map_err(failed)?;
        add(&part, &mut unfinished);
        Ok(Self { path: path.into(), part, marker, takes, replace, _lock: lock })
    }

    /// The final name.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The place of a file until the folder is committed.
    pub fn place(&self, name: impl AsRef<Path>) -> PathBuf {
        self.part.join(name)
    }

    /// Writes a file, and the folders that it is in.
    pub fn write(&self, name: impl AsRef<Path>, bytes: &[u8]) -> Result<()> {
        let path = self.place(name);
        let failed = |e| Error::io(&path, "writing", e);
        let mut file = self.create_file(&path).map_err(failed)?;
        file.write_all(bytes).map_err(failed)
    }

    fn create_file(&self, path: &Path) -> io::Result<File> {
        let _all = all(); // `abandon` must find every file
        path.parent().map_or(Ok(()), fs::create_dir_all)?;
        File::create(path)
    }

    /// Gives everything its final name.
    pub fn commit(self) -> Result<()> {
        commit_together(Some(&self), Vec::new())
    }

    fn commit_in(&self, _all: &AllUnfinished) -> Result<()> {
        let failed = |e| Error::io(&self.path, "giving this its name", e);
        match self.takes {
            Takes::Whole => self.commit_whole().map_err(failed),
            Takes::Files => {
                let made = fs::create_dir(&self.path);
                made.or_else(|e| if self.path.is_dir() { Ok(()) } else { Err(e) }).map_err(failed)?;
                self.files().map_err(failed)?.iter().try_for_each(|name| self.commit_file(Path::new(name)))
            }
        }
    }

    /// The files to move, in order.
    fn files(&self) -> io::Result<Vec<std::ffi::OsString>> {
        let names = fs::read_dir(&self.part)?.map(|entry| Ok(entry?.file_name()));
        let mut names = names.filter(|name| name.as_ref().map_or(true, |name| name != self.marker));
        let mut names = names.by_ref().collect::<io::Result<Vec<_>>>()?;
        names.sort();
        Ok(names)
    }

    fn commit_file(&self, name: &Path) -> Result<()> {
        let to = self.path.join(name);
        if to.exists() && !self.replace {
            return Err(exists(&to));
        }
        fs::rename(self.place(name), &to).map_err(|e| Error::io(&to, "giving this its name", e))
    }

    /// Gives the folder its name. One that it replaces gets the unfinished name, and is removed with it.
    fn commit_whole(&self) -> io::Result<()> {
        if !self.path.exists() {
            return fs::rename(&self.part, &self.path);
        }
        if !self.replace {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        let before = part_of(&self.part);
        if before.is_dir() {
            fs::remove_dir_all(&before)?; // of a run that was killed right here
        }
        let replaced = File::open(&self.path)?;
        let _ = replaced.try_lock(); // until it is removed, since it gets the name that other runs take
        fs::rename(&self.path, &before)?;
        fs::rename(&self.part, &self.path).inspect_err(|_| _ = fs::rename(&before, &self.path))?;
        fs::rename(&before, &self.part)?;
        remove(&self.part, self.marker)
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        // Once it was committed, the name may be that of another run.
        let is_own = all().iter().any(|one| one.is(&self.part));
        unfinished::forget(&self.part);
        if is_own {
            let _ = remove(&self.part, self.marker); // a failure cannot be reported here
        }
    }
}

/// Gives a folder and files their final names, in this order, once all of them are on disk. Meanwhile no signal ends the
/// program, so that they are all there or none.
pub fn commit_together(folder: Option<&OutputFolder>, mut files: Vec<Output>) -> Result<()> {
    files.iter_mut().try_for_each(Output::complete)?;
    let mut all = all();
    if let Some(folder) = folder {
        folder.commit_in(&all)?;
        if folder.takes == Takes::Whole {
            all.retain(|one| !one.is(&folder.part));
        }
    }
    files.iter().try_for_each(|file| file.rename(&all))?;
    drop(all);
    files.iter().try_for_each(Output::sync_name)
}

fn in_the_way(part: &Path) -> Error {
    Error::path(part, "is in the way, and not what a killed run left; remove it")
}

/// Removes everything in a folder, the marker last.
fn clear(folder: &Path, marker: &str) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        match entry.file_type()?.is_dir() {
            true => fs::remove_dir_all(entry.path())?,
            false if entry.file_name() != marker => fs::remove_file(entry.path())?,
            false => {}
        }
    }
    let removed = fs::remove_file(folder.join(marker));
    removed.or_else(|e| if e.kind() == io::ErrorKind::NotFound { Ok(()) } else { Err(e) })
}

fn remove(folder: &Path, marker: &str) -> io::Result<()> {
    clear(folder, marker)?;
    fs::remove_dir(folder)
}
