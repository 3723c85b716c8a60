//! Interprets the answers of servers.

use std::io;
use std::ops::Range;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use ureq::http::HeaderMap;
use ureq::http::header::{CONTENT_ENCODING, CONTENT_RANGE, ETAG, LAST_MODIFIED, RETRY_AFTER};
use wavesplat_core::base::error::ChangedSince;

/// The facts about an object in an answer.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct About {
    /// Length in bytes.
    pub(super) len: u64,
    pub(super) etag: Option<String>,
    modified: Option<String>,
}

/// Why a request failed.
#[derive(Debug)]
pub(super) enum Failure {
    /// It would fail again.
    Final(io::Error),
    /// The server refuses, and may say why.
    Refused(io::Error),
    /// It may succeed later, perhaps after the time that the server names.
    Temporary(io::Error, Option<Duration>),
}

impl Failure {
    pub(super) fn last(what: impl Into<String>) -> Self {
        Self::Final(io::Error::other(what.into()))
    }
}

impl About {
    /// Identifies this version of the object: the ETag, else the time of modification; `None` if the server sends
    /// neither.
    pub(super) fn version(&self) -> Option<&str> {
        self.etag.as_deref().or(self.modified.as_deref())
    }

    /// The ETag, if it is a strong one, which identifies the exact bytes.
    pub(super) fn strong_etag(&self) -> Option<&str> {
        self.etag.as_deref().filter(|etag| !etag.starts_with("W/"))
    }

    /// An error if this is another object than one that was `known`.
    fn check_same(&self, known: &Self) -> Result<(), Failure> {
        let differ = |a: &Option<String>, b: &Option<String>| {
            a.as_ref().zip(b.as_ref()).is_some_and(|(a, b)| plain(a) != plain(b))
        };
        if self.len != known.len {
            return Err(changed(&format!("{} bytes, now {}", known.len, self.len)));
        }
        let modified = self.etag.is_none() && differ(&self.modified, &known.modified);
        match differ(&self.etag, &known.etag) || modified {
            true => Err(changed("the server has another version")),
            false => Ok(()),
        }
    }
}

/// An ETag without the mark of a weak one.
fn plain(etag: &str) -> &str {
    etag.strip_prefix("W/").unwrap_or(etag)
}

fn changed(how: &str) -> Failure {
    let what = format!("changed while it was being read: {how}");
    Failure::Final(io::Error::other(ChangedSince(what)))
}

/// Reads the head of the answer to a range request, and checks that it announces the requested bytes. `known` is the
/// result of earlier answers; it is `None` for the first request, whose range may reach beyond the end.
///
/// # Errors
/// Every other answer.
pub(super) fn check(
    status: u16,
    headers: &HeaderMap,
    asked: &Range<u64>,
    known: Option<&About>,
) -> Result<About, Failure> {
    match status {
        206 => {}
        404 | 410 | 412 | 416 if known.is_some() => {
            return Err(changed(if status < 412 {
                "the server no longer has it"
            } else {
                "the server has another version"
            }));
        }
        _ => return Err(refusal(status, headers)),
    }
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok()).map(|text: &str| text.trim().to_string());
    if text(CONTENT_ENCODING).is_some_and(|how| how != "identity") {
        return Err(Failure::last("the server packs what it sends, though nobody asked for it"));
    }
    let range = text(CONTENT_RANGE).unwrap_or_default();
    let (sent, len) = parsed(&range)
        .ok_or_else(|| Failure::last(format!("the server does not say which bytes it sends ({range:?})")))?;
    let about = About { len, etag: text(ETAG), modified: text(LAST_MODIFIED) };
    known.map_or(Ok(()), |known| about.check_same(known))?;
    match sent == (asked.start..asked.end.min(len)) {
        true => Ok(about),
        false => Err(Failure::last(format!("the server sends bytes {sent:?} instead of {asked:?}"))),
    }
}

/// The range and the length of `bytes FIRST-LAST/LENGTH`.
fn parsed(text: &str) -> Option<(Range<u64>, u64)> {
    let (range, len) = text.strip_prefix("bytes ")?.trim().split_once('/')?;
    let (first, last) = range.split_once('-')?;
    let (first, last, len): (u64, u64, u64) = (first.parse().ok()?, last.parse().ok()?, len.parse().ok()?);
    let sensible = first <= last && last < len && len <= i64::MAX as u64; // places of pages may be rounded up
    sensible.then(|| (first..last + 1, len))
}

/// The error of an answer without bytes.
fn refusal(status: u16, headers: &HeaderMap) -> Failure {
    let what = match status {
        200 => {
            "the server cannot send parts of a file (HTTP ranges): download the file, or use a server that can, such as nginx, \
             Apache or an S3 store"
        }
        401 => "the server asks for a name and a password (401)",
        403 => "the server does not allow reading it (403)",
        404 | 410 => {
            return Failure::Refused(io::Error::new(
                io::ErrorKind::NotFound,
                format!("the server has no such file ({status})"),
            ));
        }
        416 => "the file is empty (416)",
        408 | 425 | 429 | 500 | 502 | 503 | 504 => {
            let wait = headers.get(RETRY_AFTER).and_then(|wait| pause(wait.to_str().ok()?.trim()));
            let what = format!("the server cannot answer now ({status})");
            return Failure::Temporary(io::Error::other(what), wait);
        }
        _ => &format!("the server does not send it ({status})"),
    };
    Failure::Refused(io::Error::other(what))
}

/// The pause that `Retry-After` asks for: seconds, or until a time; none if that has passed.
fn pause(text: &str) -> Option<Duration> {
    if !text.is_empty() && text.bytes().all(|digit| digit.is_ascii_digit()) {
        return Some(Duration::from_secs(text.parse().unwrap_or(u64::MAX)));
    }
    let now = SystemTime::now().duration_since(UNIX_EPOCH).ok()?.as_secs();
    date(text)?.checked_sub(now).filter(|seconds| *seconds > 0).map(Duration::from_secs)
}

/// The seconds from 1970 to a time like `Fri, 31 Dec 1999 23:59:59 GMT`.
fn date(text: &str) -> Option<u64> {
    const MONTHS: [&str; 12] = ["Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"];
    let words: Vec<&str> = text.strip_suffix(" GMT")?.split([' ', ':']).collect();
    let [_, day, month, year, hour, minute, second] = words[..] else { return None };
    let month = MONTHS.iter().position(|name| *name == month)? as u64 + 1;
    let number = |text: &str, most: u64| text.parse::<u64>().ok().filter(|number| *number <= most);
    let (day, year) = (number(day, 31)?, number(year, 9999).filter(|year| *year >= 1970)?);
    let (hour, minute, second) = (number(hour, 23)?, number(minute, 59)?, number(second, 60)?);
    // Years begin in March here, so that leap days come last.
    let (year, month) = if month > 2 { (year, month - 3) } else { (year - 1, month + 9) };
    let days = 365 * year + year / 4 - year / 100 + year / 400 + (153 * month + 2) / 5 + day - 1;
    Some(((days.checked_sub(719_468)? * 24 + hour) * 60 + minute) * 60 + second)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ureq::http::{HeaderName, HeaderValue};

    fn headers(list: &[(&str, &str)]) -> HeaderMap {
        let pair = |(name, value): &(&str, &str)| {
            Some((HeaderName::from_bytes(name.as_bytes()).ok()?, HeaderValue::from_str(value).ok()?))
        };
        list.iter().filter_map(pair).collect()
    }

    fn answer(range: &str, etag: &str) -> Result<About, Failure> {
        check(206, &headers(&[("Content-Range", range), ("ETag", etag)]), &(10..20), Some(&known()))
    }

    fn known() -> About {
        About { len: 100, etag: Some("\"a\"".into()), modified: None }
    }

    fn error(failure: Result<About, Failure>) -> io::Error {
        match failure.expect_err("it is refused") {
            Failure::Final(error) | Failure::Refused(error) | Failure::Temporary(error, _) => error,
        }
    }

    fn is_change(failure: Result<About, Failure>) -> bool {
        error(failure).get_ref().is_some_and(<dyn std::error::Error + Send + Sync>::is::<ChangedSince>)
    }

    #[test]
    fn exactly_the_bytes_that_were_asked_for_are_taken() {
        assert_eq!(answer("bytes 10-19/100", "\"a\"").expect("sound"), known());
        assert!(answer("bytes 10-19/100", "W/\"a\"").is_ok());
        for range in
            ["bytes 10-18/100", "bytes 0-9/100", "bytes 10-19/*", "bytes */100", "10-19/100", "", "bytes 19-10/100"]
        {
            let refused = answer(range, "\"a\"");
            assert!(!is_change(refused), "{range}");
        }
        let open = headers(&[("Content-Range", "bytes 0-99/100")]);
        assert_eq!(check(206, &open, &(0..4096), None).expect("sound").len, 100);
        for range in ["bytes 0-18446744073709551615/18446744073709551615", "bytes 0-4095/18446744073709551615"] {
            assert!(check(206, &headers(&[("Content-Range", range)]), &(0..4096), None).is_err(), "{range}");
        }
    }

    #[test]
    fn another_object_is_a_change() {
        assert!(is_change(answer("bytes 10-19/101", "\"a\"")));
        assert!(is_change(answer("bytes 10-19/100", "\"b\"")));
        for status in [404, 410, 412, 416] {
            assert!(is_change(check(status, &headers(&[]), &(0..1), Some(&known()))), "{status}");
        }
        let of = |modified| {
            check(206, &headers(&[("Content-Range", "bytes 0-0/100"), ("Last-Modified", modified)]), &(0..1), None)
        };
        let first = of("Mon, 1").expect("sound");
        let later = headers(&[("Content-Range", "bytes 0-0/100"), ("Last-Modified", "Tue, 2")]);
        assert!(is_change(check(206, &later, &(0..1), Some(&first))));
        assert_eq!(first.version(), Some("Mon, 1"));
    }

    #[test]
    fn refusals_say_what_is_wrong() {
        let refused = |status, list: &[(&str, &str)]| check(status, &headers(list), &(0..9), None);
        for (status, part) in [(200, "parts"), (401, "password"), (403, "allow"), (404, "no such"), (418, "418")] {
            let error = error(refused(status, &[]));
            assert!(error.to_string().contains(part), "{status}: {error}");
        }
        assert_eq!(error(refused(404, &[])).kind(), io::ErrorKind::NotFound);
        let packed = [("Content-Range", "bytes 0-8/9"), ("Content-Encoding", "gzip")];
        assert!(error(refused(206, &packed)).to_string().contains("packs"));
    }

    #[test]
    fn busy_servers_are_asked_again() {
        let busy = |wait| check(503, &headers(&[("Retry-After", wait)]), &(0..9), None);
        assert!(matches!(busy("7"), Err(Failure::Temporary(_, Some(wait))) if wait.as_secs() == 7));
        assert!(matches!(busy("Fri, 31 Dec 1999 23:59:59 GMT"), Err(Failure::Temporary(_, None))));
        let far = |wait| matches!(busy(wait), Err(Failure::Temporary(_, Some(wait))) if wait.as_secs() > 1 << 30);
        assert!(far("Fri, 31 Dec 9999 23:59:59 GMT") && far("99999999999999999999"));
        for nonsense in ["", "-1", "1.5", "soon", "Fri, 31 Foo 9999 23:59:59 GMT", "Fri, 31 Dec 9999 GMT"] {
            assert!(matches!(busy(nonsense), Err(Failure::Temporary(_, None))), "{nonsense}");
        }
    }

    #[test]
    fn dates_are_seconds_since_1970() {
        for (text, seconds) in [
            ("Thu, 01 Jan 1970 00:00:00 GMT", 0),
            ("Sun, 06 Nov 1994 08:49:37 GMT", 784_111_777),
            ("Tue, 29 Feb 2000 12:00:00 GMT", 951_825_600),
            ("Tue, 01 Mar 2033 00:00:01 GMT", 1_993_248_001),
        ] {
            assert_eq!(date(text), Some(seconds), "{text}");
        }
    }
}
