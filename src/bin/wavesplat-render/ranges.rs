//! The default range of colours, taken from small pictures.

use wavesplat::base::error::{Error, Result};
use wavesplat::base::progress::Silent;
use wavesplat::colour::{Norm, TransferFunction};
use wavesplat::render::{Mode, RenderConfig, Scene, check, render};

/// The largest number of pixels used to find a range.
const MOST_PIXELS: usize = 1 << 20;

/// The range of ascending values. At each end, up to one value in 200 is left out if these take two fifths of the
/// range.
fn robust_range(values: &[f32]) -> (f64, f64) {
    let few = values.len() / 200;
    let at = |n: usize| f64::from(values[n]);
    let (lo, hi, low, high) = (at(0), at(values.len() - 1), at(few), at(values.len() - 1 - few));
    let (large, least) = (0.4 * (hi - lo), 0.05 * (hi - lo));
    let clipped = |end: f64, inner: f64| if (end - inner).abs() >= large && high - low > least { inner } else { end };
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
    /// The ranges in small pictures, if any are needed: of pictures, or of their errors.
    pub(crate) fn small(
        scene: &mut dyn Scene,
        config: &RenderConfig,
        (of_pictures, of_errors): (bool, bool),
    ) -> Result<Self> {
        if !of_pictures && !of_errors {
            return Ok(Self::default());
        }
        check(scene, config)?; // before small pictures are rendered, so that errors name the full size
        let mode = match config.mode {
            Mode::Projection => Mode::Projection,
            // The colours of a composite are those of its samples, and the largest samples along rays are enough to
            // find where they end.
            Mode::Composite { .. } | Mode::Mip { .. } => Mode::Mip { slices: None },
        };
        Self::of(scene, RenderConfig { certify: of_errors, mode, ..config.clone() })
    }

    /// The ranges in small pictures of frames spread over the archive. They do not depend on the frames to render. If
    /// the pictures are empty, the range is (0, 1). Errors begin at 0.
    fn of(scene: &mut dyn Scene, mut small: RenderConfig) -> Result<Self> {
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
        let (step, mut values) = (pixels.div_ceil(MOST_PIXELS).max(1), Vec::new());
        let report = render(scene, &small, &Silent, &mut |rendered| {
            values.extend(rendered.picture.iter().step_by(step).filter(|v| !v.is_nan()));
            Ok(())
        })?;
        values.sort_unstable_by(f32::total_cmp);
        if !values.is_empty() {
            ranges.values = robust_range(&values);
            ranges.positive = values.iter().find(|v| **v > 0.0).map(|v| f64::from(*v));
        }
        ranges.errors.1 = report.certified_error.filter(|e| *e > 0.0).unwrap_or(1.0);
        Ok(ranges)
    }

    /// The colours over the range of all values, up to the largest value of small pictures. Extreme values that would
    /// take most of the colours do not count.
    pub(crate) fn stretch(&self, colours: &TransferFunction) -> Result<TransferFunction> {
        let ((lo, hi), most) = (colours.range(), self.values.1);
        if !(0.0 < most && most < hi) {
            return Ok(colours.clone());
        }
        colours.over((if lo < 0.0 { lo * most / hi } else { lo.min(0.5 * most) }, most))
    }

    /// The range from 0 to the largest value.
    pub(crate) fn up_from_zero(&self) -> (f64, f64) {
        (0.0, self.values.1)
    }

    /// The default range of colours.
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
