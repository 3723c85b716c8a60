//! ParaView's `.vti.series` and the like: a list of files and their times, in JSON.

use super::format::{Format, Reader};
use serde::Deserialize;
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::files;
use wavesplat_core::source::Parsed;
use wavesplat_core::source::series::FrameFiles;

pub(crate) static FORMAT: Format = Format::new("list of files", &["series"], Reader::List(read));

#[derive(Deserialize)]
struct SeriesList {
    files: Vec<SeriesEntry>,
}

#[derive(Deserialize)]
struct SeriesEntry {
    name: String,
    time: Option<f64>,
}

/// Reads the list; its files are found from its own folder.
fn read(path: &Path) -> Result<FrameFiles> {
    let bytes = files::read(path)?;
    parse(&bytes, path.parent().unwrap_or(Path::new(""))).map_err(|e| Error::input(path, e))
}

fn parse(bytes: &[u8], folder: &Path) -> Parsed<FrameFiles> {
    let list: SeriesList = serde_json::from_slice(bytes).map_err(|e| format!("is no list of files and times: {e}"))?;
    if list.files.is_empty() {
        return Err("lists no file".into());
    }
    let times = list.files.iter().filter_map(|file| file.time).collect();
    let paths = list.files.iter().map(|file| folder.join(&file.name)).collect();
    FrameFiles { paths, times, notes: Vec::new() }.checked()
}

#[cfg(test)]
mod tests {
    use crate::open;
    use crate::testing::{Folder, check_inputs, payload, refused};
    use wavesplat_core::base::sample::SampleType;
    use wavesplat_core::source::OpenOptions;

    fn frames(folder: &Folder) -> Vec<String> {
        let text = "# vtk DataFile Version 3.0\n\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS 7 5 3\nPOINT_DATA 105\nSCALARS J char\n";
        let names = ["b.vtk", "a.vtk", "c.vtk"].map(String::from);
        for (t, name) in names.iter().enumerate() {
            folder.write(name, [text.as_bytes(), &payload(SampleType::I8, t..t + 1, true)].concat());
        }
        names.to_vec()
    }

    fn list(entries: &[String]) -> String {
        format!("{{\"file-series-version\": \"1.0\", \"files\": [{}]}}", entries.join(", "))
    }

    #[test]
    fn files_and_times_are_listed() {
        let folder = Folder::new();
        let entry = |(t, name): (usize, &String)| format!("{{\"name\": \"{name}\", \"time\": {}}}", t as f64 / 4.0);
        let entries: Vec<String> = frames(&folder).iter().enumerate().map(entry).collect();
        let file = folder.write("a.vtk.series", list(&entries));
        for input in [file, folder.path("")] {
            check_inputs(std::slice::from_ref(&input), &OpenOptions::default(), SampleType::I8, 3);
            assert_eq!(open(&[input], &OpenOptions::default()).expect("opening").archive().times, [0.0, 0.25, 0.5]);
        }
        let pvd = "<VTKFile type=\"Collection\"><DataSet timestep=\"7\" file=\"a.vtk\"/></VTKFile>";
        folder.write("a.pvd", pvd);
        let source = open(&[folder.path("")], &OpenOptions::default()).expect("opening");
        assert_eq!(source.archive().times, [7.0], "a .pvd comes first");
        let files = [folder.path("a.vtk.series"), folder.path("a.vtk")];
        refused(&files, &OpenOptions::default(), "a list of files must be the only input");
    }

    #[test]
    fn what_is_no_list_is_refused() {
        let folder = Folder::new();
        frames(&folder);
        let with = |text: String, words: &str| {
            refused(&[folder.write("a.vtk.series", text)], &OpenOptions::default(), words);
        };
        let entry = |name: &str, time: &str| format!("{{\"name\": \"{name}\"{time}}}");
        with("[".into(), "is no list of files and times");
        with(list(&[]), "lists no file");
        with(list(&[entry("a.vtk", ", \"time\": \"soon\"")]), "is no list");
        with(list(&[entry("a.vtk", ", \"time\": 1"), entry("b.vtk", "")]), "to some of its files only");
        with(list(&[entry("a.vtk", ", \"time\": 1"), entry("b.vtk", ", \"time\": 1")]), "two files for the time 1");
        with(list(&[entry("gone.vtk", "")]), "gone.vtk: opening");
        with(list(&[entry("a.vtk", ""), entry("a.vtk", "")]), "given twice");
    }
}
