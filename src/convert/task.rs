//! What is coded: the samples of an archive, or three channels of their colours.

use super::ConvertConfig;
use crate::base::sample;
use crate::source::{Archive, ColourTransform};

/// A conversion in terms of the samples that are coded.
pub(super) struct Task {
    pub(super) config: ConvertConfig,
    pub(super) archive: Archive,
    /// What makes them of those that are read, if they are not the same.
    pub(super) colour_transform: Option<ColourTransform>,
}

impl Task {
    pub(super) fn new(config: &ConvertConfig, archive: &Archive) -> Self {
        let missing_value = sample::missing_value(archive.sample, config.missing_value);
        let (config, archive) = (ConvertConfig { missing_value, ..config.clone() }, archive.clone());
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

/// From none to full: what the samples of a channel may be.
pub(super) const BRIGHTNESS: (f64, f64) = (0.0, 1.0);
