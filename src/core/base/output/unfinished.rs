//! The unfinished files and folders of this process, for programs that end early.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A program that writes an unfinished file.
pub type Helper = Arc<Mutex<Child>>;

/// An unfinished file or folder.
#[derive(Debug)]
pub(super) struct Unfinished {
    path: PathBuf,
    /// Whether it is to stay, since a later run can continue it.
    keep: Arc<AtomicBool>,
    /// The program that writes it, if another one does. It could create the file once more after it was removed.
    helper: Option<Helper>,
}

/// All of this process. While they are locked, none is created, renamed or removed.
pub(super) type AllUnfinished = MutexGuard<'static, Vec<Unfinished>>;

static ALL: Mutex<Vec<Unfinished>> = Mutex::new(Vec::new());

pub(super) fn all() -> AllUnfinished {
    ALL.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Adds a file or folder, and returns whether it is to be kept: not yet.
pub(super) fn add(path: &Path, all: &mut AllUnfinished) -> Arc<AtomicBool> {
    let keep = Arc::new(AtomicBool::new(false));
    all.push(Unfinished { path: path.into(), keep: keep.clone(), helper: None });
    keep
}

/// Starts the program that writes a file. No file is removed meanwhile, so whoever removes this one can end the program.
pub(super) fn start_helper(path: &Path, start: impl FnOnce() -> io::Result<Child>) -> io::Result<Helper> {
    let mut all = all();
    let helper = Arc::new(Mutex::new(start()?));
    all.iter_mut().filter(|one| one.path == path).for_each(|one| one.helper = Some(helper.clone()));
    Ok(helper)
}

/// Forgets a file or folder. Its helper must be gone before it is removed, so it is ended here.
pub(super) fn forget(path: &Path) {
    let mut all = all();
    all.iter().filter(|one| one.path == path).for_each(Unfinished::end_helper);
    all.retain(|one| one.path != path);
}

impl Unfinished {
    pub(super) fn is(&self, path: &Path) -> bool {
        self.path == path
    }

    fn is_kept(&self) -> bool {
        self.keep.load(Ordering::Relaxed)
    }

    fn end_helper(&self) {
        let Some(mut helper) = self.helper.as_ref().map(|h| h.lock().unwrap_or_else(PoisonError::into_inner)) else {
            return;
        };
        let _ = helper.kill(); // it may have ended
        let _ = helper.wait();
    }

    fn remove(&self) {
        self.end_helper();
        // A failure cannot be reported here.
        let _ = if self.path.is_dir() { fs::remove_dir_all(&self.path) } else { fs::remove_file(&self.path) };
    }
}

/// Removes all unfinished files except those that can be resumed, and returns the names of these. The process must then
/// end: threads that create, commit or drop an output now wait forever.
pub fn abandon() -> Vec<PathBuf> {
    let all = all();
    all.iter().filter(|one| !one.is_kept()).for_each(Unfinished::remove);
    let kept = all.iter().filter(|one| one.is_kept() && one.path.exists());
    let kept = kept.map(|one| one.path.clone()).collect();
    std::mem::forget(all);
    kept
}
