//! The settings of a rendering.

use super::light::{Light, Surface, check_surfaces};
use serde::{Deserialize, Serialize};
use std::ops::Range;
use wavesplat_core::base::choice::Choice;
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::grid::{Grid, Region};
use wavesplat_core::colour::TransferFunction;
use wavesplat_core::view::camera::View;
use wavesplat_core::view::footprint::{Kernel, Method};

/// A pixel is background if its weights sum to less than this share of the view's largest sum.
pub(super) const BACKGROUND: f64 = 0.01;

/// The default splat error: the tolerance of the file, at most 1e-3. `None` (frames of an archive) gives 1e-3. The lattice
/// states 6e-4 to 9.5e-4 in most views, so files of 1e-3 are drawn by it; a smaller default would take three times as long.
pub fn default_splat_error(tolerance: Option<f64>) -> f64 {
    tolerance.unwrap_or(f64::INFINITY).min(1e-3)
}

/// The cheapest footprint method within a splat error.
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

/// The quantity that a pixel of a projection shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Quantity {
    /// g, the weighted mean along the ray (eq 12); NaN is background (eq 16).
    Mean,
    /// I, the emission: value times length (eq 4).
    Emission,
}

impl Choice for Quantity {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[
        ("mean", Self::Mean, "The weighted mean along the ray, in the samples' unit"),
        ("emission", Self::Emission, "The sum along the ray: value times length"),
    ];
}

/// How the values along a ray are combined.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Mode {
    /// Sums along the ray give the [`Quantity`].
    #[default]
    Projection,
    /// Values have colours and opacities, and hide the values behind them (eq 29-31).
    Composite {
        /// Colour and opacity of every value.
        transfer: TransferFunction,
        /// Length of the path that has the transfer function's opacity, in world units; by default the largest spacing.
        unit: Option<f64>,
        /// Slices per voxel along the ray, and cells of a slice per voxel across it; by default as many as the kernel and
        /// the scale of the view need.
        slices: Option<usize>,
        /// The light that shades the colours; without, colours do not depend on direction.
        light: Option<Light>,
        /// Opaque planes through the volume, in the colours of their samples.
        planes: Vec<Plane>,
    },
    /// Surfaces where the field has some value, shaded. Near ones hide far ones by their opacity (eq 41, 42).
    Iso {
        /// The surfaces.
        surfaces: Vec<Surface>,
        /// Their light.
        light: Light,
        /// Slices and cells per voxel, as in [`Self::Composite`].
        slices: Option<usize>,
    },
    /// The maximum along the ray.
    Mip {
        /// Slices and cells per voxel, as in [`Self::Composite`].
        slices: Option<usize>,
    },
    /// The interpolated samples on planes through the volume; near planes hide far ones.
    Planes {
        /// The planes, at least one.
        planes: Vec<Plane>,
        /// One view for each plane, which shows it alone in its part of the picture; or none, and the view of the picture shows all.
        panels: Vec<View>,
    },
}

impl Mode {
    /// The kind of numbers in each pixel.
    pub fn pixel(&self) -> Pixel {
        match self {
            Self::Composite { .. } | Self::Iso { .. } => Pixel::Light,
            Self::Projection | Self::Mip { .. } | Self::Planes { .. } => Pixel::Value,
        }
    }

    /// Whether this is [`Self::Iso`].
    pub(super) fn is_of_surfaces(&self) -> bool {
        matches!(self, Self::Iso { .. })
    }

    /// Whether this is [`Self::Projection`].
    pub fn is_projection(&self) -> bool {
        matches!(self, Self::Projection)
    }

    /// Whether light falls on the field.
    pub(super) fn is_shaded(&self) -> bool {
        match self {
            Self::Composite { light, .. } => light.is_some(),
            Self::Iso { .. } => true,
            Self::Projection | Self::Mip { .. } | Self::Planes { .. } => false,
        }
    }

    /// Whether the errors of pixels can be bounded.
    fn can_be_certified(&self) -> bool {
        match self {
            Self::Projection | Self::Iso { .. } => true,
            Self::Composite { planes, .. } => planes.is_empty(),
            Self::Mip { .. } | Self::Planes { .. } => false,
        }
    }

    /// An error if the mode's own settings cannot be used.
    fn check(&self) -> Result<()> {
        match self {
            Self::Composite { light, .. } => light.map_or(Ok(()), |light| light.check()),
            Self::Iso { surfaces, light, .. } => light.check().and_then(|()| check_surfaces(surfaces)),
            Self::Projection | Self::Mip { .. } | Self::Planes { .. } => Ok(()),
        }
    }

    /// The number of slices per voxel that the caller set.
    pub(super) fn slices(&self) -> Option<usize> {
        match self {
            Self::Projection | Self::Planes { .. } => None,
            Self::Composite { slices, .. } | Self::Iso { slices, .. } | Self::Mip { slices } => *slices,
        }
    }
}

/// The settings of a rendering. [`RenderConfig::new`] gives the defaults; struct update changes the others.
#[derive(Debug, Clone)]
pub struct RenderConfig {
    /// How the values along a ray are combined. Default: a projection.
    pub mode: Mode,
    /// The views, at least one; all have the same picture size.
    pub views: Vec<View>,
    /// The kernel of every voxel. Default: [`Kernel::for_grid`].
    pub kernel: Kernel,
    /// The quantity that a pixel of a projection shows. Default: the mean.
    pub quantity: Quantity,
    /// Frame numbers, ascending. Default: all frames.
    pub frames: Vec<usize>,
    /// Whether each view shows one frame alone: the first view the first of `frames`, and so on. A frame may be there
    /// several times then. Default: every view shows all frames.
    pub paired: bool,
    /// The voxels to render; `None`, the default, means all.
    pub region: Option<Region>,
    /// The error that splatting may add. For an emission it is relative to the image of the largest |v| at the
    /// brightest point of the picture plane. For a mean it is relative to the value range at pixels with that point's
    /// sum of weights, and grows in inverse proportion to the sum elsewhere. 0 selects the exact method. Default:
    /// [`default_splat_error`]. Composites and largest values are not splatted.
    pub splat_error: f64,
    /// Whether a quick look is enough: about twice as fast, with a splat error that is estimated, not bounded. Default:
    /// no.
    pub fast: bool,
    /// The error that pictures may have, in the unit of samples. A larger limit reads and splats less. `None` keeps the
    /// precision of the file; it is the default. For an emission, the limit is the error of a picture whose samples all
    /// have this error.
    pub allowed: Option<f64>,
    /// The error that `allowed` limits. Default: the certified error.
    pub error: Limit,
    /// Whether each picture comes with an error bound for every pixel. Default: no.
    pub certify: bool,
    /// Limit of allocated memory in bytes, without the memory of the sink. Default: 512 MiB.
    pub memory: usize,
}

/// Views to render.
pub(super) struct ViewTask {
    pub(super) views: Range<usize>,
    /// The settings, with the frames of these views alone.
    pub(super) config: RenderConfig,
}

/// An error that can be limited.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Limit {
    /// The largest error of any sample, and so of any pixel of a mean.
    #[default]
    Certified,
    /// The estimated root mean square error over the pixels of a window's pictures, per view.
    Expected,
}

impl Choice for Limit {
    const CHOICES: &'static [(&'static str, Self, &'static str)] = &[
        ("certified", Self::Certified, "The largest error of any sample, guaranteed"),
        ("expected", Self::Expected, "The root mean square error over the pixels, estimated"),
    ];
}

// `RenderConfig::new` is in batches/scene.rs, because the defaults depend on the scene.
impl RenderConfig {
    /// Width and height of the pictures.
    pub(super) fn size(&self) -> [usize; 2] {
        self.views[0].size
    }

    /// View and frame of each picture, in the order of the views.
    pub fn shown(&self) -> Vec<(usize, usize)> {
        if self.paired {
            return self.frames.iter().copied().enumerate().collect();
        }
        (0..self.views.len()).flat_map(|view| self.frames.iter().map(move |frame| (view, *frame))).collect()
    }

    /// The number of frames that a view shows.
    pub(super) fn frames_of_view(&self) -> usize {
        if self.paired { self.frames.len().min(1) } else { self.frames.len() }
    }

    /// Views that show the same frames.
    pub(super) fn tasks(&self) -> Vec<ViewTask> {
        if !self.paired {
            return vec![ViewTask { views: 0..self.views.len(), config: self.clone() }];
        }
        let mut first = 0;
        let task = |same: &[usize]| {
            first += same.len();
            let config = Self { frames: vec![same[0]], ..self.clone() };
            ViewTask { views: first - same.len()..first, config }
        };
        self.frames.chunk_by(|a, b| a == b).map(task).collect()
    }

    /// The voxels of a grid to render.
    pub(super) fn clip(&self, grid: &Grid) -> Result<Region> {
        let clip = self.region.unwrap_or(grid.whole());
        if !grid.whole().contains(&clip) || clip.is_empty() {
            let [x, y, z] = grid.dims;
            return Err(Error::setting("region", format!("not within the volume of {x}x{y}x{z} voxels")));
        }
        Ok(clip)
    }

    /// Whether errors are splatted beside values.
    pub(super) fn splats_errors(&self) -> bool {
        self.certify && self.mode.is_projection()
    }

    /// Whether the selection of blocks depends on the view.
    pub(super) fn chooses_by_view(&self) -> bool {
        self.allowed.is_some() && self.error == Limit::Expected
    }

    /// An error unless a scene with this number of frames can be rendered with these settings. `None` means unknown.
    pub(super) fn check(&self, scene_frames: Option<usize>) -> Result<()> {
        if self.views.is_empty() || self.views.iter().any(|view| view.size != self.size()) {
            return Err(Error::setting("views", "takes one view or more, with pictures of one size"));
        }
        if self.paired && self.views.len() != self.frames.len() {
            return Err(Error::setting("views", "are paired with frames, so there must be as many of each"));
        }
        if !self.frames.is_sorted() {
            return Err(Error::setting("frames", "takes ascending numbers"));
        }
        if let (Some(all), Some(last)) = (scene_frames, self.frames.last())
            && *last >= all
        {
            return Err(Error::setting("frames", format!("takes numbers below {all}, not {last}")));
        }
        if !(self.splat_error.is_finite() && self.splat_error >= 0.0) {
            return Err(Error::setting("splat_error", "takes a number of 0 or more"));
        }
        if self.fast && self.certify {
            return Err(Error::setting("fast", "has no bound, so it cannot be certified"));
        }
        self.mode.check()?;
        if self.mode.is_projection() {
            return Ok(());
        }
        let refused = [
            (self.kernel.tau != 0.0, "tau"),
            (self.fast, "fast"),
            (self.chooses_by_view(), "error"),
            (self.quantity != Quantity::Mean, "quantity"),
        ];
        if self.certify && !self.mode.can_be_certified() {
            let what = "applies to projections, isosurfaces, and composites without planes";
            return Err(Error::setting("certify", Note::with(what, Remedy::Project)));
        }
        let projects = |setting| Error::setting(setting, Note::with("applies to projections only", Remedy::Project));
        refused.iter().find(|(wrong, _)| *wrong).map_or(Ok(()), |(_, setting)| Err(projects(setting)))
    }
}

/// A plane across an axis of the lattice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// The axis: 0 is x, 1 is y, 2 is z.
    pub axis: usize,
    /// Its place along the axis, in voxels: 0 is the first voxel, 0.5 is halfway to the second.
    pub at: f64,
}

impl Plane {
    /// Whether the plane lies within a region: from its first voxel to its last.
    pub fn is_within(&self, region: &Region) -> bool {
        self.axis < 3
            && !region.is_empty()
            && self.at >= region.start[self.axis] as f64
            && self.at <= (region.end[self.axis] - 1) as f64
    }
}

/// The kind of numbers in each pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pixel {
    /// One value.
    Value,
    /// Red, green and blue, each a value of its own channel.
    Channels,
    /// Red, green and blue of the light, 0 to 1, and the opacity of the whole ray.
    Light,
}

impl Pixel {
    /// How many numbers a pixel has.
    pub fn numbers(self) -> usize {
        match self {
            Self::Value => 1,
            Self::Channels => 3,
            Self::Light => 4,
        }
    }
}
