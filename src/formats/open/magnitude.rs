//! The length of a vector: several variables of an archive as one.

use std::path::PathBuf;
use wavesplat_core::base::description::{Attribute, Values};
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::sample::{SampleType, is_missing, load, store};
use wavesplat_core::source::{Archive, FrameSource, FrameWindow, OpenOptions};

/// Name of the variable that stands for the length.
const NAME: &str = "magnitude";

/// Opens the variables in [`OpenOptions::magnitude`] as one archive, of the square root of the sum of their squares. A
/// sample is missing where that of any variable is.
///
/// # Errors
/// Those of opening each variable; also variables of different sizes, numbers of frames or units.
pub(crate) fn open(inputs: &[PathBuf], options: &OpenOptions) -> Result<Box<dyn FrameSource>> {
    let alone = |name: &String| OpenOptions { variable: Some(name.clone()), magnitude: Vec::new(), ..options.clone() };
    let parts = options.magnitude.iter().map(|name| super::open(inputs, &alone(name))).collect::<Result<Vec<_>>>()?;
    let Some(first) = parts.first() else { return Err(Error::setting("magnitude", "no variable was given")) };
    for (part, name) in parts.iter().zip(&options.magnitude) {
        check_alike(first.archive(), part.archive(), &options.magnitude[0], name)?;
    }
    let archive = archive(&parts, &options.magnitude);
    Ok(Box::new(Magnitude { parts, archive }))
}

fn check_alike(first: &Archive, other: &Archive, first_name: &str, name: &str) -> Result<()> {
    let size_and_unit = |archive: &Archive| (archive.grid.dims, archive.frames, archive.units.samples.clone());
    if size_and_unit(first) == size_and_unit(other) {
        return Ok(());
    }
    let words = |archive: &Archive| {
        let ([x, y, z], unit) = (archive.grid.dims, archive.units.samples.as_deref().unwrap_or("no unit"));
        format!("{x}x{y}x{z} voxels, {} frames and {unit}", archive.frames.unwrap_or(0))
    };
    let what = format!("{name} has {}, but {first_name} has {}", words(other), words(first));
    Err(Error::setting("magnitude", what))
}

/// The archive of the length: that of the first variable, with other samples.
fn archive(parts: &[Box<dyn FrameSource>], names: &[String]) -> Archive {
    let wide = |ty: SampleType| matches!(ty, SampleType::F64 | SampleType::I32 | SampleType::U32);
    let is_wide = parts.iter().any(|part| wide(part.archive().sample));
    let declared = parts.iter().any(|part| part.archive().missing.is_some());
    let mut archive = parts[0].archive().clone();
    archive.sample = if is_wide { SampleType::F64 } else { SampleType::F32 };
    archive.missing = declared.then_some(f64::NAN);
    archive.variable = Some(NAME.into());
    archive.memory = parts.iter().map(|part| part.archive().memory).sum();
    if let Some(description) = &mut archive.description {
        let text = |name: &str, text: String| Attribute { name: name.into(), value: Values::text(text) };
        let of_place =
            |attribute: &Attribute| ["units", "coordinates", "grid_mapping"].contains(&attribute.name.as_str());
        description.attributes.retain(of_place);
        description.attributes.push(text("long_name", format!("{NAME} of {}", names.join(", "))));
    }
    archive
}

struct Magnitude {
    parts: Vec<Box<dyn FrameSource>>,
    archive: Archive,
}

impl FrameSource for Magnitude {
    fn archive(&self) -> &Archive {
        &self.archive
    }

    fn window(&mut self, first: usize, count: usize) -> Result<Box<dyn FrameWindow>> {
        self.window_of(first, count, 1)
    }

    fn window_of(&mut self, first: usize, count: usize, step: usize) -> Result<Box<dyn FrameWindow>> {
        let window = |part: &mut Box<dyn FrameSource>| {
            let Archive { sample, missing, .. } = *part.archive();
            Ok((part.window_of(first, count, step)?, sample, missing))
        };
        let parts = self.parts.iter_mut().map(window).collect::<Result<_>>()?;
        Ok(Box::new(MagnitudeWindow { parts, sample: self.archive.sample }))
    }
}

struct MagnitudeWindow {
    /// The windows of the variables, the types of their samples and their missing values.
    parts: Vec<(Box<dyn FrameWindow>, SampleType, Option<f64>)>,
    sample: SampleType,
}

impl FrameWindow for MagnitudeWindow {
    fn frames(&self) -> usize {
        self.parts[0].0.frames()
    }

    fn read_box(&self, frame: usize, region: &Region, out: &mut [u8]) -> Result<()> {
        let mut squares = vec![0.0; region.voxels()];
        for (window, sample, missing) in &self.parts {
            let mut bytes = vec![0; region.voxels() * sample.size()];
            window.read_box(frame, region, &mut bytes)?;
            add_squares(*sample, &bytes, *missing, &mut squares);
        }
        squares.iter_mut().for_each(|sum| *sum = sum.sqrt());
        store(self.sample, &squares, out);
        Ok(())
    }

    fn name(&self, frame: usize) -> String {
        self.parts[0].0.name(frame)
    }

    fn check_unchanged(&self) -> Result<()> {
        self.parts.iter().try_for_each(|(window, ..)| window.check_unchanged())
    }
}

/// Adds the squares of samples to sums; NaN where they are missing.
fn add_squares(ty: SampleType, bytes: &[u8], missing: Option<f64>, sums: &mut [f64]) {
    let mut values = vec![0.0; sums.len()];
    load(ty, bytes, &mut values);
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += if is_missing(value, missing) { f64::NAN } else { value * value };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_add_up_and_missing_samples_stay_missing() {
        let mut sums = vec![0.0; 3];
        add_squares(SampleType::I16, &[3, 0, 0xff, 0xff, 7, 0], None, &mut sums);
        add_squares(SampleType::U8, &[4, 9, 0], Some(9.0), &mut sums);
        assert_eq!((sums[0], sums[2]), (25.0, 49.0));
        assert!(sums[1].is_nan());
    }
}
