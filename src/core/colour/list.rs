//! Colour maps written as lists of colours: `#0000ff,#ffffff,#ff0000`.

use super::{Colour, ColourSpace, TransferFunction};

/// Whether a name is a list of colours.
pub(super) fn is_list(name: &str) -> bool {
    name.starts_with('#') && name.contains(',')
}

/// A map whose colours are at even steps of the range, with linear interpolation.
///
/// # Errors
/// The problem with the list: a sentence that follows it.
pub(super) fn parse(list: &str) -> Result<TransferFunction, String> {
    let colours = list.split(',').map(colour).collect::<Result<Vec<_>, _>>()?;
    let last = (colours.len() - 1) as f64;
    let points = colours.into_iter().enumerate().map(|(n, colour)| (n as f64 / last, colour)).collect();
    let map = TransferFunction::from_points(points, ColourSpace::Rgb, None, None)?;
    Ok(TransferFunction { of_values: false, ..map })
}

fn colour(text: &str) -> Result<Colour, String> {
    let is_hex = |digits: &&str| digits.len() == 6 && digits.bytes().all(|b| b.is_ascii_hexdigit());
    let digits = text.trim().strip_prefix('#').filter(is_hex);
    let number = digits.and_then(|digits| u32::from_str_radix(digits, 16).ok());
    let number = number.ok_or_else(|| format!("a list of colours like #0000ff,#ffffff has '{text}'"))?;
    Ok([16, 8, 0].map(|bits| f64::from(number >> bits & 0xff) / 255.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_at_even_steps() {
        let map = parse("#000000, #ff0000,#ffffff").expect("a list");
        assert_eq!(
            [0.0, 0.25, 0.5, 1.0].map(|v| map.colour(v).expect("a colour")[..2].to_vec()),
            [[0.0, 0.0], [0.5, 0.0], [1.0, 0.0], [1.0, 1.0]]
        );
        assert!(!map.is_of_values() && is_list("#000000,#ffffff") && !is_list("#000000"));
    }

    #[test]
    fn other_texts_are_refused() {
        for list in ["#000000,", "#000000,#fff", "#000000,#gggggg", "#000000,white", "#000000,#+00000"] {
            assert!(parse(list).is_err(), "{list}");
        }
    }
}
