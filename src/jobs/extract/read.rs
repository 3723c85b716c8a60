//! Samples of a coefficient file as numbers in memory.

use super::{ExtractConfig, extract_to};
use std::ops::Range;
use wavesplat_core::base::error::Result;
use wavesplat_core::base::grid::Region;
use wavesplat_core::base::progress::Silent;
use wavesplat_core::base::sample::{is_missing, load_as};
use wavesplat_engine::file::CoefficientFile;

/// The samples of a region of some frames: x fastest, then y, z, and time slowest; `frames.len() * region.voxels()` numbers.
/// Missing samples are NaN. Only the blocks that touch the region are read.
///
/// Files of colours have three channels. This reads the first; [`super::extract`] reads any.
///
/// # Errors
/// [`Error::Setting`](wavesplat_core::base::error::Error::Setting) if the file lacks a frame or voxel, and those of reading
/// a damaged file.
pub fn read_region(file: &CoefficientFile, frames: Range<usize>, region: &Region) -> Result<Vec<f32>> {
    let (sample, declared) = (file.sample(), file.metadata().missing_value);
    let config = ExtractConfig { frames: frames.collect(), region: *region, ..ExtractConfig::new(file) };
    config.check(file)?;
    let mut samples = Vec::with_capacity(config.frames.len() * region.voxels());
    let present_or_nan = |value: f64| if is_missing(value, declared) { f32::NAN } else { value as f32 };
    let mut append = |bytes: &[u8]| {
        let first = samples.len();
        samples.resize(first + bytes.len() / sample.size(), 0.0);
        load_as(sample, bytes, &mut samples[first..], present_or_nan);
        Ok(())
    };
    extract_to(file, &config, &mut append, &Silent)?;
    Ok(samples)
}
