//! Fuzz targets: each takes any bytes and panics only if wavesplat has a bug.
//!
//! This file contains no fuzzer. `fuzz_targets/` passes these functions to libFuzzer. `tools/tests/fuzz.rs` includes
//! this file and runs them on the corpus and regressions, on any toolchain.
#![forbid(unsafe_code)]

pub mod files;
pub mod forge;
pub mod input;
pub mod payloads;
pub mod seeds;
pub mod series;
pub mod sources;
pub mod values;

/// A target.
pub type Target = fn(&[u8]);

/// Every target by name; its folders in `corpus/` and `regressions/` have the same name.
pub const TARGETS: [(&str, Target); 16] = [
    ("file", files::file),
    ("metadata", files::metadata),
    ("description", files::description),
    ("codes", payloads::codes),
    ("cells", payloads::cells),
    ("payloads", payloads::payloads),
    ("forged", files::forged),
    ("decode", files::decode),
    ("render", files::render),
    ("bare", files::bare),
    ("prefix", files::prefix),
    ("recovery", files::recovery),
    ("roundtrip", series::roundtrip),
    ("stream", sources::stream),
    ("inputs", sources::inputs),
    ("values", values::values),
];
