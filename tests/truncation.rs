//! How near the library's choice of coefficients (eq 7) comes to the fewest possible, on tiny series.
//!
//! The library quantises, so its codes may need fewer coefficients than exact values. Rounding to codes moves a sample
//! by at most the bound. So the library never uses fewer coefficients than exact values need for TWICE the bound. With
//! Haar under rms, rounding can only add to the error, so there it never uses fewer than they need for the bound
//! itself.

use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::samples::bytes;
use crate::common::{settings, stored};
use crate::reference::transform::{Matrix, ghm_matrix, haar_matrix, inverse, transpose};
use crate::reference::truncate::{Measure, fewest};
use wavesplat::base::grid::Grid;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, Bound, ConvertConfig, SchemeConstraint, SpatialPredictor};

const VOXELS: usize = 64;

/// All voxels have the same kind of series; time is the slowest axis.
fn archive(kind: &str, frames: usize) -> Vec<f64> {
    let mut random = Random(kind.len() as u64);
    let mut out = vec![0.0; VOXELS * frames];
    for voxel in 0..VOXELS {
        let (a, b, place) = (random.signed(), random.signed(), random.below(frames));
        for t in 0..frames {
            let x = t as f64 / frames as f64;
            out[t * VOXELS + voxel] = match kind {
                "noise" => random.signed(),
                "ramp" => a + b * x,
                "wave" => a * (6.0 * x + 9.0 * b).sin(),
                "flash" => a * 0.1 + if t == place { b } else { 0.0 },
                "step" => {
                    if t >= place {
                        a
                    } else {
                        b
                    }
                }
                _ => unreachable!("{kind}"),
            };
        }
    }
    out
}

/// The nonzero codes of every voxel in window 0, the bound, and the functions of the window's basis.
fn kept(values: &[f64], config: &ConvertConfig) -> (Vec<usize>, f64, Matrix) {
    let grid = Grid::unit([4, 4, 4]);
    let mut memory = Memory::new(grid, SampleType::F64, bytes(SampleType::F64, values));
    let file = stored(&mut memory, config).open();
    let codec = file.codec(0).unwrap();
    let entry = &file.leaf(&file.leaves(0)[0]).unwrap()[0];
    let block = file.block(&codec, entry, &vec![true; codec.basis.coefficients()]).unwrap();
    assert!(block.exact.is_none() && block.outliers.positions.is_empty(), "the case says nothing about coefficients");
    let codes = block.all_codes(&codec);
    let of_voxel = |v| codes.iter().skip(v).step_by(VOXELS).filter(|c| **c != 0).count();
    ((0..VOXELS).map(of_voxel).collect(), codec.bound.delta, codec.synthesis.to_vec())
}

/// Mean numbers of coefficients: the library's, and the fewest for the bound. A basis without analysis and synthesis
/// matrices is orthonormal, and its functions come from the file.
fn compare(kind: &str, frames: usize, config: &ConvertConfig, known: Option<&[Matrix; 2]>) -> [f64; 2] {
    let values = archive(kind, frames);
    let measure = if config.bound == Bound::Rms { Measure::Rms } else { Measure::Largest };
    let (found, delta, functions) = kept(&values, config);
    let [analysis, synthesis] = known.cloned().unwrap_or_else(|| [functions.clone(), transpose(&functions)]);
    let exact = config.coding.basis == Some(Basis::Haar) && config.bound == Bound::Rms;
    let (mut ours, mut best) = (0, 0);
    for (voxel, count) in found.into_iter().enumerate() {
        let series: Vec<f64> = values.iter().skip(voxel).step_by(VOXELS).copied().collect();
        let number = |delta| fewest(&analysis, &synthesis, &series, measure, delta).unwrap().indices.len();
        let within = number(delta);
        // The reference's sums are rounded, too.
        let least = number(if exact { delta * (1.0 + 1e-12) } else { 2.0 * delta * (1.0 + 1e-12) });
        assert!(config.bound == Bound::Rms && !exact || count >= least, "{kind}, voxel {voxel}: {count} for {least}");
        assert!(within > 0 || count == 0, "{kind}, voxel {voxel}: within the bound of zero, but {count} kept");
        ours += count;
        best += within;
    }
    [ours, best].map(|n| n as f64 / VOXELS as f64)
}

#[test]
fn the_coefficients_kept_are_near_the_fewest_possible() {
    let haar = haar_matrix(8);
    let multi = ghm_matrix(2);
    let haar = Some([haar.clone(), transpose(&haar)]);
    let multi = Some([multi.clone(), inverse(&multi)]);
    for (basis, frames, known) in [(Basis::Haar, 8, haar), (Basis::Multi, 5, multi), (Basis::Learned, 8, None)] {
        for bound in [Bound::Pointwise, Bound::Rms] {
            let (mut ours, mut best, mut cases) = (0.0, 0.0, 0.0);
            for kind in ["noise", "ramp", "wave", "flash", "step"] {
                for tolerance in [0.02, 0.1, 0.25] {
                    let coding = SchemeConstraint { basis: Some(basis), space: SpatialPredictor::Alone };
                    let config = ConvertConfig { bound, coding, ..settings(basis, frames, tolerance) };
                    let [found, fewest] = compare(kind, frames, &config, known.as_ref());
                    let what = format!("{basis:?} {bound:?} {kind} {tolerance}: {found:.2} kept, {fewest:.2} needed");
                    std::io::Write::write_fmt(&mut std::io::stderr(), format_args!("{what}\n")).unwrap();
                    assert!(found <= fewest + 2.0, "{what}");
                    (ours, best, cases) = (ours + found, best + fewest, cases + 1.0);
                }
            }
            let excess = (ours - best) / cases;
            let most = if (basis, bound) == (Basis::Haar, Bound::Rms) { 0.1 } else { 0.5 };
            std::io::Write::write_fmt(&mut std::io::stderr(), format_args!("{basis:?} {bound:?}: {excess:.3} more\n"))
                .unwrap();
            assert!(excess <= most, "{basis:?} {bound:?}: {excess:.3} coefficients more than needed on average");
        }
    }
}
