//! ParaView's `.pvd`: a list of files and their times, read and written.

use crate::contents::Contents;
use crate::shared::xml::{attribute, required};
use quick_xml::Reader;
use quick_xml::escape::escape;
use quick_xml::events::{BytesStart, Event};
use std::collections::HashSet;
use std::io::{self, Write};
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::files;
use wavesplat_core::source::Parsed;
use wavesplat_core::source::series::FrameFiles;

/// Reads the list; its files are found from its own folder.
pub(crate) fn read(path: &Path) -> Result<FrameFiles> {
    let bytes = files::read(path)?;
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
            let text = |name| Parsed::Ok(attribute(e, name)?.unwrap_or_default());
            sets.insert((text("group")?, text("part")?));
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
    files.checked()
}

/// Writes the list of the files of all frames with their times; `names` are relative to the list's folder.
pub(super) fn write(
    contents: &Contents,
    names: &mut dyn Iterator<Item = String>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let start = r#"<?xml version="1.0"?>
<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">
  <Collection>"#;
    writeln!(out, "{start}")?;
    for (time, name) in contents.times.iter().zip(names) {
        writeln!(out, r#"    <DataSet timestep="{time}" part="0" file="{}"/>"#, escape(&name))?;
    }
    writeln!(out, "  </Collection>\n</VTKFile>")
}

#[cfg(test)]
mod tests {
    use super::write;
    use crate::contents::testing::contents;
    use crate::open;
    use crate::testing::{Folder, refused};
    use wavesplat_core::source::OpenOptions;

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

    #[test]
    fn names_in_a_list_are_escaped() {
        let mut list = Vec::new();
        let names = ["a&b/1.vti", "a&b/2.vti", "a&b/3.vti"].map(String::from);
        write(&contents(), &mut names.into_iter(), &mut list).expect("written");
        let list = String::from_utf8(list).expect("text");
        assert!(list.contains(r#"timestep="0.75" part="0" file="a&amp;b/3.vti""#), "{list}");
    }
}
