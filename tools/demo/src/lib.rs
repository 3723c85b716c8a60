//! The paper's experiment in small, and what the other instruments share with it: a solver for eddy currents, the textbook
//! method, differences of pictures, contact sheets, frames in files.

pub mod differences;
pub mod eddy;
pub mod experiment;
pub mod lattice;
pub mod output;
pub mod scenes;
pub mod sheet;
pub mod textbook;
