//! Settings with a few named values, and what each does.

use crate::base::choice::Choice;
use crate::colour::Norm;
use crate::render::sink::Depth;
use crate::render::{Limit, Quantity, SplatSource};

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

impl Choice for Quantity {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[
        ("mean", Self::Mean, "The weighted mean along the ray, in the samples' unit"),
        ("emission", Self::Emission, "The sum along the ray: value times length"),
    ];
}

impl Choice for Limit {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[
        ("certified", Self::Certified, "The largest error of any sample, guaranteed"),
        ("expected", Self::Expected, "The root mean square error over the pixels, estimated"),
    ];
}

impl Choice for SplatSource {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[
        ("coefficients", Self::Coefficients, "Splat coefficients once for all frames of a window"),
        ("direct", Self::Samples, "Splat every frame"),
    ];
}

impl Choice for Norm {
    const CHOICES: &'static [(&'static str, Self, &'static str)] =
        &[("linear", Self::Linear, ""), ("log", Self::Log, "")];
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

impl Choice for Depth {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[("8", Self::Eight, ""), ("16", Self::Sixteen, "")];

    fn named(name: &str) -> Result<Self, String> {
        match name {
            "8" => Ok(Self::Eight),
            "16" => Ok(Self::Sixteen),
            _ => Err("8 or 16".into()),
        }
    }
}
