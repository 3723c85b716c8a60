//! Several views in one run.

use crate::common::views::{archive, field, view};
use crate::common::{MEMORY, direct, looking, settings, stored};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::grid::Grid;
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, ConvertConfig, SchemeConstraint};
use wavesplat::render::{
    CoefficientScene, Limit, Mode, Plane, Quantity, RenderConfig, RenderReport, Scene, SplatSource, check, render,
};
use wavesplat::view::camera::View;

const GRID: Grid = Grid { dims: [20, 21, 90], spacing: [1.0, 0.9, 1.1], origin: [5.0, 0.0, -3.0] };
const FRAMES: usize = 11;

/// Views along the longest axis and across it, near and far, and of a part.
fn views() -> Vec<View> {
    let at = |azimuth, elevation, scale| View { scale, ..view(azimuth, elevation, [70, 66]) };
    vec![
        at(25.0, 75.0, Some(2.1)),
        at(80.0, 12.0, Some(0.2)),
        View { center: Some([8.0, 3.0, 60.0]), ..at(10.0, 20.0, Some(5.0)) },
        at(205.0, 75.0, None),
        at(0.0, 90.0, None),
    ]
}

/// The bits of each view's pictures.
fn by_view(scene: &mut dyn Scene, config: &RenderConfig) -> Result<(Vec<Vec<u32>>, RenderReport)> {
    let mut pictures = vec![Vec::new(); config.views.len()];
    let mut last = vec![None; config.views.len()];
    let report = render(scene, config, &Silent, &mut |rendered| {
        let view = rendered.view;
        assert!(last[view].replace(rendered.frame) < Some(rendered.frame), "frames of a view come in order");
        let errors = rendered.error.unwrap_or_default();
        pictures[view].extend(rendered.picture.iter().chain(errors).map(|v| v.to_bits()));
        Ok(())
    })?;
    Ok((pictures, report))
}

/// Compares every view, and its reported errors, with the same view rendered alone, under smaller and smaller memory
/// budgets. Returns how many budgets sufficed.
fn each_as_alone(scene: &mut dyn Scene, config: &RenderConfig) -> usize {
    let alone = |view: &View| {
        let config = RenderConfig { views: vec![*view], ..config.clone() };
        let (mut pictures, report) = by_view(scene, &config).unwrap();
        (pictures.remove(0), report.views[0].expected_error)
    };
    let (expected, errors): (Vec<_>, Vec<_>) = config.views.iter().map(alone).unzip();
    let mut sufficed = 0;
    for memory in [MEMORY, 24 << 20, 16 << 20, 12 << 20, 10 << 20] {
        match by_view(scene, &RenderConfig { memory, ..config.clone() }) {
            Err(Error::Setting { setting: "memory", .. }) => continue,
            Err(other) => panic!("{other}"),
            Ok((found, report)) => {
                let same: Vec<bool> = found.iter().zip(&expected).map(|(a, b)| a == b).collect();
                assert_eq!(same, [true; 5], "{memory} bytes");
                let errors_found: Vec<f64> = report.views.iter().map(|view| view.expected_error).collect();
                assert_eq!(errors_found, errors, "{memory} bytes");
                sufficed += 1;
            }
        }
    }
    sufficed
}

#[test]
fn every_view_of_a_run_equals_the_view_rendered_alone() {
    let samples = field(&GRID, FRAMES, 5);
    let mut memory = archive(GRID, SampleType::F32, &samples);
    let haar = ConvertConfig { block: Some(16), ..settings(Basis::Haar, 8, 0.02) };
    let auto = ConvertConfig { coding: SchemeConstraint::AUTO, block: Some(20), ..settings(Basis::Haar, 8, 0.02) };
    let (haar, auto) = (stored(&mut memory, &haar), stored(&mut memory, &auto));
    for (quantity, tau) in [(Quantity::Mean, 0.0), (Quantity::Emission, 0.3)] {
        let plain = looking(view(0.0, 0.0, [70, 66]), tau, quantity, &GRID, FRAMES);
        let config = RenderConfig { views: views(), splat_error: 5e-3, ..plain };
        for file in [&haar, &auto] {
            for what in [SplatSource::Coefficients, SplatSource::Samples] {
                let sufficed = each_as_alone(&mut CoefficientScene::new(file.open(), what), &config);
                assert!(sufficed >= 2, "{sufficed} budgets sufficed");
            }
        }
        each_as_alone(&mut direct(&memory, None), &config);
        let certified = RenderConfig { certify: true, ..config.clone() };
        each_as_alone(&mut CoefficientScene::new(haar.open(), SplatSource::Coefficients), &certified);
        let loose = RenderConfig { allowed: Some(0.2), error: Limit::Expected, ..config };
        each_as_alone(&mut CoefficientScene::new(auto.open(), SplatSource::Coefficients), &loose);
    }
}

#[test]
fn each_block_is_decoded_once_for_all_views() {
    let mut memory = archive(GRID, SampleType::F32, &field(&GRID, FRAMES, 5));
    let file = stored(&mut memory, &ConvertConfig { block: Some(16), ..settings(Basis::Haar, 8, 0.02) });
    let mut scene = CoefficientScene::new(file.open(), SplatSource::Coefficients);
    for splat_error in [0.0, 5e-3] {
        let plain = looking(view(30.0, 75.0, [70, 66]), 0.0, Quantity::Mean, &GRID, FRAMES);
        let one = RenderConfig { splat_error, ..plain };
        let turned = |n| view(30.0 + 90.0 * f64::from(n), 75.0, [70, 66]);
        let four = RenderConfig { views: (0..4).map(turned).collect(), ..one.clone() };
        let [one, four] = [one, four].map(|config| by_view(&mut scene, &config).unwrap().1);
        assert_eq!((four.views[3].method, four.views.len()), (one.views[0].method, 4));
        assert_eq!((four.blocks_read, four.bytes_read), (one.blocks_read, one.bytes_read));
        assert!(four.blocks_read > 0 && (four.frames, one.frames) == (FRAMES, FRAMES));
    }
}

#[test]
fn views_of_one_run_are_of_one_size() {
    let memory = archive(GRID, SampleType::F32, &field(&GRID, 1, 5));
    let config = looking(view(0.0, 0.0, [70, 66]), 0.0, Quantity::Mean, &GRID, 1);
    for views in [vec![], vec![view(0.0, 0.0, [70, 66]), view(0.0, 0.0, [66, 70])]] {
        let refused = by_view(&mut direct(&memory, None), &RenderConfig { views, ..config.clone() });
        assert!(matches!(refused, Err(Error::Setting { setting: "views", .. })));
    }
}

#[test]
fn paired_views_show_only_their_own_frame() {
    let samples = field(&GRID, FRAMES, 7);
    let mut memory = archive(GRID, SampleType::F32, &samples);
    let file = stored(&mut memory, &ConvertConfig { block: Some(16), ..settings(Basis::Haar, 8, 0.02) });
    let plain = looking(view(0.0, 0.0, [70, 66]), 0.0, Quantity::Mean, &GRID, FRAMES);
    let surface = wavesplat::render::Surface { value: 0.3, colour: [1.0; 3], opacity: 0.5 };
    let iso = Mode::Iso { surfaces: vec![surface], light: wavesplat::render::Light::default(), slices: None };
    let planes = Mode::Planes { planes: vec![Plane { axis: 2, at: 20.5 }], panels: Vec::new() };
    let pairs = [1, 4, 4, 9, 10];
    for mode in [Mode::Projection, Mode::Mip { slices: None }, iso, planes] {
        let all = RenderConfig { views: views(), mode, ..plain.clone() };
        let paired = RenderConfig { frames: pairs.to_vec(), paired: true, ..all.clone() };
        let mut scene = CoefficientScene::new(file.open(), SplatSource::Samples);
        let mut shown = Vec::new();
        let mut found = Vec::new();
        let report = render(&mut scene, &paired, &Silent, &mut |rendered| {
            assert_eq!(rendered.views.len(), 5);
            shown.push((rendered.view, rendered.frame));
            found.push(rendered.picture.iter().map(|v| v.to_bits()).collect::<Vec<_>>());
            Ok(())
        });
        assert_eq!((report.unwrap().frames, &shown), (5, &paired.shown()));
        for (view, frame) in shown {
            let alone = RenderConfig { views: vec![all.views[view]], frames: vec![frame], ..all.clone() };
            assert!(by_view(&mut scene, &alone).unwrap().0[0] == found[view], "view {view}, frame {frame}");
        }
    }
    let scene = CoefficientScene::new(file.open(), SplatSource::Samples);
    let four = RenderConfig { views: views(), frames: vec![0, 1, 2, 3], paired: true, ..plain };
    assert!(matches!(check(&scene, &four), Err(Error::Setting { setting: "views", .. })));
}
