//! What the numbers of a variable mean, by the attributes of the NetCDF conventions.

use super::Variable;
use crate::sample::SampleType;
use crate::source::packing::Packing;

/// The samples that numbers stand for.
#[derive(Debug)]
pub(super) struct Values {
    pub(super) sample: SampleType,
    pub(super) packing: Option<Packing>,
    /// What stands for missing samples, if some may be.
    pub(super) missing: Option<f64>,
    pub(super) unit: Option<String>,
}

impl Values {
    pub(super) fn of(variable: &Variable, stored: SampleType) -> Self {
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
            valid: valid(variable),
            missing,
        };
        let is_plain =
            packing.missing.len() < 2 && packing == Packing { missing: packing.missing.clone(), ..Packing::NONE };
        if is_plain {
            let missing = packing.missing.first().copied().or((!declared.is_empty()).then_some(f64::NAN));
            return Self { sample: stored, packing: None, missing, unit };
        }
        let some_may_be = !declared.is_empty() || packing.valid != Packing::NONE.valid;
        let missing = some_may_be.then_some(f64::NAN);
        Self { sample: Packing::sample(stored), packing: Some(packing), missing, unit }
    }
}

/// A number as it is among the stored ones: attributes may be of another type.
fn as_stored(stored: SampleType, value: f64) -> f64 {
    if stored.is_float() { crate::sample::round_to(stored, value) } else { value }
}

/// The least and the largest stored number that is valid.
fn valid(variable: &Variable) -> (f64, f64) {
    let (lo, hi) = Packing::NONE.valid;
    match *variable.numbers("valid_range") {
        [lo, hi] => (lo, hi),
        _ => (variable.number("valid_min").unwrap_or(lo), variable.number("valid_max").unwrap_or(hi)),
    }
}
