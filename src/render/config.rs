//! What is to be rendered, and how.

use crate::base::error::{Error, Result};
use crate::base::grid::Region;
use crate::colour::TransferFunction;
use crate::view::camera::View;
use crate::view::footprint::{Kernel, Method};

/// A pixel is background where its weights sum to less than this share of the view's largest sum.
pub(super) const BACKGROUND: f64 = 0.01;

/// The default splat error for a file of this tolerance, or for frames: half the tolerance, at most 1e-3.
pub fn default_splat_error(tolerance: Option<f64>) -> f64 {
    tolerance.map_or(f64::INFINITY, |t| t / 2.0).min(1e-3)
}

/// The cheapest footprints within an error.
pub fn splat_method(quantity: Quantity, error: f64) -> Method {
    Method::within(most_splat_error(quantity, error))
}

/// The error that splatting may add.
pub(super) fn most_splat_error(quantity: Quantity, error: f64) -> f64 {
    match quantity {
        Quantity::Emission => error,
        // A pixel that is not background must keep some of its weights.
        Quantity::Mean => error.min(0.9 * BACKGROUND),
    }
}

/// What a pixel means (method.md section 2).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// g, the weighted mean along the ray; NaN is background (eq 12).
    Mean,
    /// I, the emission: value times length (eq 4).
    Emission,
}

/// What becomes of what lies along a ray.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Mode {
    /// It is summed up: the quantity that is asked for.
    #[default]
    Projection,
    /// It is coloured, and hides what is behind (method.md section 7).
    Composite {
        /// Colour and opacity of every value.
        transfer: TransferFunction,
        /// World units of a path that has such an opacity; by default the largest spacing.
        unit: Option<f64>,
        /// Slabs that the volume is cut into; by default each is about as thick as the largest spacing.
        slabs: Option<usize>,
    },
    /// The largest value is taken.
    Mip {
        /// As of [`Self::Composite`].
        slabs: Option<usize>,
    },
}

impl Mode {
    /// What the numbers of a pixel are.
    pub fn pixel(&self) -> Pixel {
        if matches!(self, Self::Composite { .. }) { Pixel::Light } else { Pixel::Value }
    }

    /// Whether rays are summed up.
    pub fn is_projection(&self) -> bool {
        matches!(self, Self::Projection)
    }

    /// How many slabs are asked for.
    pub(super) fn slabs(&self) -> Option<usize> {
        match self {
            Self::Projection => None,
            Self::Composite { slabs, .. } | Self::Mip { slabs } => *slabs,
        }
    }
}

/// How to render. [`RenderConfig::new`] has the defaults; change others by struct update.
#[derive(Debug, Clone)]
pub struct RenderConfig {
    /// What becomes of what lies along a ray. Default: a projection.
    pub mode: Mode,
    /// From where, one view or more; pictures of all views are equally large.
    pub views: Vec<View>,
    /// The kernel. Default: of 0.75 of the largest distance of voxels, without attenuation.
    pub kernel: Kernel,
    /// What a pixel means. Default: the mean.
    pub quantity: Quantity,
    /// Which frames, ascending. Default: all.
    pub frames: Vec<usize>,
    /// Which voxels; none means all. Default: none.
    pub region: Option<Region>,
    /// What splatting may add to the error: of an emission relative to the image of the largest |v| at the brightest
    /// place of the plane of the picture, of a mean relative to the value range where weights sum to as much as there, and
    /// elsewhere in inverse proportion to that sum. 0 asks for the exact method. Default: half of
    /// [`Scene::tolerance`](super::Scene::tolerance), at most 1e-3.
    pub splat_error: f64,
    /// How far off the picture may be, in the unit of samples, so that less is read and splatted; none: as near as the
    /// file is. Of an emission: as far as where all samples are off by so much. Default: none.
    pub allowed: Option<f64>,
    /// Which error that limits. Default: the certified one.
    pub limited: Limit,
    /// Whether each picture comes with a bound on the error of every pixel. Default: no.
    pub certify: bool,
    /// Bytes that may be allocated, besides what takes the pictures. Default: 512 MiB.
    pub memory: usize,
}

/// An error that can be limited.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Limit {
    /// The largest of any sample, and so of any pixel of a mean.
    #[default]
    Certified,
    /// The root mean square over the pixels of a window's pictures of a view, as it is estimated.
    Expected,
}

impl RenderConfig {
    /// Width and height of the pictures.
    pub(super) fn size(&self) -> [usize; 2] {
        self.views[0].size
    }

    /// Whether it depends on the view what is read of a file.
    pub(super) fn chooses_by_view(&self) -> bool {
        self.allowed.is_some() && self.limited == Limit::Expected
    }

    pub(super) fn check(&self) -> Result<()> {
        if self.views.is_empty() || self.views.iter().any(|view| view.size != self.size()) {
            return Err(Error::usage("takes one view or more, with pictures of one size"));
        }
        if self.mode.is_projection() {
            return Ok(());
        }
        let refused = [
            (self.kernel.tau != 0.0, "--tau: is of projections alone (--mode projection)"),
            (self.certify, "--error-image: certifies projections alone (--mode projection)"),
            (self.chooses_by_view(), "--error expected: is of projections alone (--mode projection)"),
            (self.quantity != Quantity::Mean, "--quantity: is of projections alone (--mode projection)"),
        ];
        refused.iter().find(|(wrong, _)| *wrong).map_or(Ok(()), |(_, what)| Err(Error::usage(*what)))
    }
}

/// What the numbers of a pixel are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pixel {
    /// A value.
    Value,
    /// Red, green and blue, each as a value is.
    Channels,
    /// Red, green and blue of the light that comes out, 0 to 1, and the opacity of all that is there.
    Light,
}

impl Pixel {
    /// How many there are.
    pub fn numbers(self) -> usize {
        match self {
            Self::Value => 1,
            Self::Channels => 3,
            Self::Light => 4,
        }
    }
}
