//! ParaView's `.pvd`: a list of files and their times.

use super::Parsed;
use super::inputs::Files;
use super::xml::{attribute, required};
use crate::error::{Error, Result};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::collections::HashSet;
use std::fs;
use std::path::Path;

/// Reads the list; its files are found from its own folder.
pub(super) fn read(path: &Path) -> Result<Files> {
    let bytes = fs::read(path).map_err(|e| Error::io(path, "reading", e))?;
    let text = std::str::from_utf8(&bytes).map_err(|e| Error::input(path, format!("is not UTF-8 text: {e}")))?;
    parse(text, path.parent().unwrap_or(Path::new(""))).map_err(|e| Error::input(path, e))
}

fn parse(text: &str, folder: &Path) -> Parsed<Files> {
    let mut reader = Reader::from_str(text);
    let (mut files, mut sets) = (Files::default(), HashSet::new());
    loop {
        let event =
            reader.read_event().map_err(|e| format!("is not well-formed at byte {}: {e}", reader.error_position()))?;
        match event {
            Event::Start(e) | Event::Empty(e) => element(&e, folder, &mut files, &mut sets)?,
            Event::Eof => break,
            _ => {}
        }
    }
    finish(files, sets.len())
}

fn element(e: &BytesStart<'_>, folder: &Path, files: &mut Files, sets: &mut HashSet<(String, String)>) -> Parsed<()> {
    match e.name().as_ref() {
        "VTKFile" if required(e, "type")? != "Collection" => Err("is not a VTK collection".into()),
        "DataSet" => {
            files.paths.push(folder.join(required(e, "file")?));
            let time = attribute(e, "timestep")?;
            files.times.extend(
                time.map(|t| t.trim().parse::<f64>().map_err(|_| format!("timestep {t:?} is no number"))).transpose()?,
            );
            let of = |name| Parsed::Ok(attribute(e, name)?.unwrap_or_default());
            sets.insert((of("group")?, of("part")?));
            Ok(())
        }
        _ => Ok(()),
    }
}

fn finish(mut files: Files, sets: usize) -> Parsed<Files> {
    if files.paths.is_empty() {
        return Err("lists no DataSet".into());
    }
    if sets > 1 {
        return Err("lists several parts or groups; one file for each time is supported".into());
    }
    if !files.times.is_empty() && files.times.len() != files.paths.len() {
        return Err("gives a timestep to some of its files only".into());
    }
    if let Some(at) = files.times.windows(2).position(|t| t[0] == t[1]) {
        return Err(format!("lists two files for the time {}; one is supported", files.times[at]));
    }
    if files.times.windows(2).any(|t| t[1].partial_cmp(&t[0]) != Some(std::cmp::Ordering::Greater)) {
        files.notes.push("the times in the .pvd do not ascend; its files are taken in the order listed".into());
    }
    Ok(files)
}
