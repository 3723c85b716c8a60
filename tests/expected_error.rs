//! The expected error of pictures, an estimate, compared with the true error for every basis and several kinds of data
//! and views.

use crate::common::memory::Memory;
use crate::common::views::{archive, field, view};
use crate::common::{Stored, direct, looking, pictures, report, settings, stored, windows};
use wavesplat::base::grid::Grid;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, ConvertConfig, SchemeConstraint, SpatialPredictor};
use wavesplat::render::{CoefficientScene, Limit, Quantity, RenderConfig, RenderReport, SplatSource};

const FRAMES: usize = 16;
const GRID: Grid = Grid { dims: [36, 33, 24], spacing: [1.0; 3], origin: [0.0; 3] };

/// Drifting bumps in a volume that is mostly near zero.
fn drifting() -> Vec<f64> {
    let value = |t: usize, v: [usize; 3]| -> f64 {
        let bump = |i: usize| {
            let at = [7 * i % 31, 11 * i % 29, 5 * i % 23].map(|n| n as f64 + 0.3 * t as f64);
            let squares: f64 = at.iter().zip(v).map(|(a, v)| (a - v as f64).powi(2)).sum();
            (1.0 + i as f64 / 8.0) * (-squares / (4.0 + i as f64)).exp()
        };
        (0..8).map(bump).sum()
    };
    (0..FRAMES).flat_map(|t| GRID.whole().iter().map(move |v| value(t, v))).collect()
}

/// One smooth shape that rises and decays.
fn decaying() -> Vec<f64> {
    let value = |t: usize, [x, y, z]: [usize; 3]| {
        let (r, t) = ((x as f64 - 17.0).hypot(y as f64 - 15.0), t as f64);
        (r / 9.0) * (-r / 9.0 - z as f64 / 10.0).exp() * (0.3 * t) * (-0.2 * t - 0.01 * r * t).exp()
    };
    (0..FRAMES).flat_map(|t| GRID.whole().iter().map(move |v| value(t, v))).collect()
}

/// A view of the unchanged archive.
struct View {
    config: RenderConfig,
    truth: Vec<f32>,
    /// The pixels that are not background.
    shown: Vec<bool>,
    /// The root mean square error of pixels if every sample had an error of 1.
    unit: f64,
}

impl View {
    fn of(memory: &Memory, ty: SampleType, (azimuth, elevation, tau): (f64, f64, f64), quantity: Quantity) -> Self {
        let config = looking(view(azimuth, elevation, [40, 30]), tau, quantity, &GRID, FRAMES);
        let config = RenderConfig { error: Limit::Expected, ..config };
        let mean = RenderConfig { quantity: Quantity::Mean, ..config.clone() };
        let picture = |memory: &Memory, config| pictures(&mut direct(memory, None), config).0;
        let shown: Vec<bool> = picture(memory, &mean).iter().map(|v| !v.is_nan()).collect();
        let ones = archive(GRID, ty, &vec![1.0; FRAMES * GRID.whole().voxels()]);
        let unit = root_mean_square(&picture(&ones, &config), &shown);
        Self { truth: picture(memory, &config), shown, unit, config }
    }

    /// The true root mean square error of pictures of a file, and the report.
    fn error(&self, file: &Stored, allowed: Option<f64>) -> (f64, RenderReport) {
        let mut scene = CoefficientScene::new(file.open(), SplatSource::Coefficients);
        let (found, report) = pictures(&mut scene, &RenderConfig { allowed, ..self.config.clone() });
        let off: Vec<f32> = found.iter().zip(&self.truth).map(|(a, b)| a - b).collect();
        (root_mean_square(&off, &self.shown), report)
    }
}

fn root_mean_square(picture: &[f32], shown: &[bool]) -> f64 {
    let squares = || picture.iter().zip(shown).filter(|(_, shown)| **shown).map(|(v, _)| f64::from(*v).powi(2));
    (squares().sum::<f64>() / squares().count() as f64).sqrt()
}

/// Every basis, and learned functions alone.
fn conversions() -> Vec<(String, ConvertConfig)> {
    let plain = windows(FRAMES).map(|(basis, window)| (format!("{basis:?}"), settings(basis, window, 1e-3)));
    let learned = settings(Basis::Learned, FRAMES, 1e-3);
    let alone =
        ConvertConfig { coding: SchemeConstraint { space: SpatialPredictor::Alone, ..learned.coding }, ..learned };
    plain.into_iter().chain([("Learned alone".into(), alone)]).collect()
}

/// The smallest and the largest ratio of the true to the expected error.
fn spread(data: &str, ty: SampleType, values: &[f64]) -> (f64, f64) {
    let memory = archive(GRID, ty, values);
    let looks = [(25.0, 35.0, 0.02), (0.0, 0.0, 0.0), (-60.0, 10.0, 0.1)];
    let mut views: Vec<View> = looks.map(|look| View::of(&memory, ty, look, Quantity::Mean)).into();
    views.push(View::of(&memory, ty, looks[0], Quantity::Emission));
    let (mut least, mut most) = (f64::INFINITY, 0.0_f64);
    for (name, config) in conversions() {
        let file = stored(&mut memory.clone(), &config);
        for view in &views {
            let mut left_out = Vec::new();
            for tolerance in [0.0, 1e-3, 4e-3, 2e-2, 0.2] {
                let allowed = tolerance * file.report.delta / 1e-3;
                let (rms, report) = view.error(&file, Some(allowed).filter(|a| *a > 0.0));
                let used = rms / report.expected_error;
                (least, most) = (least.min(used), most.max(used));
                let kept = report.left_out.parts == 0 || report.expected_error <= allowed * view.unit * 1.02;
                assert!(kept, "{data} {name} {tolerance}: {} of {allowed}", report.expected_error);
                left_out.push(report.left_out.bytes);
            }
            assert!(left_out.is_sorted() && left_out[4] > 0, "{data} {name}: {left_out:?}");
        }
    }
    (least, most)
}

/// Expected errors are near the true ones, and seldom less.
fn are_near(data: &str, ty: SampleType, values: &[f64]) {
    let (least, most) = spread(data, ty, values);
    report(&format!("{data}: {least:.2} to {most:.2} of the expected error"));
    assert!(least > 0.02 && most < 1.3, "{data}: {least} to {most}");
}

#[test]
fn expected_errors_are_near_the_true_ones_of_drifting_data() {
    are_near("drifting", SampleType::F64, &drifting());
}

#[test]
#[ignore = "exhaustive"]
fn expected_errors_are_near_the_true_ones_of_noisy_data() {
    are_near("noisy", SampleType::F32, &field(&GRID, FRAMES, 6));
}

#[test]
#[ignore = "exhaustive"]
fn expected_errors_are_near_the_true_ones_of_decaying_data() {
    are_near("decaying", SampleType::F32, &decaying());
}
