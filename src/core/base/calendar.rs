//! The calendars of the CF conventions: days counted from one fixed day, and the dates of these days.
//!
//! Years are counted astronomically: the year before 1 is 0.

/// A calendar of the CF conventions.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Calendar {
    /// Julian to 1582-10-04, and Gregorian from 1582-10-15, the next day, on: `standard`, `gregorian`.
    Standard,
    /// Gregorian at all times.
    ProlepticGregorian,
    /// Julian at all times.
    Julian,
    /// 365 days in every year: `noleap`, `365_day`.
    NoLeap,
    /// 366 days in every year: `all_leap`, `366_day`.
    AllLeap,
    /// 12 months of 30 days.
    Days360,
}

/// A day of a calendar.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Date {
    pub(super) year: i64,
    /// From 1.
    pub(super) month: i64,
    /// From 1.
    pub(super) day: i64,
}

/// The first day of the Gregorian calendar, and the last one before it.
const GREGORIAN: Date = Date { year: 1582, month: 10, day: 15 };
const LAST_JULIAN: Date = Date { year: 1582, month: 10, day: 4 };

/// From the day that the Julian calendar calls 0001-01-01 to the one that the Gregorian calendar calls so.
const JULIAN_FIRST: i64 = -2;

const MONTHS: [i64; 12] = [31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31];

impl Calendar {
    /// The calendar of a name; the usual one without a name.
    pub(super) fn named(name: Option<&str>) -> Option<Self> {
        Some(match name.map(str::trim).unwrap_or_default().to_lowercase().as_str() {
            "" | "standard" | "gregorian" => Self::Standard,
            "proleptic_gregorian" => Self::ProlepticGregorian,
            "julian" => Self::Julian,
            "noleap" | "365_day" => Self::NoLeap,
            "all_leap" | "366_day" => Self::AllLeap,
            "360_day" => Self::Days360,
            _ => return None,
        })
    }

    /// Days from 0001-01-01 to a date (for the standard calendar: from the Gregorian 0001-01-01). `None` if the date
    /// does not exist.
    pub(super) fn day(self, date: Date) -> Option<i64> {
        let Date { year, month, day } = date;
        if self == Self::Standard {
            let is_lost = LAST_JULIAN < date && date < GREGORIAN;
            return if is_lost { None } else { self.in_force(date >= GREGORIAN).day(date) };
        }
        let is_date = (1..=12).contains(&month) && (1..=self.month(year, month)).contains(&day);
        let before: i64 = (1..month).map(|month| self.month(year, month)).sum();
        is_date.then(|| self.first() + self.year(year) + before + day - 1)
    }

    /// The date of a day.
    pub(super) fn date(self, day: i64) -> Date {
        if self == Self::Standard {
            let gregorian = Self::ProlepticGregorian;
            return self.in_force(Some(day) >= gregorian.day(GREGORIAN)).date(day);
        }
        let (mut left, (years, days)) = (day - self.first(), self.cycle());
        let mut year = 1 + (i128::from(left) * i128::from(years)).div_euclid(days.into()) as i64;
        while self.year(year) > left {
            year -= 1;
        }
        while self.year(year + 1) <= left {
            year += 1;
        }
        left -= self.year(year);
        let mut month = 1;
        while left >= self.month(year, month) {
            left -= self.month(year, month);
            month += 1;
        }
        Date { year, month, day: left + 1 }
    }

    /// The calendar that the standard one is then.
    fn in_force(self, is_gregorian: bool) -> Self {
        if is_gregorian { Self::ProlepticGregorian } else { Self::Julian }
    }

    /// The day of 0001-01-01.
    fn first(self) -> i64 {
        if self == Self::Julian { JULIAN_FIRST } else { 0 }
    }

    /// Days of a month.
    fn month(self, year: i64, month: i64) -> i64 {
        match self {
            Self::Days360 => 30,
            _ => MONTHS[(month - 1) as usize] + i64::from(month == 2 && self.is_leap(year)),
        }
    }

    /// Whether a year has a 29th of February.
    fn is_leap(self, year: i64) -> bool {
        let is_multiple = |n: i64| year.rem_euclid(n) == 0;
        match self {
            Self::NoLeap | Self::Days360 => false,
            Self::AllLeap => true,
            Self::Julian => is_multiple(4),
            Self::Standard | Self::ProlepticGregorian => is_multiple(4) && (!is_multiple(100) || is_multiple(400)),
        }
    }

    /// Days from year 1 to the first one of a year.
    fn year(self, year: i64) -> i64 {
        let before = year - 1;
        let every = |n: i64| before.div_euclid(n);
        match self {
            Self::NoLeap => 365 * before,
            Self::AllLeap => 366 * before,
            Self::Days360 => 360 * before,
            Self::Julian => 365 * before + every(4),
            Self::Standard | Self::ProlepticGregorian => 365 * before + every(4) - every(100) + every(400),
        }
    }

    /// Years after which leap years come again, and their days.
    fn cycle(self) -> (i64, i64) {
        match self {
            Self::NoLeap => (1, 365),
            Self::AllLeap => (1, 366),
            Self::Days360 => (1, 360),
            Self::Julian => (4, 1461),
            Self::Standard | Self::ProlepticGregorian => (400, 146_097),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [&str; 6] = ["standard", "proleptic_gregorian", "julian", "noleap", "all_leap", "360_day"];

    fn calendar(name: &str) -> Calendar {
        Calendar::named(Some(name)).expect("a known name")
    }

    /// The next date, by the rules as schools teach them.
    fn next(name: &str, Date { year, month, day }: Date) -> Date {
        let is_julian = name == "julian" || name == "standard" && year < 1583;
        let is_leap = match name {
            "noleap" => false,
            "all_leap" => true,
            _ if is_julian => year % 4 == 0,
            _ => year % 4 == 0 && year % 100 != 0 || year % 400 == 0,
        };
        let last = match month {
            _ if name == "360_day" => 30,
            2 if is_leap => 29,
            2 => 28,
            4 | 6 | 9 | 11 => 30,
            _ => 31,
        };
        match (year, month, day) {
            (1582, 10, 4) if name == "standard" => GREGORIAN,
            (_, 12, _) if day == last => Date { year: year + 1, month: 1, day: 1 },
            _ if day == last => Date { year, month: month + 1, day: 1 },
            _ => Date { year, month, day: day + 1 },
        }
    }

    #[test]
    fn days_are_those_that_counting_one_by_one_finds() {
        for name in ALL {
            let calendar = calendar(name);
            for year in [-405, 1195, 1570] {
                let mut date = Date { year, month: 1, day: 1 };
                let first = calendar.day(date).expect("a date");
                for day in first..first + 366 * 440 {
                    assert_eq!((calendar.day(date), calendar.date(day)), (Some(day), date), "{name}");
                    date = next(name, date);
                }
                assert!(date.year > year + 430);
            }
        }
    }

    #[test]
    fn dates_that_are_not_there_have_no_day() {
        let day = |name: &str, (year, month, day)| calendar(name).day(Date { year, month, day });
        for (name, date) in [
            ("standard", (1582, 10, 5)),
            ("standard", (1582, 10, 14)),
            ("standard", (1900, 2, 29)),
            ("julian", (1901, 2, 29)),
            ("noleap", (2000, 2, 29)),
            ("all_leap", (2001, 2, 30)),
            ("360_day", (2000, 1, 31)),
            ("360_day", (2000, 13, 1)),
            ("standard", (2000, 0, 1)),
            ("standard", (2000, 1, 0)),
        ] {
            assert_eq!(day(name, date), None, "{name} {date:?}");
        }
        let there = [("julian", (1900, 2, 29)), ("all_leap", (2001, 2, 29)), ("360_day", (2001, 2, 30))];
        assert!(there.into_iter().all(|(name, date)| day(name, date).is_some()));
        assert!(day("proleptic_gregorian", (1582, 10, 5)).is_some());
    }

    #[test]
    fn calendars_have_several_names_and_days_may_be_far() {
        let same = [(None, "standard"), (Some("Gregorian"), "standard"), (Some(" 365_day "), "noleap")];
        assert!(same.into_iter().all(|(name, other)| Calendar::named(name) == Some(calendar(other))));
        assert_eq!(Calendar::named(Some("366_day")), Some(Calendar::AllLeap));
        assert!(["none", "utc", "lunar"].into_iter().all(|name| Calendar::named(Some(name)).is_none()));
        for name in ALL {
            for day in [i64::MIN >> 8, -1 << 50, 1 << 50, i64::MAX >> 8] {
                assert_eq!(calendar(name).day(calendar(name).date(day)), Some(day), "{name}");
            }
        }
    }
}
