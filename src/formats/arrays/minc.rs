//! MINC volumes: NetCDF or HDF5 files whose samples mean other numbers in every slice.

use super::Variable;
use wavesplat_core::source::Parsed;

/// The array of the samples, and those of the largest and the smallest number of each slice.
const SAMPLES: &str = "image";
const LIMITS: [&str; 2] = ["image-max", "image-min"];

/// An error for a MINC volume: without its scaling, its numbers would be wrong.
pub(crate) fn refuse(all: &[Variable]) -> Parsed<()> {
    match all.iter().any(|variable| is_volume(variable, all)) {
        true => Err("is a MINC volume, which is not read: every slice is scaled by image-max and image-min; \
                     write it as NIfTI: mnc2nii IN.mnc OUT.nii"
            .into()),
        false => Ok(()),
    }
}

fn is_volume(variable: &Variable, all: &[Variable]) -> bool {
    let group = |variable: &Variable| variable.path[..variable.path.len() - variable.name().len()].to_string();
    let is_limit = |other: &Variable| LIMITS.contains(&other.name()) && group(other) == group(variable);
    let is_said = || ["signtype", LIMITS[0], LIMITS[1]].iter().any(|name| variable.attributes.contains_key(*name));
    variable.name() == SAMPLES && (variable.text("varid").is_some_and(is_minc) || is_said() || all.iter().any(is_limit))
        || variable.path.trim_start_matches('/').starts_with("minc-2.0/")
}

fn is_minc(id: &str) -> bool {
    id.starts_with("MINC standard variable")
}
