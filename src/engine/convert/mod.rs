//! Converts frames to a coefficient file: a reader, workers and a writer, with bounded channels between them.
//!
//! ```text
//! reader thread            workers (rayon)           writer (the caller's thread)
//! scan a window      ->    encode blocks,       ->   append in order, directory, footer
//! gather its blocks        tier after tier           window by window
//! ```
//!
//! The writer puts blocks in order. So the bytes do not depend on the number of threads, nor on the memory budget, which only
//! sets how many blocks are in memory. The workers are rayon's global pool. The bound of a window follows from its own samples,
//! or, if the tolerance refers to the value range, from the range of all frames up to its end. That range never exceeds
//! the archive's. So conversion needs only one pass over the data, and a pipe gives the same bytes as files.
//!
//! A window is completed in the file only after its source was found unchanged; then `out` is flushed. So a killed
//! conversion leaves a file that is valid up to its last complete window, and [`convert_into`] continues there. Each window's
//! record holds all that the next window needs, so the resumed file has the same bytes as an uninterrupted one.

mod candidates;
mod choose;
mod coarse;
mod coded_blocks;
mod coded_input;
mod coding;
pub mod estimate;
mod gather;
mod learn;
mod max_error;
mod pipeline;
mod plan;
mod pool;
mod reading;
mod record;
mod request;
mod results;
mod run;
#[doc(hidden)]
pub mod sampled;
mod settings;
pub mod shard;
mod smoothness;
mod spread;
mod target;
mod to_bare;
mod to_file;
mod trial_boxes;
mod variation;
mod warnings;
mod workers;

use crate::file::report::{BoundReport, WindowReport};
use coarse::CoarseBlocks;
pub use coding::{BestFor, SchemeConstraint, SpatialPredictor};
use estimate::EstimatedErrors;
pub use max_error::MaxError;
pub use pipeline::{Conversion, convert, convert_into, convert_together};
use plan::Plan;
pub use request::ConvertRequest;
pub use results::errors_of_results;
pub use run::{Failure, Outcome, Task, append, run, run_together};
use serde::Serialize;
use target::WindowsDone;
pub use target::{ResumePoint, Target};
pub use to_bare::convert_to_bare;
pub use to_file::convert_to_file;
use wavesplat_core::base::choice::Choice;
use wavesplat_core::base::error::{Error, Note};
use wavesplat_core::base::memory;
use wavesplat_core::codec::WindowCodec;
pub use wavesplat_core::codec::bound::{Bound, range_bound};
use wavesplat_core::colour::TransferFunction;
pub use wavesplat_format::{Basis, Packing, Stencil};
use wavesplat_format::{Features, FileId, Keep};

/// What to do with NaN, infinities and the declared missing value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MissingPolicy {
    /// Reject the input; the error names the first one and their number.
    Error,
    /// Keep their bits; they add nothing to pictures.
    Mask,
}

impl Choice for MissingPolicy {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[
        ("error", Self::Error, "Reject the input, and name the first one"),
        ("mask", Self::Mask, "Keep them; they add nothing to pictures"),
    ];
}

/// How to convert. [`ConvertConfig::new`] has the defaults; change others by struct update:
///
/// ```
/// # use wavesplat_engine as wavesplat;
/// use wavesplat::convert::{Bound, ConvertConfig};
///
/// let config = ConvertConfig { bound: Bound::Rms, window: 16, ..ConvertConfig::new(0.001) };
/// ```
#[derive(Debug, Clone)]
pub struct ConvertConfig {
    /// Restricts the choice of scheme. Default: the smallest is found for every window.
    pub coding: SchemeConstraint,
    /// Number of consecutive windows that may reuse the previous window's scheme. A shard is a whole number of such
    /// chains. Default: 8.
    pub chain: usize,
    /// Frames in a window: a power of two for [`Basis::Haar`], one more for [`Basis::Multi`]. Default: 32.
    pub window: usize,
    /// The error allowed, as a share of what the bound refers to, 0 to 1; 0 keeps every bit.
    pub tolerance: f64,
    /// The error allowed in the samples' unit, for a pointwise or rms bound; 0 keeps every bit. It takes the place of
    /// `tolerance` and `range`; see [`ConvertConfig::with_max_error`]. Default: none.
    pub max_error: Option<f64>,
    /// What is promised. Default: no sample is off by more than the tolerance times the value range.
    pub bound: Bound,
    /// The value range that a pointwise or rms tolerance refers to. Default: that of the frames so far.
    pub range: Option<(f64, f64)>,
    /// What to do with missing samples. Default: refuse them.
    pub missing: MissingPolicy,
    /// A value that means "missing", besides NaN and infinities. Default: none.
    pub missing_value: Option<f64>,
    /// Refuse a window if its largest or smallest value repeats, probably means "missing", and would make a bound that
    /// refers to the value range larger than the variation of the other samples. Default: true.
    pub refuse_fill: bool,
    /// What samples keep besides the bound. Default: nothing.
    pub keep: Keep,
    /// Colours to convert samples to before they are coded: three channels, 0 to 1. The bound then refers to the
    /// channels, whose value range is 0 to 1 by default. Default: none.
    pub colours: Option<TransferFunction>,
    /// Voxels a side of a block. Default: as many as suit the window.
    pub block: Option<usize>,
    /// zstd level, 1 to 19. Default: 3.
    pub level: i32,
    /// Bytes that may be allocated. Default: 512 MiB.
    pub memory: usize,
    /// Options that selected the input (frames, region, variable), stored so that the same samples can be found again.
    /// Default: none.
    pub settings: Vec<(String, String)>,
}

impl ConvertConfig {
    /// The defaults, which are those of `wavesplat convert`, with a tolerance: 0.01 allows every sample to be off by 1 % of
    /// the value range.
    pub fn new(tolerance: f64) -> Self {
        Self {
            coding: SchemeConstraint::AUTO,
            chain: CHAIN,
            window: 32,
            tolerance,
            max_error: None,
            bound: Bound::Pointwise,
            range: None,
            missing: MissingPolicy::Error,
            missing_value: None,
            refuse_fill: true,
            keep: Keep::default(),
            colours: None,
            block: None,
            level: 3,
            memory: memory::DEFAULT,
            settings: Vec::new(),
        }
    }

    /// The defaults, with an error in the samples' unit: 0.1 allows every sample to be off by 0.1.
    ///
    /// ```
    /// # mod wavesplat { pub use wavesplat_core::{base::error::Error, source}; pub use wavesplat_engine::{convert, file}; }
    /// use wavesplat::convert::{ConvertConfig, convert_to_file};
    /// use wavesplat::file::{CoefficientFile, promise::max_error};
    /// use wavesplat::source::ArraySource;
    ///
    /// let kelvin: Vec<f32> = (0..4 * 512).map(|i| 280.0 + (i as f32 / 50.0).sin()).collect();
    /// let mut source = ArraySource::from_f32([8, 8, 8], &kelvin)?;
    /// # let folder = tempfile::tempdir().unwrap();
    /// # let path = folder.path().join("run.wspl");
    /// let report = convert_to_file(&mut source, &ConvertConfig::with_max_error(0.1), &path)?;
    /// assert!(report.reached <= 0.1 && report.delta == 0.1);
    /// assert_eq!(max_error(CoefficientFile::open(&path)?.metadata()), Some(0.1));
    /// # Ok::<(), wavesplat::Error>(())
    /// ```
    pub fn with_max_error(max_error: f64) -> Self {
        Self { max_error: Some(max_error), ..Self::new(0.0) }
    }

    /// Whether windows may have pyramids.
    fn has_pyramids(&self) -> bool {
        self.lists() && self.tolerance > 0.0
    }

    /// Whether blocks may list their values: not under the published method.
    fn lists(&self) -> bool {
        self.coding.space != SpatialPredictor::Alone
    }
}

/// The default of [`ConvertConfig::chain`].
const CHAIN: usize = 8;

/// The report of a conversion.
#[derive(Debug, Clone, Serialize)]
pub struct ConvertReport {
    /// Frames of the file.
    pub frames: u64,
    /// Frames that were in the file before.
    pub frames_before: u64,
    /// Windows of the file.
    pub windows: usize,
    /// Samples of all frames.
    pub samples: u64,
    /// Bytes of the samples of all frames.
    pub input_bytes: u64,
    /// Bytes of the coefficient file.
    pub output_bytes: u64,
    /// Nonzero coefficients kept.
    pub coefficients: u64,
    /// Nonzero coefficients per sample.
    pub coefficients_per_sample: f64,
    /// Samples stored exactly because coefficients missed the bound.
    pub outliers: u64,
    /// Missing samples.
    pub missing: u64,
    /// The error bound.
    #[serde(flatten)]
    pub promise: BoundReport,
    /// The value range that a pointwise or rms tolerance refers to; of an error in the samples' unit, that of the decoded
    /// samples.
    pub range: (f64, f64),
    /// The largest bound in any window.
    pub delta: f64,
    /// The largest error reached in any sample.
    pub reached: f64,
    /// The largest share of its bound that any series uses.
    pub share: f64,
    /// Typical variation over time: the median, over the voxels that change, of the standard deviation within a window.
    /// Estimated from some voxels of every window converted now. `None` if no voxel changes.
    pub typical_variation: Option<f64>,
    /// Errors of what is computed from the samples of some blocks, if [they are asked for](ConvertRequest::measures), unless the source is a
    /// stream or the samples are colours.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub results: Option<EstimatedErrors>,
    /// Warnings, with what to change.
    #[serde(skip)]
    pub warnings: Vec<Note>,
    /// The bound and the errors of each window.
    pub per_window: Vec<WindowReport>,
    /// Seconds spent scanning and gathering samples, on the reader's thread.
    pub read_seconds: f64,
    /// Seconds of wall time in which the workers encoded.
    pub encode_seconds: f64,
    /// Seconds spent writing.
    pub write_seconds: f64,
    /// Seconds from start to end.
    pub seconds: f64,
    /// Names of arrays beside the samples that are not kept, since appended frames lack them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub not_kept: Vec<String>,
}

/// An error for compression failures, which happen only if a size exceeds our own limits.
fn bug(error: wavesplat_format::Error) -> Error {
    Error::CoefficientFile { path: "encoding".into(), source: error }
}

/// A window, as the reader prepared it.
#[derive(Debug)]
struct WindowJob {
    /// Which of the conversions it is of.
    conversion: usize,
    index: u32,
    first_frame: u64,
    id: FileId,
    /// How the file's codes are packed, and whether it has a description.
    features: Features,
    codec: WindowCodec,
    /// The blocks of tiers above 0 that were coded so far.
    coarse: CoarseBlocks,
    /// The range that the tolerance refers to: the given one, or that of all samples up to the window's end.
    range: (f64, f64),
    digest: u64,
    /// The times of its frames, if the source has any.
    times: Vec<f64>,
}
