//! How the pages of a file make up frames.

use wavesplat_core::source::Parsed;

/// Pages as planes of frames.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stack {
    pub(super) frames: usize,
    /// Voxels along z.
    pub(super) planes: usize,
    pub(super) channels: usize,
    /// Pages from a frame, a plane and a channel to the next.
    pub(super) steps: [usize; 3],
    /// World units between voxels along x, y, z.
    pub(super) spacing: [f64; 3],
    pub(super) space_unit: Option<String>,
    /// Time between frames, and its unit.
    pub(super) interval: Option<(f64, String)>,
}

impl Stack {
    /// Pages in an order of axes, the fastest first: `Z`, `C` and `T`, with their lengths.
    pub(super) fn new(order: [char; 3], lengths: [usize; 3]) -> Parsed<Self> {
        let (mut step, mut found) = (1_usize, [(0, 0); 3]);
        for (axis, len) in order.into_iter().zip(lengths) {
            let at = ['T', 'Z', 'C'].iter().position(|name| *name == axis).ok_or("names an axis that is not known")?;
            found[at] = (len, step);
            step = step.checked_mul(len).filter(|n| *n > 0).ok_or("says a number of planes that cannot be")?;
        }
        if found.iter().any(|(len, _)| *len == 0) {
            return Err("says an order of axes that lacks one".into());
        }
        let [frames, planes, channels] = found.map(|(len, _)| len);
        let steps = found.map(|(_, step)| step);
        Ok(Self { frames, planes, channels, steps, spacing: [1.0; 3], space_unit: None, interval: None })
    }

    /// The number of the page that a plane is on.
    pub(super) fn page(&self, frame: usize, plane: usize, channel: usize) -> usize {
        self.steps[0] * frame + self.steps[1] * plane + self.steps[2] * channel
    }

    /// Times of several frames, if it says how far they are apart.
    pub(super) fn times(&self) -> Vec<f64> {
        match &self.interval {
            Some((interval, _)) if self.frames > 1 => (0..self.frames).map(|t| t as f64 * interval).collect(),
            _ => Vec::new(),
        }
    }

    /// What these are measured in.
    pub(super) fn time_unit(&self) -> Option<String> {
        self.interval.as_ref().filter(|_| self.frames > 1).map(|(_, unit)| unit.clone())
    }
}

/// A length, if it is positive.
pub(super) fn positive(value: f64) -> Option<f64> {
    Some(value).filter(|value| value.is_finite() && *value > 0.0)
}
