//! Compares the decoder bit by bit with a reference that follows `format/FORMAT.md` literally.

use crate::common::memory::Memory;
use crate::common::random::Random;
use crate::common::samples::{append, numbers};
use crate::common::series::{Kind, Mask, volume};
use crate::common::{Stored, extracted, report, settings, stored, times};
use crate::reference::decode::{Pyramid, haar, learned, learned_functions, multi};
use std::collections::HashMap;
use wavesplat::base::grid::Grid;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, Bound, ConvertConfig, SchemeConstraint, SpatialPredictor, Stencil};
use wavesplat::file::CoefficientFile;
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::bound::ErrorBound;
use wavesplat_core::codec::decode::Block;
use wavesplat_core::codec::scheme::Scheme;
use wavesplat_core::wavelet::{LANES, Lane, basis};
use wavesplat_format::{Axis, Packing, Window};
use wavesplat_format::{BlockEntry, BlockId, Metadata, PartKind};

const AXES: [Axis; 4] = [Axis::X, Axis::Y, Axis::Z, Axis::T];

/// Converts a pyramid to the reference's type.
fn spelled_out(pyramid: &wavesplat_format::Pyramid) -> Pyramid {
    let order = pyramid.order.iter().map(|axis| AXES.iter().position(|a| a == axis).unwrap()).collect();
    let cubic = pyramid.stencil == Stencil::Cubic;
    Pyramid {
        order,
        cubic,
        growth: pyramid.growth,
        most: pyramid.most,
        single: pyramid.single,
        nested: pyramid.packing == Packing::Nested,
        ghosts: pyramid.ghosts,
        tiers: pyramid.tiers,
    }
}

/// A random choice of axes in random order.
fn random_order(random: &mut Random) -> Vec<Axis> {
    let mut left = AXES.to_vec();
    (0..random.below(5)).map(|_| left.swap_remove(random.below(left.len()))).collect()
}

fn random_pyramid(random: &mut Random) -> wavesplat_format::Pyramid {
    let stencil = [Stencil::Linear, Stencil::Cubic][random.below(2)];
    let growth = [1.0, 1.5, 2.0, 1.0 + random.unit()][random.below(4)];
    let most = [1.0, 3.0, 4.0, 1e6, 1.0 + 9.0 * random.unit()][random.below(5)];
    let order = random_order(random);
    let packing = [Packing::Flat, Packing::Nested][random.below(2)];
    let ghosts = packing == Packing::Nested && random.below(2) == 0;
    wavesplat_format::Pyramid { order, stencil, growth, most, single: random.below(2) == 0, packing, ghosts, tiers: 0 }
}

/// Random codes: mostly small or zero, sometimes of any magnitude.
fn random_codes(count: usize, random: &mut Random) -> Vec<i32> {
    let zeros = random.below(4);
    let code = |random: &mut Random| match random.below(16) {
        0 => (random.bits() >> random.below(32)) as i32,
        n if n <= 4 * zeros => 0,
        _ => random.below(9) as i32 - 4,
    };
    (0..count).map(|_| code(random)).collect()
}

#[track_caller]
fn assert_same(found: f64, expected: f64, what: impl Fn() -> String) {
    assert!(found.to_bits() == expected.to_bits(), "{}: {found:e} for {expected:e}", what());
}

#[test]
fn pyramids_decode_to_the_specified_bits() {
    let mut random = Random(11);
    let mut nodes = 0;
    for case in 0..600 * times() {
        let pyramid = random_pyramid(&mut random);
        let extents: [usize; 4] = std::array::from_fn(|_| {
            let most = [20, 20, 5, 2][random.below(4)];
            1 + random.below(most)
        });
        let step = [1.0, 0.37, 1e-44, 1e20 * random.unit(), random.unit()][random.below(5)];
        let spelled = spelled_out(&pyramid);
        let count = spelled.passes(extents, 0).into_iter().map(|pass| spelled.added(pass, extents, 0).count()).sum();
        let codes = random_codes(count, &mut random);
        let expected = spelled_out(&pyramid).decode(extents, step, &codes);
        let what = format!("case {case}: {pyramid:?}, {extents:?}, step {step:e}");
        let scheme = Scheme { pyramid: Some(pyramid), ..Scheme::along_time(Basis::Samples) };
        let bound = ErrorBound::new(Bound::Pointwise, 0.1, 0.1);
        let codec = WindowCodec::new(scheme, extents[3], SampleType::F64, bound, 20);
        let block = Block::from_codes(&codec, [extents[0], extents[1], extents[2]], step, &codes);
        let field = block.field(&codec);
        for (i, value) in expected.iter().enumerate() {
            assert_same(field.at(i), *value, || format!("{what}, node {i}"));
        }
        nodes += expected.len();
    }
    report(&format!("{nodes} nodes"));
    assert!(nodes >= 1_000_000 * times());
}

/// The inverse of a basis, applied to one series at a time.
fn series(kind: Basis, functions: &[Vec<f64>], coefficients: &[f64], frames: usize) -> Vec<f64> {
    let mut series = match kind {
        Basis::Haar => haar(coefficients),
        Basis::Multi => multi(coefficients),
        Basis::Samples => coefficients.to_vec(),
        Basis::Learned => learned(coefficients, functions),
    };
    series.truncate(frames);
    series
}

/// Random functions, some of which are zero, equal, or nearly sums of others.
fn random_functions(frames: usize, random: &mut Random) -> Vec<i16> {
    let mut functions: Vec<Vec<i16>> = Vec::new();
    for _ in 0..random.below(frames + 1) {
        let mut next: Vec<i16> = (0..frames).map(|_| random.bits() as i16).collect();
        match random.below(6) {
            0 => next.fill(0),
            1 => next.fill(i16::MIN),
            2 if !functions.is_empty() => {
                next.clone_from(&functions[random.below(functions.len())]);
                let t = random.below(frames);
                next[t] = next[t].wrapping_add(random.below(2) as i16);
            }
            _ => {}
        }
        functions.push(next);
    }
    functions.concat()
}

#[test]
fn transforms_along_time_give_the_specified_bits() {
    let mut random = Random(12);
    for frames in 1..=70 {
        for kind in [Basis::Haar, Basis::Multi, Basis::Samples, Basis::Learned] {
            let stored = if kind == Basis::Learned { random_functions(frames, &mut random) } else { Vec::new() };
            let functions = learned_functions(&stored, frames);
            let transform = basis(kind, &stored, frames);
            let coefficient = |random: &mut Random| {
                let size = 10f64.powi(random.below(9) as i32 - 4);
                if random.below(3) == 0 { 0.0 } else { size * random.signed() }
            };
            let mut lane = |_| -> Lane { std::array::from_fn(|_| coefficient(&mut random)) };
            let mut lanes: Vec<Lane> = (0..transform.coefficients()).map(&mut lane).collect();
            let given = lanes.clone();
            let mut found = vec![Lane::default(); frames];
            transform.inverse(&mut lanes, &mut found);
            for l in 0..LANES {
                let coefficients: Vec<f64> = given.iter().map(|lane| lane[l]).collect();
                for (t, expected) in series(kind, &functions, &coefficients, frames).into_iter().enumerate() {
                    assert_same(found[t][l], expected, || format!("{kind:?} of {frames} frames, frame {t}"));
                }
            }
        }
    }
}

/// Blocks of tiers above 0, decoded: nodes in the order of their numbers.
type Coarse = HashMap<BlockId, Vec<f64>>;

/// A block of a file as the reference sees it.
struct Seen<'a> {
    metadata: &'a Metadata,
    window: &'a Window,
    id: BlockId,
    block: &'a Block,
    /// Its codes, pass after pass; empty if it has none.
    codes: Vec<i32>,
    coarse: &'a Coarse,
}

impl<'a> Seen<'a> {
    fn new(metadata: &'a Metadata, codec: &WindowCodec, id: BlockId, block: &'a Block, coarse: &'a Coarse) -> Self {
        let (window, codes) = (&metadata.windows[id.window as usize], block.all_codes(codec));
        Self { metadata, window, id, block, codes, coarse }
    }

    /// The first voxel and the extents of its box.
    fn boxed(&self, id: BlockId) -> ([usize; 3], [usize; 4]) {
        let (first, [x, y, z]) = self.metadata.block_box(id.tier, id.block).unwrap();
        (first.map(|n| n as usize), [x as usize, y as usize, z as usize, self.window.coefficients as usize])
    }

    fn is_coded(&self) -> bool {
        !self.codes.is_empty() || self.window.tiers() > self.id.tier
    }

    /// The coefficients that some of its codes give.
    fn coefficients(&self, codes: &[i32]) -> Vec<f64> {
        let Some(pyramid) = self.window.pyramid.as_ref().map(spelled_out) else {
            return codes.iter().map(|q| f64::from(*q) * self.block.step).collect();
        };
        let (tier, (start, extents)) = (self.id.tier, self.boxed(self.id));
        if tier == 0 && self.window.tiers() > 0 && self.block.step == 0.0 {
            return vec![0.0; extents.iter().product()];
        }
        let all: Vec<_> = pyramid.passes(extents, tier);
        let count = all.iter().map(|pass| pyramid.added(*pass, extents, tier).count()).sum();
        let zeros = vec![0; count];
        let codes = if codes.is_empty() { &zeros } else { codes };
        if tier == self.window.tiers() {
            return pyramid.decode_tier(extents, tier, self.block.step, codes, &|_| f64::NAN);
        }
        let id = self.metadata.above(self.id);
        let (above, (first, outer)) = (&self.coarse[&id], self.boxed(id));
        let places: HashMap<[usize; 4], f64> = pyramid.nodes_of(outer, id.tier).zip(above.iter().copied()).collect();
        let known = |[x, y, z, k]: [usize; 4]| {
            places[&[x + start[0] - first[0], y + start[1] - first[1], z + start[2] - first[2], k]]
        };
        pyramid.decode_tier(extents, tier, self.block.step, codes, &known)
    }
}

/// The samples of a block.
fn samples(seen: &Seen<'_>, ty: SampleType) -> Vec<u8> {
    let Seen { window, block, codes, .. } = seen;
    if let Some(exact) = &block.exact {
        return exact.clone();
    }
    let (voxels, frames) = (block.voxels, window.frames as usize);
    let mut numbers = vec![0.0; voxels * frames];
    if seen.is_coded() {
        let (functions, all) = (learned_functions(&window.functions, frames), seen.coefficients(codes));
        for voxel in 0..voxels {
            let of_voxel: Vec<f64> = all.iter().skip(voxel).step_by(voxels).copied().collect();
            let series = series(window.basis, &functions, &of_voxel, frames);
            series.into_iter().enumerate().for_each(|(t, v)| numbers[t * voxels + voxel] = v);
        }
    }
    let mut found = Vec::new();
    numbers.into_iter().for_each(|v| append(ty, v, &mut found));
    let mut put = |index: usize, sample: &[u8]| found[index * ty.size()..][..ty.size()].copy_from_slice(sample);
    for (index, sample) in block.outliers.positions.iter().zip(block.outliers.samples.chunks(ty.size())) {
        put(*index as usize, sample);
    }
    let missing = block.missing.0.iter().enumerate().filter(|(_, missing)| **missing);
    missing.zip(block.missing.1.chunks(ty.size())).for_each(|((index, _), sample)| put(index, sample));
    found
}

/// Calls `visit` with every block of a file and the number of its window.
fn for_each_block(file: &CoefficientFile, mut visit: impl FnMut(&WindowCodec, u32, &BlockEntry, &Block)) {
    for window in 0..file.metadata().windows.len() as u32 {
        let codec = file.codec(window).unwrap();
        let all = vec![true; codec.basis.coefficients()];
        for entry in file.leaves(window).iter().flat_map(|leaf| file.leaf(leaf).unwrap()) {
            let codec = codec.at(entry.id.tier, 0);
            visit(&codec, window, &entry, &file.block(&codec, &entry, &all).unwrap());
        }
    }
}

/// Checks what the level parts of a block state: their number of codes, and the change when they and all finer ones
/// are omitted.
fn check_parts(seen: &Seen<'_>, entry: &BlockEntry) {
    let Some(pyramid) = seen.window.pyramid.as_ref().map(spelled_out) else { return };
    let (codes, tier) = (&seen.codes, seen.id.tier);
    if codes.is_empty() {
        return;
    }
    let (_, extents) = seen.boxed(seen.id);
    let part = |pass| pyramid.added(pass, extents, tier).map(|node| pyramid.part(pass, node, tier)).collect::<Vec<_>>();
    let parts: Vec<usize> = pyramid.passes(extents, tier).into_iter().flat_map(part).collect();
    let whole = seen.coefficients(codes);
    for level in 0..4 {
        let count = codes.iter().zip(&parts).filter(|(code, part)| **code != 0 && **part == level).count();
        let coarser = codes.iter().zip(&parts).map(|(code, part)| if *part < level { *code } else { 0 });
        let rest = seen.coefficients(&coarser.collect::<Vec<_>>());
        let largest = whole.iter().zip(rest).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let said = entry.part(PartKind::Level(level as u8)).map(|part| (part.stats.count, part.stats.largest));
        let expected = (count > 0).then(|| (count as u64, largest.next_up()));
        assert_eq!(said, expected, "part {level} of {}", entry.id);
    }
}

/// Compares every sample of the file with the reference. Returns how many blocks have coefficients.
fn check_file(stored: &Stored) -> usize {
    let (file, mut coded) = (stored.open(), 0);
    let ty = file.sample();
    let mut expected = vec![0; file.frames() * file.grid.whole().voxels() * ty.size()];
    let [nx, ny, _] = file.grid.dims;
    let mut coarse = Coarse::new();
    for_each_block(&file, |codec, _, entry, block| {
        let seen = Seen::new(file.metadata(), codec, entry.id, block, &coarse);
        check_parts(&seen, entry);
        coded += usize::from(!seen.codes.is_empty());
        if entry.id.tier > 0 {
            let nodes = seen.coefficients(&seen.codes);
            coarse.insert(entry.id, nodes);
            return;
        }
        let window = seen.window;
        let start = file.blocks.region(entry.id.block as usize).start;
        for (i, sample) in samples(&seen, ty).chunks(ty.size()).enumerate() {
            let (voxel, frame) = (i % block.voxels, i / block.voxels + window.first_frame as usize);
            let [x, y, _] = block.size;
            let place = [start[0] + voxel % x, start[1] + voxel / x % y, start[2] + voxel / x / y];
            let at = frame * file.grid.whole().voxels() + place[0] + nx * (place[1] + ny * place[2]);
            expected[at * ty.size()..(at + 1) * ty.size()].copy_from_slice(sample);
        }
    });
    assert_eq!(extracted(&file), expected, "{:?}", file.metadata().windows[0]);
    coded
}

const SPACES: [SpatialPredictor; 4] = [
    SpatialPredictor::Any,
    SpatialPredictor::Alone,
    SpatialPredictor::Pyramid(Stencil::Linear),
    SpatialPredictor::Pyramid(Stencil::Cubic),
];

#[test]
fn files_decode_as_specified() {
    let (dims, frames) = ([12, 10, 7], 13);
    let kinds = [Kind::Wave, Kind::Noise, Kind::Ramp, Kind::Steps, Kind::Mixed];
    let types = [SampleType::F32, SampleType::F64, SampleType::I16, SampleType::F16, SampleType::U8];
    let bases = [None, Some(Basis::Haar), Some(Basis::Multi), Some(Basis::Samples), Some(Basis::Learned)];
    let (mut random, mut coded) = (Random(13), 0);
    for (n, basis) in bases.into_iter().enumerate() {
        for (m, space) in SPACES.into_iter().enumerate() {
            if space == SpatialPredictor::Alone && matches!(basis, None | Some(Basis::Samples)) {
                continue;
            }
            for (l, kind) in kinds.into_iter().enumerate() {
                let ty = types[(n + m + l) % types.len()];
                let mask = if ty.is_float() && l % 2 == 1 { Mask::Special } else { Mask::None };
                let voxels = dims.iter().product();
                let data = volume(kind, ty, mask, voxels, frames, random.bits());
                let window = if basis == Some(Basis::Multi) { 9 } else { 8 };
                let tolerance = [0.2, 0.02, 1e-3, 1e-6][random.below(4)];
                let bound = [Bound::Pointwise, Bound::Rms, Bound::Relative { floor: 0.1 }][random.below(3)];
                let plain = settings(Basis::Haar, window, tolerance);
                let config = ConvertConfig {
                    coding: SchemeConstraint { basis, space },
                    bound,
                    block: Some(1 + random.below(9)),
                    ..plain
                };
                coded += check_file(&stored(&mut Memory::new(Grid::unit(dims), ty, data), &config));
            }
        }
    }
    report(&format!("{coded} coded blocks"));
    assert!(coded >= 3_500);
}

/// The error of four roundings of numbers a few times as large as the largest sample.
const ROUNDING: f64 = 1.0 / (1_u64 << 48) as f64;

#[test]
fn every_node_is_within_half_a_step_of_its_level() {
    let (dims, frames) = ([19, 12, 10], 20);
    let mut coarse = [0; 2];
    for (seed, kind) in [Kind::Wave, Kind::Ramp, Kind::Flash, Kind::Noise, Kind::Steps].into_iter().enumerate() {
        for stencil in [Stencil::Linear, Stencil::Cubic] {
            let ty = SampleType::F64;
            let data = volume(kind, ty, Mask::None, dims.iter().product(), frames, seed as u64);
            let coding = SchemeConstraint { basis: Some(Basis::Samples), space: SpatialPredictor::Pyramid(stencil) };
            let config = ConvertConfig { coding, block: Some(10), ..settings(Basis::Samples, 16, 1e-5) };
            let mut memory = Memory::new(Grid::unit(dims), ty, data);
            let file = stored(&mut memory, &config).open();
            let source = numbers(ty, &memory.frames);
            let most = source.iter().fold(0.0, |m: f64, v| m.max(v.abs()));
            for_each_block(&file, |codec, window, entry, block| {
                let (window, tier) = (&file.metadata().windows[window as usize], entry.id.tier);
                let record = window.pyramid.as_ref().unwrap();
                assert!(!record.single, "the tolerance is too small for single precision");
                if block.exact.is_some() {
                    return;
                }
                let (start, [x, y, z]) = file.metadata().block_box(tier, entry.id.block).unwrap();
                let extents = [x as usize, y as usize, z as usize, window.frames as usize];
                let (pyramid, field) = (spelled_out(record), block.field(codec));
                let places: HashMap<[usize; 4], usize> = pyramid.nodes_of(extents, tier).zip(0..).collect();
                for pass in pyramid.passes(extents, tier) {
                    let step = pyramid.step(block.step, pass.level);
                    coarse[usize::from(tier > 0)] += usize::from(step < block.step);
                    assert!(step <= 2.0 * window.delta);
                    for node in pyramid.added(pass, extents, tier) {
                        let [x, y, z] = [0, 1, 2].map(|a| node[a] + start[a] as usize);
                        let frame = node[3] + window.first_frame as usize;
                        let (Some(i), true) = (places.get(&node), [x, y, z].iter().zip(dims).all(|(at, n)| *at < n))
                        else {
                            continue; // behind the block or the volume
                        };
                        let v = source[x + dims[0] * (y + dims[1] * (z + dims[2] * frame))];
                        let off = (field.at(*i) - v).abs();
                        assert!(off <= step / 2.0 + ROUNDING * most, "{kind:?} {record:?}, node {node:?}: {off:e}");
                    }
                }
            });
        }
    }
    assert!(coarse[1] > 0, "no coarser level has a smaller step");
}
