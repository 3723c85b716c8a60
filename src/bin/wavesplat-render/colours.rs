//! Which colours values have.

use clap::{Args, ValueEnum};
use wavesplat::cli::{CommonArgs, Pair, open_colours};
use wavesplat::colour::{Norm, Rgb, TransferFunction};
use wavesplat::error::{Error, Result};
use wavesplat::progress::Silent;
use wavesplat::render::sink::PictureFormat;
use wavesplat::render::{RenderConfig, Scene, render};

/// Options on colours.
#[derive(Debug, Args)]
pub(crate) struct ColourArgs {
    /// Colour map: viridis plasma inferno magma cividis turbo coolwarm grey rainbow, or a file: ParaView's .json (of several
    /// maps, FILE#NAME) or .csv with value,red,green,blue [default: viridis]
    #[arg(long, value_name = "NAME|FILE", help_heading = "Colour")]
    colormap: Option<String>,
    /// Values of the first and the last colour [default: a file's own, or those of small pictures of 16 frames of the archive,
    /// but for few spots that would take most colours; to both sides of 0 alike with coolwarm]
    #[arg(long, value_name = "LO,HI", allow_hyphen_values = true, help_heading = "Colour")]
    pub(crate) range: Option<Pair>,
    /// Spread values over colours evenly, or by their logarithm (no further down than to a ten-thousandth of the largest)
    #[arg(long, value_enum, default_value = "linear", help_heading = "Colour")]
    norm: NormName,
    /// Draw a colour bar and the time of each frame into the pictures
    #[arg(long, help_heading = "Colour")]
    pub(crate) annotate: bool,
    /// Colour of the background, as ffffff
    #[arg(long, value_name = "RRGGBB", default_value = "000000", value_parser = parse_colour, help_heading = "Colour")]
    pub(crate) background: Rgb,
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
    /// Whether a map was named, so that arrays hold colours too.
    pub(crate) fn is_asked(&self) -> bool {
        self.colormap.is_some()
    }

    /// An error if a format has no colours to draw in.
    pub(crate) fn check(&self, format: PictureFormat) -> Result<()> {
        let why = match format {
            PictureFormat::Gray16 => "gray16 has no colours to draw in; take png, or another format",
            PictureFormat::Npy if !self.is_asked() => {
                "an .npy holds values to compute with; give --colormap for colours"
            }
            _ => return Ok(()),
        };
        if self.annotate { Err(Error::usage(format!("--annotate: {why}"))) } else { Ok(()) }
    }

    /// An error if anything is asked of colours that are those of the samples.
    pub(crate) fn refuse_for_colours(&self) -> Result<()> {
        if self.is_asked() {
            let what = "the colours are fixed, since the samples themselves were turned into them";
            return Err(Error::usage(format!("--colormap: {what}")));
        }
        match self.norm {
            NormName::Linear => Ok(()),
            NormName::Log => Err(Error::usage("--norm: spreads values over a --colormap, and these are colours")),
        }
    }

    /// The colours, over the range that was asked for.
    pub(crate) fn map(&self) -> Result<TransferFunction> {
        let map = open_colours("--colormap", self.colormap.as_deref().unwrap_or("viridis"))?;
        self.range.map_or(Ok(map.clone()), |range| map.over(range.0.into()))
    }

    /// The values of the first and the last colour, and how those between are spread.
    pub(crate) fn spread(
        &self,
        map: &TransferFunction,
        seen: &Ranges,
        in_colours: bool,
        common: &CommonArgs,
    ) -> Result<((f64, f64), Norm)> {
        if !in_colours {
            return Ok((seen.values, Norm::Linear));
        }
        let norm = self.norm.into();
        if !map.is_of_values() {
            return Ok((seen.automatic(norm, map)?, norm));
        }
        let ((lo, hi), (least, most)) = (map.range(), seen.values);
        if self.range.is_none() && (most < lo || hi < least) {
            let name = self.colormap.as_deref().unwrap_or_default();
            common.note(format_args!(
                "{name} has colours of {lo:.4e} to {hi:.4e}, and values are {least:.4e} to {most:.4e}: --range stretches them"
            ));
        }
        Ok(((lo, hi), norm))
    }
}

fn parse_colour(text: &str) -> std::result::Result<Rgb, String> {
    let wrong = || "takes six hexadecimal digits, as ffffff".to_string();
    let digits = text.trim_start_matches('#');
    let number = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6).ok_or_else(wrong)?;
    Ok([(number >> 16) as u8, (number >> 8) as u8, number as u8])
}

/// Pixels that a range is judged by, at most.
const MOST_SEEN: usize = 1 << 20;

/// The range of ascending values, without the outermost ones where a few spots would take most of the colours: at either end
/// at most one value in 200, and only if those take up two fifths of the range.
fn without_spots(seen: &[f32]) -> (f64, f64) {
    let few = seen.len() / 200;
    let at = |n: usize| f64::from(seen[n]);
    let (lo, hi, low, high) = (at(0), at(seen.len() - 1), at(few), at(seen.len() - 1 - few));
    let (spots, nothing) = (0.4 * (hi - lo), 0.05 * (hi - lo));
    let clipped = |end: f64, inner: f64| if (end - inner).abs() >= spots && high - low > nothing { inner } else { end };
    (clipped(lo, low), clipped(hi, high))
}

/// The ranges of the pictures and of their errors.
pub(crate) struct Ranges {
    values: (f64, f64),
    /// The smallest value above 0, if there is one.
    positive: Option<f64>,
    pub(crate) errors: (f64, f64),
}

impl Default for Ranges {
    fn default() -> Self {
        Self { values: (0.0, 1.0), positive: Some(1.0), errors: (0.0, 1.0) }
    }
}

impl Ranges {
    /// Of small pictures of frames spread over the archive: the same for every frame, whichever are asked for. (0, 1) if
    /// they show nothing; errors begin at 0.
    pub(crate) fn of(scene: &mut dyn Scene, mut small: RenderConfig) -> Result<Self> {
        const PIXELS: f64 = 64.0;
        const FRAMES: usize = 16;
        for view in &mut small.views {
            let shrink = (PIXELS / view.size[0].max(view.size[1]) as f64).min(1.0);
            view.size = view.size.map(|n| ((n as f64 * shrink).ceil() as usize).max(1));
            view.scale = view.scale.map(|s| s * shrink);
        }
        let last = scene.frames().unwrap_or(1).saturating_sub(1);
        small.frames = (0..FRAMES).map(|i| i * last / (FRAMES - 1)).collect();
        small.frames.dedup();
        let mut ranges = Self::default();
        let pixels = small.frames.len() * small.views.iter().map(|view| view.size[0] * view.size[1]).sum::<usize>();
        let (step, mut seen) = (pixels.div_ceil(MOST_SEEN).max(1), Vec::new());
        let report = render(scene, &small, &Silent, &mut |rendered| {
            seen.extend(rendered.picture.iter().step_by(step).filter(|v| !v.is_nan()));
            Ok(())
        })?;
        seen.sort_unstable_by(f32::total_cmp);
        if !seen.is_empty() {
            ranges.values = without_spots(&seen);
            ranges.positive = seen.iter().find(|v| **v > 0.0).map(|v| f64::from(*v));
        }
        ranges.errors.1 = report.certified_error.filter(|e| *e > 0.0).unwrap_or(1.0);
        Ok(ranges)
    }

    /// Colours over the range of all values, but for few spots that would take most of them; these are of largest values.
    pub(crate) fn without_spots(&self, colours: &TransferFunction) -> Result<TransferFunction> {
        let ((lo, hi), most) = (colours.range(), self.values.1);
        if !(0.0 < most && most < hi) {
            return Ok(colours.clone());
        }
        colours.over((if lo < 0.0 { lo * most / hi } else { lo.min(0.5 * most) }, most))
    }

    /// From 0 to the largest.
    pub(crate) fn up_from_zero(&self) -> (f64, f64) {
        (0.0, self.values.1)
    }

    /// What colours are spread over where nobody says it.
    fn automatic(&self, norm: Norm, map: &TransferFunction) -> Result<(f64, f64)> {
        const DECADES: f64 = 1e-4;
        let (lo, hi) = self.values;
        if norm == Norm::Log {
            let least =
                self.positive.ok_or_else(|| Error::usage("--norm log: no value is above 0; give --norm linear"))?;
            return Ok((least.max(hi * DECADES), hi));
        }
        Ok(if lo < hi { map.suitable((lo, hi)) } else { (lo, hi) })
    }
}
