//! The errors of what is computed from a file's samples, in words.

use wavesplat_engine::convert::estimate::EstimatedErrors;

/// The errors in a line.
pub(super) fn results_text(errors: &EstimatedErrors, sides: &[f64], unit: Option<&str>) -> String {
    let percent = |share: Option<f64>| share.map_or("none".into(), |share| format!("{:.2} %", 100.0 * share));
    let unit = unit.map_or(String::new(), |unit| format!(" {unit}"));
    let sides = sides.iter().zip(&errors.sides).map(|(value, share)| format!(", edges at {value} {}", percent(*share)));
    format!(
        "of what is computed: differences off by {}, gradients {}, Laplacians {} (rms, as a share of their own){}; means of blocks up to \
         {:.2e}{unit}, extremes {:.2e}{unit} (estimated from some blocks)",
        percent(errors.difference),
        percent(errors.gradient),
        percent(errors.laplacian),
        sides.collect::<String>(),
        errors.mean,
        errors.overshoot,
    )
}
