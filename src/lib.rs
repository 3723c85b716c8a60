//! wavesplat: time-varying volumes as few coefficients under a guaranteed error bound, and pictures from them.
//!
//! # The data's path
//!
//! ```text
//!  frame files, a pipe                      source/     one file per input format behind one trait; mapped.rs
//!    |  windows of T frames                 scan.rs     value range, missing samples: fixes the window's bound
//!    |  or the channels of their colours    source/coloured.rs, by a transfer function of colour/
//!    |  boxes of voxels                     convert/    reader -> workers -> writer, bounded channels, in order
//!    v
//!  series, 8 voxels at a time               wavelet/    forward: samples to T coefficients along time (eq 5)
//!    |                                      codec/      truncate under the bound, quantise, decode again, compare;
//!    v                                                  what missed the bound is stored exactly
//!  coded blocks                             format/     parts packed by zstd, directory, checksums (another package)
//!    |
//!  ===== the .wspl file: the only meeting point of the two halves =====                          file.rs
//!    |
//!    v
//!  blocks that the picture needs            render/     plan: what fits in memory; reading: what the error allows to
//!    |                                                  leave out; scene: what is splatted
//!    |  amounts of voxels, plane by plane   codec/      the same decoder
//!    v
//!  planes of cells, then of tiles           render/lattice/ spread and gather on the sheared lattice of the view; or
//!    |                                      footprint.rs, render/splat.rs (eq 4 and 9); camera.rs, render/canvas.rs;
//!    |                                      render/slabs/ cuts the volume for what hides and what is largest
//!    |  per pixel                           wavelet/    inverse: T coefficient images to T frames (eq 8)
//!    v
//!  pictures, and what is known of errors    render/finish.rs, weights.rs (eq 12), certificate.rs, expectation.rs,
//!                                           annotate/, sink/; colour/; output.rs
//! ```
//!
//! `extract/` takes the same file back to samples, in the formats of other programs too, `verify.rs` compares it with its
//! source, `recover.rs` saves what is whole of a damaged one, and `resume.rs` finds what a conversion can go on with. The
//! programs in `bin/` turn arguments into configurations and call one function; what they share is `cli/`.
//!
//! # Words
//!
//! *frame* one time step of the whole grid; *voxel* a lattice point; *series* one voxel over time; *window* T
//! consecutive frames; *block* a box of voxels over one window; *coefficient* c_{i,k} of voxel i and basis function k;
//! *channel* the samples, or red, green or blue of the colours that they were turned into, coded like samples;
//! *code* a quantised coefficient; *part* a piece of a block with its own zstd frame: a group of temporal *levels*,
//! coarse to fine, or what overrides them (*outliers*, *missing* samples, an *exact* block); *plane* a sum of splats
//! over pixels, or over the *cells* of the lattice that a view shears the volume's into; *footprint* the projected kernel; *tolerance* what the user allows, *bound* (delta) what is guaranteed,
//! *share* how much of its bound a sample or series uses, *reached* the largest error found.
//! Triples are x, y, z; arrays have x fastest, then y, z, and time slowest.
//!
//! # Who may call whom
//!
//! `bin, cli, tools -> convert | render | extract | verify | recover | resume | report -> source, scan, codec, file, camera, footprint
//! -> wavelet, bound, sample, volume, mapped, npy, output, error -> format`. A test reads the sources and holds this.
//!
//! 1. `convert` and `render` never name each other; the file is their only meeting point.
//! 2. `format` knows bytes: it starts no thread, opens no path, maps no memory.
//! 3. Kernels (`wavelet`, `bound`, `codec`, `camera`, `footprint`, `render/splat`, `render/lattice`) are pure functions
//!    over slices: no I/O, no threads, no clocks; `codec/buffer.rs` alone remembers anything: memory that is free. Threads
//!    live in `convert/mod.rs`, `convert/choose.rs`, `convert/sampled.rs`, `scan.rs`, `render/canvas.rs`,
//!    `render/weights.rs`, `extract/mod.rs`, `verify.rs` and, to find damage, `file.rs`; `render/plan.rs` asks how many there are.
//!    In `mapped.rs` one waits for signals, and `source/formats/arrays` may decode chunks on the workers that read.
//! 4. `unsafe` is in `mapped.rs` alone. Bytes are copied out of a map before anyone looks at them.
//! 5. The encoder decides by the decoder: what [`codec`] decodes is what was compared with the source.
//! 6. No result depends on the number of threads, on the memory budget or on the machine: sums have a fixed order, and
//!    only correctly rounded operations and `libm` are used.
//! 7. Nothing is ever loaded whole: memory follows the budget and not the archive.
//! 8. A transform is one replaceable part: [`wavelet::TimeBasis`] is all that the rest knows of it, and a
//!    [`render::Scene`] turns blocks into amounts of voxels and planes into frames, whatever they are made of.

pub use base::error::{Error, Result};
pub use base::grid::{Grid, Region};
pub use base::sample::SampleType;

pub mod base;
pub mod source;
pub mod colour;
pub mod wavelet;
pub mod codec;
pub mod file;
pub mod convert;
pub mod view;
pub mod render;
pub mod extract;
#[cfg(feature = "args")]
pub mod cli;

#[doc = include_str!("method.md")]
#[allow(rustdoc::private_intra_doc_links, reason = "it links to the modules that implement it, public or not")]
pub mod method {}
#[doc = include_str!("bibliography.md")]
pub mod bibliography {}
