//! Read-only files whose bytes are copied out: memory maps by default, plain reads on request.
//!
//! A map is fast (no system call, the page cache is the buffer) but has a known
//! danger: when another process cuts the file short, touching the lost pages raises SIGBUS. So sizes are checked at
//! open, bytes are copied out before anyone looks at them, nothing is ever written through a map, and the programs
//! call [`explain_sigbus`] so that the user reads which file failed instead of "Bus error".
#![allow(unsafe_code)]

#[cfg(unix)]
mod signals;

#[cfg(unix)]
pub use signals::{explain_sigbus, on_interrupt};

use crate::base::address::refuse_address;
use crate::base::error::{ChangedSince, Error, Result};
use crate::base::files;
use crate::base::system::{FileExt, MetadataExt};
use memmap2::{Mmap, MmapOptions};
use std::ffi::{CString, c_char};
use std::fs::{File, Metadata};
use std::io;
use std::path::{Path, PathBuf};
use std::ptr;
use std::sync::atomic::{AtomicPtr, AtomicUsize, Ordering};
use std::time::SystemTime;

/// How the bytes of a file are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Through a read-only memory map.
    Map,
    /// By `pread`, for file systems where a map is slow or unsafe.
    Read,
}

impl Access {
    /// Maps unless `no_mmap`, which reads instead.
    pub fn unless(no_mmap: bool) -> Self {
        if no_mmap { Self::Read } else { Self::Map }
    }
}

/// Properties of a file that show whether it has changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct State {
    /// Length in bytes.
    pub len: u64,
    modified: Option<SystemTime>,
    device: u64,
    inode: u64,
    /// Whether this is the state of a file; false for data that the caller holds.
    is_file: bool,
}

impl State {
    /// The state of data that the caller holds: there is no file that could change.
    pub const HELD: Self = Self { len: 0, modified: None, device: 0, inode: 0, is_file: false };

    fn from_metadata(meta: &Metadata) -> Self {
        let (len, modified, device, inode) = (meta.len(), meta.modified().ok(), meta.dev(), meta.ino());
        Self { len, modified, device, inode, is_file: true }
    }

    /// An error if a file that was in this state is `now` in another.
    pub fn check(&self, path: &Path, now: &Self) -> Result<()> {
        let what = match now {
            now if now == self => return Ok(()),
            now if now.len != self.len => format!("{} bytes, now {}", self.len, now.len),
            now if now.modified != self.modified => "it has a new modification time".into(),
            _ => "it is another file".into(),
        };
        Err(Error::changed(path, format!("changed while it was being read: {what}")))
    }

    /// An error if the file of this name is not in this state.
    pub fn check_path(&self, path: &Path) -> Result<()> {
        if !self.is_file {
            return Ok(());
        }
        let now = path.metadata().map_err(|e| Error::io(path, "checking", e))?;
        self.check(path, &Self::from_metadata(&now))
    }
}

/// An open file, and its state as it was at open.
#[derive(Debug)]
#[doc(hidden)]
pub struct FileBytes {
    path: PathBuf,
    /// Closed once mapped: an archive may have more files than a process may hold open.
    file: Option<File>,
    state: State,
    map: Option<RegisteredMap>,
}

impl FileBytes {
    /// Opens a regular file for reading.
    pub fn open(path: &Path, access: Access) -> Result<Self> {
        refuse_address(path)?;
        let failed = |e| Error::io(path, "opening", e);
        let file = files::open(path)?;
        let state = State::from_metadata(&file.metadata().map_err(failed)?);
        let map = match access {
            Access::Map if state.len > 0 => {
                Some(RegisteredMap::new(&file, path).map_err(|e| Error::io(path, "mapping", e))?)
            }
            _ => None,
        };
        let file = map.is_none().then_some(file);
        Ok(Self { path: path.into(), file, state, map })
    }

    /// The path it was opened by.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Length in bytes at open.
    pub fn len(&self) -> u64 {
        self.state.len
    }

    /// Whether the file was empty at open.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Its state at open.
    pub fn state(&self) -> State {
        self.state
    }

    /// Copies `out.len()` bytes from `offset`.
    pub fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let end = offset.checked_add(out.len() as u64).filter(|end| *end <= self.len());
        let Some(end) = end else {
            let what = format!("bytes {offset}.. +{} lie beyond the end at {}", out.len(), self.len());
            return Err(io::Error::new(io::ErrorKind::UnexpectedEof, what));
        };
        match (&self.map, &self.file) {
            (Some(map), _) => out.copy_from_slice(&map.bytes()[offset as usize..end as usize]),
            (None, Some(file)) => file.read_exact_at(out, offset).map_err(|e| match e.kind() {
                io::ErrorKind::UnexpectedEof => {
                    io::Error::new(e.kind(), ChangedSince("became shorter while it was being read".into()))
                }
                _ => e,
            })?,
            (None, None) => {} // no bytes at all
        }
        Ok(())
    }

    /// Whether the file is mapped, so that small reads are cheap.
    pub(crate) fn is_mapped(&self) -> bool {
        self.map.is_some()
    }

    /// An error if the file of this name has changed since it was opened.
    pub fn check_unchanged(&self) -> Result<()> {
        self.state.check_path(&self.path)
    }
}

impl wavesplat_format::Storage for FileBytes {
    fn len(&self) -> u64 {
        self.state.len
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        Self::read_at(self, offset, out)
    }
}

/// A map whose file the SIGBUS handler can name.
#[derive(Debug)]
struct RegisteredMap {
    slot: Option<&'static Slot>,
    _path: CString, // the slot points into it
    map: Mmap,
}

impl RegisteredMap {
    fn new(file: &File, path: &Path) -> io::Result<Self> {
        // SAFETY: the map is private to this type and only ever copied from (`FileBytes::read_at`), so no reference
        // into it outlives a copy. Another process can still change the file during a copy, which may tear the copied
        // bytes (they are checked afterwards) or raise SIGBUS if it cuts the file (which `explain_sigbus` reports).
        // This contract with the outside cannot be enforced from here: inputs must not be modified during a run.
        let map = unsafe { MmapOptions::new().map(file)? };
        #[cfg(unix)]
        let _ = map.advise(memmap2::Advice::Sequential); // a hint; refusal changes nothing
        let path = CString::new(path.as_os_str().as_encoded_bytes()).unwrap_or_default();
        let slot = Slot::claim(&map, &path);
        Ok(Self { slot, _path: path, map })
    }

    fn bytes(&self) -> &[u8] {
        &self.map
    }
}

impl Drop for RegisteredMap {
    fn drop(&mut self) {
        if let Some(slot) = self.slot {
            slot.start.store(0, Ordering::SeqCst);
        }
    }
}

/// One mapped range, readable from a signal handler: no locks, no allocation.
#[derive(Debug)]
struct Slot {
    start: AtomicUsize, // 0: free
    end: AtomicUsize,
    path: AtomicPtr<c_char>,
}

/// More maps than slots work too, but a SIGBUS in one of those is reported without its name.
static SLOTS: [Slot; 1024] =
    [const { Slot { start: AtomicUsize::new(0), end: AtomicUsize::new(0), path: AtomicPtr::new(ptr::null_mut()) } };
        1024];

impl Slot {
    const CLAIMED: usize = 1; // no map starts at address 1

    fn claim(map: &Mmap, path: &CString) -> Option<&'static Self> {
        let free = |s: &&Self| s.start.compare_exchange(0, Self::CLAIMED, Ordering::SeqCst, Ordering::SeqCst).is_ok();
        let slot = SLOTS.iter().find(free)?;
        let start = map.as_ptr() as usize;
        slot.path.store(path.as_ptr().cast_mut(), Ordering::SeqCst);
        slot.end.store(start + map.len(), Ordering::SeqCst);
        slot.start.store(start, Ordering::SeqCst);
        Some(slot)
    }

    #[cfg(unix)]
    fn holds(&self, address: usize) -> bool {
        let start = self.start.load(Ordering::SeqCst);
        start > Self::CLAIMED && start <= address && address < self.end.load(Ordering::SeqCst)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn file_of(bytes: &[u8]) -> tempfile::NamedTempFile {
        let mut file = tempfile::NamedTempFile::new().expect("temporary file");
        file.write_all(bytes).expect("writing");
        file
    }

    #[test]
    fn both_ways_of_access_read_the_same() {
        let file = file_of(b"0123456789");
        for access in [Access::Map, Access::Read] {
            let bytes = FileBytes::open(file.path(), access).expect("opening");
            let mut out = [0; 4];
            bytes.read_at(3, &mut out).expect("reading");
            assert_eq!(&out, b"3456");
            assert!(bytes.read_at(7, &mut out).is_err(), "past the end");
            assert!(bytes.read_at(u64::MAX, &mut out).is_err(), "overflow");
        }
    }

    #[test]
    fn a_longer_file_is_noticed() {
        let mut file = file_of(b"0123");
        let bytes = FileBytes::open(file.path(), Access::Map).expect("opening");
        bytes.check_unchanged().expect("unchanged");
        file.write_all(b"4").expect("appending");
        assert!(matches!(bytes.check_unchanged(), Err(Error::Changed { .. })));
    }

    #[test]
    fn an_empty_file_opens_and_a_folder_does_not() {
        let file = file_of(b"");
        assert!(FileBytes::open(file.path(), Access::Map).expect("opening").is_empty());
        assert!(FileBytes::open(Path::new("/"), Access::Map).is_err());
    }
}
