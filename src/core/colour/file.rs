//! Transfer functions from files.

use super::{TransferFunction, paraview, table};
use crate::base::error::{Error, Result};
use crate::base::text;
use std::path::Path;

/// The kind of file that is expected, for messages.
const KIND: &str = "colour map";

/// Splits `FILE.json#MAP` into the file and the name of the map.
pub(super) fn split(name: &str) -> (&str, Option<&str>) {
    let ending = ".json#";
    let found = name.to_ascii_lowercase().find(ending).filter(|_| !Path::new(name).exists());
    found.map_or((name, None), |at| (&name[..at + ending.len() - 1], Some(&name[at + ending.len()..])))
}

/// Reads a file: `FILE`, or `FILE.json#MAP` for one of several maps.
pub(super) fn read(name: &str) -> Result<TransferFunction> {
    let (path, map) = split(name);
    let parsed = match ending(path).as_str() {
        "json" => paraview::parse(&text::read(Path::new(path), KIND)?, map),
        "csv" => table::parse(&text::read(Path::new(path), KIND)?),
        _ => {
            let what = "takes the name of a colour map, or a file: ParaView's .json, or .csv";
            return Err(Error::path(path, what));
        }
    };
    parsed.map_err(|what| Error::input(path, what))
}

fn ending(path: &str) -> String {
    Path::new(path).extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::fs;

    #[test]
    fn the_name_of_a_map_follows_its_file() {
        assert_eq!(split("a/b.json#Cool #1 (x.y/z)"), ("a/b.json", Some("Cool #1 (x.y/z)")));
        assert_eq!(split("a#1/b.JSON"), ("a#1/b.JSON", None));
        assert_eq!(split("é.JSON#é"), ("é.JSON", Some("é")));
    }

    #[test]
    fn files_that_are_not_colour_maps_are_rejected() {
        let folder = tempfile::tempdir().expect("a folder");
        let long = vec![b' '; text::MOST_BYTES as usize + 1];
        let cases: [(&str, &[u8], &str); 5] = [
            ("a.json", b"", "is empty"),
            ("b.csv", b" \n\t\n", "is empty"),
            ("c.csv", b"\xff\xfe\x00", "not text"),
            ("d.csv", &long, "larger than 16 MiB"),
            ("e.xml", b"<ColorMap/>", "ParaView's .json, or .csv"),
        ];
        for (name, bytes, words) in cases {
            let path = folder.path().join(name);
            fs::write(&path, bytes).expect("written");
            let error = TransferFunction::open(&path.to_string_lossy()).expect_err("refused").to_string();
            assert!(error.contains(words) && error.contains(name), "{error}");
        }
        let missing = folder.path().join("f.json").to_string_lossy().into_owned();
        assert!(matches!(TransferFunction::open(&missing), Err(Error::Io { .. })));
        assert!(matches!(TransferFunction::open(&format!("{missing}#a/b")), Err(Error::Io { .. })));
        assert!(matches!(TransferFunction::open("/dev/null.json"), Err(Error::Io { .. })));
    }

    /// Nearly valid and entirely invalid texts.
    fn texts() -> impl Strategy<Value = Vec<u8>> {
        let pieces = [
            "[",
            "]",
            "{",
            "}",
            ",",
            ":",
            "\n",
            "\"Name\"",
            "\"ColorSpace\"",
            "\"RGBPoints\"",
            "\"Points\"",
            "\"NanColor\"",
            "\"Lab\"",
            "\"Diverging\"",
            "[0,0,0,1,1,1,0,0]",
            "[0,0,0.2,0,1,1,0.5,1]",
            "0",
            "1",
            "-1e308",
            "1e308",
            "5e-324",
            "255",
            "nan",
            "inf",
            "value,red,green,blue,opacity\n",
            "0,0,0,1\n",
            "1,1,0,0\n",
            "#",
            "\"",
            "é",
        ];
        let pieces = pieces.map(|piece| piece.as_bytes().to_vec());
        prop_oneof![
            proptest::collection::vec(any::<u8>(), 0..200),
            proptest::collection::vec(proptest::sample::select(pieces.to_vec()), 0..20).prop_map(|all| all.concat()),
            proptest::collection::vec(proptest::sample::select(pieces[15..].to_vec()), 4..40).prop_map(|all| [
                b"[{\"RGBPoints\":[".to_vec(),
                all.join(&b','),
                b"]}]".to_vec()
            ]
            .concat()),
        ]
    }

    proptest! {
        #[test]
        fn no_bytes_make_a_reader_panic(bytes in texts()) {
            let Ok(text) = text::from_bytes(bytes, KIND) else { return Ok(()) };
            for map in [paraview::parse(&text, None), table::parse(&text)].into_iter().flatten() {
                let (lo, hi) = map.range();
                prop_assert!(lo < hi);
                for value in [lo, lo / 2.0 + hi / 2.0, hi, f64::INFINITY, -f64::INFINITY] {
                    let colour = map.colour(value).expect("a value's colour");
                    prop_assert!(colour.iter().all(|c| (0.0..=1.0).contains(c)), "{colour:?}");
                    prop_assert!((0.0..=1.0).contains(&map.opacity(value)));
                }
                prop_assert_eq!(TransferFunction::parse(&map.text()).map(|m| m.text()), Some(map.text()));
            }
        }

        #[test]
        fn text_gives_the_same_colours_again(
            mut points in proptest::collection::vec((-1e300..1e300, [0.0..=1.0, 0.0..=1.0, 0.0..=1.0]), 2..9),
            space in 0..6_usize,
            value in -1e300..1e300,
        ) {
            use crate::colour::{Colour, ColourSpace};
            points.sort_by(|a: &(f64, Colour), b| a.0.total_cmp(&b.0));
            let spaces = [ColourSpace::Rgb, ColourSpace::Hsv, ColourSpace::HsvWrapped, ColourSpace::Lab, ColourSpace::Diverging, ColourSpace::Step];
            let map = TransferFunction::from_points(points, spaces[space], None, None).map_err(TestCaseError::reject)?;
            for map in [map.over((-3.3, 7.7)).expect("a range"), map] {
                let again = TransferFunction::parse(&map.text()).expect("the same");
                prop_assert_eq!(&again, &map);
                prop_assert_eq!(again.colour(value), map.colour(value));
            }
        }
    }
}
