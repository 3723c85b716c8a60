//! What the numbers of a variable mean, by the attributes of the NetCDF conventions.

use super::Variable;
use wavesplat_core::base::sample::{self, SampleType};
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::Parsed;
use wavesplat_core::source::packing::Packing;

/// The samples that numbers stand for.
#[derive(Debug)]
pub(crate) struct Values {
    pub(crate) sample: SampleType,
    pub(crate) packing: Option<Packing>,
    /// The value of missing samples, if some may be missing.
    pub(crate) missing: Option<f64>,
    pub(crate) unit: Option<String>,
}

impl Values {
    pub(crate) fn from_attributes(variable: &Variable, ty: StoredType) -> Parsed<Self> {
        let stored = ty.sample();
        let unit = variable.text("units").filter(|unit| !unit.is_empty()).map(String::from);
        let declared = [variable.numbers("_FillValue"), variable.numbers("missing_value")].concat();
        let mut missing: Vec<f64> = Vec::new();
        for value in declared.iter().map(|value| as_stored(stored, *value)).filter(|value| value.is_finite()) {
            if !missing.contains(&value) {
                missing.push(value);
            }
        }
        let packing = Packing {
            scale: variable.number("scale_factor").unwrap_or(1.0),
            offset: variable.number("add_offset").unwrap_or(0.0),
            valid: valid(variable, stored),
            missing,
        };
        // The missing value of 64-bit integers may not fit in a 32-bit sample.
        let fits = packing.missing.iter().all(|value| !ty.is_64_bit() || sample::round_to(stored, *value) == *value);
        let is_plain = fits
            && packing.missing.len() < 2
            && packing == Packing { missing: packing.missing.clone(), ..Packing::NONE };
        if is_plain {
            let missing = packing.missing.first().copied().or((!declared.is_empty()).then_some(f64::NAN));
            return Ok(Self { sample: stored, packing: None, missing, unit });
        }
        let some_may_be = !declared.is_empty() || packing.valid != Packing::NONE.valid;
        let missing = some_may_be.then_some(f64::NAN);
        if !(packing.scale.is_finite() && packing.offset.is_finite() && packing.scale != 0.0) {
            let what = format!("scale_factor {} and add_offset {} make no numbers", packing.scale, packing.offset);
            return Err(format!("{}: {what}", variable.shown()));
        }
        Ok(Self { sample: packing.sample(stored), packing: Some(packing), missing, unit })
    }
}

/// An attribute's number in the type of the stored numbers, which may differ from its own.
fn as_stored(stored: SampleType, value: f64) -> f64 {
    if stored.is_float() { sample::round_to(stored, value) } else { value }
}

/// The smallest and the largest valid stored number. NaN sets no limit.
fn valid(variable: &Variable, stored: SampleType) -> (f64, f64) {
    let (lo, hi) = match *variable.numbers("valid_range") {
        [lo, hi] => (Some(lo), Some(hi)),
        _ => (variable.number("valid_min"), variable.number("valid_max")),
    };
    let limit = |of: Option<f64>| of.filter(|v| !v.is_nan()).map(|v| as_stored(stored, v));
    let (least, most) = Packing::NONE.valid;
    (limit(lo).unwrap_or(least), limit(hi).unwrap_or(most))
}
