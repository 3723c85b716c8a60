//! The ways of converting that are measured: all that this benchmark knows of them is a name and a configuration.

use wavesplat::base::error::{Error, Result};
use wavesplat::convert::ConvertConfig;
use wavesplat::wavelet::Basis;

/// A way of converting.
#[derive(Debug)]
pub struct Scheme {
    /// Its name.
    pub name: &'static str,
    /// The configuration for a tolerance and so many bytes of memory.
    config: fn(f64, usize) -> ConvertConfig,
}

/// The scheme that nonzero codes are counted against: Haar along time and nothing else.
pub const BASELINE: &str = "haar";

/// All schemes; a further one is a further line.
pub const SCHEMES: [Scheme; 2] = [
    Scheme {
        name: BASELINE,
        config: |tolerance, memory| ConvertConfig {
            coding: Basis::Haar.into(),
            memory,
            ..ConvertConfig::new(tolerance)
        },
    },
    // What `wavesplat convert` does unless told otherwise.
    Scheme { name: "default", config: |tolerance, memory| ConvertConfig { memory, ..ConvertConfig::new(tolerance) } },
];

/// The configuration of a scheme whose tolerance refers to `range`.
pub(super) fn config(name: &str, tolerance: f64, range: (f64, f64), memory: usize) -> Result<ConvertConfig> {
    let scheme = SCHEMES.iter().find(|s| s.name == name);
    let scheme = scheme.ok_or_else(|| Error::usage(format!("bench-step: there is no scheme {name}")))?;
    Ok(ConvertConfig { range: Some(range), ..(scheme.config)(tolerance, memory) })
}
