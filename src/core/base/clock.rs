//! What times count: a unit alone, or a unit since a date of a calendar, such as `days since 2000-01-01`.
//!
//! Times are converted to whole femtoseconds, finer than an f64 resolves for any date, and back with one division.

use super::calendar::{Calendar, Date};

/// Units by the names that UDUNITS gives them, in femtoseconds. Months and years are left out: their lengths differ.
const UNITS: [(&[&str], i128); 8] = [
    (&["nanosecond", "nanoseconds", "nsec", "nsecs", "ns"], SECOND / 1_000_000_000),
    (&["microsecond", "microseconds", "microsec", "microsecs", "us"], SECOND / 1_000_000),
    (&["millisecond", "milliseconds", "millisec", "millisecs", "msec", "msecs", "ms"], SECOND / 1000),
    (&["second", "seconds", "sec", "secs", "s"], SECOND),
    (&["minute", "minutes", "min", "mins"], MINUTE),
    (&["hour", "hours", "hr", "hrs", "h"], 60 * MINUTE),
    (&["day", "days", "d"], DAY),
    (&["week", "weeks"], 7 * DAY),
];

/// Femtoseconds.
pub(super) const SECOND: i128 = 1_000_000_000_000_000;
pub(super) const MINUTE: i128 = 60 * SECOND;
pub(super) const DAY: i128 = 24 * 60 * MINUTE;

/// Years of a reference date: more are a date without dashes.
const MOST_YEARS: i64 = 99_999;

/// What times count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Clock {
    /// Femtoseconds of its unit.
    pub(super) unit: i128,
    /// Where it starts.
    start: Option<(Calendar, i128)>,
}

impl Clock {
    /// Parses a unit such as `hours since 2000-01-01 06:00`, or `s`. Without a calendar, the dates are those of the
    /// standard calendar.
    ///
    /// # Errors A message that names the unit or the calendar that is not understood.
    pub(crate) fn parse(unit: &str, calendar: Option<&str>) -> Result<Self, String> {
        let unknown = || format!("the unit {unit:?} is not understood");
        let (name, since) = match unit.split_whitespace().collect::<Vec<_>>()[..] {
            [name] => (name, None),
            [name, since, ref date @ ..] if since.eq_ignore_ascii_case("since") => (name, Some(date.join(" "))),
            _ => return Err(unknown()),
        };
        let lower = name.to_lowercase();
        let (_, length) = UNITS.iter().find(|(names, _)| names.contains(&lower.as_str())).ok_or_else(unknown)?;
        let start = match since {
            Some(date) => {
                let name = calendar.unwrap_or_default();
                let calendar = Calendar::named(calendar).ok_or(format!("the calendar {name:?} is not known"))?;
                Some((calendar, instant(calendar, &date).ok_or_else(unknown)?))
            }
            None => None,
        };
        Ok(Self { unit: *length, start })
    }

    /// Times of this clock on another.
    ///
    /// # Errors
    /// Why they have no times there.
    pub(crate) fn convert(self, times: &mut [f64], to: Self) -> Result<(), String> {
        let apart = match (self.start, to.start) {
            (Some((calendar, own)), Some((other, theirs))) if calendar == other => own - theirs,
            (None, None) => 0,
            (Some(_), Some(_)) => return Err("the calendars differ".into()),
            _ => return Err("only one of them counts from a date".into()),
        };
        for time in times.iter_mut().filter(|time| time.is_finite()) {
            let since = product(*time, self.unit).and_then(|since| since.checked_add(apart));
            *time = quotient(since.ok_or_else(|| format!("the time {time} is too far"))?, to.unit);
        }
        Ok(())
    }

    /// Femtoseconds from the first day of its calendar to a time; None without a calendar, or if that is too far.
    pub(super) fn instant(self, time: f64) -> Option<i128> {
        product(time, self.unit)?.checked_add(self.start?.1)
    }

    /// The date of an instant, and the femtoseconds from its midnight on.
    pub(super) fn date(self, instant: i128) -> Option<(Date, i128)> {
        let day = i64::try_from(instant.div_euclid(DAY)).ok()?;
        Some((self.start?.0.date(day), instant.rem_euclid(DAY)))
    }
}

/// The product of a number and a unit, rounded to a whole number.
fn product(number: f64, unit: i128) -> Option<i128> {
    const FRACTION: u32 = f64::MANTISSA_DIGITS - 1;
    const MOST_BITS: i32 = 123; // of a product of a fraction and a unit
    let bits = number.abs().to_bits();
    let (stored, fraction) = ((bits >> FRACTION) as i32, bits & ((1 << FRACTION) - 1));
    let whole = fraction | u64::from(stored > 0) << FRACTION;
    let exponent = stored.max(1) - (f64::MAX_EXP - 1) - FRACTION as i32;
    let exact = i128::from(whole) * unit;
    let rounded = match exponent {
        0.. => exact.checked_mul(1_i128.checked_shl(exponent as u32).filter(|power| *power > 0)?)?,
        _ if -exponent > MOST_BITS => 0,
        _ => (exact + (1 << (-exponent - 1))) >> -exponent,
    };
    Some(if number < 0.0 { -rounded } else { rounded })
}

/// Femtoseconds in a unit.
fn quotient(femtoseconds: i128, unit: i128) -> f64 {
    (femtoseconds / unit) as f64 + (femtoseconds % unit) as f64 / unit as f64
}

/// The instant of a reference date: `DATE`, `DATE TIME`, `DATE TIME ZONE` or `DATETTIMEZ`.
fn instant(calendar: Calendar, text: &str) -> Option<i128> {
    let (date, rest) = text.split_once([' ', 'T', 't']).unwrap_or((text, ""));
    let date = self::date(date)?;
    // The calendars that people lived by have no year 0, and programs differ in how they count those before it.
    if matches!(calendar, Calendar::Standard | Calendar::Julian) && date.year < 1 {
        return None;
    }
    let rest = rest.trim();
    let zone = rest.find(|c: char| !(c.is_ascii_digit() || ":.".contains(c))).unwrap_or(rest.len());
    let (time, zone) = (time(&rest[..zone])?, minutes_east(rest[zone..].trim())?);
    Some(i128::from(calendar.day(date)?) * DAY + time - i128::from(zone) * MINUTE)
}

fn date(text: &str) -> Option<Date> {
    let (sign, digits) = text.strip_prefix('-').map_or((1, text.strip_prefix('+').unwrap_or(text)), |rest| (-1, rest));
    let [year, month, day] = digits.split('-').map(whole).collect::<Option<Vec<_>>>()?.try_into().ok()?;
    Some(Date { year: sign * year, month, day }).filter(|_| year <= MOST_YEARS)
}

/// Femtoseconds from midnight on, of `h`, `h:m`, `h:m:s` or nothing.
fn time(text: &str) -> Option<i128> {
    let mut parts = text.split(':').filter(|_| !text.is_empty());
    let mut within = |end: i64| parts.next().map_or(Some(0), whole).filter(|n| *n < end).map(i128::from);
    let minutes = within(24)? * 60 + within(60)?;
    let seconds = parts.next().map_or(Some(0), seconds)?;
    parts.next().is_none().then_some(minutes * MINUTE + seconds)
}

fn seconds(text: &str) -> Option<i128> {
    let (seconds, fraction) = text.split_once('.').unwrap_or((text, ""));
    let is_fraction = fraction.bytes().all(|c| c.is_ascii_digit());
    let fraction: String = fraction.chars().chain("000000000000000".chars()).take(15).collect();
    let seconds = whole(seconds).filter(|n| *n < 60 && is_fraction)?;
    Some(i128::from(seconds) * SECOND + fraction.parse::<i128>().ok()?)
}

/// Minutes that a time zone is east of Greenwich: `+h`, `-h:m`, `+hhmm`, `Z` or nothing.
fn minutes_east(zone: &str) -> Option<i64> {
    if ["", "Z", "z", "UTC", "utc", "GMT", "gmt"].contains(&zone) {
        return Some(0);
    }
    let sign = if zone.starts_with('-') { -1 } else { 1 };
    let digits = zone.strip_prefix(['+', '-'])?;
    let (hours, minutes) = match digits.split_once(':') {
        Some(parts) => parts,
        None if digits.len() == 4 && digits.is_ascii() => digits.split_at(2),
        None => (digits, "0"),
    };
    let (hours, minutes) = (whole(hours).filter(|n| *n < 24)?, whole(minutes).filter(|n| *n < 60)?);
    Some(sign * (60 * hours + minutes))
}

/// A number of digits alone.
fn whole(text: &str) -> Option<i64> {
    text.parse().ok().filter(|_| text.bytes().all(|c| c.is_ascii_digit()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Calendar, unit, time, another unit, and the time there: `cftime.date2num` of `cftime.num2date`, which rounds to
    /// microseconds.
    const CONVERTED: [(&str, &str, f64, &str, f64); 17] = [
        ("standard", "days since 2001-01-01", 0.0, "days since 2000-01-01", 366.0),
        ("standard", "days since 2001-01-01", 0.1, "days since 2000-01-01", 366.1),
        ("standard", "days since 2001-01-01", 0.041666666666666664, "days since 2000-01-01", 366.0416666666667),
        ("noleap", "days since 2005-01-01", 0.0, "days since 2000-01-01", 1825.0),
        ("noleap", "days since 2005-01-01", 364.125, "days since 2000-01-01", 2189.125),
        ("all_leap", "days since 2005-01-01", 0.5, "minutes since 2000-01-01", 2635920.0),
        ("360_day", "hours since 1900-01-01", 1.0, "days since 1850-01-01", 18000.041666666668),
        ("360_day", "hours since 1900-01-01", 720.0, "days since 1850-01-01", 18030.0),
        ("360_day", "hours since 1900-01-01", 0.1, "days since 1850-01-01", 18000.004166666666),
        ("standard", "hours since 2016-02-03 06:00", 0.0, "seconds since 1970-01-01", 1454479200.0),
        ("standard", "hours since 2016-02-03 06:00", 0.1, "seconds since 1970-01-01", 1454479560.0),
        ("standard", "hours since 2016-02-03 06:00", 7.3, "seconds since 1970-01-01", 1454505480.0),
        ("julian", "days since 1600-01-01", 0.0, "hours since 1500-01-01", 876600.0),
        ("julian", "days since 1600-01-01", 1000.5, "hours since 1500-01-01", 900612.0),
        ("standard", "days since 1600-01-01", 0.0, "days since 1500-01-01", 36515.0),
        ("standard", "days since 1600-01-01", 1000.5, "days since 1500-01-01", 37515.5),
        ("proleptic_gregorian", "days since 1600-01-01", 0.0, "days since 1500-01-01", 36524.0),
    ];

    fn clock(unit: &str, calendar: &str) -> Clock {
        Clock::parse(unit, Some(calendar)).expect("a unit")
    }

    #[test]
    fn times_on_another_clock_are_those_of_cftime() {
        for (calendar, unit, time, other, expected) in CONVERTED {
            let (from, to, mut found) = (clock(unit, calendar), clock(other, calendar), [time]);
            from.convert(&mut found, to).expect("the same calendar");
            let microsecond = SECOND as f64 / 1e6 / to.unit as f64;
            let off = (found[0] - expected).abs();
            assert!(
                off <= microsecond && (time.fract() != 0.0 || off == 0.0),
                "{unit}, {other}: {found:?}, {expected}"
            );
        }
    }

    #[test]
    fn whole_units_between_clocks_are_added_without_any_rounding_but_the_last() {
        let (from, to) = (clock("days since 2001-01-01", "standard"), clock("days since 2000-01-01", "standard"));
        for part in 0..100_000 {
            let time = f64::from(part) / 7.0;
            let mut found = [time];
            from.convert(&mut found, to).expect("the same calendar");
            assert_eq!(found, [time + 366.0]);
        }
        let (from, to) = (clock("ms", ""), clock("s", ""));
        let mut found = [250.0, 1e9, f64::NAN, f64::INFINITY, -0.5];
        from.convert(&mut found, to).expect("units alone");
        assert!(found[..2] == [0.25, 1e6] && found[2].is_nan() && found[3].is_infinite() && found[4] == -0.0005);
    }

    #[test]
    fn products_are_those_of_rationals() {
        for (number, unit, expected) in [
            (0.5, 3, Some(2)),
            (-0.5, 3, Some(-2)),
            (0.25, 3, Some(1)),
            (1e-300, DAY, Some(0)),
            (f64::MIN_POSITIVE / 4.0, 7 * DAY, Some(0)),
            (3.0, DAY, Some(3 * DAY)),
            (1e18, DAY, Some(1_000_000_000_000_000_000 * DAY)),
            (1e22, DAY, None),
            (f64::MAX, 1, None),
            (f64::INFINITY, 1, None),
            (f64::NAN, 1, None),
        ] {
            assert_eq!(product(number, unit), expected, "{number}");
        }
        assert_eq!(product(0.1, 1 << 60), Some(((1_i128 << 60) * 0x0019_9999_9999_999a + (1 << 55)) >> 56));
    }

    #[test]
    fn zones_may_have_one_digit_as_in_the_cf_conventions() {
        // cftime leaves such a zone out.
        let of = |date: &str| clock(&format!("seconds since {date}"), "");
        assert_eq!(of("1992-10-8 15:15:42.5 -6:00"), of("1992-10-08 21:15:42.5"));
        assert_eq!(of("1992-10-8 15:15 +0530"), of("1992-10-08 9:45"));
    }

    #[test]
    fn what_is_no_unit_is_refused() {
        for unit in [
            "",
            "months since 2000-01-01",
            "years since 2000-01-01",
            "days",
            "days since",
            "days since 2000",
            "since 2000-01-01",
            "days since 20000101",
            "days since 2000-13-01",
            "days since 2000-02-30",
            "days since 0000-01-01",
            "K",
            "days since 2000-01-01 24:00",
            "days since 2000-01-01 12:60",
            "days since 2000-01-01 1:2:60",
            "day as %Y%m%d",
            "days since 2000-01-01 1:2:3:4",
            "days since 2000-01-01 1:2:3.x",
            "days since 2000-01-01 CET",
            "days since now",
            "days since 2000-01-01 +25:00",
            "days since 2000-01-01 +1:99",
            "days since 1582-10-10",
            "days since 99999999999999999999-1-1",
            "days since 2000-01-01 +\u{e9}\u{e9}",
            "days since 2000--1-01",
            "days since 2000-1-1-1",
            "days since +-2000-1-1",
        ] {
            let is_known = Clock::parse(unit, None).is_ok();
            assert_eq!(is_known, unit == "days", "{unit}");
        }
        let days = "days since 2000-01-01";
        assert_eq!(Clock::parse(days, Some("lunar")), Err("the calendar \"lunar\" is not known".into()));
        let refused = |from: Clock, to: Clock| from.convert(&mut [1.0], to).expect_err("no times there");
        assert_eq!(refused(clock(days, "noleap"), clock(days, "360_day")), "the calendars differ");
        assert_eq!(refused(clock(days, ""), clock("days", "")), "only one of them counts from a date");
        assert!(clock(days, "").convert(&mut [1e300], clock("s since 2000-01-01", "")).is_err());
        assert_eq!(clock("Hours Since 2000-01-01t06Z", ""), clock("hr since 2000-1-1 6:0:0.000 GMT", "gregorian"));
    }
}
