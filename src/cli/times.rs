//! The options of times: those of the user in place of those in the files.

use super::{Numbers, Pair};
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::files;
use wavesplat_core::source::{GivenTimes, RegularTimes};

/// `START,STEP`, or a file with a number for each frame.
#[derive(Debug, Clone, PartialEq)]
pub enum TimesSpec {
    /// A start and a step.
    Regular(Pair),
    /// A text file with one number on each line.
    File(PathBuf),
}

impl FromStr for TimesSpec {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        Ok(text.parse().map_or_else(|_| Self::File(text.into()), Self::Regular))
    }
}

/// A step between frames.
pub(super) fn step(text: &str) -> std::result::Result<f64, String> {
    let step = text.trim().parse().ok().filter(|step: &f64| step.is_finite() && *step > 0.0);
    step.ok_or_else(|| "takes a number above 0".into())
}

/// The setting of times.
pub(super) const TIMES: &str = "times";

/// Its value for times from a file, which other frames cannot reuse.
pub(super) const LIST: &str = "list";

/// The times that `--times` or `--dt` give.
pub(super) fn given(times: Option<&TimesSpec>, step: Option<f64>) -> Result<Option<GivenTimes>> {
    match (times, step) {
        (Some(TimesSpec::File(path)), _) => read(path).map(|times| Some(GivenTimes::List(times.into()))),
        (Some(TimesSpec::Regular(Numbers([start, step]))), _) => regular(*start, *step).map(Some),
        (None, Some(step)) => regular(0.0, step).map(Some),
        (None, None) => Ok(None),
    }
}

/// The value of the setting for them.
pub(super) fn setting_value(times: Option<&TimesSpec>, step: Option<f64>) -> Option<String> {
    match (times, step) {
        (Some(TimesSpec::File(_)), _) => Some(LIST.into()),
        (Some(TimesSpec::Regular(times)), _) => Some(times.to_string()),
        (None, step) => step.map(|step| Numbers([0.0, step]).to_string()),
    }
}

fn regular(start: f64, step: f64) -> Result<GivenTimes> {
    RegularTimes::new(start, step).map(GivenTimes::Regular)
}

/// The largest number of times in a file, and of bytes in it and in a line.
const MOST_TIMES: usize = 1 << 24;
const MOST_BYTES: u64 = 1 << 30;
const MOST_IN_LINE: u64 = 1 << 12;

/// Reads one number from each line of a file. `#` begins a comment.
fn read(path: &Path) -> Result<Vec<f64>> {
    let file = files::open_or_stream(path).map_err(|e| match e {
        Error::Io { source, .. } if source.kind() == ErrorKind::NotFound => {
            Error::path(path, "is neither START,STEP nor a file with a number for each frame")
        }
        other => other,
    })?;
    let (mut lines, mut line, mut times) = (BufReader::new(file.take(MOST_BYTES)), Vec::new(), Vec::new());
    for number in 1.. {
        line.clear();
        let got = lines.by_ref().take(MOST_IN_LINE).read_until(b'\n', &mut line);
        if got.map_err(|e| Error::io(path, format!("reading line {number}"), e))? == 0 {
            break;
        }
        let refused = |what: &str| Error::input(path, format!("line {number}: {what}"));
        times.extend(time(&line).map_err(|what| refused(&what))?);
        if times.len() > MOST_TIMES || lines.get_ref().limit() == 0 {
            return Err(refused("is one too many for a list of times"));
        }
    }
    Ok(times)
}

/// The number of a line; none if it has only a comment.
fn time(line: &[u8]) -> std::result::Result<Option<f64>, String> {
    const MOST_SHOWN: usize = 30;
    if line.len() as u64 == MOST_IN_LINE {
        return Err("is too long for a number".into());
    }
    let text = std::str::from_utf8(line).map_err(|_| "is not UTF-8 text")?.trim_start_matches('\u{feff}');
    match text.split('#').next().unwrap_or_default().trim() {
        "" => Ok(None),
        text => {
            let number = text.parse().ok().filter(|number: &f64| number.is_finite());
            let shown: String = text.chars().take(MOST_SHOWN).collect();
            number.map(Some).ok_or_else(|| format!("{shown:?} is no finite number"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refusal(bytes: &[u8]) -> String {
        let file = tempfile::NamedTempFile::new().expect("temporary file");
        std::fs::write(file.path(), bytes).expect("writing");
        read(file.path()).expect_err("no list of times").to_string()
    }

    #[test]
    fn files_have_a_number_on_each_line() {
        let file = tempfile::NamedTempFile::new().expect("temporary file");
        std::fs::write(file.path(), "\u{feff}# times\r\n0\n 0.5 # s\n\n1e3\r\n-2").expect("writing");
        assert_eq!(read(file.path()).expect("a list"), [0.0, 0.5, 1e3, -2.0]);
    }

    #[test]
    fn what_is_no_number_is_named_with_its_line() {
        for (bytes, words) in [
            (&b"0\nnan\n"[..], "line 2: \"nan\" is no finite number"),
            (b"inf", "line 1: \"inf\""),
            (b"0\n\n1 2\n", "line 3: \"1 2\""),
            (b"0,1\n", "line 1: \"0,1\""),
            (b"\xff\n", "line 1: is not UTF-8"),
            (&[b'1'; 5000], "line 1: is too long"),
            (&[b'\n'; 3].iter().chain(&[0; 9000]).copied().collect::<Vec<_>>(), "line 4: is too long"),
        ] {
            let message = refusal(bytes);
            assert!(message.contains(words), "{words:?} is not in {message:?}");
        }
        assert!(refusal("x".repeat(4000).as_bytes()).len() < 200);
    }

    #[cfg(unix)]
    #[test]
    fn endless_files_are_refused() {
        assert!(read(Path::new("/dev/zero")).expect_err("endless").to_string().contains("is a device"));
    }

    #[test]
    fn an_option_names_a_file_or_gives_steps() {
        assert_eq!("0,0.1".parse(), Ok(TimesSpec::Regular(Numbers([0.0, 0.1]))));
        assert_eq!("0,x".parse(), Ok(TimesSpec::File("0,x".into())));
        assert!(step("0.1").is_ok() && ["0", "-1", "nan", "inf", "x"].iter().all(|text| step(text).is_err()));
    }
}
