//! The measurements of an archive: a list of tasks, each with the key of its result.

use super::convert::{Conversion, Scheme};
use super::view::{Method, View};
use super::work::{Task, Work};
use crate::bench::camera::{CameraSettings, compared_frames};
use crate::bench::size::Data;
use std::path::{Path, PathBuf};
use wavesplat::render::default_splat_error;

/// A scheme and a tolerance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Coded {
    pub(super) scheme: Scheme,
    /// Share of the value range.
    pub(super) tolerance: f64,
}

impl Coded {
    pub(super) fn name(&self) -> String {
        format!("{} {:e}", self.scheme.name(), self.tolerance)
    }

    /// The program's default splat error.
    fn splat_error(&self) -> f64 {
        default_splat_error(Some(self.tolerance))
    }
}

/// The measurements of an archive.
pub(super) struct Plan<'a> {
    pub(super) data: &'a Data,
    /// The default scheme at every tolerance, then Haar.
    pub(super) files: Vec<Coded>,
    /// Pixels from a voxel to the next.
    pub(super) spacings: &'a [f64],
    pub(super) threads: &'a [usize],
    /// Pixels a side of a picture.
    pub(super) size: usize,
    /// Where coefficient files go.
    pub(super) folder: &'a Path,
}

pub(super) type Tasks = Vec<(String, Task)>;

/// Limits of looser views, as shares of the value range.
pub(super) const LOOSER: [f64; 5] = [1e-3, 3e-3, 1e-2, 3e-2, 1e-1];
/// Shares of the volume that a region has.
const REGIONS: [f64; 4] = [0.01, 0.03, 0.1, 0.3];
/// How many times closer a close-up is.
const ZOOMS: [f64; 3] = [2.0, 4.0, 10.0];

/// The keys of the first file's view and the finest file's that parts and looser views are compared with.
pub(super) const WHOLE: &str = "whole";
pub(super) const FINEST: &str = "whole finest";

/// A key for measurements that depend on a file, a spacing, or neither.
pub(super) fn key(what: &str, file: Option<&Coded>, spacing: Option<f64>, threads: usize) -> String {
    let file = file.map_or(String::new(), |f| format!(" {}", f.name()));
    let spacing = spacing.map_or(String::new(), |s| format!(" {s} px"));
    format!("{what}{file}{spacing} x{threads}")
}

impl Plan<'_> {
    fn path(&self, file: &Coded) -> PathBuf {
        self.folder.join(format!("{}.wspl", file.name().replace(' ', "-")))
    }

    /// As long as the archive where that is a window of both bases, else the usual one.
    fn window(&self) -> usize {
        let frames = self.data.frames;
        if frames.is_power_of_two() && (2..=64).contains(&frames) { frames } else { 32 }
    }

    fn conversion(&self, file: &Coded) -> Conversion {
        let Coded { scheme, tolerance } = *file;
        let (source, output) = (self.data.path.clone(), self.path(file));
        Conversion { source, scheme, window: self.window(), tolerance, range: self.data.range, output }
    }

    fn view(&self, method: Method, file: Option<&Coded>, spacing: f64) -> View {
        let camera = CameraSettings { azimuth: 30.0, elevation: 30.0, size: self.size, scale: spacing };
        View {
            input: file.map_or(self.data.path.clone(), |f| self.path(f)),
            method,
            camera,
            // The conventional forms may add as much as the loosest file's.
            splat_error: file.unwrap_or(&self.files[0]).splat_error(),
            frames: (0..self.data.frames).collect(),
            region: None,
            allowed: None,
            cold: false,
        }
    }

    /// Whether the textbook form can read the archive.
    pub(super) fn has_textbook(&self) -> bool {
        self.data.samples == "f32"
    }

    /// Why there is nothing under the keys of the textbook form, where it cannot read the archive.
    pub(super) fn without_textbook(&self) -> Vec<(String, String)> {
        let why = || "not measured: the table of footprints takes f32 samples alone".to_string();
        let all = self.threads.iter().flat_map(|t| self.spacings.iter().map(|s| key("textbook", None, Some(*s), *t)));
        if self.has_textbook() { Vec::new() } else { all.map(|key| (key, why())).collect() }
    }

    /// The conventional methods, with the word for each in keys.
    fn conventional(&self) -> Vec<(&'static str, Method)> {
        let all = [("direct", Method::Direct), ("textbook", Method::Textbook), ("set-up", Method::TextbookSetUp)];
        all.into_iter().filter(|(_, m)| *m == Method::Direct || self.has_textbook()).collect()
    }

    /// Everything that is measured in turns: first the files are made.
    pub(super) fn tasks(&self) -> Tasks {
        self.threads.iter().flat_map(|threads| self.tasks_with(*threads)).collect()
    }

    fn tasks_with(&self, threads: usize) -> Tasks {
        let task = |what: &str, file, spacing, work| (key(what, file, spacing, threads), Task { threads, work });
        let mut tasks = vec![task("read", None, None, Work::Read(self.data.path.clone()))];
        for file in &self.files {
            tasks.push(task("convert", Some(file), None, Work::Convert(self.conversion(file))));
            tasks.push(task("codes", Some(file), None, Work::Codes(self.path(file))));
            tasks.push(task("payloads", Some(file), None, Work::Payloads(self.path(file))));
        }
        for spacing in self.spacings.iter().copied() {
            let view = |method, file| Work::View(self.view(method, file, spacing));
            for (what, method) in self.conventional() {
                tasks.push(task(what, None, Some(spacing), view(method, None)));
            }
            for file in &self.files {
                tasks.push(task("view", Some(file), Some(spacing), view(Method::Codes, Some(file))));
                if file.scheme == Scheme::Auto {
                    tasks.push(task("values", Some(file), Some(spacing), view(Method::Values, Some(file))));
                }
            }
        }
        tasks
    }

    /// Views with nothing cached, of the frames by the method that `best` names for a spacing and a number of threads.
    pub(super) fn cold(&self, best: impl Fn(f64, usize) -> &'static str) -> Tasks {
        let mut tasks = Vec::new();
        for (threads, spacing) in self.threads.iter().flat_map(|t| self.spacings.iter().map(|s| (*t, *s))) {
            let mut add = |what: &str, file: Option<&Coded>, method| {
                let view = View { cold: true, ..self.view(method, file, spacing) };
                tasks.push((key(what, file, Some(spacing), threads), Task { threads, work: Work::View(view) }));
            };
            let method = if best(spacing, threads) == "textbook" { Method::Textbook } else { Method::Direct };
            add("cold frames", None, method);
            self.files.iter().for_each(|file| add("cold view", Some(file), Method::Codes));
        }
        tasks
    }

    /// The file of the default scheme with the smallest tolerance.
    pub(super) fn finest(&self) -> &Coded {
        let of_auto = self.files.iter().filter(|f| f.scheme == Scheme::Auto);
        of_auto.min_by(|a, b| a.tolerance.total_cmp(&b.tolerance)).unwrap_or(&self.files[0])
    }

    fn looser(&self, limit: f64) -> View {
        let allowed = Some(limit * (self.data.range.1 - self.data.range.0));
        View { allowed, ..self.view(Method::Codes, Some(self.finest()), self.spacings[0]) }
    }

    /// Parts of the first file's view, and looser views of the finest file.
    pub(super) fn curves(&self) -> Tasks {
        let (file, spacing, mut views) = (&self.files[0], self.spacings[0], Vec::new());
        let whole = self.view(Method::Codes, Some(file), spacing);
        let counts = std::iter::successors(Some(1), |n| (2 * n < self.window()).then_some(2 * n));
        views.extend(counts.map(|n| (format!("frames {n}"), View { frames: (0..n).collect(), ..whole.clone() })));
        for share in REGIONS {
            views.push((
                format!("region {share}"),
                View { region: Some(middle(self.data.dims, share)), ..whole.clone() },
            ));
        }
        for zoom in ZOOMS {
            let camera = CameraSettings { scale: spacing * zoom, ..whole.camera };
            views.push((format!("close-up {zoom}"), View { camera, ..whole.clone() }));
        }
        views.extend(LOOSER.map(|limit| (format!("looser {limit:e}"), self.looser(limit))));
        views.push((WHOLE.into(), whole));
        views.push((FINEST.into(), View { allowed: None, ..self.looser(0.0) }));
        let conventional = self.conventional().into_iter().filter(|(_, m)| *m != Method::TextbookSetUp);
        views.extend(conventional.map(|(name, m)| (format!("whole {name}"), self.view(m, None, spacing))));
        let threads = self.threads[0];
        views.into_iter().map(|(key, view)| (key, Task { threads, work: Work::View(view) })).collect()
    }

    /// Pictures of a few frames against exact ones: of every file of the default scheme against its own; of the
    /// conventional forms, the finest file and looser views of it against the archive's.
    pub(super) fn comparisons(&self) -> Tasks {
        let few = |view: View| View { frames: compared_frames(self.data.frames), ..view };
        let exact = |view: View| View { splat_error: 0.0, allowed: None, ..few(view) };
        let mut tasks = Vec::new();
        for (file, spacing) in self.files.iter().flat_map(|f| self.spacings.iter().map(move |s| (f, *s))) {
            let view = self.view(Method::Codes, Some(file), spacing);
            if file.scheme == Scheme::Auto {
                let name = key("errors", Some(file), Some(spacing), 0);
                tasks.push((name, Work::Compare(exact(view.clone()), vec![few(view)])));
            }
        }
        let frames = |method| self.view(method, None, self.spacings[0]);
        let mut others = vec![few(self.view(Method::Codes, Some(self.finest()), self.spacings[0]))];
        others.extend(LOOSER.map(|limit| few(self.looser(limit))));
        others.push(few(frames(Method::Direct)));
        others.extend(self.has_textbook().then(|| few(frames(Method::Textbook))));
        tasks.push(("true errors".into(), Work::Compare(exact(frames(Method::Direct)), others)));
        let threads = self.threads.iter().copied().max().unwrap_or(1);
        tasks.into_iter().map(|(key, work)| (key, Task { threads, work })).collect()
    }
}

/// A box in the middle of a volume with about this share of it.
fn middle(dims: [usize; 3], share: f64) -> [[usize; 3]; 2] {
    let side = dims.map(|n| ((n as f64 * share.cbrt()).round() as usize).clamp(1, n));
    let start: [usize; 3] = std::array::from_fn(|a| (dims[a] - side[a]) / 2);
    [start, std::array::from_fn(|a| start[a] + side[a])]
}

#[cfg(test)]
mod tests {
    use super::middle;

    #[test]
    fn the_middle_has_its_share() {
        assert_eq!(middle([100, 50, 10], 0.125), [[25, 12, 2], [75, 37, 7]]);
        assert_eq!(middle([1, 2, 3], 1e-9), [[0, 0, 1], [1, 1, 2]]);
    }
}
