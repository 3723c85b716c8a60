//! wavesplat compresses time-varying volumes under a guaranteed error bound, and renders pictures from the coefficient
//! file without decompressing it first.
//!
//! Convert an array in memory to a coefficient file. No sample changes by more than 1 % of the value range:
//!
//! ```standalone_crate
//! use wavesplat::convert::{ConvertConfig, convert_to_file};
//! use wavesplat::source::ArraySource;
//!
//! # let folder = tempfile::tempdir().unwrap();
//! # std::env::set_current_dir(&folder).unwrap();
//! let (dims, frames) = ([32, 24, 16], 40); // voxels along x, y, z
//! let samples: Vec<f32> = (0..frames * 32 * 24 * 16).map(|i| (i as f32 * 1e-4).sin()).collect();
//! let mut source = ArraySource::from_f32(dims, &samples)?;
//! let report = convert_to_file(&mut source, &ConvertConfig::new(0.01), "run.wspl")?;
//! assert!(report.output_bytes < report.input_bytes / 10);
//! # Ok::<(), wavesplat::Error>(())
//! ```
//!
//! [`formats::open()`] opens files instead: NRRD, NIfTI, VTK, HDF5, NetCDF, raw bytes and more.
//!
//! Render all frames of a view to PNG files:
//!
//! ```standalone_crate
//! use wavesplat::colour::Scale;
//! use wavesplat::file::CoefficientFile;
//! use wavesplat::render::{CoefficientScene, RenderConfig, render_png};
//! use wavesplat::view::camera::View;
//!
//! # let folder = tempfile::tempdir().unwrap();
//! # std::env::set_current_dir(&folder).unwrap();
//! # let samples: Vec<f32> = (0..8 * 8 * 8 * 4).map(|i| (i as f32 * 0.01).sin()).collect();
//! # let mut source = wavesplat::source::ArraySource::from_f32([8, 8, 8], &samples)?;
//! # wavesplat::convert::convert_to_file(&mut source, &wavesplat::convert::ConvertConfig::new(0.01), "run.wspl")?;
//! let file = CoefficientFile::open("run.wspl")?;
//! let colours = Scale::named("viridis", file.value_range())?;
//! let mut scene = CoefficientScene::from(file);
//! let config = RenderConfig::new(&scene, View::new(30.0, 20.0)); // azimuth and elevation in degrees
//! render_png(&mut scene, &config, &colours, "frame_%04d.png")?;
//! # assert!(std::path::Path::new("frame_0003.png").exists());
//! # Ok::<(), wavesplat::Error>(())
//! ```
//!
//! [`render::render`] gives pictures as numbers, [`render::sink`] writes other formats and videos.
//!
//! Read one region of some frames:
//!
//! ```standalone_crate
//! use wavesplat::Region;
//! use wavesplat::extract::read_region;
//! use wavesplat::file::CoefficientFile;
//!
//! # let folder = tempfile::tempdir().unwrap();
//! # std::env::set_current_dir(&folder).unwrap();
//! # let samples: Vec<f32> = (0..32 * 24 * 16 * 12).map(|i| (i as f32 * 0.01).sin()).collect();
//! # let mut source = wavesplat::source::ArraySource::from_f32([32, 24, 16], &samples)?;
//! # wavesplat::convert::convert_to_file(&mut source, &wavesplat::convert::ConvertConfig::new(0.01), "run.wspl")?;
//! let file = CoefficientFile::open("run.wspl")?;
//! let region = Region { start: [10, 0, 4], end: [20, 24, 5] };
//! let samples: Vec<f32> = read_region(&file, 7..9, &region)?;
//! assert_eq!(samples.len(), 2 * 10 * 24 * 1); // frames, x, y, z; x is fastest
//! # Ok::<(), wavesplat::Error>(())
//! ```
//!
//! [`file::CoefficientFile::open`] also takes addresses, like `https://host/run.wspl`, and
//! [`file::CoefficientFile::from_storage`] any other storage. [`extract::extract`] gives bytes, and
//! [`extract::OutputOfExtraction`] writes the formats of other programs.
//!
//! # Packages
//!
//! This package re-exports five others and holds the two programs. Each folder below `src/` except `bin` is a package. The
//! modules of this table use only those listed before them, so the order is nearly the path of the data.
//!
//! | package | module | content |
//! |---|---|---|
//! | `core` | `base` | errors, grids, samples, mapped files, output files |
//! | | `colour` | transfer functions, and the colours of pixels |
//! | | `source` | frames in order behind one trait, a window at a time |
//! | | `wavelet` | the transform of a series along time, and its inverse (eq 5 and 8) |
//! | | `codec` | one block: samples to codes under the error bound, and back |
//! | | `view` | cameras and footprints (eq 1 to 3, 14) |
//! | `formats` | | formats of files, for both directions: headers of inputs, and of extracted samples |
//! | `engine` | `remote` | files behind `https://` and `s3://`: requests, pages that are kept, a cache |
//! | | `file` | the coefficient file: open, verify, recover, continue |
//! | | `convert` | frames to a coefficient file: reader, workers and writer |
//! | | `render` | blocks to planes (eq 9), planes to frames (eq 8), frames to picture files |
//! | `jobs` | `extract` | a coefficient file back to samples and to files of other programs |
//! | | `picture` | a request for pictures, resolved and carried out, for the programs, the viewer and Python |
//! | `cli` | | the options and commands of the programs in `bin/`, and the server of the viewer |
//! | `web` | | the viewer's answers as WebAssembly, for pages without a server |
//!
//! `formats` and `engine` use `core` but not each other; `jobs` uses all three, `cli` and `web` all four. The bytes of a coefficient
//! file are a package beside `src/`, [`wavesplat-format`](mod@format). [`method`] explains the mathematics.
//!
//! # From a request to a pixel
//!
//! A [`picture::PictureRequest`] says in plain data what is asked for. Options (`cli/render/args.rs`), the page of the viewer
//! (`jobs/picture/view_request.rs`) and Python give one. [`picture::run()`] resolves it against the open inputs of a
//! [`picture::Session`]: `Plan::new` (`jobs/picture/plan/mod.rs`) finds frames, views, colours, ranges and files. In the
//! order of the data:
//!
//! 1. `CoefficientFile::open` (`engine/file/coefficient_file.rs`) reads the directory of blocks.
//! 2. `render` (`engine/render/mod.rs`) chooses the `Renderer` of the mode: `Projection`, which makes a `ViewSetup` of each
//!    view, `Sliced` or `Planes`. All loop over batches of frames with `for_each_batch` (`engine/render/batches/driver.rs`).
//! 3. `Scene::open` (`engine/render/scenes/coefficients.rs`) selects the blocks of a batch, and the parts of them to read.
//! 4. `splat` (`engine/render/splat/`) asks for each block by `FrameBatch::planes`. That reads it
//!    (`engine/file/coefficient_file.rs`), decodes it (`core/codec/decode.rs`) and gives the values of its planes
//!    (`engine/render/scenes/coded.rs`).
//! 5. The values are added to a lattice (`engine/render/splat/lattice/spread.rs`), or to pixels
//!    (`engine/render/splat/footprints.rs`).
//! 6. `PixelReconstructor::tile` (`engine/render/projection/reconstruct.rs`) gathers the planes at pixels from the lattice
//!    (`engine/render/splat/lattice/gather.rs`), turns planes into frames by `TimeBasis::inverse` (`core/wavelet/`), and
//!    divides by weights.
//! 7. `Sink::picture` (`engine/render/sink/mod.rs`) colours and writes each picture.
//!
//! # To add something
//!
//! | what | how |
//! |---|---|
//! | an option of pictures, a mode | `jobs/picture/mod.rs` |
//! | a format of files | `formats/lib.rs` |
//! | a temporal basis | `core/wavelet/mod.rs` |
//! | a question of the viewer's page | `jobs/picture/question.rs` |
//!
//! # Words
//!
//! - A *frame* is one time step of the whole grid. A *voxel* is a point of the grid. A *series* is one voxel over time.
//! - A *window* is a number of consecutive frames that are coded together. A *block* is a box of voxels over one window.
//! - A *channel* is one number per voxel: the samples, or red, green or blue if samples were converted to colours.
//! - A *coefficient* c_{i,k} belongs to voxel i and basis function k. A *code* is a quantised coefficient.
//! - A *part* is a piece of a block that is compressed alone: a group of temporal *levels* from coarse to fine, or what
//!   replaces decoded samples: *outliers*, *missing* samples, or all samples of an *exact* block.
//! - A *footprint* is the projected kernel of a voxel. A *plane* is a sum of footprints over the pixels of a picture, or over
//!   the *cells* of a lattice from which the pixels are computed.
//! - The *tolerance* is the error that the user allows. The *bound* (delta) is the error that is guaranteed. The *share* is
//!   how much of its bound a sample or series uses. *Reached* is the largest error found.
//! - Triples are in the order x, y, z. In arrays x is fastest, then y, z, and time is slowest.
//!
//! # Rules
//!
//! Packages cannot use what their manifests leave out. A test reads the sources and checks the rest.
//!
//! - Modules are listed in the order of the data's path, and use only those listed before them, in the folders that
//!   `tests/layering.rs` names.
//! - `convert`, `render` and `extract` do not use each other: they meet in the coefficient file. Nor do `formats` and
//!   `codec`.
//! - `wavelet`, `codec` and `view`, and the kernels in `engine/render/splat`, are functions over slices: they open no file,
//!   look at no clock and start no thread but those of rayon. `core/codec/buffer.rs` alone has a state: it reuses memory.
//! - Crates that do input, output or threads are used only in the files that `tests/layering.rs` lists for them.
//! - `unsafe` code is at the edges: maps and signals in `core/base/mapped`, and JavaScript in `web/host.rs` and `web/exports.rs`.
//!
//! These rules are not checked by that test:
//!
//! - `wavesplat-format` knows bytes only. It starts no thread, opens no path and maps no memory.
//! - Bytes are copied out of a memory map before they are parsed.
//! - The encoder compares the source with the output of the decoder that readers use.
//! - Results do not depend on the number of threads, the memory budget or the machine. Sums have a fixed order, and all
//!   operations are correctly rounded or come from `libm`.
//! - Memory use follows the budget, not the size of the archive.
//! - All packages transform through the trait `TimeBasis`. `core/wavelet/mod.rs` says what else a new basis needs. A data
//!   source of the renderer can be replaced, too: see [`render::Scene`].

pub use wavesplat_core::base::error::{Error, Result};
pub use wavesplat_core::base::grid::{Grid, Region};
pub use wavesplat_core::base::sample::SampleType;
#[doc(inline)]
pub use wavesplat_core::{bibliography, colour, view};
#[doc(inline)]
pub use wavesplat_engine::{convert, file, remote, render};
pub use wavesplat_format as format;
#[doc(inline)]
pub use wavesplat_formats as formats;
#[doc(inline)]
pub use wavesplat_jobs::{axes, extract, picture};

/// Errors, grids, samples, mapped files and what else all parts use.
pub mod base {
    #[doc(inline)]
    pub use wavesplat_core::base::{
        address, cancel, choice, description, error, grid, inputs, mapped, memory, position, progress, sample, values,
        workers, zeroed,
    };
}

/// Frames in order behind one trait, [`FrameSource`](source::FrameSource), wherever they come from.
pub mod source {
    #[doc(inline)]
    pub use wavesplat_core::source::{
        Archive, ArraySource, CHANNELS, ColourTransform, FrameSource, FrameWindow, GivenTimes, OpenOptions,
        RegularTimes, Selection, Units, VariableAxis, VariableInfo, copy_box, read_frames, select, value_range,
        with_times,
    };
}

#[doc = include_str!("method.md")]
pub mod method {}
