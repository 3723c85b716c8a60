//! The colours of values.

use super::ranges::Ranges;
use crate::base::error::{Error, Result};
use crate::cli::{CommonArgs, Pair, open_colours};
use crate::colour::{Clear, Norm, Rgb, TransferFunction};
use crate::render::sink::PictureFormat;
use clap::{Args, ValueEnum};
use std::str::FromStr;

/// Options for colours.
#[derive(Debug, Args)]
pub(crate) struct ColourArgs {
    /// Colour map: viridis plasma inferno magma cividis turbo coolwarm grey rainbow, or a file: ParaView's .json
    /// (FILE#NAME selects one of several maps) or .csv with value,red,green,blue [default: viridis]
    #[arg(long, value_name = "NAME|FILE", help_heading = "Colour")]
    colormap: Option<String>,
    /// Values of the first and the last colour [default: a file's own, or the range in small pictures of up to
    /// 16 frames, without a few extreme values that would take most of the colours; symmetric about 0 with coolwarm]
    #[arg(long, value_name = "LO,HI", allow_hyphen_values = true, help_heading = "Colour")]
    pub(crate) range: Option<Pair>,
    /// Map values to colours linearly, or by their logarithm (down to a ten-thousandth of the largest)
    #[arg(long, value_enum, default_value = "linear", help_heading = "Colour")]
    norm: NormName,
    /// For means and largest values: the range of values that show the background, as LO,HI, auto or none. auto takes
    /// the least value, or 0, if many pixels of small pictures are near it
    #[arg(long, value_name = "LO,HI", default_value = "auto", allow_hyphen_values = true, help_heading = "Colour")]
    clear: ClearSpec,
    /// Background colour, like ffffff [default: that of the theme]
    #[arg(long, value_name = "RRGGBB", value_parser = parse_colour, help_heading = "Colour")]
    pub(crate) background: Option<Rgb>,
}

/// Which values show the background.
#[derive(Debug, Clone, Copy, PartialEq)]
enum ClearSpec {
    /// Those of empty space, if there is much of it.
    Auto,
    Nothing,
    Values(Pair),
}

impl FromStr for ClearSpec {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text {
            "auto" => Ok(Self::Auto),
            "none" => Ok(Self::Nothing),
            _ => match text.parse::<Pair>() {
                Ok(pair) if pair.0[0] <= pair.0[1] => Ok(Self::Values(pair)),
                _ => Err("auto, none, or two numbers, the lower one first".into()),
            },
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum NormName {
    Linear,
    Log,
}

impl From<NormName> for Norm {
    fn from(name: NormName) -> Self {
        match name {
            NormName::Linear => Self::Linear,
            NormName::Log => Self::Log,
        }
    }
}

impl ColourArgs {
    /// Whether --colormap was given, so that arrays hold colours too.
    pub(crate) fn is_asked(&self) -> bool {
        self.colormap.is_some()
    }

    /// Whether clear values are looked for in small pictures.
    pub(crate) fn finds_clear(&self) -> bool {
        self.clear == ClearSpec::Auto && self.norm == NormName::Linear
    }

    /// The values that show the background.
    pub(crate) fn clear(&self, ranges: &Ranges, (lo, hi): (f64, f64), common: &CommonArgs) -> Option<Clear> {
        match self.clear {
            ClearSpec::Nothing => None,
            ClearSpec::Values(pair) => Some(Clear::new(pair.0.into(), (lo, hi))),
            // A logarithm is for values near empty space.
            ClearSpec::Auto if self.norm == NormName::Log => None,
            ClearSpec::Auto => {
                let (clear, empty) = ranges.clear((lo, hi))?;
                let is_zero = empty.value.abs() < 1e-3 * (hi - lo);
                let (value, percent) = (if is_zero { 0.0 } else { empty.value as f32 }, (100.0 * empty.share).round());
                common.note(format_args!(
                    "values near {value}, as in {percent} % of the pixels, show the background; --clear none colours them"
                ));
                Some(clear)
            }
        }
    }

    /// An error if a format cannot hold colours or annotations.
    pub(crate) fn check(&self, format: PictureFormat, annotates: bool) -> Result<()> {
        if format == PictureFormat::Exr && self.is_asked() {
            return Err(Error::usage("--colormap: an .exr holds numbers, not colours; take png with --depth 16"));
        }
        let why = match format {
            PictureFormat::Gray16 => "gray16 has no colours to draw in; take png, or another format",
            PictureFormat::Exr => "an .exr holds numbers to compute with; take png, or another format",
            PictureFormat::Npy if !self.is_asked() => {
                "an .npy holds values to compute with; give --colormap for colours"
            }
            _ => return Ok(()),
        };
        if annotates { Err(Error::usage(format!("--annotate: {why}"))) } else { Ok(()) }
    }

    /// An error if colour options are given for samples that are colours.
    pub(crate) fn refuse_for_colours(&self) -> Result<()> {
        if self.is_asked() {
            let what = "the colours are fixed, since the samples were turned into them";
            return Err(Error::usage(format!("--colormap: {what}")));
        }
        match self.norm {
            NormName::Linear => Ok(()),
            NormName::Log => Err(Error::usage("--norm: is for values with a --colormap; these samples are colours")),
        }
    }

    /// The colours, over the range if one was given.
    pub(crate) fn map(&self) -> Result<TransferFunction> {
        let map = open_colours("--colormap", self.colormap.as_deref().unwrap_or("viridis"))?;
        self.range.map_or(Ok(map.clone()), |range| map.over(range.0.into()))
    }

    /// The values of the first and the last colour, and the norm between them.
    pub(crate) fn spread(
        &self,
        map: &TransferFunction,
        ranges: &Ranges,
        in_colours: bool,
        common: &CommonArgs,
    ) -> Result<((f64, f64), Norm)> {
        if !in_colours {
            return Ok((ranges.values, Norm::Linear));
        }
        let norm = self.norm.into();
        if !map.is_of_values() {
            return Ok((ranges.automatic(norm, map)?, norm));
        }
        let ((lo, hi), (least, most)) = (map.range(), ranges.values);
        if self.range.is_none() && (most < lo || hi < least) {
            let name = self.colormap.as_deref().unwrap_or_default();
            common.note(format_args!(
                "{name} has colours of {lo:.4e} to {hi:.4e}, and values are {least:.4e} to {most:.4e}: --range stretches them"
            ));
        }
        Ok(((lo, hi), norm))
    }
}

pub(crate) fn parse_colour(text: &str) -> std::result::Result<Rgb, String> {
    let wrong = || "takes six hexadecimal digits, such as ffffff".to_string();
    let digits = text.trim_start_matches('#');
    let number = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6).ok_or_else(wrong)?;
    Ok([(number >> 16) as u8, (number >> 8) as u8, number as u8])
}
