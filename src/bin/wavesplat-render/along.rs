//! Options for the samples along a ray.

use clap::{Args, ValueEnum};
use wavesplat::base::error::{Error, Result};
use wavesplat::cli::{OpacityPoints, Pair, open_colours, stretched};
use wavesplat::colour::TransferFunction;
use wavesplat::file::CoefficientFile;
use wavesplat::render::Mode;

/// Options for the samples along a ray.
#[derive(Debug, Args)]
pub(crate) struct AlongArgs {
    /// How the samples along a ray make a pixel
    #[arg(long, value_enum, default_value = "projection", help_heading = "Along the ray")]
    pub(crate) mode: ModeName,
    /// Colours and opacities of a composite: a colour map's name or a file. For a projection with --method direct,
    /// samples are turned into these colours before they are splatted. --range gives the values of its first and last
    /// colour [default: viridis; its own values, or those of all frames]
    #[arg(long, value_name = "NAME|FILE", help_heading = "Along the ray")]
    pub(crate) transfer_function: Option<String>,
    /// Opacities of a composite at shares of the range, like 0:0,0.5:0.1,1:0.8 [default: the file's, or 0 to 1]
    #[arg(long, value_name = "SHARE:A,...", allow_hyphen_values = true, help_heading = "Along the ray")]
    opacity: Option<OpacityPoints>,
    /// Length in world units over which the opacities apply [default: the largest spacing]
    #[arg(long, value_name = "LENGTH", allow_hyphen_values = true, help_heading = "Along the ray")]
    opacity_unit: Option<f64>,
    /// Number of slabs that divide the volume by depth [default: each as thick as the largest spacing]
    #[arg(long, value_name = "N", help_heading = "Along the ray")]
    slabs: Option<usize>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum ModeName {
    /// Average or sum the samples: see --quantity, --colormap
    Projection,
    /// Colour the samples; near ones hide far ones: see --transfer-function, --opacity
    Composite,
    /// Show the largest value: see --colormap
    Mip,
}

impl AlongArgs {
    /// An error if an option does not apply to the mode.
    pub(crate) fn check(&self, is_direct: bool, colour_map: bool) -> Result<()> {
        let composite = self.mode == ModeName::Composite;
        let colours = "colours samples along the ray (--mode composite); --colormap colours projections, and wavesplat convert \
                       --transfer-function makes files of colours";
        let wrong = [
            (self.opacity.is_some() && !composite, "--opacity: needs --mode composite"),
            (self.opacity_unit.is_some() && !composite, "--opacity-unit: needs --mode composite"),
            (self.slabs.is_some() && self.mode == ModeName::Projection, "--slabs: needs --mode composite or mip"),
            (composite && colour_map, "--colormap: a composite takes its colours from --transfer-function"),
            (
                self.transfer_function.is_some() && self.mode == ModeName::Mip,
                "--transfer-function: --mode mip takes --colormap",
            ),
        ];
        if let Some((_, what)) = wrong.into_iter().find(|(wrong, _)| *wrong) {
            return Err(Error::usage(what));
        }
        if self.transfer_function.is_some() && self.mode == ModeName::Projection && !is_direct {
            return Err(Error::usage(format!("--transfer-function: with a coefficient file, it {colours}")));
        }
        let positive = self.opacity_unit.is_none_or(|unit| unit.is_finite() && unit > 0.0);
        if positive { Ok(()) } else { Err(Error::usage("--opacity-unit: takes a length above 0")) }
    }

    /// The name of the colours of a composite, or of coloured frames.
    pub(crate) fn colours(&self) -> Option<&str> {
        let of_composite = (self.mode == ModeName::Composite).then_some("viridis");
        self.transfer_function.as_deref().or(of_composite)
    }

    /// Whether the range of a composite's colours is automatic: neither given nor stored with the colours.
    pub(crate) fn is_automatic(&self, range: Option<Pair>) -> Result<bool> {
        let Some(name) = self.colours().filter(|_| self.mode == ModeName::Composite && range.is_none()) else {
            return Ok(false);
        };
        Ok(!TransferFunction::open(name)?.is_of_values())
    }

    /// The colours of a composite of a file, over the given range, their own range, or that of all samples.
    pub(crate) fn of_file(&self, range: Option<Pair>, file: &CoefficientFile) -> Result<Option<TransferFunction>> {
        let Some(name) = self.colours().filter(|_| self.mode == ModeName::Composite) else { return Ok(None) };
        stretched(open_colours("--transfer-function", name)?, range, || Ok(file.source_range())).map(Some)
    }

    /// The mode with these colours.
    pub(crate) fn mode(&self, colours: Option<&TransferFunction>) -> Result<Mode> {
        let slabs = self.slabs;
        Ok(match (self.mode, colours) {
            (ModeName::Composite, Some(transfer)) => {
                let points = self.opacity.as_ref().map(|points| transfer.with_opacity(&points.0));
                let transfer = points.unwrap_or_else(|| Ok(transfer.clone()));
                let transfer = transfer.map_err(|what| Error::usage(format!("--opacity: {what}")))?;
                Mode::Composite { transfer, unit: self.opacity_unit, slabs }
            }
            (ModeName::Mip, _) => Mode::Mip { slabs },
            _ => Mode::Projection,
        })
    }
}
