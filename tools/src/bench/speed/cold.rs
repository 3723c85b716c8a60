//! The system's reports about a process and its files: cache, storage and memory.

use super::measured::Measured;
use std::fs::{self, File};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::Duration;
use wavesplat::base::error::{Error, Result};

/// Asks the system to drop its cache of a file. [`from_storage`] shows whether it did.
#[cfg(target_os = "linux")]
pub(super) fn forget(path: &Path) -> Result<()> {
    let file = File::open(path).map_err(|e| Error::io(path, "opening", e))?;
    file.sync_all().map_err(|e| Error::io(path, "writing it to the disk", e))?; // what is not there yet stays cached
    let asked = rustix::fs::fadvise(&file, 0, None, rustix::fs::Advice::DontNeed);
    asked.map_err(|e| Error::io(path, "emptying the cache", e.into()))
}

/// On other systems nothing is dropped, and no bytes are reported as read from storage.
#[cfg(not(target_os = "linux"))]
pub(super) fn forget(path: &Path) -> Result<()> {
    File::open(path).map(drop).map_err(|e| Error::io(path, "opening", e))
}

/// Bytes that were read from storage for this process, if the system reports it.
pub(super) fn from_storage() -> Option<u64> {
    number(&fs::read_to_string("/proc/self/io").ok()?, "read_bytes:")
}

/// Bytes of memory that belong to this process alone, without mapped files.
fn heap() -> Option<u64> {
    number(&fs::read_to_string("/proc/self/status").ok()?, "RssAnon:").map(|kib| kib << 10)
}

fn number(text: &str, name: &str) -> Option<u64> {
    text.lines().find_map(|line| line.strip_prefix(name))?.split_whitespace().next()?.parse().ok()
}

/// Interval between two samples of memory.
const INTERVAL: Duration = Duration::from_millis(2);

/// Adds the peak memory observed while `work` ran.
pub(super) fn with_peak_heap(work: impl FnOnce() -> Result<Measured>) -> Result<Measured> {
    let (done, peak) = (AtomicBool::new(false), AtomicU64::new(0));
    let measured = std::thread::scope(|scope| {
        scope.spawn(|| {
            while !done.load(Ordering::Relaxed) {
                peak.fetch_max(heap().unwrap_or(0), Ordering::Relaxed);
                std::thread::sleep(INTERVAL);
            }
        });
        let measured = work();
        done.store(true, Ordering::Relaxed);
        measured
    })?;
    let peak = peak.into_inner();
    Ok(Measured { peak_heap: (peak > 0).then_some(peak), ..measured })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_found_by_their_names() {
        assert_eq!(number("a: 1\nread_bytes: 4096\n", "read_bytes:"), Some(4096));
        assert_eq!(number("RssAnon:\t     100 kB\n", "RssAnon:"), Some(100));
        assert_eq!(number("", "RssAnon:"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_peak_outlives_what_was_freed() {
        let measured = with_peak_heap(|| {
            std::hint::black_box(vec![1_u8; 64 << 20]);
            std::thread::sleep(20 * INTERVAL);
            let large = std::hint::black_box(vec![1_u8; 64 << 20]);
            std::thread::sleep(50 * INTERVAL);
            drop(large);
            Ok(Measured::default())
        });
        assert!(measured.expect("it works").peak_heap.is_some_and(|peak| peak >= 64 << 20));
    }
}
