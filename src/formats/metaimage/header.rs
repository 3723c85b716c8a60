//! The text of a MetaImage header: fields, and the list of data files that may end it.

use super::layout::is_known;
use crate::shared::sequence::SequenceTimes;
use crate::shared::words::shortened;
use std::collections::HashMap;
use wavesplat_core::source::Parsed;

/// The fields of a header, and where it ends.
#[derive(Debug, Default)]
pub(super) struct MetaImageHeader {
    fields: HashMap<String, String>, // names in lower case
    /// Names as they are written, in order.
    names: Vec<String>,
    /// The file names after `ElementDataFile = LIST`.
    pub(super) list: Vec<String>,
    /// Bytes up to the first one after `ElementDataFile`, which ends every header.
    pub(super) len: u64,
}

impl MetaImageHeader {
    /// Reads the header at the start of these bytes. `None` if the header continues beyond them; if they are the
    /// `whole` file, it must end within them.
    pub(super) fn parse(bytes: &[u8], whole: bool) -> Parsed<Option<Self>> {
        let mut header = Self::default();
        for line in bytes.split_inclusive(|b| *b == b'\n') {
            if !line.ends_with(b"\n") && !whole {
                return Ok(None);
            }
            if header.is_list() {
                header.name(line)?;
                continue;
            }
            header.len += line.len() as u64;
            header.field(line)?;
            if header.get(DATA).is_some() && !header.is_list() {
                return Ok(Some(header));
            }
        }
        match header.is_list() {
            true => Ok(whole.then_some(header)),
            false if whole => Err("ends without ElementDataFile: is no MetaImage header".into()),
            false => Ok(None),
        }
    }

    fn field(&mut self, line: &[u8]) -> Parsed<()> {
        let line = String::from_utf8_lossy(line);
        let text = line.trim();
        if text.is_empty() || text.starts_with('#') {
            return Ok(());
        }
        let (name, value) = text
            .split_once(['=', ':'])
            .ok_or_else(|| format!("has a header line without a =: {:?}", shortened(text)))?;
        self.names.push(name.trim().into());
        match self.fields.insert(name.trim().to_lowercase(), value.trim().into()) {
            Some(_) => Err(format!("says {} twice", name.trim())),
            None => Ok(()),
        }
    }

    fn name(&mut self, line: &[u8]) -> Parsed<()> {
        let text = std::str::from_utf8(line).map_err(|_| "has a data file's name that is not UTF-8 text")?.trim();
        self.list.extend((!text.is_empty()).then(|| text.into()));
        Ok(())
    }

    fn is_list(&self) -> bool {
        self.get(DATA).is_some_and(|value| value.split_whitespace().next() == Some("LIST"))
    }

    /// A field by its name in lower case.
    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.fields.get(name).map(String::as_str)
    }

    /// The fields that do not describe the samples, unchanged.
    pub(super) fn others(&self) -> impl Iterator<Item = (&str, &str)> {
        let others = self.names.iter().filter(|name| !is_known(&name.to_lowercase()));
        others.filter_map(|name| Some((name.as_str(), self.get(&name.to_lowercase())?)))
    }

    /// The first of some fields that mean the same.
    pub(super) fn any(&self, names: &[&str]) -> Option<&str> {
        names.iter().find_map(|name| self.get(name))
    }

    /// The times of as many frames along an axis, by the fields of programs.
    pub(super) fn sequence(&self, axis: usize, count: usize) -> Option<SequenceTimes> {
        SequenceTimes::find(|name| self.get(&name.to_lowercase()), axis, count)
    }

    /// A field that must be there.
    pub(super) fn required(&self, name: &str) -> Parsed<&str> {
        self.get(&name.to_lowercase()).ok_or_else(|| format!("its header does not say {name}"))
    }

    /// Whether one of some fields that mean the same is true.
    pub(super) fn flag(&self, names: &[&str]) -> Parsed<Option<bool>> {
        let Some(text) = self.any(names) else { return Ok(None) };
        match text.bytes().next() {
            Some(b'T' | b't' | b'1') => Ok(Some(true)),
            Some(b'F' | b'f' | b'0') => Ok(Some(false)),
            _ => Err(format!("{} is neither True nor False: {text:?}", names[0])),
        }
    }
}

const DATA: &str = "elementdatafile";
