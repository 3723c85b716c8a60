//! Settings with a few named values, and what each does.

use wavesplat_core::base::choice::Choice;

/// How the samples along a ray make a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ModeName {
    /// Their mean or sum.
    Projection,
    /// Their colours; near ones hide far ones.
    Composite,
    /// The largest.
    Mip,
    /// Surfaces of equal value.
    Iso,
    /// The samples on planes.
    Slice,
}

impl Choice for ModeName {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[
        ("projection", Self::Projection, "Average or sum the samples: see `quantity`, `colormap`"),
        (
            "composite",
            Self::Composite,
            "Colour the samples; near ones hide far ones: see `transfer_function`, `opacity`",
        ),
        ("mip", Self::Mip, "Show the largest value: see `colormap`"),
        ("iso", Self::Iso, "Show surfaces of equal value: see `iso`, `light`"),
        ("slice", Self::Slice, "Show the samples on planes through the volume: see `slice`, `colormap`"),
    ];
}

impl ModeName {
    /// Whether samples along the ray have colours. In the other modes pixels have values, for `colormap`.
    pub(crate) fn colours_samples(self) -> bool {
        match self {
            Self::Composite | Self::Iso => true,
            Self::Projection | Self::Mip | Self::Slice => false,
        }
    }

    /// Whether all samples have opacities.
    pub(crate) fn has_opacities(self) -> bool {
        self == Self::Composite
    }

    pub(crate) fn is_of_surfaces(self) -> bool {
        self == Self::Iso
    }

    /// Whether rays are sampled slice by slice.
    pub(crate) fn has_slices(self) -> bool {
        match self {
            Self::Composite | Self::Mip | Self::Iso => true,
            Self::Projection | Self::Slice => false,
        }
    }
}

/// Which side of a patient slices show at the right.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Convention {
    /// The right one: the viewer looks from behind or from above.
    #[default]
    Neurological,
    /// The left one: the viewer faces the patient.
    Radiological,
}

impl Choice for Convention {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[
        ("neurological", Self::Neurological, "The patient's right side is at the right"),
        ("radiological", Self::Radiological, "The patient's left side is at the right"),
    ];
}

/// Colours of background and letters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Theme {
    /// White on black.
    Dark,
    /// Black on white.
    Light,
}

impl Choice for Theme {
    const CHOICES: &'static [(&'static str, Self, &'static str)] =
        &[("dark", Self::Dark, "White on black"), ("light", Self::Light, "Black on white")];
}
