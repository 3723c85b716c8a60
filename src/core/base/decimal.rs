//! Numbers as text for people.

/// A number, without digits that come from rounding.
pub fn short(v: f64) -> String {
    let rounded: f64 = format!("{v:.11e}").parse().unwrap_or(v);
    written(rounded, 1e6)
}

/// The same with a power of ten, but for 0.
pub fn with_power(v: f64) -> String {
    let rounded: f64 = format!("{v:.11e}").parse().unwrap_or(v);
    if rounded == 0.0 { "0".into() } else { format!("{rounded:e}") }
}

/// A number with at most so many decimals.
pub(super) fn rounded(v: f64, decimals: usize) -> String {
    written(format!("{v:.decimals$}").parse().unwrap_or(v), 1e12)
}

/// A number; from `large` on, or if it is very small, with a power of ten.
fn written(v: f64, large: f64) -> String {
    match v.abs() {
        0.0 => "0".into(),
        size if size >= 0.001 && size < large => v.to_string(),
        _ => format!("{v:e}"),
    }
}
