//! Levels of detail: every 2^lod-th voxel, read from the coarse parts alone, has the same bits as in the whole volume.

use crate::common::memory::Memory;
use crate::common::series::{Kind, Mask, volume};
use crate::common::{extracted, settings, stored};
use std::path::Path;
use wavesplat::base::error::Error;
use wavesplat::base::grid::{Grid, Region};
use wavesplat::base::mapped::Access;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, Bound, ConvertConfig, SchemeConstraint, SpatialPredictor, Stencil};
use wavesplat::extract::read_region;
use wavesplat::file::CoefficientFile;

/// The bytes of every 2^lod-th voxel along each axis of all frames.
fn thinned(all: &[u8], grid: &Grid, size: usize, lod: u32) -> Vec<u8> {
    let coarse = Grid::unit(grid.dims.map(|n| n.div_ceil(1 << lod)));
    let mut out = Vec::new();
    for frame in all.chunks_exact(grid.whole().voxels() * size) {
        for voxel in coarse.whole().iter() {
            let at = grid.whole().index(voxel.map(|n| n << lod));
            out.extend_from_slice(&frame[at * size..][..size]);
        }
    }
    out
}

fn assert_levels(name: &str, open: &dyn Fn() -> CoefficientFile, levels: std::ops::RangeInclusive<u32>) {
    let all = extracted(&open());
    for lod in levels {
        let whole = open().grid;
        let coarse = open().with_detail(lod).unwrap_or_else(|e| panic!("{name}, level {lod}: {e}"));
        assert_eq!(coarse.grid.spacing, whole.spacing.map(|s| s * f64::from(1 << lod)), "{name}, level {lod}");
        assert!(extracted(&coarse) == thinned(&all, &whole, coarse.sample().size(), lod), "{name}, level {lod}");
    }
}

#[test]
fn coarse_lattices_have_the_samples_of_the_whole() {
    let grid = Grid { dims: [23, 18, 9], spacing: [1.0, 0.5, 2.0], origin: [0.0, -1.0, 3.0] };
    let forced = |basis, stencil| SchemeConstraint { basis, space: SpatialPredictor::Pyramid(stencil) };
    let codings = [
        ("auto", SchemeConstraint::AUTO),
        ("samples", forced(Some(Basis::Samples), Stencil::Cubic)),
        ("learned", forced(Some(Basis::Learned), Stencil::Linear)),
        ("haar pyramid", forced(Some(Basis::Haar), Stencil::Cubic)),
        ("haar", Basis::Haar.into()),
    ];
    let samples = [SampleType::F32, SampleType::F64, SampleType::F16];
    for (seed, (name, coding)) in codings.into_iter().enumerate() {
        let ty = samples[seed % samples.len()];
        for (kind, mask, tolerance) in
            [(Kind::Wave, Mask::None, 0.01), (Kind::Mixed, Mask::Special, 1e-3), (Kind::Noise, Mask::None, 1e-6)]
        {
            let mut source = Memory::new(grid, ty, volume(kind, ty, mask, grid.whole().voxels(), 13, seed as u64));
            let config = ConvertConfig { coding, block: Some(8), ..settings(Basis::Samples, 8, tolerance) };
            let stored = stored(&mut source, &config);
            // Haar functions without a pyramid have no coarse parts, but may be thinned as they are read.
            let levels = if name == "haar" { 0..=0 } else { 0..=3 };
            assert_levels(&format!("{name}, {ty}, {kind:?}, {tolerance}"), &|| stored.open(), levels);
        }
    }
}

#[test]
fn files_of_version_1_0_have_coarse_lattices() {
    for name in ["linear-single", "cubic-double", "haar-cubic", "missing", "learned-f32", "samples-u16"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/golden/{name}.wspl"));
        assert_levels(name, &|| CoefficientFile::open_with(&path, Access::Read).unwrap(), 0..=1);
    }
}

#[test]
fn a_coarse_lattice_reads_few_bytes() {
    let (grid, ty) = (Grid::unit([48, 48, 48]), SampleType::F32);
    let mut source = Memory::new(grid, ty, volume(Kind::Mixed, ty, Mask::None, grid.whole().voxels(), 8, 5));
    for bound in [Bound::Pointwise, Bound::Rms] {
        let coding = SchemeConstraint { basis: Some(Basis::Samples), space: SpatialPredictor::Any };
        let config = ConvertConfig { coding, bound, ..settings(Basis::Samples, 8, 1e-4) };
        let stored = stored(&mut source, &config);
        let read = |lod| {
            let file = stored.open().with_detail(lod).unwrap();
            extracted(&file);
            file.bytes_read()
        };
        let [all, half, quarter] = [0, 1, 2].map(read);
        assert!(half * 3 < all && quarter * 12 < all, "{bound:?}: {all}, {half}, {quarter} bytes");
    }
}

#[test]
fn levels_that_a_file_does_not_have_are_errors() {
    let mut source = Memory::new(Grid::unit([20, 12, 10]), SampleType::U8, vec![7; 10 * 2400]);
    let of_blocks = |source: &mut Memory, block| {
        stored(source, &ConvertConfig { block: Some(block), ..settings(Basis::Samples, 8, 0.01) })
    };
    for (block, coarsest) in [(4, 2), (6, 1), (7, 0), (20, 4)] {
        let stored = of_blocks(&mut source, block);
        assert_eq!(stored.open().coarsest_detail(), coarsest, "blocks of {block}");
        assert!(stored.open().with_detail(coarsest).is_ok());
        let refused = stored.open().with_detail(coarsest + 1).unwrap_err();
        assert!(matches!(refused, Error::Setting { setting: "lod", .. }), "{refused}");
    }
    let stored = of_blocks(&mut source, 4);
    let file = stored.open().with_detail(2).unwrap();
    assert!(read_region(&file, 1..1, &file.grid.whole()).unwrap().is_empty());
    let samples: Vec<f32> = read_region(&file, 0..2, &Region { start: [1, 0, 2], end: [5, 3, 3] }).unwrap();
    assert_eq!(samples, [7.0; 2 * 12], "regions count voxels of the coarse lattice");
}
