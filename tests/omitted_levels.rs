//! The directory's statement about the level parts of a pyramid: how far omitting them moves a sample.

use crate::common::memory::Memory;
use crate::common::samples::bytes;
use crate::common::views::{archive, field, view};
use crate::common::{looking, pictures, rendered, settings, stored};
use wavesplat::base::grid::Grid;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, ConvertConfig};
use wavesplat::file::CoefficientFile;
use wavesplat::render::{CoefficientScene, Quantity, RenderConfig, SplatSource};
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::decode::Block;
use wavesplat_format::{BlockEntry, PartKind};

const FRAMES: usize = 16;

fn entries(file: &CoefficientFile) -> Vec<BlockEntry> {
    file.leaves(0).iter().flat_map(|leaf| file.leaf(leaf).unwrap()).collect()
}

/// All coefficients of a block decoded from only the level parts below `end`.
fn coefficients(file: &CoefficientFile, codec: &WindowCodec, entry: &BlockEntry, end: u8) -> Vec<f64> {
    let mut entry = entry.clone();
    entry.parts.retain(|p| !matches!(p.kind, PartKind::Level(level) if level >= end));
    let block: Block = file.block(codec, &entry, &vec![true; codec.basis.coefficients()]).unwrap();
    let field = block.field(codec);
    (0..codec.basis.coefficients() * block.voxels).map(|i| field.at(i)).collect()
}

#[test]
fn a_part_states_the_exact_change_if_it_and_finer_parts_are_omitted() {
    let grid = Grid::unit([21, 14, 9]);
    let samples = field(&grid, FRAMES, 3);
    let mut checked = 0;
    for (ty, tolerance) in [(SampleType::F32, 0.01), (SampleType::F32, 1e-3), (SampleType::F64, 1e-7)] {
        for basis in [Basis::Samples, Basis::Learned] {
            let config = ConvertConfig { block: Some(12), ..settings(basis, FRAMES, tolerance) };
            let file = stored(&mut Memory::new(grid, ty, bytes(ty, &samples)), &config).open();
            let codec = file.codec(0).unwrap();
            for entry in entries(&file) {
                let codec = codec.at(entry.id.tier, 0);
                let whole = coefficients(&file, &codec, &entry, u8::MAX);
                for part in &entry.parts {
                    let PartKind::Level(level) = part.kind else { continue };
                    let rest = coefficients(&file, &codec, &entry, level);
                    let changes = || whole.iter().zip(&rest).map(|(a, b)| (a - b).abs());
                    let largest = changes().fold(0.0, f64::max);
                    assert_eq!(part.stats.largest, largest.next_up(), "{basis:?} {ty} level {level}");
                    let energy: f64 = changes().map(|d| d * d).sum();
                    assert!((part.stats.energy / energy - 1.0).abs() < 1e-9, "{} for {energy}", part.stats.energy);
                    checked += 1;
                }
            }
        }
    }
    assert!(checked > 40, "only {checked} parts");
}

#[test]
fn codes_too_large_to_decode_exceed_every_stated_value() {
    let grid = Grid::unit([12, 12, 12]);
    let settings = settings(Basis::Samples, FRAMES, 0.01);
    let file = stored(&mut archive(grid, SampleType::F32, &field(&grid, FRAMES, 3)), &settings).open();
    let (codec, entry) = (file.codec(0).unwrap(), &entries(&file)[0]);
    let mut block = file.block(&codec, entry, &[true; FRAMES]).unwrap();
    assert!(block.largest(&codec, &block.field(&codec)).iter().all(|largest| largest.is_finite()));
    block.step = 1e38;
    let codes = vec![1 << 20; block.all_codes(&codec).len()];
    block.set_codes(&codec, &codes);
    assert!(block.largest(&codec, &block.field(&codec)).contains(&f64::INFINITY));
}

#[test]
fn a_looser_tolerance_reads_fewer_parts_of_a_pyramid_and_certifies_what_it_shows() {
    let grid = Grid::unit([40, 33, 30]);
    let memory = archive(grid, SampleType::F32, &field(&grid, FRAMES, 5));
    let plain = looking(view(25.0, 35.0, [40, 30]), 0.02, Quantity::Mean, &grid, FRAMES);
    let truth =
        pictures(&mut crate::common::direct(&memory, None), &RenderConfig { splat_error: 0.0, ..plain.clone() }).0;
    for basis in [Basis::Samples, Basis::Learned] {
        let file = stored(&mut memory.clone(), &settings(basis, FRAMES, 1e-4));
        let mut left_out = Vec::new();
        for tolerance in [0.0, 0.003, 0.03, 0.3] {
            let allowed = Some(tolerance * file.report.delta / 1e-4).filter(|a| *a > 0.0);
            let config = RenderConfig { certify: true, allowed, ..plain.clone() };
            let mut scene = CoefficientScene::new(file.open(), SplatSource::Coefficients);
            let (found, errors, report) = rendered(&mut scene, &config);
            for ((found, error), truth) in found.iter().zip(&errors).zip(&truth) {
                assert!(truth.is_nan() && found.is_nan() || (found - truth).abs() <= *error, "{found} {truth} {error}");
            }
            left_out.push(report.left_out.coefficients);
        }
        assert!(basis == Basis::Learned || left_out[3] > 0, "nothing is left out");
        assert!(left_out.is_sorted() && left_out[0] == 0, "{basis:?} {left_out:?}");
    }
}
