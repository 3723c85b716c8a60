//! Where the samples of a NRRD are: after the header, in another file, or in one file for each frame.

use super::header::Header;
use crate::error::{Error, Result};
use crate::mapped::{Access, FileBytes};
use crate::source::Parsed;
use crate::source::described::{Part, check_size};
use crate::source::frames::Shape;
use std::path::Path;

const PIECE: usize = 64 << 10; // bytes read at a time when lines are counted

/// Bytes and lines to leave out before the samples of each data file.
struct Skip {
    lines: u64,
    bytes: Option<u64>, // none: the samples are at the end of the file
}

/// The files that hold the frames, checked for their size.
pub(super) fn parts(
    file: &FileBytes,
    header: &Header,
    shape: &Shape,
    frames: usize,
    big_endian: bool,
) -> Result<Vec<Part>> {
    let refused = |e| Error::input(file.path(), e);
    let skip = skip(header).map_err(refused)?;
    let part = |data: &FileBytes, start, frames| {
        let start = skip.start(data, start, shape, frames)?;
        Part::plain((data.path(), data.state()), (shape, frames), big_endian, start).map_err(refused)
    };
    let Some(named) = header.get("datafile") else {
        if !header.closed {
            return Err(refused("ends inside its header: no empty line comes before the samples".into()));
        }
        return Ok(vec![part(file, header.len, frames)?]);
    };
    let folder = file.path().parent().unwrap_or(Path::new(""));
    let open = |name: &str| FileBytes::open(&folder.join(name), Access::Read);
    match Files::parse(named, &header.list).map_err(refused)? {
        Files::One(name) => Ok(vec![part(&open(&name)?, 0, frames)?]),
        many => {
            let names = many.one_for_each(header, frames).map_err(refused)?;
            names.map(|name| part(&open(&name)?, 0, 1)).collect()
        }
    }
}

fn skip(header: &Header) -> Parsed<Skip> {
    let number = |name| header.get(name).unwrap_or("0").parse::<i64>().map_err(|_| format!("{name} is no number"));
    let lines = u64::try_from(number("lineskip")?).map_err(|_| "line skip is negative")?;
    match number("byteskip")? {
        -1 => Ok(Skip { lines, bytes: None }),
        n => Ok(Skip { lines, bytes: Some(u64::try_from(n).map_err(|_| format!("byte skip {n} is not supported"))?) }),
    }
}

impl Skip {
    /// Where the samples start, and that they fill the rest of the file.
    fn start(&self, file: &FileBytes, header: u64, shape: &Shape, frames: usize) -> Result<u64> {
        let refused = |e| Error::input(file.path(), e);
        let start = match self.bytes {
            None => {
                let payload = (shape.frame_bytes() as u64).saturating_mul(frames as u64);
                file.len().saturating_sub(payload).max(header)
            }
            Some(n) => after_lines(file, header, self.lines)?
                .checked_add(n)
                .ok_or_else(|| refused("byte skip is too large".into()))?,
        };
        check_size(file.len(), start, shape, frames).map_err(refused)?;
        Ok(start)
    }
}

/// The byte after so many ends of lines.
fn after_lines(file: &FileBytes, start: u64, lines: u64) -> Result<u64> {
    let (mut at, mut left, mut piece) = (start, lines, vec![0; if lines > 0 { PIECE } else { 0 }]);
    while left > 0 {
        let len = usize::try_from(file.len().saturating_sub(at)).unwrap_or(PIECE).min(PIECE);
        if len == 0 {
            return Err(Error::input(file.path(), format!("ends before the {lines} lines of its line skip")));
        }
        file.read_at(at, &mut piece[..len]).map_err(|e| Error::io(file.path(), "counting lines", e))?;
        let ends = piece[..len].iter().enumerate().filter(|(_, b)| **b == b'\n');
        let (mut used, mut seen) = (len, 0);
        for (i, _) in ends.take(usize::try_from(left).unwrap_or(usize::MAX)) {
            seen += 1;
            used = if seen == left { i + 1 } else { used };
        }
        left -= seen;
        at += used as u64;
    }
    Ok(at)
}

/// What `data file` says.
enum Files {
    One(String),
    Pattern { pattern: String, first: i64, last: i64, step: i64, axes: Option<usize> },
    List { names: Vec<String>, axes: Option<usize> },
}

impl Files {
    fn parse(text: &str, list: &[String]) -> Parsed<Self> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let axes = |word: Option<&&str>| {
            word.map(|w| w.parse().map_err(|_| format!("{w:?} is no number of axes"))).transpose()
        };
        if words.first() == Some(&"LIST") {
            return Ok(Self::List { names: list.to_vec(), axes: axes(words.get(1))? });
        }
        let numbers: Vec<i64> = words.iter().skip(1).map_while(|w| w.parse().ok()).collect();
        match (words[..].first(), &numbers[..]) {
            (Some(pattern), [first, last, step, ..]) if pattern.contains('%') && numbers.len() + 1 == words.len() => {
                let (pattern, axes) = ((*pattern).into(), axes(words.get(4))?);
                Ok(Self::Pattern { pattern, first: *first, last: *last, step: *step, axes })
            }
            _ => Ok(Self::One(text.into())),
        }
    }

    /// The names of files that hold one frame each.
    fn one_for_each(self, header: &Header, frames: usize) -> Parsed<Box<dyn Iterator<Item = String>>> {
        let (axes, count) = match &self {
            Self::List { names, axes } => (*axes, names.len()),
            Self::Pattern { first, last, step, axes, .. } => (*axes, pattern_count(*first, *last, *step)?),
            Self::One(_) => (None, 1),
        };
        if header.get("dimension") != Some("4") || axes.is_some_and(|a| a != 3) {
            return Err(
                "has several data files of less than a frame each; one for each frame of four axes is supported".into(),
            );
        }
        if count != frames {
            return Err(format!("names {count} data files for {frames} frames"));
        }
        Ok(match self {
            Self::List { names, .. } => Box::new(names.into_iter()),
            Self::One(name) => Box::new(std::iter::once(name)),
            Self::Pattern { pattern, first, step, .. } => {
                numbered(&pattern, first)?; // so that a wrong pattern is an error
                Box::new((0..count as i64).filter_map(move |i| numbered(&pattern, first + i * step).ok()))
            }
        })
    }
}

fn pattern_count(first: i64, last: i64, step: i64) -> Parsed<usize> {
    let wrong = || format!("data file numbers from {first} to {last} in steps of {step} make no sense");
    let span = last.checked_sub(first).ok_or_else(wrong)?;
    let steps = span.checked_div(step).filter(|n| *n >= 0).ok_or_else(wrong)?;
    usize::try_from(steps).ok().and_then(|n| n.checked_add(1)).ok_or_else(wrong)
}

/// A name from a printf pattern with one `%d`, perhaps with a width such as `%03d`.
fn numbered(pattern: &str, number: i64) -> Parsed<String> {
    let wrong = || format!("data file pattern {pattern:?} needs one number such as %d or %03d");
    let (before, rest) = pattern.split_once('%').ok_or_else(wrong)?;
    let end = rest.find(|c: char| !c.is_ascii_digit()).ok_or_else(wrong)?;
    let (digits, after) = rest.split_at(end);
    let after = after.strip_prefix(['d', 'i', 'u']).filter(|a| !a.contains('%')).ok_or_else(wrong)?;
    let width: usize = if digits.is_empty() { 0 } else { digits.parse().map_err(|_| wrong())? };
    if width > 64 {
        return Err(wrong());
    }
    let number = if digits.starts_with('0') { format!("{number:0width$}") } else { format!("{number:width$}") };
    Ok(format!("{before}{number}{after}"))
}
