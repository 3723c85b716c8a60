//! The way out of bincode: wincode, whose defaults are the same layout, reads and writes the same record.
//!
//! Its derive is a package of its own; records have no framing of fields, so nested tuples of the fields in their
//! order, with variants as `u32`, are the same bytes.

use crate::testing::metadata;
use crate::*;

type Times = (u64, Vec<f64>, Option<String>);
type Grid = ([u64; 3], [f64; 3], [f64; 3], u32, u32, u16);
type Tolerance<B> = (B, f64, (f64, f64), Option<f64>);
type Frames = (u64, u32, u32, u32, Vec<u32>);
type Reached = (f64, f64, f64, f64, f64, f64, u64, u64, u64);
type Record<B> = (Grid, Times, Tolerance<B>, Vec<(Frames, Reached)>, Vec<(String, String)>, String);

/// A variant is its number and its fields.
fn record<B>(m: &Metadata, bound: B) -> Record<B> {
    let grid = (m.dims, m.spacing, m.origin, m.sample as u32, m.block_edge, m.channels);
    let times = (m.frames, m.times.clone(), m.variable.clone());
    let tolerance = (bound, m.tolerance, m.range, m.missing_value);
    let window = |w: &Window| {
        let frames = (w.first_frame, w.frames, w.basis as u32, w.coefficients, w.levels.clone());
        (frames, (w.delta, w.reached, w.share, w.squared_error, w.min, w.max, w.missing, w.coded, w.outliers))
    };
    (grid, times, tolerance, m.windows.iter().map(window).collect(), m.settings.clone(), m.program.clone())
}

#[test]
fn wincode_reads_and_writes_the_same_record() {
    let metadata = Metadata { times: (0..7).map(f64::from).collect(), ..metadata() };
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
    let hex: String = testing::tiny().encode().expect("valid").iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(hex, include_str!("record.hex").trim());
}
