//! Fuzz targets: each takes any bytes and panics only where wavesplat is wrong.
//!
//! Here is no fuzzer. `fuzz_targets/` gives these functions to libFuzzer, and `tools/tests/fuzz.rs` includes this file and
//! gives them what fuzzers found, on any toolchain.
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

/// Every target by its name, which is also that of its folder in `corpus/` and `regressions/`.
pub const TARGETS: [(&str, Target); 13] = [
    ("file", files::file),
    ("metadata", files::metadata),
    ("codes", payloads::codes),
    ("cells", payloads::cells),
    ("payloads", payloads::payloads),
    ("forged", files::forged),
    ("decode", files::decode),
    ("prefix", files::prefix),
    ("recovery", files::recovery),
    ("roundtrip", series::roundtrip),
    ("stream", sources::stream),
    ("inputs", sources::inputs),
    ("values", values::values),
];
