//! The JSON that tifffile writes into the first page: `{"shape": [5, 7, 9, 8], "axes": "TZYX"}`; napari and scikit-image
//! write it by tifffile, often without axes.

use super::stack::Counts;
use serde::Deserialize;
use wavesplat_core::source::Parsed;

#[derive(Deserialize)]
struct Said {
    shape: Vec<usize>,
    axes: Option<String>,
}

/// Whether a text is such JSON, or what tifffile wrote before.
pub(super) fn is_shaped(said: &str) -> bool {
    said.starts_with("shape=(") || said.trim_start().starts_with('{') && said.contains("\"shape\"")
}

/// Reads the lengths of all axes, the slowest first, and what they count.
pub(super) fn parse(said: &str) -> Parsed<Vec<Counts>> {
    let Said { shape, axes } = match said.strip_prefix("shape=(") {
        Some(rest) => {
            let numbers = rest.split(')').next().unwrap_or_default().split(',');
            let numbers = numbers.map(str::trim).filter(|text| !text.is_empty()).map(|text| text.parse().ok());
            let shape: Option<_> = numbers.collect();
            Said { shape: shape.ok_or("has a shape in its description that is not made of numbers")?, axes: None }
        }
        None => serde_json::from_str(said).map_err(|e| format!("has a shape in its description, but: {e}"))?,
    };
    let letters: Vec<char> = match axes {
        Some(axes) => axes.to_uppercase().chars().collect(),
        None => (0..shape.len()).map(|axis| if axis + 2 < shape.len() { '?' } else { 'Y' }).collect(),
    };
    if letters.len() != shape.len() || shape.len() < 2 {
        let letters: String = letters.into_iter().collect();
        return Err(format!("has the shape {shape:?} in its description, but the axes {letters}"));
    }
    let known = |(at, letter): (usize, char)| match letter {
        'Y' if at + 1 == shape.len() => 'X', // of a shape without axes
        'S' => 'C',
        'T' | 'Z' | 'Y' | 'X' | 'C' => letter,
        _ => '?',
    };
    let letters: Vec<char> = letters.into_iter().enumerate().map(known).collect();
    Ok(letters.into_iter().zip(shape).map(|(letter, length)| Counts { letter, length }).collect())
}
