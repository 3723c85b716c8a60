//! Replacing bincode is possible: wincode reads and writes the same record, because its defaults have the same layout.
//!
//! wincode's derive macro is a separate package, which is not used here. Records do not frame their fields, so nested
//! tuples of the fields in order, with variants as `u32`, have the same bytes.

use crate::testing::metadata;
use crate::*;

type Times = (u64, Vec<f64>, Option<String>);
type Grid = ([u64; 3], [f64; 3], [f64; 3], u32, u32, u16);
type Tolerance<B> = (B, f64, Option<f64>);
type Refined = Option<(Vec<u32>, u32, f64, f64, u8)>;
type Coded = (u32, u32, Vec<u32>, Vec<i16>, Refined, f64, (f64, f64), u64);
type Reached = (f64, f64, f64, f64, f64, f64, u64, u64, u64);
type Record<B> = (Grid, Times, Tolerance<B>, Vec<(u64, u32, Coded, Reached)>, Vec<(String, String)>, String);

/// A variant as its number and its fields.
fn record<B>(m: &Metadata, bound: B) -> Record<B> {
    let grid = (m.dims, m.spacing, m.origin, m.sample as u32, m.block_edge, m.channels);
    let times = (m.frames, m.times.clone(), m.variable.clone());
    let tolerance = (bound, m.tolerance, m.missing_value);
    let window = |w: &Window| {
        let (levels, functions, pyramid) = (w.levels.clone(), w.functions.clone(), w.pyramid.as_ref().map(refined));
        let coded = (w.basis as u32, w.coefficients, levels, functions, pyramid, w.coarseness, w.range, w.digest);
        let reached = (w.delta, w.reached, w.share, w.squared_error, w.min, w.max, w.missing, w.coded, w.outliers);
        (w.first_frame, w.frames, coded, reached)
    };
    (grid, times, tolerance, m.windows.iter().map(window).collect(), m.settings.clone(), m.program.clone())
}

fn refined(p: &Pyramid) -> (Vec<u32>, u32, f64, f64, u8) {
    let flags = u8::from(p.single) + 2 * u8::from(p.packing == Packing::Nested) + 4 * u8::from(p.ghosts);
    (p.order.iter().map(|axis| *axis as u32).collect(), p.stencil as u32, p.growth, p.most, flags)
}

/// Metadata that uses every field: the first window has no pyramid, the second has a pyramid and a learned basis.
fn every_field() -> Metadata {
    let mut metadata = Metadata { times: (0..7).map(f64::from).collect(), ..metadata() };
    let order = vec![Axis::Z, Axis::X];
    let pyramid = Pyramid {
        order,
        stencil: Stencil::Cubic,
        growth: 1.5,
        most: 3.0,
        single: true,
        packing: Packing::Flat,
        ghosts: false,
        tiers: 0,
    };
    let coded = Window { basis: Basis::Learned, coefficients: 3, ..metadata.windows[1].clone() };
    let functions = vec![1, -2, 3, -32768, 5, 32767];
    metadata.windows[1] = Window { levels: Vec::new(), functions, pyramid: Some(pyramid), ..coded };
    metadata
}

#[test]
fn wincode_reads_and_writes_the_same_record() {
    let metadata = every_field();
    let with = |bound| Metadata { bound, ..metadata.clone() };
    let bytes = with(Bound::Rms).encode().expect("valid");
    let expected = record(&metadata, 1u32);
    assert_eq!(wincode::serialize(&expected).expect("serialized"), bytes);
    assert_eq!(wincode::deserialize::<Record<u32>>(&bytes).expect("deserialized"), expected);
    let bytes = with(Bound::Relative { floor: 0.125 }).encode().expect("valid");
    assert_eq!(wincode::serialize(&record(&metadata, (2u32, 0.125))).expect("serialized"), bytes);
    let bytes = with(Bound::Sampled { samples: 300, seed: 1 << 40 }).encode().expect("valid");
    assert_eq!(wincode::serialize(&record(&metadata, (3u32, 300u32, 1u64 << 40))).expect("serialized"), bytes);
}

#[test]
fn the_record_keeps_its_golden_bytes() {
    let hex: String = every_field().encode().expect("valid").iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(hex, include_str!("record.hex").trim());
}
