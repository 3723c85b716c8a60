//! The measured ways of converting. This benchmark knows only their names and configurations.

use wavesplat::base::error::{Error, Result};
use wavesplat::convert::{Basis, ConvertConfig, ConvertRequest};
use wavesplat::source::Archive;

/// A way of converting.
#[derive(Debug)]
pub struct Scheme {
    /// Its name.
    pub name: &'static str,
    /// What is given beside a tolerance.
    given: fn() -> ConvertRequest,
}

/// The scheme with which nonzero codes are compared: Haar along time, nothing in space.
pub const BASELINE: &str = "haar";

/// All schemes. Add a line to add a scheme.
pub const SCHEMES: [Scheme; 2] = [
    Scheme { name: BASELINE, given: || ConvertRequest { basis: Some(Basis::Haar), ..ConvertRequest::default() } },
    // The default of `wavesplat convert`.
    Scheme { name: "default", given: ConvertRequest::default },
];

/// The configuration of a scheme for an archive, whose tolerance refers to `range`.
pub(super) fn config(
    name: &str,
    archive: &Archive,
    tolerance: f64,
    range: (f64, f64),
    memory: usize,
) -> Result<ConvertConfig> {
    let scheme = SCHEMES.iter().find(|s| s.name == name);
    let scheme = scheme.ok_or_else(|| Error::usage(format!("bench-step: there is no scheme {name}")))?;
    let (tolerance, range) = (Some(tolerance), Some(range));
    ConvertRequest { tolerance, range, memory, ..(scheme.given)() }.config(archive)
}
