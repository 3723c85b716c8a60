//! wavesplat's own instruments: the demo and its physics, the gallery, synthetic archives, contact sheets, differences of pictures, the
//! benchmark.

pub mod bench;
pub mod demo;
pub mod diff;
pub mod eddy;
pub mod gallery;
pub mod lattice;
pub mod output;
pub mod plume;
pub mod random;
mod scenes;
pub mod sheet;
pub mod synth;
mod textbook;
