//! All pictures of a view, by any method.

use super::cold;
use super::measured::{Measured, Stopwatch, Time};
use crate::bench::camera::{CameraSettings, SIGMA};
use crate::bench::plan::TEXTBOOK_CUT;
use crate::bench::stages::MEMORY;
use crate::bench::textbook;
use serde::{Deserialize, Serialize};
use std::hint::black_box;
use std::path::PathBuf;
use wavesplat::base::error::Result;
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::progress::Silent;
use wavesplat::file::CoefficientFile;
use wavesplat::formats;
use wavesplat::render::{CoefficientScene, FrameScene, Limit, RenderConfig, Scene, SplatSource, render};
use wavesplat::source::{FrameSource, OpenOptions};
use wavesplat::view::camera::Camera;
use wavesplat::view::footprint::Kernel;

/// What to show.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct View {
    /// A coefficient file, or an archive.
    pub(super) input: PathBuf,
    pub(super) method: Method,
    pub(super) camera: CameraSettings,
    /// The error that splatting may add, as a share of the value range.
    pub(super) splat_error: f64,
    pub(super) frames: Vec<usize>,
    /// A box of voxels; by default all.
    pub(super) region: Option<[[usize; 3]; 2]>,
    /// The limit of the expected root mean square error of the pixels, in the samples' unit.
    pub(super) allowed: Option<f64>,
    /// Whether to drop the input from the system's cache first.
    pub(super) cold: bool,
}

/// How pictures are made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Method {
    /// From a file, by what it stores.
    Codes,
    /// From a file, decoded frame by frame.
    Values,
    /// From an archive, by the library.
    Direct,
    /// From an archive, by a table of footprints.
    Textbook,
    /// Only the set-up of the table, before the first frame.
    TextbookSetUp,
}

/// A view faster than this many seconds is made again, so that the first one's costs are not counted.
const FAST: f64 = 3.0;

/// The times of a view from opening its input, and of further ones.
pub(super) fn measure(view: &View) -> Result<Measured> {
    if view.cold {
        cold::forget(&view.input)?;
    }
    let stored = cold::from_storage();
    let watch = Stopwatch::start();
    let mut opened = Opened::new(view)?;
    let (mut shown, mut further) = Stopwatch::time(|| opened.show(view, &mut ignore))?;
    let time = watch.read();
    let from_storage = cold::from_storage().zip(stored).map(|(after, before)| after - before);
    for _ in 0..2 {
        if view.cold || further.wall > FAST {
            break;
        }
        let (again, time) = Stopwatch::time(|| opened.show(view, &mut ignore))?;
        shown = if time.processor < further.processor { again } else { shown };
        further = further.least(time);
    }
    let seen = Some(opened.seen(view)?);
    Ok(Measured { from_storage: from_storage.filter(|_| view.cold), seen, ..measured(time, further, shown) })
}

fn ignore(_: usize, picture: &[f32]) {
    black_box(picture);
}

fn measured(time: Time, further: Time, shown: Shown) -> Measured {
    let Shown { splatting, method, bytes } = shown;
    Measured { time, further: Some(further), splatting, method: Some(method), bytes, ..Measured::default() }
}

/// How far the pictures of `others` are from those of `truth`, where both show something.
pub(super) fn compare(truth: &View, others: &[View]) -> Result<Measured> {
    let truth = pictures(truth)?;
    let brightest = truth.iter().filter(|p| !p.is_nan()).map(|p| f64::from(p.abs())).fold(0.0, f64::max);
    let error = |view: &View| {
        let found = pictures(view)?;
        let off = found.iter().zip(&truth).map(|(a, b)| f64::from(a - b) / brightest).filter(|d| !d.is_nan());
        let (count, squares, largest) =
            off.fold((0, 0.0, 0.0_f64), |(n, squares, most), d| (n + 1, squares + d * d, most.max(d.abs())));
        Ok((largest, (squares / f64::from(count.max(1))).sqrt()))
    };
    let errors = others.iter().map(error).collect::<Result<Vec<(f64, f64)>>>()?;
    Ok(Measured { errors, ..Measured::default() })
}

fn pictures(view: &View) -> Result<Vec<f32>> {
    let mut all = Vec::new();
    Opened::new(view)?.show(view, &mut |frame, picture| {
        // The textbook form renders all frames up to the last.
        if view.frames.contains(&frame) {
            all.extend_from_slice(picture);
        }
    })?;
    Ok(all)
}

enum Opened {
    Library(Box<dyn Scene>),
    Textbook(Box<dyn FrameSource>),
}

/// The renderer's report about a view.
struct Shown {
    splatting: Option<f64>,
    method: String,
    bytes: u64,
}

impl Opened {
    fn new(view: &View) -> Result<Self> {
        let frames = || formats::open(std::slice::from_ref(&view.input), &OpenOptions::default());
        let file = |what| {
            let file = CoefficientFile::open(&view.input)?;
            Ok(Self::Library(Box::new(CoefficientScene::new(file, what))))
        };
        match view.method {
            Method::Codes => file(SplatSource::Coefficients),
            Method::Values => file(SplatSource::Samples),
            Method::Direct => Ok(Self::Library(Box::new(FrameScene::new(frames()?, None)))),
            Method::Textbook | Method::TextbookSetUp => Ok(Self::Textbook(frames()?)),
        }
    }

    fn show(&mut self, view: &View, sink: &mut dyn FnMut(usize, &[f32])) -> Result<Shown> {
        match self {
            Self::Library(scene) => by_library(scene.as_mut(), view, sink),
            Self::Textbook(source) => {
                let last = view.frames.last().map_or(0, |f| f + 1);
                let frames = if view.method == Method::TextbookSetUp { 0 } else { last };
                textbook::render(source.as_mut(), frames, &view.camera, TEXTBOOK_CUT, sink)?;
                Ok(Shown { splatting: None, method: format!("table-{TEXTBOOK_CUT}"), bytes: 0 })
            }
        }
    }

    /// The share of the voxels that are in the region and in the picture.
    fn seen(&self, view: &View) -> Result<f64> {
        let grid = match self {
            Self::Library(scene) => *scene.grid(),
            Self::Textbook(source) => source.archive().grid,
        };
        let camera = Camera::new(&view.camera.view(), &grid)?;
        let inside = |voxel: &[usize; 3]| {
            let [x, y, _] = camera.project(grid.position(*voxel));
            [x, y].iter().all(|c| (0.0..view.camera.size as f64).contains(c))
        };
        let region = region(view, &grid);
        Ok(region.iter().filter(inside).count() as f64 / grid.whole().voxels() as f64)
    }
}

fn region(view: &View, grid: &Grid) -> Region {
    view.region.map_or(grid.whole(), |[start, end]| Region { start, end })
}

fn by_library(scene: &mut dyn Scene, view: &View, sink: &mut dyn FnMut(usize, &[f32])) -> Result<Shown> {
    let config = RenderConfig {
        kernel: Kernel::new(Some(SIGMA), 0.0, scene.grid())?,
        frames: view.frames.clone(),
        region: view.region.map(|_| region(view, scene.grid())),
        splat_error: view.splat_error,
        fast: false,
        allowed: view.allowed,
        error: Limit::Expected,
        memory: MEMORY,
        ..RenderConfig::new(scene, view.camera.view())
    };
    let report = render(scene, &config, &Silent, &mut |rendered| {
        sink(rendered.frame, rendered.picture);
        Ok(())
    })?;
    let splatting = Some((report.decode_seconds + report.splat_seconds) / report.seconds);
    Ok(Shown { splatting, method: report.views[0].method.into(), bytes: report.bytes_read })
}
