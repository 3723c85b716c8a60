//! The way out of bincode: wincode, whose defaults are the same layout, reads and writes the same record.
//!
//! Its derive is a package of its own; records have no framing of fields, so nested tuples of the fields in their
//! order, with variants as `u32`, are the same bytes.

use crate::testing::metadata;
use crate::*;

type Times = (u64, Vec<f64>, Option<String>);
type Grid = ([u64; 3], [f64; 3], [f64; 3], u32, u32, u16);
type Tolerance = (u32, f64, (f64, f64), Option<f64>);
type Frames = (u64, u32, u32, u32, Vec<u32>);
type Reached = (f64, f64, f64, f64, f64, u64, u64, u64);
type Record = (Grid, Times, Tolerance, Vec<(Frames, Reached)>, Vec<(String, String)>, String);

fn record(m: &Metadata) -> Record {
    let grid = (m.dims, m.spacing, m.origin, m.sample as u32, m.block_edge, m.channels);
    let times = (m.frames, m.times.clone(), m.variable.clone());
    let tolerance = (m.bound as u32, m.tolerance, m.range, m.missing_value);
    let window = |w: &Window| {
        let frames = (w.first_frame, w.frames, w.basis as u32, w.coefficients, w.levels.clone());
        (frames, (w.delta, w.reached, w.squared_error, w.min, w.max, w.missing, w.coded, w.outliers))
    };
    (grid, times, tolerance, m.windows.iter().map(window).collect(), m.settings.clone(), m.program.clone())
}

#[test]
fn wincode_reads_and_writes_the_same_record() {
    let metadata = Metadata { times: (0..7).map(f64::from).collect(), ..metadata() };
    let bytes = metadata.encode().expect("valid");
    assert_eq!(wincode::serialize(&record(&metadata)).expect("serialized"), bytes);
    assert_eq!(wincode::deserialize::<Record>(&bytes).expect("deserialized"), record(&metadata));
}

#[test]
fn the_record_keeps_its_golden_bytes() {
    let hex: String = testing::tiny().encode().expect("valid").iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(hex, include_str!("record.hex").trim());
}
