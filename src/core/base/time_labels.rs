//! Times as people read them: dates where a calendar is known, else numbers with the digits that tell frames apart.

use super::calendar::Date;
use super::clock::{Clock, DAY, MINUTE, SECOND};
use super::decimal;
use std::fmt::Write;

/// Times are rounded to this part of the least step between neighbours.
const PART: i128 = 1000;
const PART_DIGITS: i32 = 3;

/// Digits of a double that can be trusted.
const DIGITS: i32 = 15;

/// Digits of femtoseconds within a second.
const SECOND_DIGITS: usize = 15;

/// The times of frames, and how they are written.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct TimeLabels {
    times: Vec<f64>,
    unit: String,
    /// Decimals needed to distinguish the times of frames; `None` if all times are the same.
    decimals: Option<usize>,
    dates: Option<Dates>,
}

/// How the dates of a clock are written.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Dates {
    clock: Clock,
    /// Femtoseconds that they are rounded to.
    grain: i128,
    shown: Shown,
}

/// The parts of a date that are written.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Shown {
    Day,
    Minute,
    /// Seconds with so many decimals.
    Second(usize),
}

/// The seconds from one date to another, in the standard calendar; `None` if one of them is no date.
pub fn seconds_since(first: &str, date: &str) -> Option<f64> {
    let clock = |date: &str| Clock::parse(&format!("seconds since {date}"), None).ok();
    let mut times = [0.0];
    clock(date)?.convert(&mut times, clock(first)?).ok()?;
    Some(times[0])
}

impl TimeLabels {
    /// The times of frames in a unit, perhaps since a date of a calendar; no times if frames are numbered.
    pub fn new(times: Vec<f64>, unit: Option<&str>, calendar: Option<&str>) -> Self {
        let unit = unit.map(str::trim).unwrap_or_default().to_string();
        let clock = Clock::parse(&unit, calendar).ok();
        let (decimals, dates) = (decimals(&times), clock.and_then(|clock| Dates::new(clock, &times)));
        Self { times, unit, decimals, dates }
    }

    /// The times themselves.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// The unit of times, perhaps since when; empty if it is unknown.
    pub fn unit(&self) -> &str {
        &self.unit
    }

    /// The date of a frame, such as `2016-02-03 00:00`: with seconds only if some frame has them, and without a time of day
    /// if all are at midnight. None if no date is known.
    pub fn date(&self, frame: usize) -> Option<String> {
        let Dates { clock, grain, shown } = self.dates?;
        let (date, within) = clock.date(rounded(clock.instant(*self.times.get(frame)?)?, grain))?;
        Some(written(date, within, shown))
    }

    /// The date of a frame, or its time with the unit; None if it has none.
    pub fn text(&self, frame: usize) -> Option<String> {
        let number = || Some(format!("{} {}", self.number(frame)?, self.unit).trim_end().to_string());
        self.date(frame).or_else(number)
    }

    /// The time of a frame as a number, with only the digits needed to distinguish it from its neighbours.
    pub fn number(&self, frame: usize) -> Option<String> {
        let time = *self.times.get(frame)?;
        Some(self.decimals.map_or_else(|| decimal::short(time), |decimals| decimal::rounded(time, decimals)))
    }

    /// The dates of all frames; empty if no dates are known.
    pub fn dates(&self) -> Vec<String> {
        (0..self.times.len()).filter_map(|frame| self.date(frame)).collect()
    }

    /// A summary for `info`: the first and the last time, with their dates. None without times.
    pub fn span(&self) -> Option<String> {
        let last = self.times.len().checked_sub(1)?;
        let numbers = format!("{} to {} {}", self.number(0)?, self.number(last)?, self.unit);
        let numbers = numbers.trim_end();
        Some(match self.date(0).zip(self.date(last)) {
            Some((first, last)) => format!("{first} to {last} ({numbers})"),
            None => numbers.into(),
        })
    }
}

impl Dates {
    /// None if not all times have a date.
    fn new(clock: Clock, times: &[f64]) -> Option<Self> {
        let instants = times.iter().map(|time| clock.instant(*time)).collect::<Option<Vec<_>>>()?;
        let step = instants.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0).min();
        let blur = (largest(times) * f64::EPSILON * clock.unit as f64) as i128;
        let mut grain = SECOND;
        while grain > 1 && grain * PART > step.unwrap_or(SECOND) && grain > 2 * blur {
            grain /= 10;
        }
        let all: Vec<i128> = instants.into_iter().map(|instant| rounded(instant, grain)).collect();
        clock.date(*all.iter().min()?).and(clock.date(*all.iter().max()?))?;
        Some(Self { clock, grain, shown: Shown::exact(&all) })
    }
}

impl Shown {
    /// The coarsest format that shows all of these instants exactly.
    fn exact(instants: &[i128]) -> Self {
        let are = |length: i128| instants.iter().all(|instant| instant % length == 0);
        let least = |decimals: &usize| are(SECOND / 10_i128.pow(*decimals as u32));
        match (are(DAY), are(MINUTE)) {
            (true, _) => Self::Day,
            (false, true) => Self::Minute,
            (false, false) => Self::Second((0..SECOND_DIGITS).find(least).unwrap_or(SECOND_DIGITS)),
        }
    }
}

/// Decimals needed to distinguish the closest neighbours, at most as many as an f64 holds; `None` if all times are the
/// same.
fn decimals(times: &[f64]) -> Option<usize> {
    let steps = times.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0);
    let step = steps.min_by(f64::total_cmp).filter(|step| step.is_finite())?;
    let decimals = (PART_DIGITS - exponent(step)).min(DIGITS - 1 - exponent(largest(times)));
    Some(decimals.max(0) as usize)
}

fn largest(times: &[f64]) -> f64 {
    times.iter().fold(0.0, |most: f64, time| most.max(time.abs()))
}

/// The power of ten at or below a positive number.
fn exponent(v: f64) -> i32 {
    format!("{v:e}").split_once('e').and_then(|(_, power)| power.parse().ok()).unwrap_or(0)
}

/// The multiple of `grain` next to an instant.
fn rounded(instant: i128, grain: i128) -> i128 {
    instant.saturating_add(grain / 2).div_euclid(grain).saturating_mul(grain)
}

fn written(Date { year, month, day }: Date, within: i128, shown: Shown) -> String {
    let sign = if year < 0 { "-" } else { "" };
    let mut text = format!("{sign}{:04}-{month:02}-{day:02}", year.unsigned_abs());
    let (minutes, seconds) = (within / MINUTE, within % MINUTE);
    if shown != Shown::Day {
        let _ = write!(text, " {:02}:{:02}", minutes / 60, minutes % 60);
    }
    if let Shown::Second(decimals) = shown {
        let _ = write!(text, ":{:02}", seconds / SECOND);
        if decimals > 0 {
            let _ = write!(text, ".{}", &format!("{:015}", seconds % SECOND)[..decimals]);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Calendar, unit, time, and `cftime.num2date(time, unit, calendar)` of Python's cftime 1.6.6.
    const DATES: [(&str, &str, f64, &str); 39] = [
        ("standard", "days since 1582-10-01", 3.0, "1582-10-04 00:00:00.000000"),
        ("standard", "days since 1582-10-01", 4.0, "1582-10-15 00:00:00.000000"),
        ("standard", "days since 1582-10-01", 10.5, "1582-10-21 12:00:00.000000"),
        ("standard", "hours since 1900-01-01 00:00:0.0", 1051956.0, "2020-01-03 12:00:00.000000"),
        ("standard", "hours since 1900-01-01 00:00:0.0", -1.5, "1899-12-31 22:30:00.000000"),
        ("gregorian", "seconds since 1970-01-01 00:00:00 UTC", 1454500800.0, "2016-02-03 12:00:00.000000"),
        ("gregorian", "seconds since 1970-01-01 00:00:00 UTC", -1.0, "1969-12-31 23:59:59.000000"),
        ("gregorian", "seconds since 1970-01-01 00:00:00 UTC", 951782400.0, "2000-02-29 00:00:00.000000"),
        ("standard", "days since 0001-01-01 00:00:00", 577736.0, "1582-10-04 00:00:00.000000"),
        ("standard", "days since 0001-01-01 00:00:00", 735964.25, "2015-12-31 06:00:00.000000"),
        ("proleptic_gregorian", "days since 0001-01-01 00:00:00", 577736.0, "1582-10-16 00:00:00.000000"),
        ("proleptic_gregorian", "days since 0001-01-01 00:00:00", 735964.25, "2016-01-02 06:00:00.000000"),
        ("proleptic_gregorian", "days since 0000-03-01", 0.0, "0000-03-01 00:00:00.000000"),
        ("proleptic_gregorian", "days since 0000-03-01", -60.0, "0000-01-01 00:00:00.000000"),
        ("proleptic_gregorian", "days since 0000-03-01", 730424.0, "1999-12-31 00:00:00.000000"),
        ("proleptic_gregorian", "days since -4-3-1", 1.0, "-0004-03-02 00:00:00.000000"),
        ("julian", "days since 1900-02-28 12:00", 0.5, "1900-02-29 00:00:00.000000"),
        ("julian", "days since 1900-02-28 12:00", 1.5, "1900-03-01 00:00:00.000000"),
        ("julian", "days since 1900-02-28 12:00", 40000.0, "2009-09-03 12:00:00.000000"),
        ("julian", "minutes since 2000-01-01T06:00:00Z", 44640.0, "2000-02-01 06:00:00.000000"),
        ("noleap", "days since 2000-01-01", 59.0, "2000-03-01 00:00:00.000000"),
        ("noleap", "days since 2000-01-01", 365.0, "2001-01-01 00:00:00.000000"),
        ("noleap", "days since 2000-01-01", -1.0, "1999-12-31 00:00:00.000000"),
        ("noleap", "days since 2000-01-01", 3650.125, "2010-01-01 03:00:00.000000"),
        ("365_day", "hours since 1850-01-01 00:00:00", 1314000.0, "2000-01-01 00:00:00.000000"),
        ("all_leap", "days since 2001-01-01", 59.0, "2001-02-29 00:00:00.000000"),
        ("all_leap", "days since 2001-01-01", 366.0, "2002-01-01 00:00:00.000000"),
        ("all_leap", "days since 2001-01-01", -366.0, "2000-01-01 00:00:00.000000"),
        ("366_day", "seconds since 2001-02-28", 86400.0, "2001-02-29 00:00:00.000000"),
        ("366_day", "seconds since 2001-02-28", 172800.0, "2001-03-01 00:00:00.000000"),
        ("360_day", "days since 1850-01-30", 0.0, "1850-01-30 00:00:00.000000"),
        ("360_day", "days since 1850-01-30", 30.0, "1850-02-30 00:00:00.000000"),
        ("360_day", "days since 1850-01-30", 54000.75, "2000-01-30 18:00:00.000000"),
        ("360_day", "days since 1850-01-30", -31.0, "1849-12-29 00:00:00.000000"),
        ("standard", "hours since 2000-01-01 00:00:00 +02:00", 1.0, "1999-12-31 23:00:00.000000"),
        ("standard", "hours since 2000-1-1 6:00:00.25 -06:00", 1.0, "2000-01-01 13:00:00.250000"),
        ("standard", "hours since 2000-01-01 00:00 -0130", 1.0, "2000-01-01 02:30:00.000000"),
        ("standard", "milliseconds since 2000-01-01 12:30:15.5", 1.0, "2000-01-01 12:30:15.501000"),
        ("standard", "milliseconds since 2000-01-01 12:30:15.5", 86400000.0, "2000-01-02 12:30:15.500000"),
    ];

    fn labels(times: &[f64], unit: &str, calendar: Option<&str>) -> Vec<String> {
        let labels = TimeLabels::new(times.to_vec(), Some(unit), calendar);
        (0..times.len()).filter_map(|frame| labels.text(frame)).collect()
    }

    #[test]
    fn dates_are_those_of_cftime() {
        for (calendar, unit, time, date) in DATES {
            let labels = TimeLabels::new(vec![time], Some(unit), Some(calendar));
            let found = labels.date(0).expect("a date");
            let rest = date.strip_prefix(&found).unwrap_or_else(|| panic!("{found}, {date}: {unit}, {calendar}"));
            assert!(rest.chars().all(|c| " :.0".contains(c)), "{found}, {date}");
        }
    }

    #[test]
    fn dates_have_as_much_of_the_time_of_day_as_some_frame_needs() {
        let days = |times: &[f64]| labels(times, "days since 2016-02-28", None);
        assert_eq!(days(&[0.0, 1.0, 2.0]), ["2016-02-28", "2016-02-29", "2016-03-01"]);
        assert_eq!(days(&[0.0, 0.25, 1.0 / 3.0])[1..], ["2016-02-28 06:00", "2016-02-28 08:00"]);
        assert_eq!(days(&[1.0, 1.0 + 90.0 / 86400.0]), ["2016-02-29 00:00:00", "2016-02-29 00:01:30"]);
        assert_eq!(labels(&[1_454_500_800.0], "seconds since 1970-01-01", None), ["2016-02-03 12:00"]);
        let film: Vec<f64> = (0..4).map(|t| 20_000.0 + f64::from(t) * 0.04 / 86400.0).collect();
        let film = labels(&film, "days since 1970-01-01", Some("standard"));
        assert_eq!(film[1..3], ["2024-10-04 00:00:00.04", "2024-10-04 00:00:00.08"]);
        assert_eq!(labels(&[0.0, 5e-15], "s since 2000-01-01", None)[1], "2000-01-01 00:00:00.000000000000005");
    }

    #[test]
    fn digits_that_come_from_rounding_are_not_written() {
        let hourly: Vec<f64> = (0..2000).map(|hour| 735_000.0 + f64::from(hour) / 24.0).collect();
        for (hour, label) in labels(&hourly, "days since 0001-01-01", Some("noleap")).into_iter().enumerate() {
            assert!(label.ends_with(&format!(" {:02}:00", hour % 24)), "{label}");
        }
        let single: Vec<f64> = (0..300).map(|t| f64::from(t as f32 * 0.01)).collect();
        assert_eq!(labels(&single, "s", None)[254], "2.54 s");
        assert_eq!(labels(&[5.07999992371, 5.1], "", None), ["5.08", "5.1"]);
        assert_eq!(labels(&[5.079_999_999_999_9], "ms", None), ["5.08 ms"]);
        assert_eq!(labels(&[1e9, 1e9 + 0.25], "s", None), ["1000000000 s", "1000000000.25 s"]);
        assert_eq!(labels(&[0.0, 2e-9, 3e-9], "s", None), ["0 s", "2e-9 s", "3e-9 s"]);
        assert_eq!(labels(&[3.0, 3.0], "days", None), ["3 days", "3 days"]);
    }

    #[test]
    fn times_without_a_known_calendar_are_numbers() {
        let number = |unit, calendar| labels(&[0.5], unit, calendar);
        assert_eq!(number("months since 2000-01-01", None), ["0.5 months since 2000-01-01"]);
        assert_eq!(number("days since 2000-01-01", Some("lunar")), ["0.5 days since 2000-01-01"]);
        assert_eq!(number("days since 2000-02-30", Some("360_day")), ["2000-02-30 12:00"]);
        let far = labels(&[1e300, -1e300, f64::MAX], "days since 2000-01-01", None);
        assert_eq!(far[0], "1e300 days since 2000-01-01");
        assert_eq!(labels(&[1e25, -1e25], "weeks since 2000-01-01", None).len(), 2);
        assert!(labels(&[f64::NAN, f64::INFINITY], "s", None).len() == 2 && labels(&[], "s", None).is_empty());
    }

    #[test]
    fn a_span_has_dates_and_numbers() {
        let span = |times: &[f64], unit| TimeLabels::new(times.to_vec(), unit, None).span();
        let days = "days since 2000-01-01";
        assert_eq!(
            span(&[0.5, 2.5], Some(days)).as_deref(),
            Some("2000-01-01 12:00 to 2000-01-03 12:00 (0.5 to 2.5 days since 2000-01-01)")
        );
        assert_eq!(span(&[0.1 + 0.2, 2.5], None).as_deref(), Some("0.3 to 2.5"));
        assert_eq!(span(&[], None), None);
    }
}
