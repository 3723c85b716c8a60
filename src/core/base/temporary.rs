//! Temporary folders that are gone when the program ends, also after a signal.

use super::error::{Error, Result};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::{env, fs};
use tempfile::TempDir;

/// The folders that are there.
static FOLDERS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn folders() -> MutexGuard<'static, Vec<PathBuf>> {
    FOLDERS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A folder that only its owner may read. Dropping it removes it with all its files.
#[derive(Debug)]
pub struct TemporaryFolder(TempDir);

impl TemporaryFolder {
    /// Makes a folder, where the system has its temporary ones.
    ///
    /// # Errors
    /// It cannot be made.
    pub fn new() -> Result<Self> {
        let mut folders = folders(); // `remove_all` must know every folder
        let made = tempfile::Builder::new().prefix("wavesplat-").tempdir();
        let folder = made.map_err(|e| Error::io(env::temp_dir(), "creating a folder", e))?;
        folders.push(folder.path().into());
        Ok(Self(folder))
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        self.0.path()
    }
}

impl Drop for TemporaryFolder {
    fn drop(&mut self) {
        folders().retain(|path| path != self.0.path());
    }
}

/// Removes all folders. The process must then end: threads that make or drop one now wait for ever.
pub fn remove_all() {
    let folders = folders();
    for folder in folders.iter() {
        let _ = fs::remove_dir_all(folder); // a failure cannot be reported here
    }
    std::mem::forget(folders);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_known_until_it_is_gone() {
        let folder = TemporaryFolder::new().expect("a folder");
        let path = folder.path().to_path_buf();
        fs::write(path.join("a"), "b").expect("writable");
        assert!(folders().contains(&path));
        drop(folder);
        assert!(!folders().contains(&path) && !path.exists());
    }
}
