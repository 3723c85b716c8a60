//! A remote storage whose pages are kept in memory once they were read.

use super::cache::CachedObject;
use super::pages::{PAGE, cut, numbers, place, runs};
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::io;
use std::ops::Range;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use wavesplat_format::Storage;

/// Pages that are kept in memory: 64 MiB.
const MOST: usize = 2048;

/// Pages that [`Storage::fetch`] brings at a time, so that they stay until they are used.
const AHEAD: usize = MOST / 2;

/// Counts the pages of ranges that are to be fetched together.
#[derive(Debug, Default)]
pub(crate) struct PageCount {
    pages: usize,
    /// The page that was counted last.
    last: Option<u64>,
}

impl PageCount {
    /// Counts the pages of a range, except the last page of the range before it.
    pub(crate) fn add(&mut self, range: &Range<u64>) {
        let pages = numbers(range);
        self.pages += pages.clone().count() - usize::from(self.last.is_some_and(|last| pages.contains(&last)));
        self.last = pages.last().or(self.last);
    }

    /// Whether there are as many pages as should be fetched together.
    pub(crate) fn is_full(&self) -> bool {
        self.pages >= AHEAD / 2
    }
}

/// Bytes from one place on that are fetched at a time.
pub(crate) const FETCHED: u64 = AHEAD as u64 * PAGE / 2;

/// A storage that is read in pages. The pages read last stay in memory, and on disk if there is a cache. Several
/// threads may read; no page is read by two threads at once.
#[derive(Debug)]
pub(crate) struct Paged<S> {
    storage: S,
    on_disk: Option<CachedObject>,
    pages: Mutex<Pages>,
    /// Signals that a thread has finished reading its pages, or has failed.
    arrived: Condvar,
}

type Page = Arc<[u8]>;

#[derive(Debug, Default)]
struct Pages {
    held: HashMap<u64, Held>,
    /// Pages that a thread is reading.
    in_flight: HashSet<u64>,
    /// Counts uses.
    clock: u64,
}

#[derive(Debug)]
struct Held {
    bytes: Page,
    /// When it was used last.
    used: u64,
}

impl Pages {
    /// A page that is held.
    fn take(&mut self, page: u64) -> Option<Page> {
        self.clock += 1;
        let held = self.held.get_mut(&page)?;
        held.used = self.clock;
        Some(held.bytes.clone())
    }

    /// Keeps a page. If there are too many, drops the least recently used quarter.
    fn keep(&mut self, page: u64, bytes: Page) {
        self.clock += 1;
        self.held.insert(page, Held { bytes, used: self.clock });
        if self.held.len() > MOST {
            let mut used: Vec<u64> = self.held.values().map(|held| held.used).collect();
            let (_, oldest, _) = used.select_nth_unstable(MOST / 4);
            let oldest = *oldest;
            self.held.retain(|_, held| held.used > oldest);
        }
    }
}

/// Pages that this thread is reading. When dropped, it lets other threads read the pages that did not arrive.
struct PageClaim<'a, S> {
    to: &'a Paged<S>,
    pages: Vec<u64>,
}

impl<S> Drop for PageClaim<'_, S> {
    fn drop(&mut self) {
        let mut pages = self.to.lock();
        self.pages.iter().for_each(|page| {
            pages.in_flight.remove(page);
        });
        self.to.arrived.notify_all();
    }
}

impl<S> Paged<S> {
    /// Pages of a storage, and the place on a disk where they are kept, if there is one.
    pub(crate) fn new(storage: S, on_disk: Option<CachedObject>) -> Self {
        Self { storage, on_disk, pages: Mutex::default(), arrived: Condvar::new() }
    }

    fn lock(&self) -> MutexGuard<'_, Pages> {
        self.pages.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<S: Storage> Paged<S> {
    /// Keeps the whole pages among the first bytes of the storage, which were read already.
    #[cfg_attr(not(feature = "remote"), allow(dead_code, reason = "only objects of servers have this"))]
    pub(super) fn begun(self, first: &[u8]) -> Self {
        let pages = cut(&(0..first.len() as u64), first);
        let whole = pages
            .filter(|(page, bytes)| place(*page, self.storage.len()).end == page * PAGE + <[u8]>::len(bytes) as u64);
        whole.for_each(|(page, bytes)| self.lock().keep(page, bytes.into()));
        self
    }

    /// Gets the pages of these numbers, whichever thread reads them.
    fn get(&self, wanted: &BTreeSet<u64>) -> io::Result<BTreeMap<u64, Page>> {
        let mut found = BTreeMap::new();
        while found.len() < wanted.len() {
            let claim = self.claim(wanted, &mut found);
            let missing: Vec<u64> = claim.pages.iter().copied().filter(|page| !self.load(*page, &mut found)).collect();
            self.read(&missing, &mut found)?;
        }
        Ok(found)
    }

    /// Takes the wanted pages that are in memory, and claims those that no thread is reading. If other threads are
    /// reading all of the rest, waits until some arrive.
    fn claim(&self, wanted: &BTreeSet<u64>, found: &mut BTreeMap<u64, Page>) -> PageClaim<'_, S> {
        let mut pages = self.lock();
        loop {
            for page in wanted {
                if !found.contains_key(page)
                    && let Some(bytes) = pages.take(*page)
                {
                    found.insert(*page, bytes);
                }
            }
            let free = |page: &&u64| !found.contains_key(page) && !pages.in_flight.contains(page);
            let mine: Vec<u64> = wanted.iter().filter(free).copied().collect();
            if !mine.is_empty() || found.len() == wanted.len() {
                pages.in_flight.extend(&mine);
                return PageClaim { to: self, pages: mine };
            }
            pages = self.arrived.wait(pages).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Loads a page from the disk cache. Returns false if it is not cached.
    fn load(&self, page: u64, found: &mut BTreeMap<u64, Page>) -> bool {
        let length = place(page, self.storage.len()).count();
        let Some(bytes) = self.on_disk.as_ref().and_then(|disk| disk.load(page, length)) else { return false };
        let bytes: Page = bytes.into();
        self.lock().keep(page, bytes.clone());
        found.insert(page, bytes);
        true
    }

    /// Reads pages, and keeps them.
    fn read(&self, missing: &[u64], found: &mut BTreeMap<u64, Page>) -> io::Result<()> {
        if missing.is_empty() {
            return Ok(());
        }
        let runs = runs(missing, self.storage.len());
        let read = self.storage.read_many(&runs)?;
        check_lengths(&runs, &read)?;
        for (page, bytes) in runs.iter().zip(&read).flat_map(|(run, bytes)| cut(run, bytes)) {
            if let Some(disk) = &self.on_disk {
                disk.store(page, bytes);
            }
            if missing.binary_search(&page).is_ok() {
                let bytes: Page = bytes.into();
                self.lock().keep(page, bytes.clone());
                found.insert(page, bytes);
            }
        }
        Ok(())
    }

    /// An error unless a range lies within the storage.
    fn check(&self, range: &Range<u64>) -> io::Result<()> {
        match range.start <= range.end && range.end <= self.storage.len() {
            true => Ok(()),
            false => {
                let what = format!("bytes {range:?} lie beyond the end at {}", self.storage.len());
                Err(io::Error::new(io::ErrorKind::UnexpectedEof, what))
            }
        }
    }
}

/// An error unless a storage gave all that it was asked for.
fn check_lengths(asked: &[Range<u64>], read: &[Vec<u8>]) -> io::Result<()> {
    let lengths = asked.iter().map(|range| range.end - range.start);
    match lengths.eq(read.iter().map(|bytes| bytes.len() as u64)) {
        true => Ok(()),
        false => Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the storage gave other numbers of bytes")),
    }
}

/// Copies a range from its pages.
fn copy(pages: &BTreeMap<u64, Page>, range: &Range<u64>, out: &mut [u8]) {
    for number in numbers(range) {
        let (start, bytes) = (number * PAGE, &pages[&number]);
        let (from, to) = (range.start.max(start), range.end.min(start + <[u8]>::len(bytes) as u64));
        if from < to {
            out[(from - range.start) as usize..(to - range.start) as usize]
                .copy_from_slice(&bytes[(from - start) as usize..(to - start) as usize]);
        }
    }
}

impl<S: Storage> Storage for Paged<S> {
    fn len(&self) -> u64 {
        self.storage.len()
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let range = offset..offset.saturating_add(out.len() as u64);
        self.check(&range)?;
        let pages = self.get(&numbers(&range).collect())?;
        copy(&pages, &range, out);
        Ok(())
    }

    fn fetch(&self, ranges: &[Range<u64>]) -> io::Result<()> {
        let mut wanted = BTreeSet::new();
        let within = ranges.iter().map(|range| range.start..range.end.min(self.storage.len()));
        for page in within.flat_map(|range| numbers(&range)) {
            if wanted.len() == AHEAD {
                break;
            }
            wanted.insert(page);
        }
        self.get(&wanted).map(drop)
    }

    fn forget(&self, ranges: &[Range<u64>]) -> bool {
        let within = ranges.iter().map(|range| range.start..range.end.min(self.storage.len()));
        let wrong: Vec<u64> = within.flat_map(|range| numbers(&range)).collect();
        // Another thread may be loading the wrong page from the disk: it would be kept after it was dropped here.
        let is_loading = |pages: &mut Pages| wrong.iter().any(|page| pages.in_flight.contains(page));
        let mut pages = self.arrived.wait_while(self.lock(), is_loading).unwrap_or_else(PoisonError::into_inner);
        for page in wrong {
            pages.held.remove(&page);
            self.on_disk.iter().for_each(|disk| disk.remove(page));
        }
        drop(pages);
        self.storage.forget(ranges);
        true
    }

    fn is_remote(&self) -> bool {
        true
    }
}

#[cfg(test)]
mod tests {
    use super::super::cache::Cache;
    use super::*;
    use std::path::Path;
    use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
    use std::thread;
    use std::time::Duration;

    /// Bytes far away: remembers what was asked for, and fails on demand.
    #[derive(Debug, Default)]
    struct Far {
        bytes: Vec<u8>,
        asked: Mutex<Vec<Vec<Range<u64>>>>,
        fails: AtomicBool,
    }

    impl Storage for Far {
        fn len(&self) -> u64 {
            self.bytes.len() as u64
        }

        fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
            self.bytes.read_at(offset, out)
        }

        fn read_many(&self, ranges: &[Range<u64>]) -> io::Result<Vec<Vec<u8>>> {
            if !ranges.is_empty() {
                self.asked.lock().expect("sound").push(ranges.to_vec());
            }
            thread::sleep(Duration::from_millis(2)); // so that others want the same
            if self.fails.load(Relaxed) { Err(io::Error::other("away")) } else { self.bytes.read_many(ranges) }
        }
    }

    fn far(len: usize) -> Paged<Far> {
        let bytes = (0..len).map(|at| (at * at / 7) as u8).collect();
        Paged::new(Far { bytes, ..Far::default() }, None)
    }

    fn asked(paged: &Paged<Far>) -> Vec<Vec<Range<u64>>> {
        std::mem::take(&mut paged.storage.asked.lock().expect("sound"))
    }

    #[test]
    fn bytes_are_those_of_the_storage() {
        let paged = far(5 * PAGE as usize + 77);
        let end = paged.len();
        let ranges = [3..9, PAGE - 2..2 * PAGE + 1, end - 5..end, 7..7, 0..end];
        assert_eq!(paged.read_many(&ranges).expect("within"), paged.storage.bytes.read_many(&ranges).expect("within"));
        for range in &ranges {
            let mut out = vec![0; (range.end - range.start) as usize];
            paged.read_at(range.start, &mut out).expect("within");
            assert_eq!(out, paged.storage.bytes[range.start as usize..range.end as usize]);
        }
        assert!(paged.read_at(end - 1, &mut [0; 2]).is_err());
        assert!(paged.read_at(u64::MAX, &mut [0; 2]).is_err());
        assert!(paged.read_many(&[0..1, end..end + 1]).is_err());
    }

    #[test]
    fn a_page_is_read_once_and_near_ones_together() {
        let paged = far(9 * PAGE as usize);
        paged.fetch(&[0..1, 2 * PAGE..2 * PAGE + 9, 6 * PAGE..7 * PAGE, 8 * PAGE..u64::MAX]).expect("within");
        assert_eq!(asked(&paged), [[0..3 * PAGE, 6 * PAGE..9 * PAGE]]);
        paged.read_at(2 * PAGE, &mut [0; 100]).expect("within");
        paged.read_many(&[0..5, 6 * PAGE..7 * PAGE]).expect("within");
        assert!(asked(&paged).is_empty(), "what was asked for is held");
    }

    #[test]
    fn threads_share_what_is_coming() {
        let paged = far(20 * PAGE as usize);
        thread::scope(|scope| {
            for start in 0..8 {
                let paged = &paged;
                scope.spawn(move || {
                    let range = start * PAGE + 1..(start + 12) * PAGE;
                    let read = paged.read_many(std::slice::from_ref(&range)).expect("within");
                    assert_eq!(read[0], paged.storage.bytes[range.start as usize..range.end as usize]);
                });
            }
        });
        let mut pages: Vec<u64> = asked(&paged).into_iter().flatten().flat_map(|run| numbers(&run)).collect();
        pages.sort_unstable();
        assert!(pages.windows(2).filter(|pair| pair[0] == pair[1]).count() <= 8, "only gaps come twice: {pages:?}");
    }

    #[test]
    fn what_did_not_come_is_asked_for_again() {
        let paged = far(2 * PAGE as usize);
        paged.storage.fails.store(true, Relaxed);
        thread::scope(|scope| {
            (0..4).for_each(|_| {
                scope.spawn(|| paged.read_at(0, &mut [0; 9]).expect_err("the storage fails"));
            });
        });
        paged.storage.fails.store(false, Relaxed);
        paged.read_at(0, &mut [0; 9]).expect("it is back");
    }

    /// Gives these answers, whatever was asked for.
    struct Short(Vec<Vec<u8>>);

    impl Storage for Short {
        fn len(&self) -> u64 {
            3 * PAGE
        }

        fn read_at(&self, _: u64, _: &mut [u8]) -> io::Result<()> {
            Ok(())
        }

        fn read_many(&self, _: &[Range<u64>]) -> io::Result<Vec<Vec<u8>>> {
            Ok(self.0.clone())
        }
    }

    #[test]
    fn too_few_bytes_are_an_error() {
        for answers in [vec![], vec![vec![]], vec![vec![0; 99]], vec![vec![0; PAGE as usize], vec![]]] {
            let paged = Paged::new(Short(answers), None);
            assert_eq!(paged.read_at(0, &mut [0; 9]).expect_err("too few").kind(), io::ErrorKind::UnexpectedEof);
        }
    }

    #[test]
    fn pages_of_neighbours_are_counted_once() {
        let mut count = PageCount::default();
        [0..9, 10..20, PAGE - 1..PAGE + 1, 5 * PAGE..7 * PAGE].iter().for_each(|range| count.add(range));
        assert_eq!(count.pages, 4);
        count.add(&(0..u64::MAX / 2));
        assert!(count.is_full());
    }

    #[test]
    fn wrong_pages_are_read_again_from_the_storage() {
        let folder = tempfile::tempdir().expect("a folder");
        let disk = || Cache::new(folder.path(), 1 << 30).expect("a folder").object(Path::new("a"), b"", "", 5 * PAGE);
        let mut paged = far(5 * PAGE as usize);
        paged.on_disk = Some(disk());
        let right = paged.storage.bytes.clone();
        paged.storage.bytes[3 * PAGE as usize..][..9].fill(0xFF);
        let read =
            |paged: &Paged<Far>| paged.read_many(std::slice::from_ref(&(0..5 * PAGE))).expect("within").remove(0);
        assert!(read(&paged) != right);
        paged.storage.bytes.clone_from(&right);
        assert!(read(&paged) != right, "it is kept");
        asked(&paged);
        assert!(paged.forget(&[3 * PAGE + 1..3 * PAGE + 5, 5 * PAGE - 1..u64::MAX]));
        assert!(read(&paged) == right);
        assert_eq!(asked(&paged).concat(), std::slice::from_ref(&(3 * PAGE..5 * PAGE)), "only what was wrong");
        let later = Paged::new(Far { bytes: vec![0; right.len()], ..Far::default() }, Some(disk()));
        assert!(read(&later) == right, "the disk has the right bytes, too");
    }

    #[test]
    fn wrong_pages_are_read_again_by_all_threads_that_share_them() {
        let folder = tempfile::tempdir().expect("a folder");
        let disk = || Cache::new(folder.path(), 1 << 30).expect("a folder").object(Path::new("a"), b"", "", PAGE);
        for round in 0..100 {
            disk().store(0, &vec![0xFF; PAGE as usize]);
            let paged = Paged { on_disk: Some(disk()), ..far(PAGE as usize) };
            let is_right = || {
                let mut read = vec![0; PAGE as usize];
                paged.read_at(0, &mut read).expect("within");
                read == paged.storage.bytes
            };
            thread::scope(|scope| {
                (0..4).for_each(|_| {
                    scope.spawn(|| {
                        assert!(is_right() || paged.forget(std::slice::from_ref(&(0..PAGE))) && is_right(), "{round}");
                    });
                });
            });
        }
    }

    #[test]
    fn memory_is_bounded() {
        let paged = far((MOST + 200) * PAGE as usize);
        paged.fetch(std::slice::from_ref(&(0..paged.len()))).expect("within");
        assert_eq!(paged.lock().held.len(), AHEAD);
        let mut all = vec![0; paged.storage.bytes.len()];
        paged.read_at(0, &mut all).expect("within");
        assert!(all == paged.storage.bytes && paged.lock().held.len() <= MOST);
    }
}
