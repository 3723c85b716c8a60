//! Archives written by other programs: `tests/golden/inputs`, whose README describes the files.

use crate::common::random::Random;
use crate::common::times;
use serde::Deserialize;
use std::path::{Path, PathBuf};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::grid::Grid;
use wavesplat::base::mapped::Access;
use wavesplat::base::sample::load;
use wavesplat::formats::open;
use wavesplat::source::{Archive, FrameSource, OpenOptions};

/// A case of `manifest.json`.
#[derive(Debug, Clone, Deserialize)]
struct Case {
    path: String,
    variable: Option<String>,
    #[serde(default)]
    refused: bool,
    #[serde(default)]
    may_refuse: bool,
    #[serde(default)]
    sample: String,
    #[serde(default)]
    sample_may_be: Vec<String>,
    #[serde(default)]
    frames: usize,
    #[serde(default)]
    dims: [usize; 3],
    spacing: Option<[f64; 3]>,
    origin: Option<[f64; 3]>,
    #[serde(default)]
    times: Vec<f64>,
    #[serde(default)]
    dates: Vec<String>,
    units: Option<String>,
    #[serde(default)]
    values: String,
    #[serde(default)]
    missing: Vec<[usize; 4]>,
    axes: Option<String>,
    #[serde(default)]
    may_lack: Vec<String>,
    components: Option<usize>,
    note: String,
}

fn folder() -> PathBuf {
    match std::env::var_os("WAVESPLAT_INPUTS") {
        Some(folder) => folder.into(),
        None => Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/inputs"),
    }
}

/// The cases of a format, and the errors found in reading them.
fn check_all(format: &str) {
    let text = std::fs::read_to_string(folder().join("manifest.json")).unwrap();
    let cases: Vec<Case> = serde_json::from_str(&text).unwrap();
    let cases: Vec<_> = cases.into_iter().filter(|case| case.path.split('/').next() == Some(format)).collect();
    assert!(cases.len() > 7, "{format} has cases");
    let wrong = |case: &Case| case.check().err().map(|e| format!("{} ({}): {e}", case.path, case.note));
    let wrong: Vec<_> = cases.iter().filter_map(wrong).collect();
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), cases.len(), wrong.join("\n"));
}

impl Case {
    /// Reads with and without a memory map, in memory and, if the file must be decoded, spooled to disk.
    fn check(&self) -> std::result::Result<(), String> {
        for (access, memory) in [(Access::Map, 1 << 20), (Access::Read, 1600)] {
            let opened = self.open(access, memory);
            let needs_more =
                opened.as_ref().err().is_some_and(|e| matches!(e, Error::Setting { setting: "memory", .. }));
            let found = match (if needs_more { self.open(access, 1 << 20) } else { opened }, self.refused) {
                (Ok(_), true) => return Err("was read".into()),
                (Err(e), true) => return if e.to_string().len() > 40 { Ok(()) } else { Err(e.to_string()) },
                (Err(_), false) if self.may_refuse => return Ok(()),
                (Err(e), false) => return Err(e.to_string()),
                (Ok(found), false) => found,
            };
            self.check_archive(found.archive())?;
            self.check_samples(found)?;
        }
        Ok(())
    }

    fn open(&self, access: Access, memory: usize) -> Result<Box<dyn FrameSource>> {
        let first = |name: &String| if self.components.is_some() { format!("{name}[0]") } else { name.clone() };
        let variable = self.variable.as_ref().map(first);
        let options = OpenOptions { access, memory, variable, axes: self.axes.clone(), ..OpenOptions::default() };
        let mut source = open(&[folder().join(&self.path)], &options)?;
        if self.refused {
            source.window(0, 1)?; // some errors appear only here
        }
        Ok(source)
    }

    fn check_archive(&self, found: &Archive) -> std::result::Result<(), String> {
        let of = |what: &str, found: String, expected: String, same: bool| match same {
            true => Ok(()),
            false => Err(format!("{what} {found}, not {expected}")),
        };
        let Archive { grid, sample, frames, times, units, .. } = found;
        let name = sample.name();
        let types = [vec![self.sample.clone()], self.sample_may_be.clone()].concat();
        of("type", name.into(), self.sample.clone(), types.iter().any(|ty| ty == name))?;
        of("size", format!("{:?}", grid.dims), format!("{:?}", self.dims), grid.dims == self.dims)?;
        of("frames", format!("{frames:?}"), self.frames.to_string(), *frames == Some(self.frames))?;
        let lacks = |key: &str| self.may_lack.iter().any(|lacking| lacking == key);
        for (key, found, expected, none) in
            [("spacing", grid.spacing, self.spacing, [1.0; 3]), ("origin", grid.origin, self.origin, [0.0; 3])]
        {
            let same = |expected: [f64; 3]| found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5);
            let good = expected.is_none_or(|e| same(e) || lacks(key) && same(none));
            of(key, format!("{found:?}"), format!("{expected:?}"), good)?;
        }
        let factor = match units.times.as_deref().unwrap_or_default() {
            unit if unit.starts_with("day") => 86400.0,
            unit if unit.starts_with("hour") => 3600.0,
            unit if unit.starts_with("ms") => 1e-3,
            _ => 1.0,
        };
        let same = times.len() == self.times.len()
            && times.iter().zip(&self.times).all(|(a, b)| (a * factor - b).abs() < 1e-6);
        let expected = format!("{:?}", self.times);
        of("times", format!("{times:?}"), expected, same || lacks("times") && times.is_empty())?;
        let dates = found.time_labels().dates();
        of("dates", format!("{dates:?}"), format!("{:?}", self.dates), self.dates.is_empty() || self.dates == dates)?;
        let same = units.samples == self.units || lacks("units") && units.samples.is_none();
        of("unit", format!("{:?}", units.samples), format!("{:?}", self.units), same)
    }

    /// Reads frames in windows of two, as boxes.
    fn check_samples(&self, mut source: Box<dyn FrameSource>) -> std::result::Result<(), String> {
        let (archive, whole) = (source.archive().clone(), Grid::unit(self.dims).whole());
        let is_missing = |v: f64| v.is_nan() || archive.missing.is_some_and(|m| m == v);
        for first in (0..self.frames).step_by(2) {
            let count = 2.min(self.frames - first);
            let window = source.window(first, count).map_err(|e| e.to_string())?;
            for frame in 0..count {
                let (mut bytes, mut values) =
                    (vec![0; whole.voxels() * archive.sample.size()], vec![0.0; whole.voxels()]);
                window.read_box(frame, &whole, &mut bytes).map_err(|e| e.to_string())?;
                load(archive.sample, &bytes, &mut values);
                for (voxel, found) in whole.iter().zip(values) {
                    let t = first + frame;
                    let number = (whole.index(voxel) + t) as f64;
                    let expected = if self.values == "float" { number / 4.0 - 3.0 } else { number };
                    let absent = self.missing.contains(&[t, voxel[0], voxel[1], voxel[2]]);
                    if if absent { !is_missing(found) } else { (found - expected).abs() > 1e-4 } {
                        return Err(format!("{found} at {voxel:?} of frame {t}, not {expected} (missing: {absent})"));
                    }
                }
            }
            window.check_unchanged().map_err(|e| e.to_string())?;
        }
        Ok(())
    }
}

/// The files that a case's path refers to.
fn files(path: &Path) -> Vec<PathBuf> {
    match std::fs::read_dir(path) {
        Ok(entries) => entries.flat_map(|entry| files(&entry.unwrap().path())).collect(),
        Err(_) => vec![path.into()],
    }
}

/// Copies a folder.
fn copy(from: &Path, to: &Path) {
    for file in files(from) {
        let name = to.join(file.strip_prefix(from).unwrap());
        std::fs::create_dir_all(name.parent().unwrap()).unwrap();
        std::fs::copy(&file, name).unwrap();
    }
}

/// Changes, cuts or repeats some bytes of every file of a format. Each file must be read or refused without a panic.
fn check_damaged(format: &str) {
    let work = tempfile::tempdir().unwrap();
    copy(&folder().join(format), work.path());
    let mut random = Random(format.len() as u64);
    for file in files(work.path()) {
        let good = std::fs::read(&file).unwrap();
        for _ in 0..4 * times() {
            std::fs::write(&file, damaged(&good, &mut random)).unwrap();
            let near = file.ancestors().take_while(|path| *path != work.path());
            for path in near {
                let options = OpenOptions { memory: 1 << 20, ..OpenOptions::default() };
                let Ok(mut source) = open(&[path.into()], &options) else { continue };
                let whole = source.archive().grid.whole();
                let frames = source.archive().frames.unwrap_or(0).min(4);
                if whole.voxels() < 1 << 16
                    && let Ok(window) = source.window(0, frames)
                {
                    let mut out = vec![0; whole.voxels() * source.archive().sample.size()];
                    (0..frames).for_each(|frame| drop(window.read_box(frame, &whole, &mut out)));
                }
            }
        }
        std::fs::write(&file, good).unwrap();
    }
}

fn damaged(good: &[u8], random: &mut Random) -> Vec<u8> {
    let mut bad = good.to_vec();
    for _ in 0..1 + random.below(4) {
        let at = random.below(bad.len().max(1));
        match random.below(8) {
            0 => bad.truncate(at),
            1 if at + 8 <= bad.len() => bad[at..at + 8].copy_from_slice(&[0xff; 8]),
            2 if at + 4 <= bad.len() => bad[at..at + 4].copy_from_slice(&[0; 4]),
            3 => bad.extend_from_within(at..),
            _ if at < bad.len() => bad[at] ^= 1 << random.below(8),
            _ => {}
        }
    }
    bad
}

#[test]
fn damaged_files_are_read_or_refused() {
    for format in ["npy", "npz", "metaimage", "vtk", "vti", "vtr", "nifti", "nrrd"] {
        check_damaged(format);
    }
}

#[test]
#[cfg_attr(not(feature = "netcdf"), ignore = "needs the feature netcdf")]
fn damaged_files_of_arrays_are_read_or_refused() {
    for format in ["vtkhdf", "hdf5", "netcdf"] {
        check_damaged(format);
    }
}

#[test]
#[cfg_attr(not(feature = "tiff"), ignore = "needs the feature tiff")]
fn damaged_tiff_files_are_read_or_refused() {
    check_damaged("tiff");
}

#[test]
fn npy_is_read() {
    check_all("npy");
}

#[test]
fn npz_is_read() {
    check_all("npz");
}

#[test]
fn metaimage_is_read() {
    check_all("metaimage");
}

#[test]
fn vtk_is_read() {
    check_all("vtk");
}

#[test]
fn vti_is_read() {
    check_all("vti");
}

#[test]
fn vtr_is_read() {
    check_all("vtr");
}

#[test]
#[cfg_attr(not(feature = "hdf5"), ignore = "needs the feature hdf5")]
fn vtkhdf_is_read() {
    check_all("vtkhdf");
}

#[test]
fn nifti_is_read() {
    check_all("nifti");
}

#[test]
fn nrrd_is_read() {
    check_all("nrrd");
}

#[test]
#[cfg_attr(not(feature = "tiff"), ignore = "needs the feature tiff")]
fn tiff_is_read() {
    check_all("tiff");
}

#[test]
#[cfg_attr(not(feature = "hdf5"), ignore = "needs the feature hdf5")]
fn hdf5_is_read() {
    check_all("hdf5");
}

#[test]
#[cfg_attr(not(feature = "netcdf"), ignore = "needs the feature netcdf")]
fn netcdf_is_read() {
    check_all("netcdf");
}

#[test]
#[cfg_attr(not(feature = "zarr"), ignore = "needs the feature zarr")]
fn zarr_is_read() {
    check_all("zarr");
}
