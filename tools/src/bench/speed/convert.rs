//! The measured conversion.

use super::measured::{Measured, Stopwatch};
use crate::bench::stages::MEMORY;
use serde::{Deserialize, Serialize};
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::PathBuf;
use wavesplat::base::error::{Error, Result};
use wavesplat::base::progress::Silent;
use wavesplat::convert::{Basis, ConvertConfig, SchemeConstraint, convert};
use wavesplat::formats;
use wavesplat::source::OpenOptions;

/// The settings of a conversion.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Conversion {
    pub(super) source: PathBuf,
    pub(super) scheme: Scheme,
    /// Frames of a window.
    pub(super) window: usize,
    pub(super) tolerance: f64,
    /// Lowest and highest sample of the archive.
    pub(super) range: (f64, f64),
    pub(super) output: PathBuf,
}

/// The measured ways of converting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Scheme {
    /// The program's default.
    Auto,
    Haar,
    Multi,
}

impl Scheme {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::Haar => "haar",
            Self::Multi => "multi",
        }
    }

    fn coding(self) -> SchemeConstraint {
        match self {
            Self::Auto => SchemeConstraint::AUTO,
            Self::Haar => Basis::Haar.into(),
            Self::Multi => Basis::Multi.into(),
        }
    }
}

/// Converts to a file, without waiting for the disk.
pub(super) fn run(conversion: &Conversion) -> Result<Measured> {
    let Conversion { source, scheme, window, tolerance, range, output } = conversion;
    let config = ConvertConfig {
        coding: scheme.coding(),
        window: *window,
        range: Some(*range),
        memory: MEMORY,
        ..ConvertConfig::new(*tolerance)
    };
    let out = File::create(output).map_err(|e| Error::io(output, "creating", e))?;
    let (report, time) = Stopwatch::time(|| {
        let mut frames = formats::open(std::slice::from_ref(source), &OpenOptions::default())?;
        convert(frames.as_mut(), &config, output, BufWriter::new(out), &Silent)
    })?;
    let bytes = fs::metadata(output).map_err(|e| Error::io(output, "looking at", e))?.len();
    Ok(Measured { time, bytes, codes_per_sample: Some(report.coefficients_per_sample), ..Measured::default() })
}
