//! What decoded samples keep besides their bound, as words: on the command line, in files and in reports.

use crate::limits::MAX_SIDES;
use std::fmt;

/// What decoded samples keep of the source.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Keep {
    /// None is beyond the extremes of its window.
    pub range: bool,
    /// Each is on its side of these values, or equal to them as in the source. They ascend.
    pub sides: Vec<f64>,
}

impl Keep {
    /// The setting of a file that holds the words.
    pub const SETTING: &'static str = "keep";

    /// The setting that older files have for `range`.
    const OLD_RANGE: (&'static str, &'static str) = ("clip", "true");

    /// Parses words such as `range`, `sign` and `side=0.5,2`, with spaces between them.
    ///
    /// # Errors
    /// The reason, for a user.
    pub fn parse(words: &str) -> Result<Self, String> {
        let mut keep = Self::default();
        words.split_whitespace().try_for_each(|word| keep.add(word))?;
        keep.sort();
        let count = keep.sides.len();
        if count > MAX_SIDES { Err(format!("sides of {count} values; at most {MAX_SIDES}")) } else { Ok(keep) }
    }

    /// What the settings of a file say. Unknown words are left to later versions: if a reader needs them, a feature tells it.
    pub(crate) fn of_settings(settings: &[(String, String)]) -> Self {
        let mut keep = Self::default();
        for (name, value) in settings {
            match (name.as_str(), value.as_str()) {
                (Self::SETTING, words) => words.split_whitespace().for_each(|word| drop(keep.add(word))),
                Self::OLD_RANGE => keep.range = true,
                _ => {}
            }
        }
        keep.sort();
        keep
    }

    fn add(&mut self, word: &str) -> Result<(), String> {
        match word.split_once('=') {
            None if word == "range" => self.range = true,
            None if word == "sign" => self.sides.push(0.0),
            Some(("side", values)) => {
                for value in values.split(',') {
                    let number = value.parse().ok().filter(|number: &f64| number.is_finite());
                    self.sides.push(number.ok_or_else(|| format!("side={value}: not a finite number"))?);
                }
            }
            _ => return Err(format!("{word}: unknown; range, sign or side=VALUE[,VALUE...]")),
        }
        Ok(())
    }

    fn sort(&mut self) {
        self.sides.iter_mut().for_each(|value| *value += 0.0); // -0 is 0
        self.sides.sort_by(f64::total_cmp);
        self.sides.dedup();
    }

    /// Whether nothing is kept.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

impl fmt::Display for Keep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let other: Vec<String> = self.sides.iter().filter(|value| **value != 0.0).map(ToString::to_string).collect();
        let words = [
            self.range.then(|| "range".to_string()),
            (other.len() < self.sides.len()).then(|| "sign".to_string()),
            (!other.is_empty()).then(|| format!("side={}", other.join(","))),
        ];
        f.write_str(&words.into_iter().flatten().collect::<Vec<_>>().join(" "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_as_written() {
        let keep = Keep::parse("side=2,-0.5 range side=1e-3,2 sign").expect("known words");
        assert_eq!(keep, Keep { range: true, sides: vec![-0.5, 0.0, 1e-3, 2.0] });
        assert_eq!(keep.to_string(), "range sign side=-0.5,0.001,2");
        assert_eq!(Keep::parse(&keep.to_string()), Ok(keep));
        assert!(Keep::parse("").is_ok_and(|keep| keep.is_empty() && keep.to_string().is_empty()));
    }

    #[test]
    fn other_words_are_refused() {
        for words in ["sum", "side", "side=", "side=1,x", "side=inf", "side=NaN", "sign=1", "RANGE"] {
            assert!(Keep::parse(words).is_err(), "{words}");
        }
        let many: Vec<String> = (0..=MAX_SIDES).map(|n| n.to_string()).collect();
        assert!(Keep::parse(&format!("side={}", many.join(","))).is_err_and(|what| what.contains("at most")));
    }
}
