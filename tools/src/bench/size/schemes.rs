//! The measured ways of converting. This benchmark knows only their names and configurations.

use wavesplat::base::error::{Error, Result};
use wavesplat::convert::ConvertConfig;
use wavesplat::wavelet::Basis;

/// A way of converting.
#[derive(Debug)]
pub struct Scheme {
    /// Its name.
    pub name: &'static str,
    /// The configuration for a tolerance and a memory budget in bytes.
    config: fn(f64, usize) -> ConvertConfig,
}

/// The scheme with which nonzero codes are compared: Haar along time, nothing in space.
pub const BASELINE: &str = "haar";

/// All schemes. Add a line to add a scheme.
pub const SCHEMES: [Scheme; 2] = [
    Scheme {
        name: BASELINE,
        config: |tolerance, memory| ConvertConfig {
            coding: Basis::Haar.into(),
            memory,
            ..ConvertConfig::new(tolerance)
        },
    },
    // The default of `wavesplat convert`.
    Scheme { name: "default", config: |tolerance, memory| ConvertConfig { memory, ..ConvertConfig::new(tolerance) } },
];

/// The configuration of a scheme whose tolerance refers to `range`.
pub(super) fn config(name: &str, tolerance: f64, range: (f64, f64), memory: usize) -> Result<ConvertConfig> {
    let scheme = SCHEMES.iter().find(|s| s.name == name);
    let scheme = scheme.ok_or_else(|| Error::usage(format!("bench-step: there is no scheme {name}")))?;
    Ok(ConvertConfig { range: Some(range), ..(scheme.config)(tolerance, memory) })
}
