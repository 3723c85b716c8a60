//! Finished points on disk, one JSON object a line after a line of settings: an interrupted run goes on where it was.

use super::json::bad_json;
use super::point::Point;
use super::settings::Settings;
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Result};

/// The name of the file.
const NAME: &str = "points.jsonl";

/// The open file and its contents.
#[derive(Debug)]
pub(super) struct Journal {
    path: PathBuf,
    file: File,
    points: BTreeMap<String, Point>,
}

impl Journal {
    /// Opens the journal of a folder, or begins one; `force` begins anew.
    pub(super) fn open(folder: &Path, settings: &Settings, force: bool) -> Result<Self> {
        let path = folder.join(NAME);
        let text = if force { String::new() } else { read(&path)? };
        let points = if text.is_empty() { BTreeMap::new() } else { points(&path, &text, settings)? };
        let failed = |e| Error::io(&path, "opening", e);
        let file = File::options().create(true).truncate(false).write(true).open(&path).map_err(failed)?;
        file.set_len(text.len() as u64).map_err(failed)?; // a torn line is gone
        let file = File::options().append(true).open(&path).map_err(failed)?;
        let mut journal = Self { path, file, points };
        if text.is_empty() {
            journal.write(&[settings])?;
        }
        Ok(journal)
    }

    /// Whether a point was measured.
    pub(super) fn has(&self, key: &str) -> bool {
        self.points.contains_key(key)
    }

    /// Adds points.
    pub(super) fn append(&mut self, points: Vec<Point>) -> Result<()> {
        self.write(&points)?;
        self.points.extend(points.into_iter().map(|p| (p.key.clone(), p)));
        Ok(())
    }

    /// The points of these names.
    pub(super) fn take(mut self, keys: &[String]) -> Vec<Point> {
        keys.iter().filter_map(|key| self.points.remove(key)).collect()
    }

    fn write(&mut self, lines: &[impl Serialize]) -> Result<()> {
        let mut text = String::new();
        for line in lines {
            text += &serde_json::to_string(line).map_err(|e| bad_json(&self.path, &e))?;
            text.push('\n');
        }
        self.file.write_all(text.as_bytes()).map_err(|e| Error::io(&self.path, "writing", e))
    }
}

/// All whole lines; nothing if there is no file.
fn read(path: &Path) -> Result<String> {
    let mut text = match fs::read_to_string(path) {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => String::new(),
        other => other.map_err(|e| Error::io(path, "reading", e))?,
    };
    text.truncate(text.rfind('\n').map_or(0, |end| end + 1));
    Ok(text)
}

/// The points of a journal that has these settings.
fn points(path: &Path, text: &str, settings: &Settings) -> Result<BTreeMap<String, Point>> {
    let mut lines = text.lines();
    let found = serde_json::from_str::<Settings>(lines.next().unwrap_or_default());
    if !found.is_ok_and(|found| found == *settings) {
        let what = "was measured with other settings, by another build or on another machine; --force begins anew";
        return Err(Error::usage(format!("{}: {what}", path.display())));
    }
    let point = |line| serde_json::from_str::<Point>(line).map(|p| (p.key.clone(), p)).map_err(|e| bad_json(path, &e));
    lines.map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::machine::Machine;

    fn settings(size: usize) -> Settings {
        let (version, build) = ("1".into(), "2".into());
        Settings { schema: 1, dims: [8, 8, 8, 33], size, repeats: 1, version, build, machine: Machine::this() }
    }

    #[test]
    fn a_journal_is_read_back_without_a_torn_line() {
        let folder = tempfile::tempdir().expect("a folder");
        let open = |force| Journal::open(folder.path(), &settings(40), force);
        open(false).expect("new").append(vec![Point::example("a"), Point::example("b")]).expect("written");
        let path = folder.path().join(NAME);
        let whole = fs::read_to_string(&path).expect("read");
        fs::write(&path, &whole[..whole.len() - 9]).expect("torn");
        let mut journal = open(false).expect("opened again");
        assert!(journal.has("a") && !journal.has("b"));
        journal.append(vec![Point::example("b")]).expect("written");
        assert_eq!(fs::read_to_string(&path).expect("read"), whole);
        assert_eq!(open(false).expect("opened").take(&["b".into(), "c".into()]), [Point::example("b")]);
        assert!(!open(true).expect("begun anew").has("a"));
    }

    #[test]
    fn other_settings_are_refused() {
        let folder = tempfile::tempdir().expect("a folder");
        Journal::open(folder.path(), &settings(40), false).expect("new");
        assert!(Journal::open(folder.path(), &settings(41), false).is_err());
        assert!(Journal::open(folder.path(), &settings(41), true).is_ok());
        assert!(Journal::open(folder.path(), &settings(41), false).is_ok());
    }
}
