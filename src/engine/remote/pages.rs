//! Pages: aligned pieces of an object, the unit in which it is read and kept.

use std::ops::Range;

/// Bytes of a page. At 10 MB a second they take 3 ms, much less than most servers take to answer.
pub(super) const PAGE: u64 = 32 << 10;

/// Largest gap, in pages, that is read along with the pages around it: 64 KiB cost less than one more request.
const GAP: u64 = 2;

/// Largest number of pages per request. Longer runs are split, so that their pieces are requested in parallel.
const LONGEST: u64 = 128;

/// The numbers of the pages that hold a range.
pub(super) fn numbers(range: &Range<u64>) -> Range<u64> {
    range.start / PAGE..range.end.div_ceil(PAGE).max(range.start / PAGE)
}

/// The bytes of a page of an object of `len` bytes.
pub(super) fn place(number: u64, len: u64) -> Range<u64> {
    number * PAGE..((number + 1) * PAGE).min(len)
}

/// Ranges that bring all these pages, whose numbers ascend, with few requests: small gaps are read as well.
pub(super) fn runs(pages: &[u64], len: u64) -> Vec<Range<u64>> {
    let mut runs: Vec<Range<u64>> = Vec::new();
    for page in pages {
        match runs.last_mut() {
            Some(run) if *page <= run.end + GAP && *page < run.start + LONGEST => run.end = page + 1,
            _ => runs.push(*page..page + 1),
        }
    }
    runs.into_iter().map(|run| run.start * PAGE..(run.end * PAGE).min(len)).collect()
}

/// The pages of a range that [`runs`] gave, with their bytes.
pub(super) fn cut<'a>(run: &Range<u64>, bytes: &'a [u8]) -> impl Iterator<Item = (u64, &'a [u8])> + use<'a> {
    numbers(run).zip(bytes.chunks(PAGE as usize))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_has_the_pages_that_it_touches() {
        assert_eq!(numbers(&(0..1)), 0..1);
        assert_eq!(numbers(&(PAGE - 1..PAGE + 1)), 0..2);
        assert_eq!(numbers(&(PAGE..2 * PAGE)), 1..2);
        assert!(numbers(&(PAGE + 5..PAGE + 5)).count() <= 1);
        assert_eq!(place(2, 2 * PAGE + 7), 2 * PAGE..2 * PAGE + 7);
    }

    #[test]
    fn near_pages_come_together_and_long_runs_are_cut() {
        let of = |pages: Range<u64>| pages.start * PAGE..pages.end * PAGE;
        assert_eq!(runs(&[0, 1, 4, 8], u64::MAX), [of(0..5), of(8..9)]);
        assert_eq!(runs(&(0..150).collect::<Vec<_>>(), u64::MAX), [of(0..128), of(128..150)]);
        assert_eq!(runs(&[1], PAGE + 3), vec![PAGE..PAGE + 3; 1]);
        assert!(runs(&[], 9).is_empty());
    }

    #[test]
    fn the_last_page_may_be_short() {
        let bytes = vec![7; PAGE as usize + 3];
        let found: Vec<_> = cut(&(PAGE..2 * PAGE + 3), &bytes).map(|(page, bytes)| (page, bytes.len())).collect();
        assert_eq!(found, [(1, PAGE as usize), (2, 3)]);
    }
}
