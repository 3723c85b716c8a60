//! ParaView's colour maps: the JSON of its colour map editor.

use super::{Colour, ColourSpace, TransferFunction};
use serde::Deserialize;
use serde_json::Value;

/// The fields of a map that matter here.
#[derive(Deserialize)]
struct Map {
    #[serde(rename = "Name")]
    name: Option<String>,
    #[serde(rename = "ColorSpace")]
    space: Option<String>,
    /// Whether hue takes the shorter way around; 0 by default.
    #[serde(rename = "HSVWrap")]
    wrapped: Option<Value>,
    /// Value, red, green, blue, and so on.
    #[serde(rename = "RGBPoints")]
    colours: Option<Vec<f64>>,
    /// Value, opacity, midpoint, sharpness, and so on.
    #[serde(rename = "Points")]
    opacities: Option<Vec<f64>>,
    #[serde(rename = "NanColor")]
    nan: Option<Vec<f64>>,
    #[serde(rename = "IndexedColors")]
    indexed: Option<Vec<f64>>,
}

/// The largest number of objects in a file. An object needs much more memory than its two brackets.
const MOST_OBJECTS: usize = 1 << 16;

/// Parses the map with this name, or the only map.
pub(super) fn parse(text: &str, name: Option<&str>) -> Result<TransferFunction, String> {
    let wrong = |e: serde_json::Error| format!("expected a colour map in ParaView's JSON: {e}");
    if text.bytes().filter(|byte| *byte == b'{').count() > MOST_OBJECTS {
        return Err(format!("holds more than {MOST_OBJECTS} objects, where colour maps are expected"));
    }
    let maps: Vec<Map> = match text.trim_start().chars().next() {
        Some('[') => serde_json::from_str(text).map_err(wrong)?,
        _ => vec![serde_json::from_str(text).map_err(wrong)?],
    };
    transfer_function(chosen(&maps, name)?)
}

fn chosen<'a>(maps: &'a [Map], name: Option<&str>) -> Result<&'a Map, String> {
    let found = match name {
        Some(name) => maps.iter().find(|map| map.name.as_deref() == Some(name)),
        None => maps.first().filter(|_| maps.len() == 1),
    };
    found.ok_or_else(|| which(maps, name))
}

/// The error that asks for the name of a map.
fn which(maps: &[Map], name: Option<&str>) -> String {
    const SHOWN: usize = 10;
    let names: Vec<&str> = maps.iter().filter_map(|map| map.name.as_deref()).collect();
    let more = names.len().saturating_sub(SHOWN);
    let listed =
        names[..names.len() - more].join(", ") + &if more > 0 { format!(" and {more} more") } else { "".into() };
    match name {
        _ if names.is_empty() => format!("holds {} maps, none with a name, where one is expected", maps.len()),
        Some(name) => format!("has no map '{name}', but {listed}"),
        None => format!("holds {} maps; name one as FILE#NAME: {listed}", maps.len()),
    }
}

fn transfer_function(map: &Map) -> Result<TransferFunction, String> {
    if map.indexed.is_some() && map.colours.is_none() {
        return Err("has IndexedColors, which are of categories; RGBPoints of values are expected".into());
    }
    let colours = map.colours.as_deref().ok_or("has no RGBPoints, where value, red, green and blue are expected")?;
    let points = fours("RGBPoints", "value, red, green, blue", colours)?.iter().map(|[v, r, g, b]| (*v, [*r, *g, *b]));
    let opacities = map.opacities.as_deref().map(|all| fours("Points", "value, opacity, midpoint, sharpness", all));
    let opacities = opacities.transpose()?.map(bends).transpose()?;
    let nan = map.nan.as_ref().map(|nan| <Colour>::try_from(nan.as_slice()));
    let nan = nan.transpose().map_err(|_| "has a NanColor that is not 3 numbers")?;
    TransferFunction::from_points(points.collect(), space(map)?, opacities, nan)
}

/// Numbers in groups of four.
fn fours<'a>(name: &str, what: &str, numbers: &'a [f64]) -> Result<&'a [[f64; 4]], String> {
    let (fours, rest) = numbers.as_chunks();
    if rest.is_empty() {
        Ok(fours)
    } else {
        Err(format!("has {} numbers in {name}, where fours of {what} are expected", numbers.len()))
    }
}

fn space(map: &Map) -> Result<ColourSpace, String> {
    let wrapped = map.wrapped.as_ref().is_some_and(|w| w.as_bool().unwrap_or(w.as_f64() != Some(0.0)));
    let Some(name) = map.space.as_deref() else { return Ok(ColourSpace::Rgb) };
    match ColourSpace::named(if name.eq_ignore_ascii_case("CIELAB") { "Lab" } else { name }) {
        Some(ColourSpace::Hsv) if wrapped => Ok(ColourSpace::HsvWrapped),
        Some(space) => Ok(space),
        None => Err(format!("has the ColorSpace '{name}', where RGB, HSV, Lab, Diverging or Step is expected")),
    }
}

/// Turns opacities into straight lines. The midpoint of two points is the share of the way at which the mean of both
/// lies. Their sharpness is 0 for straight lines on both sides of the midpoint, and 1 for a step at the midpoint. The
/// first of two points holds both settings.
fn bends(points: &[[f64; 4]]) -> Result<Vec<(f64, f64)>, String> {
    let mut lines = Vec::new();
    for (n, [value, opacity, midpoint, sharpness]) in (1..).zip(points) {
        lines.push((*value, *opacity));
        let Some([next, other, ..]) = points.get(n) else { break };
        let middle = value + (next - value) * midpoint;
        if !(0.0..=1.0).contains(midpoint) {
            return Err(format!("point {n} of its Points has the midpoint {midpoint}, where 0 to 1 is expected"));
        }
        match sharpness {
            0.0..0.01 if *midpoint == 0.5 => {}
            0.0..0.01 => lines.push((middle, (opacity + other) / 2.0)),
            0.99..=1.0 => lines.extend([(middle, *opacity), (middle, *other)]),
            _ => {
                let what = "0 (straight lines) or 1 (a step) is expected";
                return Err(format!("point {n} of its Points has the sharpness {sharpness}, where {what}"));
            }
        }
    }
    Ok(lines)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO: &str = r#"[
        {"Name": "a", "ColorSpace": "Diverging", "NanColor": [1, 1, 0],
         "RGBPoints": [-2, 0.231373, 0.298039, 0.752941, 2, 0.705882, 0.0156863, 0.14902]},
        {"Name": "b", "ColorSpace": "HSV", "RGBPoints": [0, 0, 0, 1, 1, 1, 0, 0], "Creator": "x"}]"#;

    #[test]
    fn maps_are_taken_by_their_names() {
        let map = parse(TWO, Some("a")).expect("a map");
        let white = map.colour(0.0).expect("a colour");
        assert!(white.iter().all(|c| (c - 0.865).abs() < 2e-3), "{white:?}");
        assert_eq!((map.range(), map.colour(f64::NAN), map.is_diverging()), ((-2.0, 2.0), Some([1.0, 1.0, 0.0]), true));
        let map = parse(TWO, Some("b")).expect("a map");
        assert_eq!(map.colour(0.5), Some([0.0, 1.0, 0.0]), "HSV does not wrap by itself");
        assert_eq!((map.opacity(0.25), map.colour(f64::NAN)), (0.25, None));
        let wrapped = TWO.replace("\"Creator\": \"x\"", "\"HSVWrap\": 1");
        assert_eq!(parse(&wrapped, Some("b")).expect("a map").colour(0.5), Some([1.0, 0.0, 1.0]));
        let one = r#" {"ColorSpace": "CIELAB", "RGBPoints": [0, 0, 0, 0, 1, 1, 1, 1]}"#;
        assert_eq!(parse(one, None).expect("a map").colour(2.0), Some([1.0; 3]));
    }

    #[test]
    fn opacities_bend_at_midpoints_and_step_where_they_are_sharp() {
        let map = r#"{"RGBPoints": [0,0,0,0, 3,1,1,1], "Points": [0,0,0.25,0, 1,1,0.5,0, 2,0,0.75,1, 3,1,0.5,0]}"#;
        let map = parse(map, None).expect("a map");
        for (value, opacity) in
            [(0.125, 0.25), (0.25, 0.5), (0.625, 0.75), (1.5, 0.5), (2.7, 0.0), (2.8, 1.0), (3.0, 1.0)]
        {
            assert!((map.opacity(value) - opacity).abs() < 1e-12, "{value}: {}", map.opacity(value));
        }
    }

    #[test]
    fn invalid_maps_give_errors() {
        let many: Vec<String> = (0..12).map(|i| format!(r#"{{"Name": "m{i}"}}"#)).collect();
        let many = format!("[{}]", many.join(","));
        let objects = format!("[{}]", vec!["{}"; MOST_OBJECTS + 1].join(","));
        let cases = [
            (objects.as_str(), "holds more than 65536 objects"),
            (TWO, "holds 2 maps; name one as FILE#NAME: a, b"),
            (&many, "m8, m9 and 2 more"),
            ("[]", "holds 0 maps"),
            ("colours", "expected a colour map in ParaView's JSON"),
            (&TWO[..200], "EOF"),
            ("[1]", "ParaView's JSON"),
            (r#"{"RGBPoints": "x"}"#, "expected a sequence"),
            (r#"{"Name": "a"}"#, "has no RGBPoints"),
            (r#"{"IndexedColors": [1,0,0]}"#, "IndexedColors"),
            (r#"{"RGBPoints": [0,0,0,0, 1,1,1]}"#, "has 7 numbers in RGBPoints, where fours"),
            (r#"{"RGBPoints": [0,0,0,0]}"#, "has 1 point(s) of colours, where two or more"),
            (r#"{"RGBPoints": []}"#, "has 0 point(s) of colours"),
            (r#"{"RGBPoints": [1,0,0,0, 0,1,1,1]}"#, "point 2 has 0 after 1"),
            (r#"{"RGBPoints": [1,0,0,0, 1,1,1,1]}"#, "all of its colours have the value 1, where a range"),
            (r#"{"RGBPoints": [-1e308,0,0,0, 1e308,1,1,1]}"#, "too far apart"),
            (r#"{"RGBPoints": [0,0,0,0, 1,1,1,1.5]}"#, "point 2 of its colours has 1.5, where 0 to 1"),
            (r#"{"RGBPoints": [0,0,0,0, 1e999,1,1,1]}"#, "out of range"),
            (r#"{"ColorSpace": "XYZ", "RGBPoints": [0,0,0,0, 1,1,1,1]}"#, "RGB, HSV, Lab, Diverging or Step"),
            (r#"{"NanColor": [1], "RGBPoints": [0,0,0,0, 1,1,1,1]}"#, "NanColor that is not 3 numbers"),
            (r#"{"NanColor": [1,1,2], "RGBPoints": [0,0,0,0, 1,1,1,1]}"#, "NaN's colour has 2, where 0 to 1"),
            (r#"{"Points": [0,0,0.5], "RGBPoints": [0,0,0,0, 1,1,1,1]}"#, "has 3 numbers in Points, where fours"),
            (r#"{"Points": [0,0,0.5,0], "RGBPoints": [0,0,0,0, 1,1,1,1]}"#, "has 1 point(s) of opacities"),
            (r#"{"Points": [0,0,0.5,0.3, 1,1,0.5,0], "RGBPoints": [0,0,0,0, 1,1,1,1]}"#, "the sharpness 0.3, where 0"),
            (r#"{"Points": [0,0,-2,0, 1,1,0.5,0], "RGBPoints": [0,0,0,0, 1,1,1,1]}"#, "the midpoint -2, where 0 to 1"),
            (
                r#"{"Points": [0,0,0.5,0, 1,2,0.5,0], "RGBPoints": [0,0,0,0, 1,1,1,1]}"#,
                "of its opacities has 2, where 0 to 1",
            ),
        ];
        for (text, words) in cases {
            let error = parse(text, None).expect_err(text);
            assert!(error.contains(words), "{text}: {error}");
        }
        assert_eq!(parse(TWO, Some("c")), Err("has no map 'c', but a, b".into()));
    }
}
