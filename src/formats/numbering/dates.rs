//! Dates in names: several numbers that are one time.

use super::names::{Name, Reading};

/// The numbers of a date and a time of day, each in the one before: the first of them, and the one after the last.
pub(super) fn of(reading: &Reading) -> Option<std::ops::Range<usize>> {
    let count = reading.names.first()?.numbers.len();
    (0..count).find_map(|first| {
        let end = (first + 1..count).find(|at| !is_joined(reading, *at)).unwrap_or(count);
        is_date(reading, first, end).then_some(first..end)
    })
}

/// Whether a number follows the one before as a part of a time does.
fn is_joined(reading: &Reading, at: usize) -> bool {
    let words = reading.names[0].words().nth(at).unwrap_or_default();
    let short: [&[u8]; 15] =
        [b"-", b"_", b".", b":", b"/", b"T", b"t", b" ", b"h", b"m", b"min", b"_T", b"-T", b"H", b"M"];
    short.contains(&words)
}

/// Whether numbers are a year with a month or a day, a date in one number with a time, or hours and minutes with colons.
fn is_date(reading: &Reading, first: usize, end: usize) -> bool {
    let all = |is: &dyn Fn(&Name) -> bool| reading.names.iter().all(is);
    let value = |name: &Name, at: usize| name.numbers[at].integer();
    let width = |at: usize, digits: usize| all(&|name| name.numbers[at].width == digits);
    let within = |at: usize, range: std::ops::RangeInclusive<i128>| all(&|name| range.contains(&value(name, at)));
    if end < first + 2 {
        return false;
    }
    let words = reading.names[0].words().nth(first + 1).unwrap_or_default();
    let is_year = width(first, 4) && (words != b"_" || within(first, 1700..=2300));
    let is_month = width(first + 1, 2) && within(first + 1, 1..=12);
    let is_day_of_year = width(first + 1, 3) && within(first + 1, 1..=366) && within(first, 1700..=2300);
    let is_day = width(first, 8)
        && all(&|name| {
            let (year, month, day) =
                (value(name, first) / 10_000, value(name, first) / 100 % 100, value(name, first) % 100);
            (1700..=2300).contains(&year) && (1..=12).contains(&month) && (1..=31).contains(&day)
        });
    let is_clock = matches!(words, b":" | b"h" | b"H") && within(first + 1, 0..=59);
    is_year && (is_month || is_day_of_year) || is_day || is_clock
}
