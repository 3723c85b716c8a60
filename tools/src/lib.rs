//! wavesplat's own instruments: the gallery, synthetic archives, differences of pictures, the benchmark. What they share
//! with the demo is in [`wavesplat_demo`].

pub mod bench;
pub mod diff;
pub mod gallery;
pub mod plume;
pub mod random;
pub mod synth;
