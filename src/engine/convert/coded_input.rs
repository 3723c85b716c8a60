//! The samples to code: those of an archive, or three channels of their colours.

use super::ConvertConfig;
use crate::file::promise::UNIT_RANGE;
use wavesplat_core::base::sample;
use wavesplat_core::source::{Archive, ColourTransform};

/// The samples to code, and how.
#[derive(Debug, Clone)]
pub(super) struct CodedInput {
    pub(super) config: ConvertConfig,
    pub(super) archive: Archive,
    /// Converts source samples to coded ones, if they differ.
    pub(super) colour_transform: Option<ColourTransform>,
}

impl CodedInput {
    pub(super) fn new(config: &ConvertConfig, archive: &Archive) -> Self {
        let missing_value = sample::missing_value(archive.sample, config.missing_value);
        let config = max_error_as_tolerance(ConvertConfig { missing_value, ..config.clone() });
        let archive = archive.clone();
        let Some(colours) = config.colours.clone() else { return Self { config, archive, colour_transform: None } };
        let colour_transform = ColourTransform { colours, sample: archive.sample, missing_value };
        let (range, missing_value) = (config.range.or(Some(BRIGHTNESS)), None);
        let config = ConvertConfig { range, missing_value, ..config };
        Self {
            config,
            archive: Archive { sample: ColourTransform::SAMPLE, ..archive },
            colour_transform: Some(colour_transform),
        }
    }
}

/// The same bound as a tolerance. An error in the samples' unit is a share of a range of length 1.
fn max_error_as_tolerance(config: ConvertConfig) -> ConvertConfig {
    let Some(tolerance) = config.max_error else { return config };
    ConvertConfig { tolerance, range: config.range.or(Some(UNIT_RANGE)), ..config }
}

/// The range of a colour channel, from no brightness to full.
pub(super) const BRIGHTNESS: (f64, f64) = (0.0, 1.0);
