//! Certified pictures (eq 26): no pixel is further from the truth than its certificate says.
//!
//! The reference is brute force over the samples of the source with an uncut kernel. The comparison allows nothing
//! beyond the certificate itself.

use crate::coefficients::{Trial, doubles, views};
use crate::common::random::Random;
use crate::common::views::{SKEWED, archive, field, truth, values, view};
use crate::common::{direct, is_taken, looking, pictures, rendered, settings, stored};
use crate::frame_pictures::{bits, under_less_memory};
use crate::reference::splat::{BACKGROUND, Images};
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, Bound, ConvertConfig};
use wavesplat::render::{CoefficientScene, LeftOut, Quantity, RenderConfig, RenderReport, Scene, SplatSource};
use wavesplat::view::camera::View;
use wavesplat_format::{BlockEntry, Keep, PartKind};

/// The reference pictures of one view, with which several pictures are compared.
struct Reference<'a> {
    trial: &'a Trial,
    config: RenderConfig,
    images: Images,
    masked: bool,
}

impl<'a> Reference<'a> {
    /// Renders all frames by brute force; the kernel's sigma may differ from the default.
    fn new(trial: &'a Trial, (view, tau): (View, f64), sigma: Option<f64>) -> Self {
        let samples = values(&trial.memory, trial.ty());
        let missing: Vec<bool> =
            samples.iter().map(|v| !v.is_finite() || Some(*v) == trial.config.missing_value).collect();
        let frames = trial.file.open().frames();
        let mut config = looking(view, tau, Quantity::Mean, &trial.grid(), frames);
        config.kernel.sigma = sigma.unwrap_or(config.kernel.sigma);
        config.certify = true;
        let (_, report) = pictures(&mut coefficients(trial), &RenderConfig { certify: false, ..config.clone() });
        let images = truth(&trial.grid(), &config, report.views[0].scale, &samples, Some(&missing));
        Self { trial, config, images, masked: missing.contains(&true) }
    }

    /// Compares every pixel of both quantities for coarser and coarser splats. Returns the largest share of a
    /// certificate that any pixel uses.
    fn check(&self, scene: &mut dyn Scene, allowed: Option<f64>) -> f64 {
        let mut used = 0.0_f64;
        for splat_error in [0.0, 1e-3, 0.02, 2.0] {
            for quantity in [Quantity::Mean, Quantity::Emission] {
                let config = RenderConfig { splat_error, quantity, allowed, ..self.config.clone() };
                used = used.max(self.compare(scene, &config));
            }
        }
        used
    }

    fn compare(&self, scene: &mut dyn Scene, config: &RenderConfig) -> f64 {
        let (found, errors, report) = rendered(scene, config);
        let mean = config.quantity == Quantity::Mean;
        let expected = if mean { &self.images.mean } else { &self.images.emission };
        let (mut used, name) = (0.0_f64, self.trial.name);
        for (at, ((found, error), expected)) in found.iter().zip(&errors).zip(expected).enumerate() {
            assert_eq!(found.is_nan(), error.is_nan(), "{name}");
            if found.is_nan() != expected.is_nan() {
                assert!(self.is_border(at, &report), "{name}: {found} for {expected}");
            } else if !found.is_nan() {
                let off = (f64::from(*found) - expected).abs();
                assert!(off <= f64::from(*error), "{name}: {found} for {expected}, certified {error}");
                assert!(f64::from(*error) <= report.certified_error.unwrap());
                used = used.max(off / f64::from(*error));
            }
        }
        used
    }

    /// Missing samples are splatted with the cut kernel, so the border of the background moves by the part beyond the
    /// cut.
    fn is_border(&self, at: usize, report: &RenderReport) -> bool {
        let share = self.images.weight[at] / self.images.largest_weight;
        self.masked && (share - BACKGROUND).abs() < report.views[0].stated_splat_error
    }
}

fn coefficients(trial: &Trial) -> CoefficientScene {
    CoefficientScene::new(trial.file.open(), SplatSource::Coefficients)
}

fn samples(trial: &Trial) -> CoefficientScene {
    CoefficientScene::new(trial.file.open(), SplatSource::Samples)
}

#[test]
fn no_pixel_is_beyond_its_certificate() {
    for (n, trial) in doubles().into_iter().enumerate() {
        let mut used = 0.0_f64;
        for (_, view) in views().into_iter().enumerate().filter(|(m, _)| is_taken(m + n, 3)) {
            let truth = Reference::new(&trial, view, None);
            used = used.max(truth.check(&mut coefficients(&trial), None));
            used = used.max(truth.check(&mut samples(&trial), None));
            used = used.max(truth.check(&mut direct(&trial.memory, trial.config.missing_value), None));
            for allowed in [0.0, 0.1, 0.5, 2.0, 100.0] {
                truth.check(&mut coefficients(&trial), Some(allowed));
            }
            truth.check(&mut samples(&trial), Some(0.5));
        }
        assert!(used > 0.01, "{}: only {used} is used", trial.name);
    }
}

#[test]
fn kernels_far_narrower_and_wider_than_a_cell_are_certified() {
    let memory = archive(SKEWED, SampleType::F64, &field(&SKEWED, 3, 7));
    let trial = Trial::new("kernels", memory, settings(Basis::Haar, 4, 0.1));
    for sigma in [0.02, 0.1, 0.3, 1.0, 4.0, 50.0] {
        for view in views() {
            Reference::new(&trial, view, Some(sigma)).check(&mut coefficients(&trial), Some(0.7));
        }
    }
}

#[test]
fn pictures_of_files_that_keep_sides_are_certified() {
    for (basis, words) in [(Basis::Learned, "side=0.3,-0.2"), (Basis::Samples, "sign range"), (Basis::Haar, "side=0.1")]
    {
        let memory = archive(SKEWED, SampleType::F32, &field(&SKEWED, 6, 5));
        let config = ConvertConfig { keep: Keep::parse(words).unwrap(), ..settings(basis, 8, 0.05) };
        let trial = Trial::new("sides", memory, config);
        let reader = trial.file.open();
        let entries = reader.leaves(0).iter().flat_map(|leaf| reader.leaf(leaf).unwrap());
        assert!(entries.into_iter().any(|entry| entry.part(PartKind::Sides).is_some()), "{basis:?}");
        for view in views() {
            let truth = Reference::new(&trial, view, None);
            for allowed in [None, Some(0.1), Some(0.7), Some(2.0), Some(100.0)] {
                truth.check(&mut coefficients(&trial), allowed);
                truth.check(&mut samples(&trial), allowed);
            }
        }
    }
}

/// Half of the volume is empty, one block is constant, and only the rest changes.
fn uneven(bound: Bound) -> Trial {
    let grid = Grid::unit([16, 8, 8]);
    let noise = field(&grid, 8, 4);
    let voxels = grid.whole().voxels();
    let value = |i: usize| if i % 16 < 8 { 0.0 } else { noise[i] * f64::from(1 + (i % voxels / 512) as u32) };
    let samples: Vec<f64> = (0..noise.len()).map(value).collect();
    let config = ConvertConfig { bound, block: Some(4), ..settings(Basis::Haar, 8, 0.02) };
    Trial::new("uneven", archive(grid, SampleType::F64, &samples), config)
}

#[test]
fn certificates_are_tighter_where_blocks_did_better() {
    let trial = uneven(Bound::Pointwise);
    let delta = trial.file.open().metadata().windows[0].delta;
    let config = looking(view(0.0, 0.0, [40, 30]), 0.0, Quantity::Mean, &trial.grid(), 8);
    let (_, errors, _) = rendered(&mut coefficients(&trial), &RenderConfig { certify: true, ..config });
    let inside: Vec<f32> = errors.into_iter().filter(|e| !e.is_nan()).collect();
    assert!(inside.iter().all(|e| f64::from(*e) <= delta * 1.000_001), "with a bound of {delta}");
    let small = inside.iter().filter(|e| f64::from(**e) < 0.01 * delta).count();
    assert!(small * 4 > inside.len(), "{small} of {} pixels", inside.len());
}

/// One block is large enough to have each level in a part of its own; a smaller one is flat.
fn in_levels(bound: Bound) -> Trial {
    let grid = Grid::unit([36, 32, 32]);
    let noise = field(&grid, 32, 4);
    let value = |i: usize| if i % 36 < 32 { noise[i] } else { 0.25 };
    let samples: Vec<f64> = (0..noise.len()).map(value).collect();
    let config = ConvertConfig { bound, ..settings(Basis::Haar, 32, 0.005) };
    let memory = archive(grid, SampleType::F64, &samples);
    let file = stored(&mut memory.clone(), &config);
    Trial { name: "in levels", memory, config, file }
}

/// The change of every sample when parts are omitted, computed from the directory alone: `[block][frame]`.
fn added(trial: &Trial, allowed: f64) -> Vec<Vec<f64>> {
    let file = trial.file.open();
    let codec = file.codec(0).unwrap();
    let gain = |part: usize, t: usize| codec.levels[part].clone().map(|k| codec.synthesis[k][t].abs()).sum::<f64>();
    let most = |part: usize| (0..codec.frames()).map(|t| gain(part, t)).fold(0.0, f64::max);
    let of_block = |entry: BlockEntry| {
        let stats = entry.stats;
        let largest = stats.min.abs().max(stats.max.abs());
        if largest + stats.reached <= allowed {
            return vec![largest; codec.frames()];
        }
        let (mut total, mut by_frame) = (stats.reached, vec![0.0; codec.frames()]);
        for part in entry.parts.iter().rev() {
            let PartKind::Level(level) = part.kind else { continue };
            if total + part.stats.largest * most(level.into()) <= allowed {
                total += part.stats.largest * most(level.into());
                (0..codec.frames()).for_each(|t| by_frame[t] += part.stats.largest * gain(level.into(), t));
            }
        }
        by_frame
    };
    file.leaves(0).iter().flat_map(|l| file.leaf(l).unwrap()).map(of_block).collect()
}

/// The emission of the change of every sample when parts are omitted.
fn growth(trial: &Trial, config: &RenderConfig, scale: f64, allowed: f64) -> Vec<f64> {
    let (grid, blocks) = (trial.grid(), trial.file.open().blocks);
    let mut amounts = vec![0.0; 32 * grid.whole().voxels()];
    for (block, by_frame) in added(trial, allowed).iter().enumerate() {
        for voxel in blocks.region(block).iter() {
            let at = grid.whole().index(voxel);
            (0..32).for_each(|t| amounts[t * grid.whole().voxels() + at] = by_frame[t]);
        }
    }
    truth(&grid, config, scale, &amounts, None).emission
}

#[test]
fn a_certificate_grows_by_just_what_is_left_out() {
    for bound in [Bound::Pointwise, Bound::Rms] {
        let trial = in_levels(bound);
        let config = looking(view(20.0, 35.0, [16, 12]), 0.05, Quantity::Emission, &trial.grid(), 32);
        let config = RenderConfig { certify: true, ..config };
        let (_, whole, report) = rendered(&mut coefficients(&trial), &config);
        for allowed in [1.0, 2.0] {
            let loose = RenderConfig { allowed: Some(allowed), ..config.clone() };
            let (_, errors, seen) = rendered(&mut coefficients(&trial), &loose);
            assert!((1..5).contains(&seen.left_out.parts), "{:?}", seen.left_out);
            let growth = growth(&trial, &config, report.views[0].scale, allowed);
            for ((error, whole), growth) in errors.iter().zip(&whole).zip(&growth) {
                // Certificates are `f32`, rounded up, and include the rounding of their pixels.
                let off = (f64::from(*error) - f64::from(*whole) - growth).abs();
                assert!(off <= 1e-6 * f64::from(*error) + 1e-5, "{error} after {whole}: {growth} more");
            }
        }
    }
}

#[test]
fn a_looser_tolerance_reads_less() {
    let trial = in_levels(Bound::Pointwise);
    let loose = |allowed| {
        let config = looking(view(20.0, 35.0, [30, 24]), 0.05, Quantity::Mean, &trial.grid(), 32);
        pictures(&mut coefficients(&trial), &RenderConfig { allowed, ..config })
    };
    let (picture, all) = loose(None);
    let (same, none) = loose(Some(0.0));
    assert!(bits(&picture) == bits(&same) && none.left_out == LeftOut::default() && all.left_out == none.left_out);
    let mut before = all.bytes_read;
    for allowed in [0.3, 1.0, 2.0, 5.0] {
        let (_, report) = loose(Some(allowed));
        assert!(report.bytes_read < before, "{allowed}: {report:?}");
        assert_eq!(report.bytes_read + report.left_out.bytes, all.bytes_read);
        assert_eq!(report.coefficients + report.left_out.coefficients, all.coefficients);
        before = report.bytes_read;
    }
    let (picture, report) = loose(Some(1e6));
    assert_eq!((report.bytes_read, report.blocks_read, report.left_out.blocks), (0, 0, 2));
    assert!(picture.iter().all(|v| v.is_nan() || *v == 0.0));
}

#[test]
fn regions_are_certified_alone() {
    let trial = uneven(Bound::Pointwise);
    let region = Some(Region { start: [2, 0, 0], end: [7, 8, 8] });
    let config = looking(view(20.0, 35.0, [30, 24]), 0.05, Quantity::Mean, &trial.grid(), 8);
    let config = RenderConfig { certify: true, region, allowed: Some(0.4), ..config };
    let (picture, errors, report) = rendered(&mut coefficients(&trial), &config);
    assert!(picture.iter().all(|v| v.is_nan() || *v == 0.0), "nothing but zeros is there");
    assert!(errors.iter().all(|e| e.is_nan() || *e < 1e-5), "{:?}", report.certified_error);
}

#[test]
fn memory_changes_no_bit_of_a_certificate() {
    let grid = Grid::unit([20, 18, 16]);
    let mut samples = field(&grid, 12, 3);
    let missing = |i: usize| i.is_multiple_of(7) || i % 5760 < 900;
    samples.iter_mut().enumerate().filter(|(i, _)| missing(*i)).for_each(|(_, v)| *v = f64::NAN);
    let trial = Trial::new("memory", archive(grid, SampleType::F64, &samples), settings(Basis::Haar, 8, 0.01));
    let config = looking(view(30.0, 25.0, [200, 150]), 0.05, Quantity::Mean, &grid, 12);
    for allowed in [None, Some(0.5)] {
        let config = RenderConfig { certify: true, allowed, ..config.clone() };
        assert!(under_less_memory(&mut coefficients(&trial), &config) >= 3);
        assert!(under_less_memory(&mut direct(&trial.memory, None), &config) >= 3);
    }
}

/// A picture in which all visible voxels within the cut are missing, and those beyond the cut are present.
fn masked_within_the_cut() -> Trial {
    let grid = Grid::unit([21, 40, 1]);
    let mut random = Random(4);
    let hidden = |x: usize, y: usize, t: usize| x < 3 && (y < 20 || t.is_multiple_of(2));
    let mut samples = Vec::new();
    for t in 0..4 {
        for [x, y, _] in grid.whole().iter() {
            let value = random.unit();
            samples.push(if hidden(x, y, t) { f64::NAN } else { value });
        }
    }
    Trial::new("masked within the cut", archive(grid, SampleType::F64, &samples), settings(Basis::Haar, 4, 0.01))
}

#[test]
fn the_rest_of_a_masked_pixel_is_certified_or_background() {
    let trial = masked_within_the_cut();
    for tau in [0.0, 0.05] {
        let view = View { scale: Some(11.0), center: Some([-12.6, 20.0, 0.0]), ..view(0.0, 0.0, [24, 3]) };
        let truth = Reference::new(&trial, (view, tau), Some(4.0));
        for scene in [&mut coefficients(&trial) as &mut dyn Scene, &mut direct(&trial.memory, None)] {
            for splat_error in [0.0, 0.02, 0.5, 2.0] {
                let (found, errors, _) = rendered(scene, &RenderConfig { splat_error, ..truth.config.clone() });
                for ((found, error), expected) in found.iter().zip(&errors).zip(&truth.images.mean) {
                    assert_eq!(found.is_nan(), error.is_nan());
                    let off = (f64::from(*found) - expected).abs();
                    // The largest weight lies far outside of the picture, so the cut may omit everything in the
                    // picture.
                    assert!(found.is_nan() || expected.is_nan() || off <= f64::from(*error), "{found} for {expected}");
                }
            }
        }
    }
}

#[test]
fn pixels_without_a_certificate_have_infinite_errors() {
    let grid = Grid { origin: [1e16, 0.0, 0.0], ..Grid::unit([2, 2, 2]) };
    let trial =
        Trial::new("far away", archive(grid, SampleType::F64, &field(&grid, 2, 1)), settings(Basis::Haar, 2, 0.1));
    let config = looking(view(0.0, 0.0, [8, 8]), 0.0, Quantity::Mean, &grid, 2);
    let (found, errors, report) = rendered(&mut coefficients(&trial), &RenderConfig { certify: true, ..config });
    assert!(found.iter().zip(&errors).all(|(v, e)| v.is_nan() == e.is_nan()));
    assert_eq!(report.certified_error, Some(f64::INFINITY));
}
