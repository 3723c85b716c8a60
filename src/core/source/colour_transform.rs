//! Samples as the colours of a transfer function: three channels before any transform, as in
//! [Dobashi](crate::bibliography), section 4.1.
//!
//! ```text
//! v_i^colour(t_j) = map_colour(v_i(t_j))        colour = red, green, blue                                 (eq 28)
//! ```

use super::FrameWindow;
use crate::base::error::Result;
use crate::base::grid::Region;
use crate::base::sample::{self, SampleType};
use crate::colour::TransferFunction;
use std::cell::Cell;
use std::ops::Deref;

/// The channels of a colour by their names, in the order in which they are stored.
pub const CHANNELS: [&str; 3] = ["red", "green", "blue"];

/// The transform from samples to channels.
#[derive(Debug, Clone, PartialEq)]
pub struct ColourTransform {
    /// The colours of values.
    pub colours: TransferFunction,
    /// The type of the samples that are coloured.
    pub sample: SampleType,
    /// The value of a missing sample among these.
    pub missing_value: Option<f64>,
}

impl ColourTransform {
    /// The type of a channel's samples: 0 to 1, NaN what is missing.
    pub const SAMPLE: SampleType = SampleType::F32;

    /// The names of its settings in a file of colours, and what messages call them: the transfer function, the type of
    /// the source's samples, and if one was declared the value that means "missing" among these.
    pub const SETTINGS: [(&'static str, &'static str); 3] =
        [("colours", "transfer function"), ("dtype", "type of samples"), ("missing-value", "missing value")];

    /// The settings that a file of colours stores.
    pub fn settings(&self) -> impl Iterator<Item = (&'static str, String)> {
        let Self { colours, sample, missing_value } = self;
        let values = [Some(colours.text()), Some(sample.to_string()), missing_value.map(|v| format!("{v:?}"))];
        Self::SETTINGS.into_iter().zip(values).filter_map(|((name, _), value)| Some((name, value?)))
    }

    /// From stored [settings](Self::settings), looked up by name; `None` if some are absent or invalid.
    pub fn of_settings<'a>(find: impl Fn(&str) -> Option<&'a str>) -> Option<Self> {
        let [colours, sample, missing] = Self::SETTINGS.map(|(name, _)| find(name));
        let missing_value = match missing {
            Some(value) => Some(value.parse().ok()?),
            None => None,
        };
        Some(Self { colours: TransferFunction::parse(colours?)?, sample: sample?.parse().ok()?, missing_value })
    }

    /// One channel of the colours of some samples, little-endian as these. `out` has room for as many of
    /// [`Self::SAMPLE`].
    pub fn paint(&self, channel: usize, samples: &[u8], out: &mut [u8]) {
        let first = (0.0_f64, self.component(channel, 0.0));
        let last = Cell::new(first); // neighbours are often equal
        sample::load_as(self.sample, samples, out.as_chunks_mut().0, |value: f64| {
            if value.to_bits() != last.get().0.to_bits() {
                last.set((value, self.component(channel, value)));
            }
            last.get().1
        });
    }

    /// One channel of the colour of a value. A missing value has no colour, whatever the map gives NaN.
    fn component(&self, channel: usize, value: f64) -> [u8; 4] {
        let missing = sample::is_missing(value, self.missing_value);
        let component = if missing { None } else { self.colours.component(value, channel) };
        component.map_or(f32::NAN, |component| component as f32).to_le_bytes()
    }
}

/// One channel of the colours of a window's samples.
pub struct ColourWindow<'a, W> {
    /// The samples.
    pub window: W,
    /// Their colours.
    pub colour_transform: &'a ColourTransform,
    /// Red, green or blue: 0, 1 or 2.
    pub channel: usize,
}

impl<'a, W: Deref<Target = dyn FrameWindow + 'a> + Send + Sync> FrameWindow for ColourWindow<'_, W> {
    fn frames(&self) -> usize {
        self.window.frames()
    }

    fn read_box(&self, frame: usize, region: &Region, out: &mut [u8]) -> Result<()> {
        let mut samples = vec![0; region.voxels() * self.colour_transform.sample.size()];
        self.window.read_box(frame, region, &mut samples)?;
        self.colour_transform.paint(self.channel, &samples, out);
        Ok(())
    }

    fn name(&self, frame: usize) -> String {
        self.window.name(frame)
    }

    fn check_unchanged(&self) -> Result<()> {
        self.window.check_unchanged()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn painted(colour_transform: &ColourTransform, channel: usize, values: &[f64]) -> Vec<f32> {
        let samples: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let mut out = vec![0; values.len() * 4];
        colour_transform.paint(channel, &samples, &mut out);
        out.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
    }

    #[test]
    fn values_become_the_channels_of_their_colours_and_what_is_missing_nan() {
        let points = vec![(0.0, [0.0, 0.5, 1.0]), (2.0, [1.0, 0.5, 0.0])];
        let nan = Some([0.25; 3]);
        let colours =
            TransferFunction::from_points(points, crate::colour::ColourSpace::Rgb, None, nan).expect("two points");
        let colour_transform = ColourTransform { colours, sample: SampleType::F64, missing_value: Some(1.0) };
        let values = [0.0, -0.0, 0.5, 0.5, 3.0, 1.0, f64::NAN, f64::INFINITY, -7.0];
        let missing = |v: &f32| v.is_nan();
        for (channel, expected) in [[0.0, 0.25, 1.0], [0.5; 3], [1.0, 0.75, 0.0]].into_iter().enumerate() {
            let found = painted(&colour_transform, channel, &values);
            assert_eq!([found[1], found[3], found[4]], expected);
            assert_eq!((found[0], found[2], found[8]), (found[1], found[3], expected[0]));
            assert!(found[5..8].iter().all(missing) && found.iter().filter(|v| missing(v)).count() == 3);
        }
    }
}
