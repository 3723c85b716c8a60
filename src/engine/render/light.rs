//! Light on surfaces: the lamp and the material of shaded composites and isosurfaces.

use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::colour::Colour;

/// A lamp far away, and how surfaces reflect its light ([Blinn](wavesplat_core::bibliography)).
///
/// The colour c of a point whose gradient has the direction n, turned to the viewer, becomes
///
/// ```text
/// c (ambient + diffuse max(0, n.l)) + specular max(0, n.h)^32        h = (l + v) / |l + v|                 (eq 42)
/// ```
///
/// where l points to the lamp and v to the viewer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Light {
    /// Degrees by which the lamp stands to the right of the viewer. Default: -30.
    pub azimuth: f64,
    /// Degrees by which the lamp stands above the viewer. Default: 40.
    pub elevation: f64,
    /// Share of a colour that every point keeps.
    pub ambient: f64,
    /// Share of a colour that depends on the direction of the lamp.
    pub diffuse: f64,
    /// White light of the highlight.
    pub specular: f64,
}

impl Default for Light {
    fn default() -> Self {
        Self { azimuth: -30.0, elevation: 40.0, ambient: 0.4, diffuse: 0.8, specular: 0.25 }
    }
}

impl Light {
    /// An error if a number cannot be used.
    pub(super) fn check(&self) -> Result<()> {
        let shares = [self.ambient, self.diffuse, self.specular];
        if !(self.azimuth.is_finite() && self.elevation.is_finite()) {
            return Err(Error::setting("light", "takes finite angles"));
        }
        if shares.iter().all(|share| (0.0..=2.0).contains(share)) {
            return Ok(());
        }
        Err(Error::setting("light", "takes ambient, diffuse and specular shares of 0 to 2"))
    }
}

/// An isosurface: the points where the field has one value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// The value, in the samples' unit.
    pub value: f64,
    /// Red, green and blue, 0 to 1.
    pub colour: Colour,
    /// The opacity, above 0 and at most 1.
    pub opacity: f64,
}

/// The largest number of surfaces.
pub(super) const MOST_SURFACES: usize = 64;

/// An error unless these surfaces can be drawn.
pub(super) fn check_surfaces(surfaces: &[Surface]) -> Result<()> {
    let wrong = |what: String| Err(Error::setting("surfaces", what));
    if !(1..=MOST_SURFACES).contains(&surfaces.len()) {
        return wrong(format!("takes 1 to {MOST_SURFACES} surfaces, not {}", surfaces.len()));
    }
    for surface in surfaces {
        if !surface.value.is_finite() {
            return wrong(format!("takes finite values, not {}", surface.value));
        }
        if !(surface.opacity > 0.0 && surface.opacity <= 1.0) {
            return wrong(format!("takes opacities above 0 and at most 1, not {}", surface.opacity));
        }
        if surface.colour.iter().any(|c| !(0.0..=1.0).contains(c)) {
            return wrong("takes colours of 0 to 1".into());
        }
    }
    Ok(())
}
