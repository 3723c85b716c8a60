//! The values that colours are spread over, where nobody says them: those of small pictures.

use crate::Cli;
use wavesplat::base::error::{Error, Result};
use wavesplat::base::progress::Silent;
use wavesplat::colour::{Norm, TransferFunction};
use wavesplat::render::{Mode, Pixel, RenderConfig, Scene, check, render};

/// Slabs of small pictures that only a range is judged by.
const FEW_SLABS: usize = 32;

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
    pub(crate) values: (f64, f64),
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
    pub(crate) fn automatic(&self, norm: Norm, map: &TransferFunction) -> Result<(f64, f64)> {
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

impl Cli {
    /// What small pictures show, if any of them are needed: of pictures, or of their errors.
    pub(crate) fn seen(
        &self,
        scene: &mut dyn Scene,
        config: &RenderConfig,
        (of_pictures, of_errors): (bool, bool),
    ) -> Result<Ranges> {
        if !of_pictures && !of_errors {
            return Ok(Ranges::default());
        }
        check(scene, config)?; // or small pictures would be made in vain, and what they need be named
        let mode = if config.mode.is_projection() { Mode::Projection } else { Mode::Mip { slabs: Some(FEW_SLABS) } };
        Ranges::of(scene, RenderConfig { certify: of_errors, mode, ..config.clone() })
    }

    /// The colours of a composite that nobody gave a range for, by the largest values that small pictures show.
    pub(crate) fn without_spots(
        &self,
        scene: &mut dyn Scene,
        config: &mut RenderConfig,
        colours: Option<TransferFunction>,
    ) -> Result<Option<TransferFunction>> {
        let Some(all) = colours.as_ref().filter(|_| config.mode.pixel() == Pixel::Light) else { return Ok(colours) };
        if !self.along.is_automatic(self.colour.range)? {
            return Ok(colours);
        }
        let colours = self.seen(scene, config, (true, false))?.without_spots(all)?;
        let (lo, hi) = colours.range();
        self.common.detail(format_args!("colours from {lo:.4e} to {hi:.4e}; --range sets them"));
        config.mode = self.along.mode(Some(&colours))?;
        Ok(Some(colours))
    }
}
