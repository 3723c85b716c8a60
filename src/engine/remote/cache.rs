//! A folder that keeps pages of remote files for later runs. Several processes may use it at once.
//!
//! A page is a file of its own, written under another name and renamed, with a checksum: a page that is damaged or cut
//! short is downloaded again. Failing to write a page is no error, since the cache only saves time.

use super::pages::PAGE;
use std::fs::{self, File, FileTimes};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::{Duration, SystemTime};
use tempfile::NamedTempFile;
use wavesplat_core::base::error::{Error, Result};
use xxhash_rust::xxh3::{xxh3_64_with_seed, xxh3_128};

/// Folders of the cache begin with this: nothing else in it is ever touched.
const PREFIX: &str = "wavesplat-";

/// Hexadecimal digits of the name of such a folder.
const DIGITS: usize = 32;

/// The ending of pages.
const ENDING: &str = "page";

/// Names of pages that are being written begin with this; 6 letters follow.
const UNFINISHED: &str = ".new";

/// A page used again within this time keeps its recorded time of use.
const RECENT: Duration = Duration::from_secs(60);

/// A folder of pages of at most a number of bytes.
#[derive(Debug, Clone)]
pub struct Cache {
    folder: PathBuf,
    most: u64,
    /// Bytes written since sizes were counted.
    written: Arc<AtomicU64>,
}

impl Cache {
    /// Default cache size: 4 GiB.
    pub const ROOM: u64 = 4 << 30;

    /// A cache in a folder, which is made if it does not exist; of at most `most` bytes.
    ///
    /// # Errors
    /// The folder cannot be made or written.
    pub fn new(folder: impl Into<PathBuf>, most: u64) -> Result<Self> {
        let folder = folder.into();
        fs::create_dir_all(&folder).map_err(|e| Error::io(&folder, "creating the cache", e))?;
        NamedTempFile::new_in(&folder).map_err(|e| Error::io(&folder, "writing to the cache", e))?;
        let cache = Self { folder, most, written: Arc::default() };
        cache.trim();
        Ok(cache)
    }

    /// The cache entry of one object, identified by its name, first bytes, version and length. The first bytes hold the
    /// identity of a coefficient file.
    #[cfg_attr(not(feature = "remote"), allow(dead_code, reason = "only objects of servers have this"))]
    pub(super) fn object(&self, name: &Path, first: &[u8], version: &str, len: u64) -> CachedObject {
        let digests =
            [name.as_os_str().as_encoded_bytes(), first, version.as_bytes(), &len.to_le_bytes()].map(xxh3_128);
        let digest = xxh3_128(&digests.map(u128::to_le_bytes).concat());
        CachedObject {
            cache: self.clone(),
            folder: self.folder.join(format!("{PREFIX}{digest:032x}")),
            digest: digest as u64,
        }
    }

    /// Counts bytes that were written, and makes room from time to time.
    fn grown(&self, bytes: u64) {
        if self.written.fetch_add(bytes, Relaxed) + bytes > self.most / 16 {
            self.written.store(0, Relaxed);
            self.trim();
        }
    }

    /// If the cache is too large, removes the least recently used pages until at most three quarters of its room are
    /// used.
    fn trim(&self) {
        let mut pages: Vec<(SystemTime, u64, PathBuf)> = self.pages().collect();
        let mut bytes: u64 = pages.iter().map(|(_, bytes, _)| bytes).sum();
        if bytes <= self.most {
            return;
        }
        pages.sort();
        for (_, size, path) in pages {
            if bytes <= self.most / 4 * 3 {
                break;
            }
            bytes -= size;
            let _ = fs::remove_file(&path); // another process may have done so
            let _ = path.parent().map(fs::remove_dir); // fails unless it is empty
        }
    }

    /// All pages, also unfinished ones: when they were used, their sizes and paths. Links are not followed, and names that
    /// the cache does not give are not its own.
    fn pages(&self) -> impl Iterator<Item = (SystemTime, u64, PathBuf)> {
        let objects = entries(&self.folder).filter(|path| is_object(path) && is_real_folder(path));
        objects.flat_map(|object| entries(&object)).filter_map(|path| {
            let about = path.symlink_metadata().ok().filter(|about| about.is_file() && is_page(&path))?;
            Some((about.modified().ok()?, about.len(), path))
        })
    }
}

/// The paths in a folder; none if it cannot be read.
fn entries(folder: &Path) -> impl Iterator<Item = PathBuf> + use<> {
    fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path())
}

/// Whether a path is a folder, and no link to one.
fn is_real_folder(path: &Path) -> bool {
    path.symlink_metadata().is_ok_and(|about| about.is_dir())
}

/// Whether the folder of an object has this name.
fn is_object(path: &Path) -> bool {
    let digest = path.file_name().and_then(|name| name.to_str()?.strip_prefix(PREFIX));
    digest.is_some_and(|digest| digest.len() == DIGITS && digest.bytes().all(|digit| digit.is_ascii_hexdigit()))
}

/// Whether a page has this name, or an unfinished one.
fn is_page(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str()?.strip_suffix(ENDING)?.strip_suffix('.'));
    name.is_some_and(|name| match name.strip_prefix(UNFINISHED) {
        Some(random) => random.len() == 6 && random.bytes().all(|letter| letter.is_ascii_alphanumeric()),
        None => name.len() >= 10 && name.bytes().all(|digit| digit.is_ascii_digit()),
    })
}

/// The pages of one object.
#[derive(Debug)]
pub(crate) struct CachedObject {
    cache: Cache,
    folder: PathBuf,
    /// Tells pages of other objects apart that have come here by mistake.
    digest: u64,
}

impl CachedObject {
    fn path(&self, page: u64) -> PathBuf {
        self.folder.join(format!("{page:010}.{ENDING}"))
    }

    fn checksum(&self, page: u64, bytes: &[u8]) -> [u8; 8] {
        xxh3_64_with_seed(bytes, self.digest ^ page).to_le_bytes()
    }

    /// A page of this length; none if it is not kept, or damaged.
    pub(super) fn load(&self, page: u64, length: usize) -> Option<Vec<u8>> {
        let path = self.path(page);
        path.symlink_metadata().ok().filter(|about| about.is_file() && about.len() <= PAGE + 8)?; // no link, no pipe
        let file = File::open(path).ok()?;
        let about = file.metadata().ok()?;
        let mut bytes = Vec::with_capacity(PAGE as usize + 8);
        std::io::Read::read_to_end(&mut std::io::Read::take(&file, PAGE + 9), &mut bytes).ok()?;
        let checksum = bytes.split_off(bytes.len().checked_sub(8)?);
        let is_whole = bytes.len() == length && checksum == self.checksum(page, &bytes);
        let unused = about.modified().ok().and_then(|used| used.elapsed().ok());
        if is_whole && unused.is_some_and(|unused| unused > RECENT) {
            let _ = file.set_times(FileTimes::new().set_modified(SystemTime::now())); // if that fails, it is removed sooner
        }
        is_whole.then_some(bytes)
    }

    /// Removes a page, if it is kept.
    pub(super) fn remove(&self, page: u64) {
        if is_real_folder(&self.folder) {
            let _ = fs::remove_file(self.path(page)); // most were not kept
        }
    }

    /// Keeps a page, if that can be done.
    pub(super) fn store(&self, page: u64, bytes: &[u8]) {
        let write = || {
            fs::create_dir_all(&self.folder)?;
            if !is_real_folder(&self.folder) {
                return Err(std::io::ErrorKind::NotADirectory.into()); // a link: what is behind it is not the cache's
            }
            let ending = format!(".{ENDING}");
            let mut file =
                tempfile::Builder::new().prefix(UNFINISHED).rand_bytes(6).suffix(&ending).tempfile_in(&self.folder)?;
            file.write_all(bytes)?;
            file.write_all(&self.checksum(page, bytes))?;
            file.persist(self.path(page)).map_err(|failed| failed.error)
        };
        if write().is_ok() {
            self.cache.grown(bytes.len() as u64 + 8);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::thread;

    fn kept(folder: &Path) -> u64 {
        Cache::new(folder, u64::MAX).expect("a folder").pages().map(|(_, bytes, _)| bytes).sum()
    }

    #[test]
    fn pages_come_back_for_the_same_object_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let cache = Cache::new(folder.path().join("deep/er"), 1 << 30).expect("a folder");
        let name = Path::new("https://host/run.wspl");
        let object = cache.object(name, b"first", "\"1\"", 100_000);
        object.store(1, &[7; 30_000]);
        assert_eq!(object.load(1, 30_000), Some(vec![7; 30_000]));
        assert_eq!(cache.object(name, b"first", "\"1\"", 100_000).load(1, 30_000), Some(vec![7; 30_000]));
        assert_eq!((object.load(1, 9), object.load(0, 30_000)), (None, None));
        assert_eq!(cache.object(Path::new("other"), b"first", "\"1\"", 100_000).load(1, 30_000), None);
        for (first, version, len) in
            [("other", "\"1\"", 100_000), ("first", "\"2\"", 100_000), ("first", "\"1\"", 100_001)]
        {
            assert_eq!(cache.object(name, first.as_bytes(), version, len).load(1, 30_000), None);
        }
    }

    #[test]
    fn damaged_pages_are_not_used() {
        let folder = tempfile::tempdir().expect("a folder");
        let object = Cache::new(folder.path(), 1 << 30).expect("a folder").object(Path::new("a"), b"", "", 1000);
        object.store(0, &[1; 1000]);
        let whole = fs::read(object.path(0)).expect("it was stored");
        for at in [0, 500, 999, 1000, 1007] {
            let mut damaged = whole.clone();
            damaged[at] ^= 4;
            fs::write(object.path(0), damaged).expect("writable");
            assert_eq!(object.load(0, 1000), None, "byte {at}");
        }
        for length in [0, 7, 8, 999, 1007] {
            fs::write(object.path(0), &whole[..length]).expect("writable");
            assert_eq!(object.load(0, 1000), None, "{length} bytes");
        }
        fs::copy(object.path(0), object.path(1)).expect("writable");
        fs::write(object.path(1), &whole).expect("writable");
        assert_eq!(object.load(1, 1000), None, "that is another page");
    }

    #[test]
    fn room_is_bounded_and_nothing_else_is_touched() {
        let folder = tempfile::tempdir().expect("a folder");
        let other = folder.path().join("mine");
        fs::create_dir(&other).expect("writable");
        fs::write(other.join("0000000000.page"), vec![0; 500_000]).expect("writable");
        let most = 400_000;
        thread::scope(|scope| {
            for name in ["a", "b", "c"] {
                let folder = folder.path();
                scope.spawn(move || {
                    let object = Cache::new(folder, most).expect("a folder").object(Path::new(name), b"", "", 1 << 30);
                    (0..40).for_each(|page| object.store(page, &[3; 10_000]));
                });
            }
        });
        Cache::new(folder.path(), most).expect("a folder");
        assert!((1..=most).contains(&kept(folder.path())), "{}", kept(folder.path()));
        assert!(other.join("0000000000.page").exists());
    }

    #[test]
    fn links_are_not_followed_and_files_of_others_stay() {
        let folder = tempfile::tempdir().expect("a folder");
        let [kept, mine] = ["kept", "mine"].map(|name| folder.path().join(name));
        let object = Cache::new(&kept, 1 << 30).expect("a folder").object(Path::new("a"), b"", "", 1 << 20);
        object.store(1, &[7; 30_000]);
        let [linked, named] = ["0".repeat(32), "f".repeat(32)].map(|name| kept.join(format!("{PREFIX}{name}")));
        fs::create_dir(&mine).expect("writable");
        std::os::unix::fs::symlink(&mine, &linked).expect("a link");
        fs::create_dir_all(&named).expect("writable");
        let others = [
            mine.join("0000000000.page"),
            named.join("notes.page"),
            named.join("12.page"),
            kept.join("wavesplat-mine/0000000000.page"),
        ];
        fs::create_dir(kept.join("wavesplat-mine")).expect("writable");
        for path in &others {
            fs::write(path, vec![0; 100_000]).expect("writable");
            File::options().write(true).open(path).expect("a file").set_modified(SystemTime::UNIX_EPOCH).expect("old");
        }
        let outside = mine.join("outside.page");
        fs::write(&outside, vec![0; 100_000]).expect("writable");
        std::os::unix::fs::symlink(&outside, named.join("0000000009.page")).expect("a link");
        Cache::new(&kept, 1000).expect("a folder");
        assert!(others.iter().chain([&outside]).all(|path| path.exists()), "only the cache's own pages go");
        assert_eq!(object.load(1, 30_000), None, "it went");
    }

    #[test]
    fn only_files_are_read_and_written_as_pages() {
        let folder = tempfile::tempdir().expect("a folder");
        let object = Cache::new(folder.path(), 1 << 30).expect("a folder").object(Path::new("a"), b"", "", 1 << 20);
        object.store(1, &[7; 1000]);
        object.store(2, &[8; 1000]);
        let [one, two, moved] = [object.path(1), object.path(2), folder.path().join("moved")];
        fs::rename(&one, &moved).expect("writable");
        std::os::unix::fs::symlink(&moved, &one).expect("a link");
        fs::remove_file(&two).expect("writable");
        assert!(std::process::Command::new("mkfifo").arg(&two).status().expect("mkfifo").success());
        assert_eq!((object.load(1, 1000), object.load(2, 1000)), (None, None));
        object.store(2, &[8; 1000]);
        object.store(1, &[9; 1000]);
        assert_eq!((object.load(1, 1000), object.load(2, 1000)), (Some(vec![9; 1000]), Some(vec![8; 1000])));
        assert_eq!(fs::read(&moved).expect("a file")[0], 7, "the link went, and not what it led to");
        fs::rename(&object.folder, moved.with_extension("d")).expect("writable");
        std::os::unix::fs::symlink(moved.with_extension("d"), &object.folder).expect("a link");
        object.remove(1);
        object.store(3, &[9; 1000]);
        assert_eq!(entries(&moved.with_extension("d")).count(), 2, "nothing behind a link changes");
    }

    #[test]
    fn a_folder_that_cannot_be_written_is_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        fs::write(&file, "").expect("writable");
        assert!(Cache::new(&file, 1).is_err());
    }
}
