//! The integration tests, by topic.
#![allow(missing_docs, reason = "tests are read through their names")]
#![allow(clippy::unwrap_used, reason = "a panic is how a test fails")]
#![allow(clippy::needless_range_loop, reason = "the reference spells formulas out with their indices")]

mod adversary;
mod bounds;
mod catalogue;
mod certificates;
mod channels;
mod choice;
mod cli;
mod coefficients;
mod common;
mod composite;
mod decoded_once;
mod detail;
mod determinism;
mod every_float;
mod expected;
mod golden;
mod images;
mod inputs;
mod lattice;
mod kept;
mod layering;
mod library;
mod left_out;
mod literature;
mod max_error;
mod overview;
mod own_scene;
mod partial;
mod python;
mod real;
mod reference;
mod sampled;
mod scenes;
mod specification;
mod torn;
mod truncation;
#[cfg(feature = "view")]
mod viewer;
mod views;
mod wavelets;
