//! What the user named as inputs, as a list of files in the order of time.

use super::format::{self, Format, SUPPORTED};
use super::{OpenOptions, numbering, pvd};
use crate::error::{Error, Result};
use std::collections::HashSet;
use std::fs;
use std::path::{Path, PathBuf};

/// The files of an archive, in order.
#[derive(Debug, Default)]
pub(super) struct Files {
    /// The files, at least one, none twice.
    pub(super) paths: Vec<PathBuf>,
    /// Time of each where a list says so, else empty.
    pub(super) times: Vec<f64>,
    /// What a user should know about how they were found.
    pub(super) notes: Vec<String>,
}

/// The files that the inputs stand for.
pub(super) fn expand(inputs: &[PathBuf], options: &OpenOptions) -> Result<Files> {
    let files = match inputs {
        [only] => expand_one(only, options)?,
        _ => Files { paths: listed(inputs)?, ..Files::default() },
    };
    refuse_twice(&files.paths)?;
    if files.times.is_empty() && !options.allow_gaps {
        numbering::check(&files.paths)?;
    }
    Ok(files)
}

fn expand_one(input: &Path, options: &OpenOptions) -> Result<Files> {
    if input.is_dir() {
        return directory(input, options);
    }
    if !input.exists() && is_pattern(input) {
        return Ok(Files { paths: matching(input)?, ..Files::default() });
    }
    match Format::by_name(input) {
        Some(Format::Pvd) => pvd::read(input),
        _ => Ok(Files { paths: vec![input.into()], ..Files::default() }),
    }
}

fn listed(inputs: &[PathBuf]) -> Result<Vec<PathBuf>> {
    if inputs.is_empty() {
        return Err(Error::usage("no input was given"));
    }
    for input in inputs {
        if input == Path::new(super::stream::NAME) {
            return Err(Error::usage("standard input (-) must be the only input"));
        }
        if input.is_dir() {
            return Err(Error::usage(format!("{}: a directory must be the only input", input.display())));
        }
        if !input.exists() && is_pattern(input) {
            return Err(Error::usage(format!("{}: a pattern must be the only input", input.display())));
        }
    }
    Ok(inputs.to_vec())
}

fn refuse_twice(paths: &[PathBuf]) -> Result<()> {
    let mut seen = HashSet::new();
    let plain = |p: &Path| p.components().filter(|c| !matches!(c, std::path::Component::CurDir)).collect::<PathBuf>();
    match paths.iter().find(|p| !seen.insert(plain(p))) {
        Some(path) => Err(Error::usage(format!("{}: is given twice", path.display()))),
        None => Ok(()),
    }
}

fn is_pattern(path: &Path) -> bool {
    path.to_string_lossy().contains(['*', '?', '['])
}

fn matching(pattern: &Path) -> Result<Vec<PathBuf>> {
    let refused = |what: String| Error::usage(format!("{}: {what}", pattern.display()));
    let text = pattern.to_str().ok_or_else(|| refused("a pattern must be UTF-8".into()))?;
    let rules =
        glob::MatchOptions { require_literal_separator: true, require_literal_leading_dot: true, ..Default::default() };
    let matches = glob::glob_with(text, rules).map_err(|e| refused(format!("is no valid pattern: {e}")))?;
    let mut paths = Vec::new();
    for path in matches {
        let path = path.map_err(|e| Error::io(e.path().to_path_buf(), "listing", e.into()))?;
        paths.extend(path.is_file().then_some(path));
    }
    if paths.is_empty() {
        return Err(refused("no file matches this pattern".into()));
    }
    alphanumeric_sort::sort_path_slice(&mut paths);
    Ok(paths)
}

fn directory(folder: &Path, options: &OpenOptions) -> Result<Files> {
    let all = visible_files(folder)?;
    let of = |format| all.iter().filter(move |p| Format::by_name(p) == Some(format));
    let lists: Vec<_> = of(Format::Pvd).collect();
    match lists[..] {
        [list] if options.dims.is_none() => return with_list(list),
        [a, b, ..] if of(Format::Vti).next().is_none() => {
            let what = format!("has several .pvd, {} and {}: name the one", name(a), name(b));
            return Err(Error::usage(format!("{}: {what}", folder.display())));
        }
        _ => {}
    }
    let frames = |p: &&PathBuf| match Format::by_name(p) {
        Some(Format::Npy | Format::Nrrd | Format::Vti) => options.dims.is_none(),
        Some(Format::Pvd | Format::Coefficients) => false,
        None => options.dims.is_some(),
    };
    let paths = one_extension(folder, all.iter().filter(frames).cloned().collect())?;
    Ok(Files { paths, ..Files::default() })
}

fn with_list(list: &Path) -> Result<Files> {
    let mut files = pvd::read(list)?;
    files.notes.push(format!("the frames and times are those of {}", list.display()));
    Ok(files)
}

fn visible_files(folder: &Path) -> Result<Vec<PathBuf>> {
    let failed = |e| Error::io(folder, "listing", e);
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let hidden = name(&path).starts_with('.');
        files.extend((!hidden && path.is_file()).then_some(path));
    }
    alphanumeric_sort::sort_path_slice(&mut files);
    Ok(files)
}

fn one_extension(folder: &Path, files: Vec<PathBuf>) -> Result<Vec<PathBuf>> {
    let Some(first) = files.first() else {
        let what = format!("has no file of frames. Supported are {SUPPORTED} if --dims and --dtype say what it is");
        return Err(Error::usage(format!("{}: {what}", folder.display())));
    };
    let extension = format::extension(first);
    if let Some(other) = files.iter().find(|p| format::extension(p) != extension) {
        let what = format!("mixes formats, for example {} and {}", name(first), name(other));
        return Err(Error::usage(format!("{}: {what}; a pattern such as '*.npy' chooses", folder.display())));
    }
    Ok(files)
}

fn name(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}
