#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| wavesplat_fuzz::files::bare(data));
