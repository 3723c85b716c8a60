//! Locks of unfinished files and folders. What is not locked was left by a run that was killed.

use super::unfinished::{AllUnfinished, all};
use crate::base::error::{Error, Result};
use crate::base::system::{Instant, MetadataExt};
use std::fs::{self, File, TryLockError};
use std::io;
use std::path::Path;
use std::time::Duration;

/// How long to wait for a lock: a killed process may hold it a little longer.
const WAIT: Duration = Duration::from_secs(1);

/// The system's error for a lock that needs a file open for writing, as NFS does: folders never are.
const EBADF: i32 = 9;

/// Opens and locks the file or folder `part`, unfinished of `path`, and repeats this until it is the one of that name:
/// between the two, its last owner may have renamed or removed it.
pub(super) fn locked(path: &Path, part: &Path, open: impl Fn() -> io::Result<File>) -> Result<(File, AllUnfinished)> {
    let failed = |e| Error::io(path, "creating", e);
    let asked = Instant::now();
    loop {
        let unfinished = all(); // `abandon` must know all that is there
        let file = open().map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) if asked.elapsed() < WAIT => {
                drop(unfinished);
                std::thread::sleep(WAIT / 20);
                continue;
            }
            Err(TryLockError::WouldBlock) => {
                let who = holder(&file).unwrap_or("another program".into());
                return Err(Error::path(path, format!("{who} is writing it")));
            }
            Err(TryLockError::Error(e)) if is_unsupported(&e) => {}
            Err(TryLockError::Error(e)) => return Err(failed(e)),
        }
        let own = file.metadata().map_err(failed)?;
        if fs::metadata(part).is_ok_and(|there| (there.dev(), there.ino()) == (own.dev(), own.ino())) {
            return Ok((file, unfinished));
        }
    }
}

/// Whether the file system has no locks; NFS has none of folders.
fn is_unsupported(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::Unsupported || error.raw_os_error() == Some(EBADF)
}

/// The process that has locked a file, if the system tells.
fn holder(file: &File) -> Option<String> {
    let locks = fs::read_to_string("/proc/locks").ok()?;
    let inode = format!(":{}", file.metadata().ok()?.ino());
    let line =
        locks.lines().find(|line| line.split_whitespace().nth(5).is_some_and(|place| place.ends_with(&inode)))?;
    let process: u32 = line.split_whitespace().nth(4)?.parse().ok().filter(|process| *process > 0)?;
    let name = fs::read_to_string(format!("/proc/{process}/comm")).unwrap_or_default();
    Some(format!("process {process} ({})", name.trim()))
}
