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
    /// The sums of each block's frames are those of the source, to rounding.
    pub sum: bool,
    /// Derivatives have at most these errors; at most one for each, in their order.
    pub derivatives: Vec<DerivativeBound>,
    /// The error of each sample is at most a share of it.
    pub relative: Option<RelativeBound>,
}

/// A derivative that is computed by differences, in space by central ones, where both neighbours exist.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Derivative {
    /// The change from one frame to the next.
    Difference,
    /// The derivatives along x, y and z.
    Gradient,
    /// The curl of a vector, if each of its components keeps this.
    Curl,
    /// The divergence of a vector, if each of its components keeps this.
    Divergence,
    /// The sum of the second derivatives along x, y and z.
    Laplacian,
}

impl Derivative {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Difference, Self::Gradient, Self::Curl, Self::Divergence, Self::Laplacian];

    /// Its word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Difference => "difference",
            Self::Gradient => "gradient",
            Self::Curl => "curl",
            Self::Divergence => "divergence",
            Self::Laplacian => "laplacian",
        }
    }
}

/// The largest error of a derivative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DerivativeBound {
    /// The derivative.
    pub derivative: Derivative,
    /// The error, in the samples' unit: per frame for differences, else per unit of length or of its square.
    pub error: f64,
}

/// The largest error of a sample, as a share of its magnitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RelativeBound {
    /// The share.
    pub share: f64,
    /// It applies to samples of at least this magnitude.
    pub floor: f64,
}

impl Keep {
    /// The setting of a file that holds the words.
    pub const SETTING: &'static str = "keep";

    /// The setting that older files have for `range`.
    const OLD_RANGE: (&'static str, &'static str) = ("clip", "true");

    /// Parses words such as `range`, `sign`, `side=0.5,2`, `gradient=0.1` and `relative=0.01@5`, with spaces between them.
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

    /// All that several keep.
    ///
    /// # Errors
    /// As [`Self::parse`].
    pub fn joined(all: &[Self]) -> Result<Self, String> {
        let words: Vec<String> = all.iter().map(ToString::to_string).collect();
        Self::parse(&words.join(" "))
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
        let (name, value) = word.split_once('=').map_or((word, None), |(name, value)| (name, Some(value)));
        let derivative = Derivative::ALL.into_iter().find(|derivative| derivative.name() == name);
        match (name, value, derivative) {
            ("range", None, _) => self.range = true,
            ("sum", None, _) => self.sum = true,
            ("sign", None, _) => self.sides.push(0.0),
            ("side", Some(values), _) => {
                for value in values.split(',') {
                    self.sides.push(number(value).ok_or_else(|| format!("side={value}: not a finite number"))?);
                }
            }
            ("relative", Some(value), _) => self.add_relative(value)?,
            (_, Some(value), Some(derivative)) => {
                let error = amount(value).ok_or_else(|| format!("{word}: not a finite number of 0 or more"))?;
                self.derivatives.push(DerivativeBound { derivative, error });
            }
            _ => return Err(format!("{word}: not understood; takes {WORDS}")),
        }
        Ok(())
    }

    fn add_relative(&mut self, value: &str) -> Result<(), String> {
        let (share, floor) = value.split_once('@').unwrap_or((value, "0"));
        let wrong = || format!("relative={value}: takes SHARE or SHARE@FLOOR, such as 0.01@5");
        let bound = RelativeBound { share: amount(share).ok_or_else(wrong)?, floor: amount(floor).ok_or_else(wrong)? };
        if self.relative.replace(bound).is_some_and(|before| before != bound) {
            return Err("relative: give it once".into());
        }
        Ok(())
    }

    fn sort(&mut self) {
        self.sides.iter_mut().for_each(|value| *value += 0.0); // -0 is 0
        self.sides.sort_by(f64::total_cmp);
        self.sides.dedup();
        self.derivatives.sort_by(|a, b| a.derivative.cmp(&b.derivative).then(a.error.total_cmp(&b.error)));
        self.derivatives.dedup_by_key(|of| of.derivative); // the smallest error of each stays
    }

    /// Whether a bound of the mean holds for each sample, because single samples have limits or are shifted.
    pub fn limits_samples(&self) -> bool {
        self.sum || self.relative.is_some() || !self.derivatives.is_empty()
    }

    /// Whether nothing is kept.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// The words, for a user.
const WORDS: &str = "range, sum, sign, side=VALUE[,VALUE...], relative=SHARE[@FLOOR], and difference, gradient, curl, divergence or \
                     laplacian with =ERROR";

fn number(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number: &f64| number.is_finite())
}

/// A number of 0 or more.
fn amount(text: &str) -> Option<f64> {
    number(text).filter(|number| *number >= 0.0).map(f64::abs) // no -0
}

impl fmt::Display for Keep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let other: Vec<String> = self.sides.iter().filter(|value| **value != 0.0).map(ToString::to_string).collect();
        let words = [
            self.range.then(|| "range".to_string()),
            self.sum.then(|| "sum".to_string()),
            (other.len() < self.sides.len()).then(|| "sign".to_string()),
            (!other.is_empty()).then(|| format!("side={}", other.join(","))),
            self.relative.map(|RelativeBound { share, floor }| match floor {
                0.0 => format!("relative={share:?}"),
                _ => format!("relative={share:?}@{floor:?}"),
            }),
        ];
        let derivatives = self.derivatives.iter().map(|of| format!("{}={:?}", of.derivative.name(), of.error));
        f.write_str(&words.into_iter().flatten().chain(derivatives).collect::<Vec<_>>().join(" "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_read_as_written() {
        let keep = Keep::parse("side=2,-0.5 range side=1e-3,2 sign").expect("known words");
        assert_eq!(keep, Keep { range: true, sides: vec![-0.5, 0.0, 1e-3, 2.0], ..Keep::default() });
        assert_eq!(keep.to_string(), "range sign side=-0.5,0.001,2");
        assert_eq!(Keep::parse(&keep.to_string()), Ok(keep));
        let keep = Keep::parse("gradient=2 relative=0.01@5 curl=1 difference=1e-30 gradient=0.5").expect("known words");
        assert_eq!(keep.to_string(), "relative=0.01@5.0 difference=1e-30 gradient=0.5 curl=1.0");
        assert_eq!(Keep::parse(&keep.to_string()), Ok(keep));
        assert!(Keep::parse("").is_ok_and(|keep| keep.is_empty() && keep.to_string().is_empty()));
    }

    #[test]
    fn other_words_are_refused() {
        for words in [
            "total",
            "side",
            "side=",
            "side=1,x",
            "side=inf",
            "side=NaN",
            "sign=1",
            "RANGE",
            "gradient",
            "gradient=-1",
            "relative=1@",
            "relative=1 relative=2",
        ] {
            assert!(Keep::parse(words).is_err(), "{words}");
        }
        let many: Vec<String> = (0..=MAX_SIDES).map(|n| n.to_string()).collect();
        assert!(Keep::parse(&format!("side={}", many.join(","))).is_err_and(|what| what.contains("at most")));
    }
}
