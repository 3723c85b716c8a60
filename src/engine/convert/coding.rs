//! What a user fixes of how samples are coded.

use wavesplat_core::base::choice::Choice;
use wavesplat_core::codec::scheme::Stencil;
use wavesplat_core::wavelet::Basis;
use wavesplat_format::limits::MAX_BLOCK_SAMPLES;

/// The fixed parts of a scheme; the rest is chosen for each window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SchemeConstraint {
    /// The transform along time; none allows any.
    pub basis: Option<Basis>,
    /// The pyramid.
    pub space: SpatialPredictor,
}

/// How coefficients are predicted in space, or samples in space and time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SpatialPredictor {
    /// A pyramid with whichever stencil suits.
    Any,
    /// No prediction: every series is coded by itself.
    Alone,
    /// A pyramid with this stencil.
    Pyramid(Stencil),
}

impl Choice for SpatialPredictor {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[
        ("none", Self::Alone, "No prediction: each series by itself"),
        ("linear", Self::Pyramid(Stencil::Linear), "From two neighbours along an axis"),
        ("cubic", Self::Pyramid(Stencil::Cubic), "From four neighbours along an axis"),
        ("auto", Self::Any, "linear or cubic, whichever makes a few sample boxes smaller"),
    ];
}

/// What a file is made best for, in place of the default, which suits all. It sets window and block where they are not given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BestFor {
    /// Series of single voxels.
    Series,
    /// Single frames and their pictures.
    Pictures,
    /// The smallest file.
    Size,
}

impl Choice for BestFor {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[
        ("series", Self::Series, "Series of single voxels: windows of 128 frames or more, with smaller blocks"),
        ("pictures", Self::Pictures, "Single frames and their pictures: windows of 8 frames"),
        ("size", Self::Size, "The smallest file: blocks of 64 voxels in thick volumes, which take more memory"),
    ];
}

impl BestFor {
    /// Frames in a window; `usual` is the default number.
    pub(super) fn window(self, usual: usize) -> usize {
        match self {
            Self::Series => usual.max(128),
            Self::Pictures => usual.min(8),
            Self::Size => usual,
        }
    }

    /// Voxels a side of a block in windows of `window` frames; none for the default number.
    pub(super) fn block(self, dims: [usize; 3], window: usize) -> Option<usize> {
        let fits =
            |edge: &usize| dims.iter().all(|n| n >= edge) && (edge * edge * edge * window) as u64 <= MAX_BLOCK_SAMPLES;
        Some(64).filter(|edge| self == Self::Size && fits(edge))
    }
}

impl SchemeConstraint {
    /// No constraint: everything is chosen.
    pub const AUTO: Self = Self { basis: None, space: SpatialPredictor::Any };
}

impl From<Basis> for SchemeConstraint {
    /// The bases of [Dobashi](wavesplat_core::bibliography) along time alone, others with a pyramid.
    fn from(basis: Basis) -> Self {
        let space = match basis {
            Basis::Haar | Basis::Multi => SpatialPredictor::Alone, // the published method, for comparisons
            Basis::Samples | Basis::Learned => SpatialPredictor::Any, // only a pyramid makes these files small
        };
        Self { basis: Some(basis), space }
    }
}
