//! Random scenes.

use super::Scene;
use crate::bounds::{BOUNDS, TOLERANCES};
use crate::common::random::Random;
use crate::common::samples::{TYPES, bytes, special};
use crate::common::series::{KINDS, Kind, Mask, volume};
use crate::common::views::field;
use crate::common::{BASES, looking, settings};
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, ConvertConfig};
use wavesplat::render::{Quantity, RenderConfig, SplatSource};
use wavesplat::view::camera::{Camera, View};
use wavesplat::view::footprint::Kernel;

/// The ranges from which scenes are drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Limits {
    /// Sigma in units of the largest spacing.
    pub(super) sigma: (f64, f64),
    /// Multiple of the scale at which the volume fits the picture.
    pub(super) scale: (f64, f64),
    /// Whether the centre of the picture may differ from the centre of the volume.
    pub(super) moved: bool,
    /// Range of tau times the depth of the volume.
    pub(super) tau: f64,
}

impl Random {
    /// A number between two positive numbers, uniform in its logarithm.
    fn about(&mut self, (lo, hi): (f64, f64)) -> f64 {
        lo * (hi / lo).powf(self.unit())
    }

    fn one_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    fn of<T: Copy>(&mut self, all: &[T]) -> T {
        all[self.below(all.len())]
    }
}

/// The scene for a seed.
pub(super) fn scene(limits: &Limits, seed: u64) -> Scene {
    let mut random = Random(seed);
    let grid = grid(&mut random);
    let ty = random.of(&TYPES);
    let frames = 1 + random.below(12);
    let (samples, missing_value) = samples(&grid, ty, frames, &mut random);
    let convert = ConvertConfig { missing_value, ..conversion(&mut random) };
    let look = look(&grid, frames, limits, &mut random);
    let what = if random.one_in(6) { SplatSource::Samples } else { SplatSource::Coefficients };
    Scene { grid, ty, samples, convert, look, what }
}

fn grid(random: &mut Random) -> Grid {
    let even = random.about((0.01, 100.0));
    let spacing = if random.one_in(3) { [even; 3] } else { std::array::from_fn(|_| even * random.about((0.4, 2.5))) };
    let origin = if random.one_in(2) { [0.0; 3] } else { std::array::from_fn(|_| 100.0 * even * random.signed()) };
    Grid { dims: std::array::from_fn(|_| 1 + random.below(7)), spacing, origin }
}

fn samples(grid: &Grid, ty: SampleType, frames: usize, random: &mut Random) -> (Vec<u8>, Option<f64>) {
    let voxels = grid.whole().voxels();
    let mask = match random.below(6) {
        0 if ty.is_float() => Mask::Special,
        1 if ty.is_float() => Mask::Most,
        2 => Mask::Declared(if ty == SampleType::U8 { 0.0 } else { 7.0 }),
        _ => Mask::None,
    };
    let missing_value = if let Mask::Declared(value) = mask { Some(value) } else { None };
    if random.one_in(2) {
        let mut smooth = bytes(ty, &field(grid, frames, random.bits()));
        if matches!(mask, Mask::Special | Mask::Most) {
            for sample in smooth.chunks_exact_mut(ty.size()) {
                if random.one_in(5) {
                    sample.copy_from_slice(&special(ty, random.below(4)));
                }
            }
        }
        return (smooth, missing_value);
    }
    let kind = random.of(&KINDS);
    // `f64` samples whose sums overflow are tested in the catalogue.
    let huge = ty == SampleType::F64 && matches!(kind, Kind::AnyBits | Kind::NearTheLargest | Kind::Mixed);
    let kind = if huge { Kind::Noise } else { kind };
    (volume(kind, ty, mask, voxels, frames, random.bits()), missing_value)
}

fn conversion(random: &mut Random) -> ConvertConfig {
    let (basis, bound) = (random.of(&BASES), random.of(&BOUNDS));
    let window = (1 << (1 + random.below(4))) + usize::from(basis == Basis::Multi);
    let block = Some(1 + random.below(8));
    ConvertConfig { bound, block, ..settings(basis, window, random.of(&TOLERANCES) * (0.5 + 0.5 * random.unit())) }
}

fn look(grid: &Grid, frames: usize, limits: &Limits, random: &mut Random) -> RenderConfig {
    let mut view = view(random);
    let fits = Camera::new(&view, grid).unwrap().scale;
    view.scale = random.one_in(2).then(|| fits * random.about(limits.scale));
    let extent: [f64; 3] = std::array::from_fn(|a| grid.dims[a] as f64 * grid.spacing[a]);
    if limits.moved && random.one_in(4) {
        view.center = Some(std::array::from_fn(|a| grid.origin[a] + extent[a] * (1.5 * random.unit() - 0.25)));
    }
    let depth = extent.iter().map(|e| e * e).sum::<f64>().sqrt();
    let tau = if random.one_in(2) { 0.0 } else { random.about((1e-3, limits.tau)) / depth };
    let quantity = random.of(&[Quantity::Mean, Quantity::Emission]);
    let plain = looking(view, tau, quantity, grid, frames);
    let widest = grid.spacing.iter().copied().fold(0.0, f64::max);
    let sigma = if random.one_in(3) { None } else { Some(widest * random.about(limits.sigma)) };
    let sigma = sigma.filter(|sigma| sigma * tau < 30.0); // beyond 37 the kernel's weights overflow
    let error = random.about((1e-8, 2e-2)) * if quantity == Quantity::Mean { 100.0 } else { 1.0 };
    RenderConfig {
        kernel: Kernel::new(sigma, tau, grid).unwrap(),
        frames: some(frames, random),
        region: random.one_in(4).then(|| region(grid, random)),
        splat_error: if random.one_in(4) { 0.0 } else { error },
        fast: false,
        certify: !random.one_in(3),
        allowed: random.one_in(6).then(|| random.about((1e-6, 10.0))),
        ..plain
    }
}

fn view(random: &mut Random) -> View {
    let around =
        |random: &mut Random| if random.one_in(4) { 90.0 * random.signed().round() } else { 360.0 * random.signed() };
    let elevation = if random.one_in(4) { random.of(&[-90.0, 0.0, 90.0]) } else { 90.0 * random.signed() };
    let size = [1 + random.below(24), 1 + random.below(24)];
    View { azimuth: around(random), elevation, roll: around(random), size, scale: None, center: None }
}

/// Some frames, or all.
fn some(frames: usize, random: &mut Random) -> Vec<usize> {
    let all: Vec<usize> = (0..frames).collect();
    let some: Vec<usize> = all.iter().copied().filter(|_| random.one_in(2)).collect();
    if some.is_empty() || random.one_in(2) { all } else { some }
}

fn region(grid: &Grid, random: &mut Random) -> Region {
    let start: [usize; 3] = std::array::from_fn(|a| random.below(grid.dims[a]));
    Region { start, end: std::array::from_fn(|a| start[a] + 1 + random.below(grid.dims[a] - start[a])) }
}
