//! Every bit pattern of an `f32`, converted into a file and back.
//!
//! Nothing here calls the library's own bound: the test compares decoded samples with the patterns themselves,
//! exactly.

use crate::common::computed::{Computed, Sampled};
use crate::common::exact::Limit;
use crate::common::{report, settings};
use rayon::prelude::*;
use std::ops::{Add, Range};
use std::path::Path;
use std::time::Instant;
use wavesplat::base::grid::Grid;
use wavesplat::base::progress::Silent;
use wavesplat::base::sample::SampleType;
use wavesplat::convert::{Basis, ConvertConfig, convert};
use wavesplat_core::codec::WindowCodec;
use wavesplat_core::codec::decode::Block;
use wavesplat_format::{BlockEntry, Reader};

/// Voxels along the edge of a block. A row of blocks along z holds consecutive patterns.
const EDGE: usize = 64;
const BLOCKS: usize = 16;
const GRID: Grid = Grid { dims: [EDGE, EDGE, EDGE * BLOCKS], spacing: [1.0; 3], origin: [0.0; 3] };
const VOXELS: usize = EDGE * EDGE * EDGE * BLOCKS;

/// The archive of a range of patterns, indexed by `frame * VOXELS + voxel`.
fn patterns(places: Range<u64>, pattern: fn(u64) -> u32) -> Computed<4, impl Sampled<4>> {
    let frames = (places.end - places.start) as usize / VOXELS;
    let sample = move |frame, voxel| pattern(places.start + (frame * VOXELS + voxel) as u64).to_le_bytes();
    Computed::new(GRID, SampleType::F32, frames, sample)
}

/// Counts of the comparison.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Counts {
    /// Finite samples, and those of them that did not come back bit for bit.
    finite: u64,
    changed: u64,
    missing: u64,
}

impl Add for Counts {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            finite: self.finite + other.finite,
            changed: self.changed + other.changed,
            missing: self.missing + other.missing,
        }
    }
}

/// With `--range 0,1`, the tolerance is the bound of every sample.
const TOLERANCE: f64 = 1e-3;

/// Converts the patterns into a file in memory, decodes it and compares.
fn check(patterns: &Computed<4, impl Sampled<4>>, basis: Basis, window: usize) -> Counts {
    let config = ConvertConfig { range: Some((0.0, 1.0)), block: Some(EDGE), ..settings(basis, window, TOLERANCE) };
    let mut file = Vec::new();
    convert(&mut patterns.clone(), &config, Path::new("a.wspl"), &mut file, &Silent).unwrap();
    let reader = Reader::open(file).unwrap();
    let windows = &reader.metadata().windows;
    let of_window = |(number, window): (usize, &wavesplat_format::Window)| {
        let codec = WindowCodec::from_metadata(reader.metadata(), window).unwrap();
        let leaves = reader.leaves(number as u32).iter();
        let entries: Vec<BlockEntry> = leaves.flat_map(|leaf| reader.leaf(leaf).unwrap()).collect();
        let of_block = |entry: &BlockEntry| {
            let voxels = EDGE * EDGE * EDGE;
            let all = vec![true; codec.basis.coefficients()];
            let samples = Block::read(&reader, &codec, entry, [EDGE; 3], &all, None, None).unwrap().samples(&codec);
            let block = entry.id.block as usize * voxels;
            let frames = samples.chunks_exact(voxels * 4).zip(window.first_frame as usize..);
            let compared =
                frames.map(|(found, frame)| compare(found, |i| u32::from_le_bytes(patterns.at(frame, block + i))));
            compared.fold(Counts::default(), Add::add)
        };
        entries.par_iter().map(of_block).reduce(Counts::default, Add::add)
    };
    windows.iter().enumerate().map(of_window).fold(Counts::default(), Add::add)
}

/// Compares the samples of a block and frame with their bit patterns.
fn compare(found: &[u8], expected: impl Fn(usize) -> u32) -> Counts {
    let limit = Limit::range(TOLERANCE, 0.0, 1.0);
    let mut seen = Counts::default();
    for (i, bytes) in found.as_chunks().0.iter().enumerate() {
        let (found, expected) = (u32::from_le_bytes(*bytes), expected(i));
        if expected >> 23 & 0xff == 0xff {
            assert_eq!(found, expected, "a missing sample");
            seen.missing += 1;
            continue;
        }
        let (a, b) = (f32::from_bits(found), f32::from_bits(expected));
        // Below 0.999 of the bound, rounding cannot decide the comparison.
        let clear = (f64::from(a) - f64::from(b)).abs() < 0.999 * TOLERANCE;
        assert!(clear || a.is_finite() && limit.holds(a.into(), b.into()), "{a} for {b} ({expected:#x})");
        seen.finite += 1;
        seen.changed += u64::from(found != expected);
    }
    seen
}

/// Number of patterns per batch.
const CHUNK: u64 = 1 << 26;

fn consecutive(place: u64) -> u32 {
    place as u32
}

#[test]
#[ignore = "exhaustive"]
fn every_pattern_of_32_bits_comes_back_within_the_bound() {
    let started = Instant::now();
    let chunk = |first| check(&patterns(first..first + CHUNK, consecutive), Basis::Haar, 1);
    let seen = (0..1 << 32).step_by(CHUNK as usize).map(chunk).fold(Counts::default(), Add::add);
    report(&format!("every f32: {seen:?} in {:.1?}", started.elapsed()));
    assert_eq!((seen.missing, seen.finite), (1 << 24, (1 << 32) - (1 << 24)));
    assert!(seen.changed > 1 << 31, "few were coded: {seen:?}");
}

/// Numbers from 2^-12 to 4 of both signs in any order: these get codes at this step, and not all are zero.
fn shuffled(place: u64) -> u32 {
    const FIRST: u32 = 0x3980_0000;
    const END: u32 = 0x4080_0000;
    let mixed = (place as u32).wrapping_mul(0x9e37_79b1);
    (FIRST + (mixed >> 1) % (END - FIRST)) | mixed << 31
}

#[test]
fn patterns_side_by_side_come_back_within_the_bound_in_windows() {
    let started = Instant::now();
    let (mut place, mut all) = (0, Counts::default());
    for (basis, window) in [(Basis::Haar, 2), (Basis::Multi, 3), (Basis::Haar, 8), (Basis::Multi, 9)] {
        let end = place + (window * VOXELS) as u64;
        let seen = check(&patterns(place..end, shuffled), basis, window);
        assert!(seen.changed > (window * VOXELS) as u64 / 2, "few were coded: {seen:?}");
        (place, all) = (end, all + seen);
    }
    report(&format!("f32 in windows: {all:?} in {:.1?}", started.elapsed()));
}
