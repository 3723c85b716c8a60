//! The solver's frames (eddy currents in a plate), where they are available.

use crate::common::views::{rounding, view};
use crate::common::{looking, pictures, settings, stored};
use std::path::PathBuf;
use wavesplat::base::progress::Silent;
use wavesplat::convert::Basis;
use wavesplat::file::verify::verify;
use wavesplat::formats::open;
use wavesplat::render::{CoefficientScene, FrameScene, Quantity, SplatSource};
use wavesplat::source::{FrameSource, OpenOptions};

fn plate() -> Option<Box<dyn FrameSource>> {
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "..", "shared", "data", "plate_jz.npy"].iter().collect();
    path.exists().then(|| open(&[path], &OpenOptions::default()).unwrap())
}

#[test]
fn the_plate_keeps_its_bound_in_samples_and_pixels() {
    let Some(mut source) = plate() else {
        std::io::Write::write_all(&mut std::io::stderr(), b"skipped: no ../shared/data/plate_jz.npy\n").unwrap();
        return;
    };
    let (grid, frames) = (source.archive().grid, source.archive().frames.unwrap());
    let views = [
        (view(30.0, 30.0, [96, 96]), 0.0),
        (view(0.0, 90.0, [96, 96]), 0.0),
        (view(120.0, 20.0, [96, 96]), 0.05 / grid.spacing[0]),
    ];
    let looks = views.map(|(view, tau)| looking(view, tau, Quantity::Mean, &grid, frames));
    let mut scene = FrameScene::new(plate().unwrap(), None);
    let expected = looks.each_ref().map(|look| pictures(&mut scene, look).0);
    for (basis, window) in [(Basis::Haar, 32), (Basis::Multi, 33)] {
        for tolerance in [0.02, 0.001] {
            let file = stored(source.as_mut(), &settings(basis, window, tolerance));
            let (lo, hi) = file.report.range;
            assert!(file.report.output_bytes * 4 < file.report.input_bytes, "{:?}", file.report);
            let against = verify(&file.open(), Some(source.as_mut()), 64 << 20, &Silent).unwrap().against.unwrap();
            assert_eq!(against.series_outside, 0);
            assert!(against.largest_error <= tolerance * (hi - lo) && against.largest_error > 0.0);
            let mut scene = CoefficientScene::new(file.open(), SplatSource::Coefficients);
            for (look, expected) in looks.iter().zip(&expected) {
                let (found, _) = pictures(&mut scene, look);
                for (a, b) in found.iter().zip(expected) {
                    assert_eq!(a.is_nan(), b.is_nan());
                    let off = (f64::from(*a) - f64::from(*b)).abs();
                    let most = tolerance * (hi - lo) + rounding(*a) + rounding(*b);
                    assert!(a.is_nan() || off <= most, "{basis:?} {tolerance}: {a} for {b}");
                }
                assert!(found.iter().filter(|v| v.is_finite()).count() > found.len() / 10);
            }
        }
    }
}
