//! What is coded: the samples of an archive, or three channels of their colours.

use super::ConvertConfig;
use crate::base::sample;
use crate::source::{Archive, Painter};

/// A conversion in terms of the samples that are coded.
pub(super) struct Task {
    pub(super) config: ConvertConfig,
    pub(super) archive: Archive,
    /// What makes them of those that are read, if they are not the same.
    pub(super) painter: Option<Painter>,
}

impl Task {
    pub(super) fn new(config: &ConvertConfig, archive: &Archive) -> Self {
        let missing_value = sample::missing_value(archive.sample, config.missing_value);
        let (config, archive) = (ConvertConfig { missing_value, ..config.clone() }, archive.clone());
        let Some(colours) = config.colours.clone() else { return Self { config, archive, painter: None } };
        let painter = Painter { colours, sample: archive.sample, missing_value };
        let (range, missing_value) = (config.range.or(Some(BRIGHTNESS)), None);
        let config = ConvertConfig { range, missing_value, ..config };
        Self { config, archive: Archive { sample: Painter::SAMPLE, ..archive }, painter: Some(painter) }
    }
}

/// From none to full: what the samples of a channel may be.
pub(super) const BRIGHTNESS: (f64, f64) = (0.0, 1.0);
