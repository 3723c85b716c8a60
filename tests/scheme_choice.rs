//! Compares the choice of `--basis pyramid` with every available scheme.

use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::samples::bytes;
use crate::common::{settings, stored};
use wavesplat::base::grid::Grid;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, Stencil};
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::encode::Encoder;
use wavesplat_core::codec::scheme::Scheme;
use wavesplat_format::{Axis, Pyramid};
use wavesplat_format::{BlockId, EncodedPart};

const EDGE: usize = 24;
const FRAMES: usize = 16;

/// Stands for an axis: waves are long in space, and their phases jump from frame to frame.
const SPACE_ALONE: usize = 4;

/// Waves that are long along one axis of x, y, z, t and short along the others; or [`SPACE_ALONE`].
fn long_along(axis: usize) -> Vec<f64> {
    let length = |a: usize| match axis {
        SPACE_ALONE => [0.1, 0.1, 0.1, 100.0][a],
        _ if a == axis => 0.05,
        _ => 0.5,
    };
    let mut random = Random(axis as u64);
    let wave = |random: &mut Random| {
        let along: [f64; 4] = std::array::from_fn(|a| random.signed() * length(a));
        (along, 6.0 * random.unit(), random.signed())
    };
    let waves: Vec<_> = (0..6).map(|_| wave(&mut random)).collect();
    let value = |place: [usize; 4]| {
        let of = |(along, phase, amount): &([f64; 4], f64, f64)| {
            amount * (phase + (0..4).map(|a| along[a] * place[a] as f64).sum::<f64>()).sin()
        };
        waves.iter().map(of).sum()
    };
    let grid = Grid::unit([EDGE; 3]);
    (0..FRAMES).flat_map(|t| grid.whole().iter().map(|[x, y, z]| value([x, y, z, t])).collect::<Vec<_>>()).collect()
}

/// Total bytes of all level parts.
fn size<'a>(parts: impl IntoIterator<Item = &'a EncodedPart>) -> usize {
    parts.into_iter().map(|part| part.stored.len()).sum()
}

fn schemes(like: &Pyramid) -> Vec<Scheme> {
    use Axis::{T, X, Y, Z};
    let scheme = |order: &[Axis], stencil, growth, most| {
        let pyramid = Pyramid { order: order.to_vec(), stencil, growth, most, ..like.clone() };
        Scheme { pyramid: Some(pyramid), ..Scheme::along_time(Basis::Samples) }
    };
    let mut found = Vec::new();
    for order in [&[X, Y, Z, T][..], &[Z, Y, X, T], &[T, Z, Y, X], &[Z, Y, X]] {
        for stencil in [Stencil::Linear, Stencil::Cubic] {
            found.extend([(1.0, 1.0), (1.5, 3.0), (2.0, 4.0)].map(|(g, m)| scheme(order, stencil, g, m)));
        }
    }
    found
}

#[test]
fn the_chosen_scheme_is_nearly_the_smallest() {
    for axis in 0..=SPACE_ALONE {
        for tolerance in [1e-2, 1e-3] {
            let samples = bytes(SampleType::F32, &long_along(axis));
            let grid = Grid::unit([EDGE; 3]);
            let mut memory = Memory::new(grid, SampleType::F32, samples.clone());
            let file = stored(&mut memory, &settings(Basis::Samples, FRAMES, tolerance)).open();
            let (window, codec) = (&file.metadata().windows[0], file.codec(0).unwrap());
            let mut encoder = Encoder::new(3).unwrap();
            let mut coded = |scheme: Scheme| {
                let codec = WindowCodec::new(scheme, FRAMES, SampleType::F32, codec.bound, EDGE);
                let id = BlockId::new(0, 0, 0);
                size(&encoder.block(&codec, id, [EDGE; 3], samples[..].into(), None).unwrap().block.parts)
            };
            let chosen = coded(Scheme::from_window(window));
            let least = schemes(window.pyramid.as_ref().unwrap()).into_iter().map(&mut coded).min().unwrap();
            assert!(chosen * 100 <= least * 105, "long along {axis}, {tolerance}: {chosen} for {least} bytes");
        }
    }
}
