//! Remedies for errors and notes. Programs express them by their options.

use std::fmt::{self, Display};

/// What a caller can do about an error or a note. Fields are named as in the configuration that they belong to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Remedy {
    /// Set this field, which overrides the files: `spacing`, `origin`, `axes` or `times`.
    Set(&'static str),
    /// Choose an array by `variable`.
    ChooseVariable,
    /// Choose a component of an array by `variable`: `NAME[0]` up to one less than `components`.
    ChooseComponent {
        /// The array.
        name: String,
        /// How many components it has.
        components: usize,
    },
    /// Choose one index of an axis beside space and time by `variable`, as `NAME[0]`; or give the meaning of
    /// each axis by `axes`.
    ChooseIndex {
        /// The array.
        name: String,
    },
    /// Choose the frames that the other input has.
    ChooseFrames,
    /// Describe headerless data by `dims` and `sample`.
    DescribeSamples,
    /// Give one of these fields another value.
    Adjust(&'static [&'static str]),
    /// Set `dims` to this: the file holds exactly this many frames of this size.
    SetDims {
        /// Voxels along x, y, z.
        dims: [usize; 3],
        /// Frames.
        frames: u64,
    },
    /// Set `allow_gaps`, which accepts files with gaps in their numbers.
    AllowGaps,
    /// Set `missing` to `MissingPolicy::Mask`, which keeps missing samples.
    MaskMissing,
    /// Set `missing_value` to this: it means "missing".
    DeclareMissing(String),
    /// Set `missing_value` to this if it means "missing"; otherwise say by `max_error` what error suits the other samples.
    DeclareMissingOrError(String),
    /// Set this field to a value.
    Try(&'static str, String),
    /// Keep `range`: extracted samples stay within the extremes of the source.
    KeepRange,
    /// Allow larger errors by this field.
    Allow(&'static str),
    /// Build with this Cargo feature.
    BuildWith(&'static str),
    /// Allow the existing file to be replaced.
    Replace,
    /// Allow the existing file to be replaced, or append to it.
    ReplaceOrAppend,
    /// Discard the unfinished file and start over.
    BeginAnew,
    /// Resume the unfinished file, or discard it and start over.
    ResumeOrBeginAnew,
    /// Convert the first `frames` frames, and append the others to that file; or start over.
    AppendOrBeginAnew {
        /// How many the input had before it grew.
        frames: u64,
    },
    /// Recover the undamaged blocks of a file, or read it without the damaged ones.
    RecoverOrSkip,
    /// A server gave wrong bytes twice: recover a downloaded copy, or read it without the damaged blocks.
    DownloadOrSkip,
    /// Resume the conversion that left this unfinished file, or recover its blocks.
    ResumeOrRecover,
    /// Give a range above 0, or take the linear norm.
    RangeAboveZero,
    /// Make projections: other modes do not have this.
    Project,
    /// Make projections, or convert the samples instead of their colours.
    ProjectOrConvertSamples,
}

/// A text about a file or a field, and a remedy.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// The text. It may follow the name of a file.
    pub text: String,
    /// What the caller can do.
    pub remedy: Option<Remedy>,
}

impl Note {
    /// A text with a remedy.
    pub fn with(text: impl Into<String>, remedy: Remedy) -> Self {
        Self { text: text.into(), remedy: Some(remedy) }
    }
}

impl From<String> for Note {
    fn from(text: String) -> Self {
        Self { text, remedy: None }
    }
}

impl From<&str> for Note {
    fn from(text: &str) -> Self {
        text.to_string().into()
    }
}

impl Display for Note {
    /// Writes the text without the remedy.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}
