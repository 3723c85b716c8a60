//! Describes several coefficient files as one data set: the variables of a run, or its parts.

use super::InfoArgs;
use crate::print;
use serde::Serialize;
use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use wavesplat_core::base::address::{is_address, public_name};
use wavesplat_core::base::error::Result;
use wavesplat_engine::file::report::BoundReport;
use wavesplat_engine::file::{CoefficientFile, time_labels};
use wavesplat_formats::{extension_of_frames, files};
use wavesplat_jobs::picture::is_coefficient_name;

/// The keys of `--json`.
#[derive(Debug, Serialize)]
struct Collection {
    files: Vec<Member>,
    /// Names of variables; the name of the file for one without a name.
    variables: BTreeSet<String>,
    /// What all files share; null where they differ.
    dims: Option<[u64; 3]>,
    spacing: Option<[f64; 3]>,
    origin: Option<[f64; 3]>,
    frames: Option<u64>,
    times: Option<Vec<f64>>,
    #[serde(skip)]
    span: Option<String>,
    bytes: u64,
    raw_bytes: u64,
}

/// One file.
#[derive(Debug, Serialize)]
struct Member {
    path: PathBuf,
    variable: String,
    sample: &'static str,
    dims: [u64; 3],
    spacing: [f64; 3],
    origin: [f64; 3],
    frames: u64,
    times: Vec<f64>,
    #[serde(skip)]
    span: Option<String>,
    bytes: u64,
    raw_bytes: u64,
    #[serde(flatten)]
    promise: BoundReport,
}

/// The coefficient files, if the inputs are several or a folder of nothing else; else none.
pub(super) fn coefficient_files(inputs: &[PathBuf]) -> Result<Vec<PathBuf>> {
    match inputs {
        [folder] if folder.is_dir() => {
            let is_frame = |entry: std::io::Result<std::fs::DirEntry>| {
                entry.is_ok_and(|entry| extension_of_frames(&entry.path()).is_some())
            };
            let has_frames = || folder.read_dir().is_ok_and(|mut all| all.any(is_frame));
            Ok(files(folder, "wspl").ok().filter(|_| !has_frames()).unwrap_or_default())
        }
        [pattern] if !is_address(pattern) && !pattern.exists() && is_coefficient_name(pattern) => {
            match files(pattern, "wspl")? {
                only if only == inputs => Ok(Vec::new()), // no pattern
                found => Ok(found),
            }
        }
        several if several.len() > 1 && several.iter().all(|path| is_coefficient_name(path)) => Ok(several.to_vec()),
        _ => Ok(Vec::new()),
    }
}

pub(super) fn run(paths: &[PathBuf], args: &InfoArgs) -> Result<()> {
    let open = |path: &PathBuf| Ok(Member::new(path, &args.remote.open(path, args.input.access())?));
    let members = paths.iter().map(open).collect::<Result<_>>()?;
    let all = Collection::new(members);
    if args.common.json { args.common.report(&all, false) } else { print(&all.text()) }
}

impl Member {
    fn new(path: &Path, file: &CoefficientFile) -> Self {
        let path = public_name(path);
        let m = file.metadata();
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        Self {
            variable: m.variable.clone().unwrap_or_else(|| stem.into()),
            path,
            sample: m.sample.name(),
            dims: m.dims,
            spacing: m.spacing,
            origin: m.origin,
            frames: m.frames,
            times: m.times.clone(),
            span: time_labels(m).span(),
            bytes: file.bytes(),
            raw_bytes: m.dims.iter().product::<u64>() * m.frames * file.of_source().0.size() as u64,
            promise: BoundReport::from_metadata(m),
        }
    }
}

/// What all files share.
fn shared<T: PartialEq + Clone>(files: &[Member], of: impl Fn(&Member) -> &T) -> Option<T> {
    let first = of(files.first()?);
    files.iter().all(|file| of(file) == first).then(|| first.clone())
}

impl Collection {
    fn new(files: Vec<Member>) -> Self {
        Self {
            variables: files.iter().map(|file| file.variable.clone()).collect(),
            dims: shared(&files, |file| &file.dims),
            spacing: shared(&files, |file| &file.spacing),
            origin: shared(&files, |file| &file.origin),
            frames: shared(&files, |file| &file.frames),
            times: shared(&files, |file| &file.times),
            span: shared(&files, |file| &file.span).flatten(),
            bytes: files.iter().map(|file| file.bytes).sum(),
            raw_bytes: files.iter().map(|file| file.raw_bytes).sum(),
            files,
        }
    }

    fn text(&self) -> String {
        let ratio = self.raw_bytes as f64 / self.bytes as f64;
        let (count, variables) = (self.files.len(), self.variables.len());
        let mut text = format!(
            "data set   {count} files, {variables} variable(s), {} bytes, {ratio:.1}x smaller than raw\n",
            self.bytes
        );
        let volume = self.dims.map_or("of different sizes".into(), |[x, y, z]| format!("{x} x {y} x {z} voxels"));
        let place = |what: &str, value: Option<[f64; 3]>| {
            value.map_or(format!("different {what}s"), |value| format!("{what} {value:?}"))
        };
        let (spacing, origin) = (place("spacing", self.spacing), place("origin", self.origin));
        let _ = writeln!(text, "volume     {volume}, {spacing}, {origin}");
        let frames = self.frames.map_or("different numbers of".into(), |frames| frames.to_string());
        let times = match (&self.times, &self.span) {
            (None, _) => ", at different times".into(),
            (Some(_), Some(span)) => format!(", {span}"),
            (Some(_), None) => String::new(),
        };
        let _ = writeln!(text, "frames     {frames} frames{times}");
        let width = self.files.iter().map(|file| file.variable.chars().count()).max().unwrap_or(0);
        self.files.iter().for_each(|file| text += &self.line(file, width));
        text
    }

    /// One file: what it has of its own.
    fn line(&self, file: &Member, width: usize) -> String {
        let ratio = file.raw_bytes as f64 / file.bytes as f64;
        let unit = file.promise.units.as_ref().map_or(String::new(), |unit| format!(" in {unit}"));
        let [x, y, z] = file.dims;
        let dims = if self.dims.is_none() { format!(", {x} x {y} x {z} voxels") } else { String::new() };
        let frames = if self.frames.is_none() { format!(", {} frames", file.frames) } else { String::new() };
        let times =
            file.span.as_ref().filter(|_| self.times.is_none()).map_or(String::new(), |span| format!(", {span}"));
        format!(
            "  {:width$}  {}{unit}{dims}{frames}{times}, {} bytes ({ratio:.1}x), {}: {}  [{}]\n",
            file.variable,
            file.sample,
            file.bytes,
            file.promise.bound,
            file.promise.promise,
            file.path.display()
        )
    }
}
