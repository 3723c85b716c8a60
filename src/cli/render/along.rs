//! Options for the samples along a ray.

use super::surfaces::SurfaceList;
use crate::base::error::{Error, Result};
use crate::base::grid::Grid;
use crate::cli::{Numbers, Opacities, Pair, open_colours, stretched};
use crate::colour::TransferFunction;
use crate::file::CoefficientFile;
use crate::render::{Light, Mode};
use clap::{Args, ValueEnum};

/// Options for the samples along a ray.
#[derive(Debug, Args)]
pub(crate) struct AlongArgs {
    /// How the samples along a ray make a pixel [default: iso with --iso, slice with --slice, else projection]
    #[arg(long, value_enum, help_heading = "Along the ray")]
    mode: Option<ModeName>,
    /// Colours and opacities of a composite: a colour map's name or a file. For a projection with --method direct,
    /// samples are turned into these colours before they are splatted. --range gives the values of its first and last
    /// colour [default: viridis; its own values, or those of all frames]
    #[arg(long, value_name = "NAME|FILE", help_heading = "Along the ray")]
    pub(crate) transfer_function: Option<String>,
    /// Opacities of a composite at shares of the range, like 0:0,0.5:0.1,1:0.8, or auto: empty space (the
    /// least value or 0), or else the most common value, is transparent, and rare values are opaque [default: the file's, or auto]
    #[arg(long, value_name = "SHARE:A,...", allow_hyphen_values = true, help_heading = "Along the ray")]
    opacity: Option<Opacities>,
    /// Length in world units over which the opacities apply [default: the largest spacing]
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true, help_heading = "Along the ray")]
    opacity_unit: Option<f64>,
    /// Isosurfaces: V, V:RRGGBB or V:RRGGBB:OPACITY, with commas between. V is a value, or a share of the range such as
    /// 40% [default: 50%; colours of
    /// --transfer-function; opaque if there is one, else 0.6]
    #[arg(long, value_name = "V,...", allow_hyphen_values = true, help_heading = "Along the ray")]
    iso: Option<SurfaceList>,
    /// Shade a composite by the gradient of the samples, so that it looks solid
    #[arg(long, help_heading = "Along the ray")]
    shade: bool,
    /// Direction of the light for --shade and isosurfaces: degrees to the right of the viewer, and degrees above
    /// [default: -30,40]
    #[arg(long, value_name = "AZ,EL", allow_hyphen_values = true, help_heading = "Along the ray")]
    light: Option<Pair>,
    /// Slices per voxel along the ray, and cells per voxel across it [default: by the kernel and the scale, mostly 2]
    #[arg(long, value_name = "N", help_heading = "Along the ray")]
    slices: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ModeName {
    /// Average or sum the samples: see --quantity, --colormap
    Projection,
    /// Colour the samples; near ones hide far ones: see --transfer-function, --opacity
    Composite,
    /// Show the largest value: see --colormap
    Mip,
    /// Show surfaces of equal value: see --iso, --light
    Iso,
    /// Show the samples on planes through the volume: see --slice, --colormap
    Slice,
}

impl ModeName {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Projection => "projection",
            Self::Composite => "composite",
            Self::Mip => "mip",
            Self::Iso => "iso",
            Self::Slice => "slice",
        }
    }

    /// Whether samples along the ray have colours. In the other modes pixels have values, for --colormap.
    pub(crate) fn colours_samples(self) -> bool {
        match self {
            Self::Composite | Self::Iso => true,
            Self::Projection | Self::Mip | Self::Slice => false,
        }
    }

    /// Whether all samples have opacities.
    fn has_opacities(self) -> bool {
        self == Self::Composite
    }

    fn is_of_surfaces(self) -> bool {
        self == Self::Iso
    }

    /// Whether rays are sampled slice by slice.
    fn has_slices(self) -> bool {
        match self {
            Self::Composite | Self::Mip | Self::Iso => true,
            Self::Projection | Self::Slice => false,
        }
    }

    /// Why --transfer-function does not apply to the mode, if it does not.
    fn refuse_colours(self, is_direct: bool) -> Option<String> {
        let why = match self {
            Self::Composite | Self::Iso => return None,
            Self::Projection if is_direct => return None, // frames are turned into colours before they are splatted
            Self::Projection => {
                "with a coefficient file, it colours samples along the ray (--mode composite); --colormap colours \
                 projections, and wavesplat convert --transfer-function makes files of colours"
            }
            Self::Mip => "--mode mip takes --colormap",
            Self::Slice => "--slice takes --colormap",
        };
        Some(format!("--transfer-function: {why}"))
    }

    /// The names of all modes with a property, for messages.
    fn names(of: impl Fn(Self) -> bool) -> String {
        let modes = Self::value_variants().iter().filter(|mode| of(**mode));
        modes.map(|mode| mode.name()).collect::<Vec<_>>().join(" or ")
    }
}

impl AlongArgs {
    /// The mode that was given.
    pub(crate) fn given_mode(&self) -> Option<ModeName> {
        self.mode
    }

    /// Sets the mode.
    pub(crate) fn take_mode(&mut self, mode: ModeName) {
        self.mode = Some(mode);
    }

    /// The mode: as given, or the one that other options imply.
    pub(crate) fn mode_name(&self) -> ModeName {
        self.mode.unwrap_or(if self.iso.is_some() { ModeName::Iso } else { ModeName::Projection })
    }

    /// An error if an option does not apply to the mode.
    pub(crate) fn check(&self, is_direct: bool, colour_map: bool) -> Result<()> {
        let mode = self.mode_name();
        let needs = |given: bool, option: &str, of: fn(ModeName) -> bool| {
            (given && !of(mode)).then(|| format!("{option}: needs --mode {}", ModeName::names(of)))
        };
        let colours = || {
            (colour_map && mode.colours_samples())
                .then(|| format!("--colormap: --mode {} takes its colours from --transfer-function", mode.name()))
        };
        let refused = needs(self.opacity.is_some(), "--opacity", ModeName::has_opacities)
            .or_else(|| needs(self.opacity_unit.is_some(), "--opacity-unit", ModeName::has_opacities))
            .or_else(|| needs(self.iso.is_some(), "--iso", ModeName::is_of_surfaces))
            .or_else(|| needs(self.shade, "--shade", ModeName::has_opacities))
            .or_else(|| needs(self.light.is_some(), "--light", ModeName::colours_samples))
            .or_else(|| needs(self.slices.is_some(), "--slices", ModeName::has_slices))
            .or_else(colours)
            .or_else(|| self.transfer_function.as_ref().and_then(|_| mode.refuse_colours(is_direct)));
        if let Some(what) = refused {
            return Err(Error::usage(what));
        }
        let positive = self.opacity_unit.is_none_or(|unit| unit.is_finite() && unit > 0.0);
        if positive { Ok(()) } else { Err(Error::usage("--opacity-unit: takes a length above 0")) }
    }

    /// The name of the colours of a composite, or of coloured frames.
    pub(crate) fn colours(&self) -> Option<&str> {
        let of_composite = self.mode_name().colours_samples().then_some("viridis");
        self.transfer_function.as_deref().or(of_composite)
    }

    /// Whether the range of a composite's colours is automatic: neither given nor stored with the colours.
    pub(crate) fn is_automatic(&self, range: Option<Pair>) -> Result<bool> {
        let Some(name) = self.colours().filter(|_| self.mode_name().colours_samples() && range.is_none()) else {
            return Ok(false);
        };
        Ok(!TransferFunction::open(name)?.is_of_values())
    }

    /// Whether the opacities of a composite are to be suggested: neither given nor stored with the colours.
    pub(crate) fn suggests_opacities(&self, colours: &TransferFunction) -> bool {
        let suggests = match &self.opacity {
            Some(Opacities::Auto) => true,
            Some(Opacities::Points(_)) => false,
            None => colours.name().is_some(),
        };
        suggests && self.mode_name().has_opacities()
    }

    /// The length over which opacities apply.
    pub(crate) fn unit(&self, grid: &Grid) -> f64 {
        self.opacity_unit.unwrap_or_else(|| grid.largest_spacing())
    }

    /// The colours of a composite of a file, over the given range, their own range, or that of all samples.
    pub(crate) fn of_file(&self, range: Option<Pair>, file: &CoefficientFile) -> Result<Option<TransferFunction>> {
        let Some(name) = self.colours().filter(|_| self.mode_name().colours_samples()) else { return Ok(None) };
        stretched(open_colours("--transfer-function", name)?, range, || Ok(file.source_range())).map(Some)
    }

    /// The mode with these colours, which a composite needs.
    pub(crate) fn mode(&self, colours: Option<&TransferFunction>) -> Result<Mode> {
        let slices = self.slices;
        Ok(match self.mode_name() {
            ModeName::Projection => Mode::Projection,
            ModeName::Composite => {
                let transfer = needed(colours)?;
                let transfer = match &self.opacity {
                    Some(Opacities::Points(points)) => transfer.with_opacity(&points.0),
                    Some(Opacities::Auto) | None => Ok(transfer.clone()),
                };
                let transfer = transfer.map_err(|what| Error::usage(format!("--opacity: {what}")))?;
                let light = (self.shade || self.light.is_some()).then(|| self.lamp());
                Mode::Composite { transfer, unit: self.opacity_unit, slices, light, planes: Vec::new() }
            }
            ModeName::Mip => Mode::Mip { slices },
            ModeName::Iso => {
                let list = self.iso.clone().unwrap_or_default();
                let surfaces = list.surfaces(needed(colours)?, self.transfer_function.is_some());
                Mode::Iso { surfaces, light: self.lamp(), slices }
            }
            ModeName::Slice => Mode::Planes { planes: Vec::new() },
        })
    }

    fn lamp(&self) -> Light {
        let default = Light::default();
        self.light.map_or(default, |Numbers([azimuth, elevation])| Light { azimuth, elevation, ..default })
    }
}

/// The colours of samples.
fn needed(colours: Option<&TransferFunction>) -> Result<&TransferFunction> {
    colours.ok_or_else(|| Error::usage("--mode: needs --transfer-function"))
}
