//! Overviews against whole decoding: the reference extracts every sample, and picks those that an overview takes.

use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::series::{KINDS, Kind, Mask, volume};
use crate::common::{MEMORY, extracted, settings, stored, windows};
use std::sync::Mutex;
use wavesplat::base::progress::{Progress, Silent};
use wavesplat::base::sample::{SampleType, load};
use wavesplat::convert::{Basis, ConvertConfig};
use wavesplat::render::{
    CoefficientScene, FrameScene, OverviewRequest, RenderConfig, Scene, SplatSource, Thinning, stride,
};
use wavesplat::view::camera::View;
use wavesplat::{Grid, Region};

const DIMS: [usize; 3] = [23, 14, 17];
const FRAMES: usize = 34;

fn archive(kind: Kind, ty: SampleType, mask: Mask, seed: u64) -> Memory {
    let grid = Grid { spacing: [1.0, 0.5, 2.0], ..Grid::unit(DIMS) };
    Memory::new(grid, ty, volume(kind, ty, mask, DIMS.iter().product(), FRAMES, seed))
}

/// Voxels that an overview takes along an axis: in each block of `edge` voxels, every `stride`-th from the first.
fn taken(axis: usize, edge: usize, stride: usize) -> Vec<usize> {
    let blocks = (0..DIMS[axis]).step_by(edge);
    blocks.flat_map(|first| (first..(first + edge).min(DIMS[axis])).step_by(stride)).collect()
}

/// The samples that an overview takes from whole frames; NaN for those that are missing.
fn picked(samples: &[u8], ty: SampleType, declared: Option<f64>, request: &OverviewRequest<'_>) -> Vec<f32> {
    let Thinning { blocks, stride } = request.thinning;
    let mut values = vec![0.0; samples.len() / ty.size()];
    load(ty, samples, &mut values);
    let [xs, ys, zs] = [0, 1, 2].map(|axis| taken(axis, blocks.edges[axis], stride));
    let mut out = Vec::new();
    for frame in request.frames {
        for z in &zs {
            for y in &ys {
                for x in &xs {
                    let value = values[((frame * DIMS[2] + z) * DIMS[1] + y) * DIMS[0] + x];
                    out.push(if value.is_finite() && Some(value) != declared { value as f32 } else { f32::NAN });
                }
            }
        }
    }
    out
}

fn request<'a>(scene: &dyn Scene, stride: usize, frames: &'a [usize]) -> OverviewRequest<'a> {
    let thinning = Thinning { blocks: scene.blocks(), stride };
    OverviewRequest { thinning, frames, memory: MEMORY, region: Region { start: [0; 3], end: DIMS } }
}

/// Frames at multiples of 4 from the first of their window, which every pyramid codes first.
fn coded_first(window: usize) -> [usize; 4] {
    [0, 8, window + 4, window + 12]
}

#[test]
fn an_overview_of_a_file_holds_the_samples_that_extraction_gives() {
    assert!(overviews_hold_the_samples(4) > 250_000);
}

#[test]
#[ignore = "exhaustive"]
fn an_overview_of_a_file_holds_the_samples_of_every_kind_of_series() {
    assert!(overviews_hold_the_samples(1) > 1_000_000);
}

/// Compares overviews with extracted samples, for every `step`-th kind of series. Returns the number of samples.
fn overviews_hold_the_samples(step: usize) -> usize {
    let mut random = Random(83);
    let (mut cases, mut exact) = (0, 0);
    for ((basis, window), kind) in
        windows(16).into_iter().flat_map(|basis| KINDS.into_iter().step_by(step).map(move |kind| (basis, kind)))
    {
        for (ty, mask) in
            [(SampleType::F32, Mask::None), (SampleType::F32, Mask::Special), (SampleType::F64, Mask::Most)]
        {
            let config = ConvertConfig {
                block: [None, Some(6), Some(8)][random.below(3)],
                ..settings(basis, window, [1e-1, 1e-3][random.below(2)])
            };
            let source = archive(kind, ty, mask, random.bits());
            let file = stored(&mut source.clone(), &config);
            let all = extracted(&file.open());
            let mut scene = CoefficientScene::new(file.open(), SplatSource::Coefficients);
            let frames = coded_first(window);
            for stride in [1, 2, 4, 8] {
                let request = request(&scene, stride, &frames);
                let expected = picked(&all, ty, None, &request);
                let found = scene.overview(&request, &Silent).unwrap().unwrap();
                let largest = expected.iter().filter(|v| v.is_finite()).fold(0.0, |m: f32, v| m.max(v.abs()));
                assert_eq!(found.len(), expected.len());
                for (a, b) in found.iter().zip(&expected) {
                    // A transform along time may sum its terms in another order.
                    let near = (a - b).abs() <= 4.0 * f32::EPSILON * largest;
                    let same = a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan() || a == b;
                    assert!(same || near, "{basis:?} {kind:?} {ty:?} {mask:?} {stride}: {a} {b}");
                    exact += usize::from(same);
                    cases += 1;
                }
            }
        }
    }
    assert!(exact as f64 > 0.9 * cases as f64, "{exact} of {cases}");
    cases
}

#[test]
fn an_overview_of_frames_holds_their_samples() {
    for (ty, declared) in [(SampleType::F32, None), (SampleType::I16, Some(3.0)), (SampleType::F64, None)] {
        let mask = declared.map_or(Mask::Special, Mask::Declared);
        let source = archive(Kind::Mixed, ty, mask, 5);
        let mut scene = FrameScene::new(Box::new(source.clone()), declared);
        for stride in [1, 2, 4, 64] {
            let request = request(&scene, stride, &[0, 3, FRAMES - 1]);
            let expected = picked(&source.frames, ty, declared, &request);
            let found = scene.overview(&request, &Silent).unwrap().unwrap();
            assert!(stride > 1 || expected.iter().any(|v| v.is_nan()) && expected.iter().any(|v| v.is_finite()));
            assert!(
                found.iter().zip(&expected).all(|(a, b)| a == b || a.is_nan() && b.is_nan())
                    && found.len() == expected.len()
            );
        }
    }
}

#[test]
fn a_region_reads_its_blocks_alone() {
    let source = archive(Kind::Noise, SampleType::F32, Mask::None, 11);
    let config = ConvertConfig { block: Some(6), ..settings(Basis::Samples, 16, 1e-2) };
    let file = stored(&mut source.clone(), &config);
    let region = Region { start: [7, 1, 2], end: [11, 5, 6] };
    for scene in [
        &mut CoefficientScene::new(file.open(), SplatSource::Coefficients) as &mut dyn Scene,
        &mut FrameScene::new(Box::new(source), None),
    ] {
        let frames = coded_first(16);
        let whole = request(scene, 2, &frames);
        let some = OverviewRequest { region, ..whole };
        let (all, found) =
            (scene.overview(&whole, &Silent).unwrap().unwrap(), scene.overview(&some, &Silent).unwrap().unwrap());
        let (thinned, inside) = (some.thinning.blocks(), some.thinning.region(&region));
        let voxels = thinned.dims.iter().product::<usize>();
        let mut unread = 0;
        for (i, (a, b)) in all.iter().zip(&found).enumerate() {
            let voxel = Region { start: [0; 3], end: thinned.dims }.voxel(i % voxels);
            let needed = (0..3).all(|axis| (inside.start[axis]..inside.end[axis]).contains(&voxel[axis]));
            assert!(a == b || !needed && b.is_nan(), "{voxel:?}");
            unread += usize::from(b.is_nan());
        }
        assert!(unread > 0 && unread < found.len());
    }
}

/// Counts steps.
#[derive(Default)]
struct Steps(Mutex<(Option<u64>, u64, bool)>);

impl Progress for Steps {
    fn start(&self, steps: Option<u64>) {
        self.0.lock().unwrap().0 = steps;
    }

    fn advance(&self, steps: u64) {
        self.0.lock().unwrap().1 += steps;
    }

    fn finish(&self) {
        self.0.lock().unwrap().2 = true;
    }
}

#[test]
fn progress_counts_every_step_of_an_overview() {
    let source = archive(Kind::Wave, SampleType::F32, Mask::None, 3);
    let file = stored(&mut source.clone(), &ConvertConfig { block: Some(8), ..settings(Basis::Haar, 16, 1e-2) });
    for (scene, steps) in [
        (&mut CoefficientScene::new(file.open(), SplatSource::Coefficients) as &mut dyn Scene, 2 * 3 * 2 * 3),
        (&mut FrameScene::new(Box::new(source), None), 4),
    ] {
        let counted = Steps::default();
        scene.overview(&request(scene, 2, &coded_first(16)), &counted).unwrap();
        assert_eq!(*counted.0.lock().unwrap(), (Some(steps), steps, true));
    }
}

#[test]
fn an_overview_fills_the_same_part_of_the_world() {
    for (edge, stride) in [(6, 4), (8, 2), (32, 4), (43, 8)] {
        let grid = Grid { dims: DIMS, spacing: [1.0, 0.5, 2.0], origin: [3.0, -1.0, 0.0] };
        let blocks = wavesplat::base::grid::BlockGrid::cubes(DIMS, edge);
        let thinning = Thinning { blocks, stride };
        let thinned = thinning.grid(&grid);
        assert_eq!(thinned.dims, [0, 1, 2].map(|axis| taken(axis, edge, stride).len()));
        assert_eq!(thinning.blocks().len(), blocks.len());
        for axis in 0..3 {
            let face = |g: &Grid, n: f64| g.origin[axis] + g.spacing[axis] * (n - 0.5);
            assert!((face(&thinned, 0.0) - face(&grid, 0.0)).abs() < 1e-12);
            assert!((face(&thinned, thinned.dims[axis] as f64) - face(&grid, DIMS[axis] as f64)).abs() < 1e-12);
        }
        let one = Region { start: [5, 13, 16], end: [6, 14, 17] };
        assert!(!thinning.region(&one).is_empty() && grid.whole().contains(&thinning.region(&one)));
    }
}

#[test]
fn the_stride_of_an_overview_follows_views_and_region() {
    let grid = Grid::unit([256; 3]);
    let scene =
        FrameScene::new(Box::new(wavesplat::source::ArraySource::from_f32([256, 1, 1], &[0.0; 256]).unwrap()), None);
    let view = View { size: [64; 2], ..View::new(30.0, 30.0) };
    let config = RenderConfig { memory: MEMORY, ..RenderConfig::new(&scene, view) };
    let of = |config: &RenderConfig| stride(&grid, config, 1.0).unwrap();
    assert_eq!(of(&config), 4);
    let zoomed = RenderConfig { views: vec![View { scale: Some(1.0), ..view }], ..config.clone() };
    assert_eq!(of(&zoomed), 1);
    let thin = Region { start: [0; 3], end: [256, 256, 14] };
    assert_eq!(of(&RenderConfig { region: Some(thin), ..config.clone() }), 2);
    let slice = Region { start: [0, 0, 7], end: [256, 256, 8] };
    assert_eq!(of(&RenderConfig { region: Some(slice), ..config.clone() }), 1);
    let mut fading = config;
    fading.kernel.tau = 1.0;
    assert_eq!(of(&fading), 1);
}
