//! The text of a NRRD header: fields, and the list of data files that may end it.

use super::layout::MAGIC;
use crate::shared::sequence::SequenceTimes;
use std::collections::HashMap;
use wavesplat_core::source::Parsed;

/// The fields of a header, and where it ends.
#[derive(Debug)]
pub(super) struct NrrdHeader {
    fields: HashMap<String, String>, // names in lower case, without spaces
    /// Keys of users, and their values.
    pub(super) keys: Vec<(String, String)>,
    /// The file names after `data file: LIST`.
    pub(super) list: Vec<String>,
    /// Bytes up to the first sample of an attached file.
    pub(super) len: u64,
    /// Whether an empty line ended it, which an attached file needs.
    pub(super) closed: bool,
}

impl NrrdHeader {
    /// Reads the header at the start of these bytes. `None` if the header continues beyond them; if they are the
    /// `whole` file, it must end within them.
    pub(super) fn parse(bytes: &[u8], whole: bool) -> Parsed<Option<Self>> {
        if !bytes.starts_with(MAGIC) {
            return Err("does not start as a NRRD file does".into());
        }
        let mut header = Self { fields: HashMap::new(), keys: Vec::new(), list: Vec::new(), len: 0, closed: false };
        for line in bytes.split_inclusive(|b| *b == b'\n') {
            if !line.ends_with(b"\n") && !whole {
                return Ok(None);
            }
            let first = header.len == 0;
            header.len += line.len() as u64;
            let text = std::str::from_utf8(line).map_err(|_| "has a header line that is not text")?.trim_end();
            if text.is_empty() {
                header.closed = true;
                return Ok(Some(header));
            }
            if !first {
                header.line(text)?;
            }
        }
        Ok(whole.then_some(header))
    }

    fn line(&mut self, text: &str) -> Parsed<()> {
        if text.starts_with('#') {
            return Ok(());
        }
        if self.get("datafile").is_some_and(|v| v.split_whitespace().next() == Some("LIST")) {
            self.list.push(text.into());
            return Ok(());
        }
        match (text.split_once(": "), text.split_once(":=")) {
            (Some((name, _)), Some((key, value))) if key.len() < name.len() => self.key(key, value),
            (Some((name, value)), _) => self.field(name, value),
            (None, Some((key, value))) => self.key(key, value),
            (None, None) => Err(format!("has a header line without a colon: {text:?}")),
        }
    }

    fn key(&mut self, key: &str, value: &str) -> Parsed<()> {
        self.keys.push((key.trim().into(), value.trim().into()));
        Ok(())
    }

    fn field(&mut self, name: &str, value: &str) -> Parsed<()> {
        let plain = name.to_lowercase().split_whitespace().collect::<String>();
        match self.fields.insert(plain, value.trim().into()) {
            Some(_) => Err(format!("says {name} twice")),
            None => Ok(()),
        }
    }

    /// A field by its name in lower case without spaces.
    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.fields.get(name).map(String::as_str)
    }

    /// Vectors in the world.
    pub(super) fn vectors(&self, text: &str) -> Parsed<Vec<Option<Vec<f64>>>> {
        vectors(text, self.get("spacedimension") == Some("2"))
    }

    /// The times of as many frames along an axis, by the keys of programs.
    pub(super) fn sequence(&self, axis: usize, count: usize) -> Option<SequenceTimes> {
        let get = |name: &str| self.keys.iter().find(|(key, _)| key == name).map(|(_, value)| value.as_str());
        SequenceTimes::find(get, axis, count)
    }

    /// A field that must be there.
    pub(super) fn required(&self, name: &str) -> Parsed<&str> {
        self.get(name).ok_or_else(|| format!("its header does not say {name}"))
    }
}

/// Vectors such as `(1,0,0)`, of three numbers or with time of four, in a plane of two; and `none` between them.
fn vectors(text: &str, are_of_plane: bool) -> Parsed<Vec<Option<Vec<f64>>>> {
    let numbers = if are_of_plane { 2..=3 } else { 3..=4 };
    let wrong = || format!("{text:?} is not made of vectors of three numbers such as (1,0,0)");
    let (mut vectors, mut left) = (Vec::new(), text.trim_start());
    while !left.is_empty() {
        let Some((inside, rest)) = left.strip_prefix('(').and_then(|left| left.split_once(')')) else {
            let (word, rest) = left.split_once(char::is_whitespace).unwrap_or((left, ""));
            if !word.eq_ignore_ascii_case("none") {
                return Err(wrong());
            }
            vectors.push(None);
            left = rest.trim_start();
            continue;
        };
        let vector: Option<Vec<f64>> = inside.split(',').map(|n| n.trim().parse().ok()).collect();
        let mut vector = vector.filter(|v| numbers.contains(&v.len())).ok_or_else(wrong)?;
        vector.resize(vector.len().max(3), 0.0);
        vectors.push(Some(vector));
        left = rest.trim_start();
    }
    Ok(vectors)
}
