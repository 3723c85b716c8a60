//! Expands the inputs of the user to a list of files in the order of time.

use super::{by_name, has_header, links};
use crate::format::{Format, Reader};
use crate::numbering::{self, Planes};
use crate::shared::extension::extension;
use crate::shared::links::{is_lost, lost};
use crate::zarr::metadata_file;
use crate::{file_series, vtk, vtk_xml};
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};
use wavesplat_core::base::address::refuse_frames;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::output::STANDARD;
use wavesplat_core::source::OpenOptions;
use wavesplat_core::source::series::FrameFiles;

/// The files of the inputs.
pub(crate) struct Expanded {
    pub(crate) files: FrameFiles,
    /// Whether each holds a plane of a frame.
    pub(crate) planes: Option<Planes>,
}

/// The files that the inputs stand for.
pub(crate) fn expand(inputs: &[PathBuf], options: &OpenOptions) -> Result<Expanded> {
    refuse_frames(inputs)?;
    let mut files = match inputs {
        [only] => expand_one(only, options)?,
        _ => FrameFiles { paths: listed(inputs)?, ..FrameFiles::default() },
    };
    refuse_twice(&files.paths)?;
    refuse_lost(&files.paths)?;
    let (is_sorted, is_checked) = (inputs.len() == 1 && files.times.is_empty(), !options.allow_gaps);
    if is_sorted && is_checked {
        numbering::check_one_series(&files.paths)?;
    }
    let planes = if is_sorted { numbering::sort(&mut files.paths)? } else { None };
    if files.times.is_empty() && is_checked && planes.is_none() {
        numbering::check(&files.paths)?;
    }
    Ok(Expanded { files, planes })
}

/// An error if a file is a link to one that is not there.
fn refuse_lost(paths: &[PathBuf]) -> Result<()> {
    match paths.iter().find(|path| is_lost(path)) {
        Some(path) => Err(lost(path)),
        None => Ok(()),
    }
}

/// Whether the inputs are files with headers.
pub(crate) fn have_headers(inputs: &[PathBuf], options: &OpenOptions) -> bool {
    let files = expand(inputs, &options.for_headers());
    files.is_ok_and(|all| has_header(&all.files.paths[0]))
}

/// The files that one name stands for, sorted naturally: those of a folder whose names end in `extension` (lower case,
/// no dot), those that match a pattern, or the one of that name, which need not exist.
///
/// # Errors
/// A folder that cannot be listed, an invalid pattern, and either without any such file.
pub fn files(input: &Path, extension: &str) -> Result<Vec<PathBuf>> {
    if !input.is_dir() {
        let is_pattern = !input.exists() && is_pattern(input);
        return if is_pattern { Ok(in_order(matching(input)?)) } else { Ok(vec![input.into()]) };
    }
    let mut files = visible_files(input)?;
    files.retain(|file| self::extension(file) == extension);
    if files.is_empty() {
        return Err(Error::path(input, format!("has no .{extension} file")));
    }
    Ok(in_order(files))
}

/// Files in the order of their numbers. Names that count several things stay in the order of their letters.
fn in_order(mut files: Vec<PathBuf>) -> Vec<PathBuf> {
    let _ = numbering::sort(&mut files);
    files
}

fn expand_one(input: &Path, options: &OpenOptions) -> Result<FrameFiles> {
    if input.is_dir() && metadata_file(input).is_none() {
        return directory(input, options);
    }
    if !input.exists() && is_pattern(input) {
        return Ok(FrameFiles { paths: frames_matching(input, options)?, ..FrameFiles::default() });
    }
    match by_name(input).map(|format| &format.reader) {
        Some(Reader::List(read)) => read(input),
        _ => Ok(FrameFiles { paths: vec![input.into()], ..FrameFiles::default() }),
    }
}

/// Whether a folder or a pattern stands for no file yet.
pub(super) fn is_empty(input: &Path, options: &OpenOptions) -> bool {
    if input.is_dir() {
        let holds = |all: Vec<PathBuf>| all.iter().any(|path| is_list(path) || is_frame(path, options));
        return metadata_file(input).is_none() && !visible_files(input).is_ok_and(holds);
    }
    let is_valid = |text: &str| glob::Pattern::new(text).is_ok();
    !input.exists() && input.to_str().is_some_and(is_valid) && frames_matching(input, options).is_err()
}

/// Whether a file lists others.
pub(super) fn is_list(path: &Path) -> bool {
    by_name(path).is_some_and(|format| matches!(format.reader, Reader::List(_)))
}

/// Whether a file of a folder is one of frames.
fn is_frame(path: &Path, options: &OpenOptions) -> bool {
    match by_name(path) {
        Some(format) => options.dims.is_none() && format.holds_frames(),
        None => options.dims.is_some() && !is_of_run(path, options),
    }
}

/// Whether a file is one that a run and its conversion need beside the frames.
fn is_of_run(path: &Path, options: &OpenOptions) -> bool {
    options.follow.as_ref().is_some_and(|follow| follow.is_end(path) || extension(path) == "part")
}

fn listed(inputs: &[PathBuf]) -> Result<Vec<PathBuf>> {
    if inputs.is_empty() {
        return Err(Error::setting("inputs", "no input was given"));
    }
    for input in inputs {
        if input == Path::new(STANDARD) {
            return Err(Error::path(STANDARD, "standard input must be the only input"));
        }
        if input.is_dir() {
            return Err(Error::path(input, "a directory must be the only input"));
        }
        if !input.exists() && is_pattern(input) {
            return Err(Error::path(input, "a pattern must be the only input"));
        }
    }
    Ok(inputs.to_vec())
}

fn refuse_twice(paths: &[PathBuf]) -> Result<()> {
    let mut seen = HashSet::new();
    let plain = |p: &Path| p.components().filter(|c| !matches!(c, std::path::Component::CurDir)).collect::<PathBuf>();
    match paths.iter().find(|p| !seen.insert(plain(p))) {
        Some(path) => Err(Error::path(path, "is given twice")),
        None => Ok(()),
    }
}

/// Whether a path that is not there is a pattern.
pub(super) fn is_pattern(path: &Path) -> bool {
    path.to_string_lossy().contains(['*', '?', '['])
}

/// The files that match a pattern, but for those that a run needs beside its frames.
fn frames_matching(pattern: &Path, options: &OpenOptions) -> Result<Vec<PathBuf>> {
    let mut paths = matching(pattern)?;
    paths.retain(|path| !is_of_run(path, options));
    if paths.is_empty() { Err(Error::path(pattern, "no file matches this pattern")) } else { Ok(paths) }
}

fn matching(pattern: &Path) -> Result<Vec<PathBuf>> {
    let refused = |what: String| Error::path(pattern, what);
    let text = pattern.to_str().ok_or_else(|| refused("a pattern must be UTF-8".into()))?;
    let rules =
        glob::MatchOptions { require_literal_separator: true, require_literal_leading_dot: true, ..Default::default() };
    let matches = glob::glob_with(text, rules).map_err(|e| refused(format!("is no valid pattern: {e}")))?;
    let mut paths = Vec::new();
    for path in matches {
        let path = path.map_err(|e| {
            let place = e.path().to_path_buf();
            Error::io(place, "listing", e.into())
        })?;
        paths.extend(may_be_file(&path).then_some(path));
    }
    if let Some(link) = links::lost_to(pattern, rules) {
        return Err(lost(&link));
    }
    if paths.is_empty() {
        return Err(refused("no file matches this pattern".into()));
    }
    alphanumeric_sort::sort_path_slice(&mut paths);
    Ok(paths)
}

/// Whether a path is a file, or a link that leads nowhere.
fn may_be_file(path: &Path) -> bool {
    path.is_file() || is_lost(path)
}

fn directory(folder: &Path, options: &OpenOptions) -> Result<FrameFiles> {
    let all = visible_files(folder)?;
    let in_format = |format: &'static Format| all.iter().filter(move |p| by_name(p).is_some_and(|own| own.is(format)));
    let mut lists: Vec<_> = in_format(&vtk_xml::PVD).collect();
    if lists.is_empty() {
        lists.extend(in_format(&file_series::FORMAT));
    }
    match lists[..] {
        [list] if options.dims.is_none() => {
            let mut files = expand_one(list, options)?;
            files.notes.push(format!("the frames and times are those of {}", list.display()).into());
            return Ok(files);
        }
        [a, b, ..] if in_format(&vtk_xml::VTI).chain(in_format(&vtk::FORMAT)).next().is_none() => {
            let what = format!("has several lists of files, {} and {}: name one of them", name(a), name(b));
            return Err(Error::path(folder, what));
        }
        _ => {}
    }
    let mut paths: Vec<PathBuf> = all.iter().filter(|path| is_frame(path, options)).cloned().collect();
    if paths.iter().any(|p| extension(p) == "pvti") {
        paths.retain(|p| extension(p) != "vti"); // the pieces
    }
    let paths = one_extension(folder, paths)?;
    Ok(FrameFiles { paths, ..FrameFiles::default() })
}

fn visible_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let failed = |e| Error::io(folder, "listing", e);
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let hidden = name(&path).starts_with('.');
        files.extend((!hidden && may_be_file(&path)).then_some(path));
    }
    alphanumeric_sort::sort_path_slice(&mut files);
    Ok(files)
}

fn one_extension(folder: &Path, files: Vec<PathBuf>) -> Result<Vec<PathBuf>> {
    let Some(first) = files.first() else {
        return Err(Error::path(folder, Note::with("has no file of frames", Remedy::DescribeSamples)));
    };
    let first_extension = extension(first);
    if let Some(other) = files.iter().find(|p| extension(p) != first_extension) {
        let what = format!("mixes formats, for example {} and {}", name(first), name(other));
        let pattern = folder.join(format!("*.{first_extension}"));
        let hint = format!("a pattern in quotes such as '{}' chooses", pattern.display());
        return Err(Error::path(folder, format!("{what}; {hint}")));
    }
    Ok(files)
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{DIMS, Folder, check_inputs, payload, refused};
    use wavesplat_core::base::sample::SampleType;
    use wavesplat_core::source::GivenTimes;

    const TY: SampleType = SampleType::U16;

    fn raw() -> OpenOptions {
        OpenOptions { dims: Some(DIMS.into()), sample: Some(TY), ..OpenOptions::default() }
    }

    fn frames(folder: &Folder, frames: std::ops::Range<usize>) -> Vec<PathBuf> {
        frames.map(|t| folder.write(&format!("f{t}.raw"), payload(TY, t..t + 1, false))).collect()
    }

    #[test]
    fn a_directory_and_a_pattern_are_sorted_by_number() {
        let folder = Folder::new();
        frames(&folder, 0..12);
        folder.write(".hidden.raw", "x");
        folder.write("a.wspl", "x");
        fs::create_dir(folder.path("f3.raw.d")).expect("folder");
        check_inputs(&[folder.path("")], &raw(), TY, 12);
        check_inputs(&[folder.path("f*.raw")], &raw(), TY, 12);
        check_inputs(&[folder.path("f?.raw")], &raw(), TY, 10);
    }

    #[test]
    fn one_name_stands_for_files_of_one_ending() {
        let folder = Folder::new();
        let pictures = ["f2.png", "f10.PNG"].map(|name| folder.write(name, "x"));
        folder.write("f3.txt", "x");
        assert_eq!(files(&folder.path(""), "png").expect("a folder"), pictures);
        assert_eq!(files(&folder.path("f?.png"), "png").expect("a pattern"), pictures[..1]);
        assert_eq!(files(&folder.path("gone.png"), "png").expect("a name"), [folder.path("gone.png")]);
        assert!(files(&folder.path(""), "npy").is_err() && files(&folder.path("g*.png"), "png").is_err());
    }

    #[test]
    fn a_list_is_taken_in_its_order() {
        let folder = Folder::new();
        let mut files = frames(&folder, 0..3);
        files.reverse();
        let listed = expand(&files, &raw()).expect("list");
        assert_eq!(listed.files.paths, files);
    }

    #[test]
    fn missing_frames_are_refused_unless_allowed() {
        let folder = Folder::new();
        let mut files = frames(&folder, 0..5);
        fs::remove_file(files.remove(3)).expect("removing");
        for inputs in [files.clone(), vec![folder.path("")], vec![folder.path("*.raw")]] {
            refused(&inputs, &raw(), "f2.raw is followed by f4.raw");
            let options = OpenOptions { allow_gaps: true, ..raw() };
            assert_eq!(crate::open(&inputs, &options).expect("gaps").archive().frames, Some(4));
        }
    }

    #[test]
    fn files_that_are_not_there_are_named() {
        let folder = Folder::new();
        let mut files = frames(&folder, 0..2);
        files.push(folder.path("f2.raw"));
        refused(&files, &raw(), "f2.raw: opening");
        refused(&[folder.path("gone.npy")], &OpenOptions::default(), "gone.npy: opening");
        refused(&[folder.path("g*.raw")], &raw(), "no file matches");
        refused(&[folder.path("[")], &raw(), "no valid pattern");
    }

    #[cfg(unix)]
    #[test]
    fn links_to_files_that_are_gone_are_named() {
        let folder = Folder::new();
        let files = frames(&folder, 0..3);
        let link = folder.path("f3.raw");
        std::os::unix::fs::symlink("/moved/away/f3.raw", &link).expect("a link");
        let listed: Vec<PathBuf> = files.iter().chain([&link]).cloned().collect();
        for inputs in [vec![folder.path("")], vec![folder.path("*.raw")], vec![folder.path("f?.raw")], listed] {
            refused(&inputs, &raw(), "f3.raw: is a link to /moved/away/f3.raw, which cannot be opened");
        }
        let inner = Folder::new();
        for t in 0..2 {
            fs::create_dir(inner.path(&format!("r{t}"))).expect("a folder");
            inner.write(&format!("r{t}/u.raw"), payload(TY, t..t + 1, false));
        }
        let pattern = [inner.path("r*/u.raw")];
        check_inputs(&pattern, &raw(), TY, 2);
        std::os::unix::fs::symlink("/moved/away", inner.path("r2")).expect("a link");
        refused(&pattern, &raw(), "r2: is a link to /moved/away");
        let list =
            folder.write("a.pvd", "<VTKFile type=\"Collection\"><DataSet timestep=\"7\" file=\"f3.raw\"/></VTKFile>");
        refused(&[list], &OpenOptions::default(), "f3.raw: is a link to");
    }

    #[test]
    fn files_of_planes_are_stacked() {
        let folder = Folder::new();
        let plane = DIMS[0] * DIMS[1] * 2;
        for t in 0..3 {
            for (z, bytes) in payload(TY, t..t + 1, false).chunks(plane).enumerate() {
                folder.write(&format!("img_z{z}_t{}.raw", 5 * t), bytes);
            }
        }
        let options = OpenOptions { dims: Some(vec![DIMS[0], DIMS[1], 1]), ..raw() };
        check_inputs(&[folder.path("")], &options, TY, 3);
        check_inputs(
            &[folder.path("*.raw")],
            &OpenOptions { spacing: Some([1.0, 2.0, 3.0]), ..options.clone() },
            TY,
            3,
        );
        let timed = OpenOptions { times: Some(GivenTimes::List(vec![0.0, 1.0, 4.0].into())), ..options.clone() };
        let source = crate::open(&[folder.path("")], &timed).expect("times of frames");
        assert_eq!(source.archive().times, [0.0, 1.0, 4.0]);
        fs::remove_file(folder.path("img_z1_t5.raw")).expect("removing");
        refused(&[folder.path("")], &options, "names count several things");
    }

    #[test]
    fn unclear_inputs_are_refused() {
        let folder = Folder::new();
        let files = frames(&folder, 0..2);
        let (a, b) = (files[0].clone(), files[1].clone());
        refused(&[], &raw(), "no input");
        refused(&[a.clone(), b.clone(), folder.path("./f0.raw")], &raw(), "given twice");
        refused(&[a.clone(), "-".into()], &raw(), "must be the only input");
        refused(&[a.clone(), folder.path("")], &raw(), "directory must be the only");
        refused(&[a.clone(), folder.path("*.raw")], &raw(), "pattern must be the only");
        refused(&[folder.path("")], &OpenOptions::default(), "has no file of frames");
        refused(&[folder.write("a.wspl", "x")], &OpenOptions::default(), "coefficient file already");
        folder.write("c.dat", payload(TY, 0..1, false));
        refused(&[folder.path("")], &raw(), "mixes formats, for example c.dat and f0.raw");
    }

    #[test]
    fn a_frame_unlike_the_first_is_named() {
        let folder = Folder::new();
        let mut files = frames(&folder, 0..2);
        files.push(folder.write("f2.raw", "short"));
        refused(&files, &raw(), "f2.raw: expected 210 bytes");
    }

    #[test]
    fn options_for_headerless_data_are_refused_elsewhere() {
        let folder = Folder::new();
        let file = [folder.write("a.npy", "x")];
        let headerless = format!("{} says itself what it holds; this is for headerless data", file[0].display());
        for (options, setting) in [
            (raw(), "dims"),
            (OpenOptions { offset: 1, ..OpenOptions::default() }, "offset"),
            (OpenOptions { big_endian: true, ..OpenOptions::default() }, "big_endian"),
            (OpenOptions { sample: Some(TY), ..OpenOptions::default() }, "sample"),
        ] {
            refused(&file, &options, &format!("{setting}: {headerless}"));
        }
        let named = OpenOptions { variable: Some("a".into()), ..OpenOptions::default() };
        refused(&file, &named, "a.npy has a single array without a name; leave this out");
    }
}
