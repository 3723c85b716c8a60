//! What helps against a problem, as values; programs put it into the words of their options.

use std::fmt::{self, Display};

/// What a caller can do about an error or a note. Fields are named as in the configuration that they belong to.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum Remedy {
    /// Give this field a value, in place of what the files say: `spacing`, `origin`, or `axes`.
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
    /// Choose one index of an axis beside space and time by `variable`, as `NAME[0]`; or say by `axes` what each axis counts.
    ChooseIndex {
        /// The array.
        name: String,
    },
    /// Choose as many frames as the other side has.
    ChooseFrames,
    /// Say by `dims` and `sample` what headerless data is.
    DescribeSamples,
    /// Give one of these fields another value.
    Adjust(&'static [&'static str]),
    /// Set `dims` to this: the file holds just so many frames of that size.
    SetDims {
        /// Voxels along x, y, z.
        dims: [usize; 3],
        /// Frames.
        frames: u64,
    },
    /// Set `allow_gaps`, which takes files in the order in which they are.
    AllowGaps,
    /// Set `missing` to [`crate::convert::MissingPolicy::Mask`], which keeps missing samples.
    MaskMissing,
    /// Build with this Cargo feature.
    BuildWith(&'static str),
    /// Allow the existing file to be replaced.
    Replace,
    /// Discard the unfinished file and begin anew.
    BeginAnew,
    /// Resume the unfinished file, or discard it and begin anew.
    ResumeOrBeginAnew,
    /// Convert the first `frames` frames, and append the others to that file; or begin anew.
    AppendOrBeginAnew {
        /// How many the input had before it grew.
        frames: u64,
    },
    /// Recover what is whole of a damaged file, or read it with damaged blocks left out.
    RecoverOrSkip,
    /// Resume the conversion that left this unfinished file, or recover what it holds.
    ResumeOrRecover,
    /// Give a range above 0, or take the linear norm.
    RangeAboveZero,
    /// Make projections: no other mode has this.
    Project,
    /// Make projections, or convert the samples themselves and not their colours.
    ProjectOrConvertSamples,
}

/// Words about a file or a field, and what can be done about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Note {
    /// What is to be known. It may follow the name of a file.
    pub text: String,
    /// What can be done about it.
    pub remedy: Option<Remedy>,
}

impl Note {
    /// Words with a remedy.
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
    /// The words alone.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}
