//! ParaView's `.pvd`: a list of files and their times.

use super::shared::xml::{attribute, required};
use crate::base::error::{Error, Result};
use crate::source::Parsed;
use crate::source::inputs::FrameFiles;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use std::collections::HashSet;
use std::fs;
use std::path::Path;

/// Reads the list; its files are found from its own folder.
pub(in crate::source) fn read(path: &Path) -> Result<FrameFiles> {
    let bytes = fs::read(path).map_err(|e| Error::io(path, "reading", e))?;
    let text = std::str::from_utf8(&bytes).map_err(|e| Error::input(path, format!("is not UTF-8 text: {e}")))?;
    parse(text, path.parent().unwrap_or(Path::new(""))).map_err(|e| Error::input(path, e))
}

fn parse(text: &str, folder: &Path) -> Parsed<FrameFiles> {
    let mut reader = Reader::from_str(text);
    let (mut files, mut sets) = (FrameFiles::default(), HashSet::new());
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

fn element(
    e: &BytesStart<'_>,
    folder: &Path,
    files: &mut FrameFiles,
    sets: &mut HashSet<(String, String)>,
) -> Parsed<()> {
    match e.name().as_ref() {
        "VTKFile" if required(e, "type")? != "Collection" => Err("is not a VTK collection".into()),
        "DataSet" => {
            files.paths.push(folder.join(required(e, "file")?));
            let time = attribute(e, "timestep")?;
            if let Some(time) = time {
                files.times.push(time.trim().parse().map_err(|_| format!("timestep {time:?} is no number"))?);
            }
            let of = |name| Parsed::Ok(attribute(e, name)?.unwrap_or_default());
            sets.insert((of("group")?, of("part")?));
            Ok(())
        }
        _ => Ok(()),
    }
}

fn finish(files: FrameFiles, sets: usize) -> Parsed<FrameFiles> {
    if files.paths.is_empty() {
        return Err("lists no DataSet".into());
    }
    if sets > 1 {
        return Err("lists several parts or groups; one file for each time is supported".into());
    }
    files.of_list()
}

#[cfg(test)]
mod tests {
    use crate::source::testing::{Folder, refused};
    use crate::source::{OpenOptions, open};

    const NPY: &[u8] = b"\x93NUMPY\x01\x00\x3e\x00{'descr':'|u1', 'fortran_order':False, 'shape':(1,1,1,2)}    \nab";

    fn pvd(sets: &str) -> String {
        format!("<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\"><Collection>{sets}</Collection></VTKFile>")
    }

    #[test]
    fn files_and_times_are_listed() {
        let folder = Folder::new();
        for name in ["a&7.npy", "b3.npy", "c4.npy"] {
            folder.write(name, NPY);
        }
        let sets =
            r#"<DataSet timestep="0.5" part="0" file="c4.npy"/><DataSet timestep="2" part="0" file="a&amp;7.npy"/>"#;
        let list = folder.write("list.pvd", pvd(sets));
        let source = open(&[list], &OpenOptions::default()).expect("opening");
        assert_eq!(source.archive().times, [0.5, 2.0]);
        assert!(source.archive().notes.is_empty());
        let source = open(&[folder.path("")], &OpenOptions::default()).expect("opening the folder");
        assert_eq!(source.archive().frames, Some(2));
        assert!(source.archive().notes[0].text.contains("list.pvd"));
    }

    #[test]
    fn what_is_not_one_file_for_each_time_is_refused() {
        let folder = Folder::new();
        let list = |sets: &str, words: &str| {
            let file = folder.write("list.pvd", pvd(sets));
            refused(&[file], &OpenOptions::default(), words);
        };
        list("", "lists no DataSet");
        list(r#"<DataSet timestep="0" part="0" file="a"/><DataSet timestep="0" part="1" file="b"/>"#, "several parts");
        list(r#"<DataSet timestep="0" group="x" file="a"/><DataSet timestep="1" group="y" file="b"/>"#, "groups");
        list(r#"<DataSet timestep="1" file="a"/><DataSet timestep="1" file="b"/>"#, "two files for the time 1");
        list(r#"<DataSet timestep="1" file="a"/><DataSet file="b"/>"#, "some of its files only");
        list(r#"<DataSet timestep="soon" file="a"/>"#, "is no number");
        list(r#"<DataSet timestep="1"/>"#, "has no file");
        list(r#"<DataSet timestep="1" file="a"/><DataSet timestep="2" file="./a"/>"#, "given twice");
        list(r#"<DataSet timestep="1" file="a.vtu"/>"#, "a.vtu: opening");
        list(r#"<DataSet timestep="1" file="list.pvd"/>"#, "a list of files must be the only input");
        list("</oops>", "not well-formed");
        let other = folder.write("list.pvd", r#"<VTKFile type="ImageData"/>"#);
        refused(&[other], &OpenOptions::default(), "not a VTK collection");
    }

    #[test]
    fn times_that_go_back_are_noted_and_several_lists_refused() {
        let folder = Folder::new();
        folder.write("a.npy", NPY);
        folder.write("b.npy", NPY);
        let sets = r#"<DataSet timestep="2" file="a.npy"/><DataSet timestep="1" file="b.npy"/>"#;
        let list = folder.write("x.pvd", pvd(sets));
        let source = open(&[list], &OpenOptions::default()).expect("opening");
        assert!(source.archive().notes[0].text.contains("do not ascend"));
        folder.write("y.pvd", pvd(sets));
        refused(&[folder.path("")], &OpenOptions::default(), "several lists of files, x.pvd and y.pvd");
    }
}
