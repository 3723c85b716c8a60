//! The numbers in names: decimals with signs and exponents, or digits alone.

use std::path::{Path, PathBuf};

const MAX_DIGITS: usize = 18; // of integers; longer ones are left alone
const MAX_DECIMALS: usize = 30; // of numbers with a fraction or an exponent
const MARK: u8 = 0; // in no path

/// How digits are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Style {
    /// As `0.25`, `1e-05` and `=-3`.
    Decimals,
    /// As decimals, and `t-3` is less than `t3`.
    Signed,
    /// Runs of digits.
    Integers,
}

/// A number in a name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Number {
    /// Its digits.
    mantissa: i128,
    /// The power of 10 that they are multiplied by.
    exponent: i32,
    /// Digits before a point.
    pub(super) width: usize,
    /// Its place in the name.
    pub(super) start: usize,
    pub(super) end: usize,
}

impl Number {
    /// Its digits, without a point.
    pub(super) fn integer(&self) -> i128 {
        self.mantissa
    }

    /// In units of a power of 10 that is not above its own.
    fn in_units(&self, unit: i32) -> Option<i128> {
        let power = u32::try_from(self.exponent.checked_sub(unit)?).ok()?;
        if self.mantissa == 0 { Some(0) } else { self.mantissa.checked_mul(10_i128.checked_pow(power)?) }
    }
}

/// A name with a mark in place of each number.
#[derive(Debug)]
pub(super) struct Name {
    pub(super) words: Vec<u8>,
    pub(super) numbers: Vec<Number>,
}

impl Name {
    /// Whether it has any number.
    pub(super) fn is_numbered(&self) -> bool {
        !self.numbers.is_empty()
    }

    /// The words before a number, and after the last one.
    pub(super) fn words(&self) -> impl Iterator<Item = &[u8]> {
        self.words.split(|byte| *byte == MARK)
    }

    /// The name; `None` if it has a number that is too long.
    pub(super) fn parse(path: &Path, style: Style) -> Option<Self> {
        let text = path.to_string_lossy();
        let text = text.as_bytes();
        let (mut words, mut numbers, mut at) = (Vec::new(), Vec::new(), 0);
        while at < text.len() {
            if !text[at].is_ascii_digit() {
                words.push(text[at]);
                at += 1;
                continue;
            }
            let spelled = Spelled::at(text, at, style, &mut words);
            numbers.push(spelled.number()?);
            words.push(MARK);
            at = spelled.end;
        }
        Some(Self { words, numbers })
    }
}

/// The parts of a number in a text.
struct Spelled<'a> {
    is_negative: bool,
    digits: &'a [u8],
    fraction: &'a [u8],
    /// Its sign and digits.
    exponent: &'a [u8],
    start: usize,
    end: usize,
}

impl<'a> Spelled<'a> {
    /// The number whose first digit is here. A sign before it is taken off the words.
    fn at(text: &'a [u8], start: usize, style: Style, words: &mut Vec<u8>) -> Self {
        let digits = digits(text, start);
        let mut spelled =
            Self { is_negative: false, digits, fraction: &[], exponent: &[], start, end: start + digits.len() };
        if style == Style::Integers {
            return spelled;
        }
        let is_after_word = start > 0 && text[start - 1].is_ascii_alphanumeric();
        if let Some(sign) = sign(words, style) {
            words.pop();
            (spelled.is_negative, spelled.start) = (sign == b'-', start - 1);
        }
        spelled.take_fraction(text, words);
        spelled.take_exponent(text, is_after_word);
        spelled
    }

    /// Digits after a point; not in `1.2.3`.
    fn take_fraction(&mut self, text: &'a [u8], words: &[u8]) {
        let Some(point) = text.get(self.end).filter(|byte| b".,p".contains(byte)) else { return };
        let fraction = digits(text, self.end + 1);
        let end = self.end + 1 + fraction.len();
        let continues = text.get(end) == Some(point) && text.get(end + 1).is_some_and(u8::is_ascii_digit);
        let is_continued = words.ends_with(&[MARK, *point]);
        if !fraction.is_empty() && !continues && !is_continued {
            (self.fraction, self.end) = (fraction, end);
        }
    }

    /// `e-05`; without a sign only where no word ends before the number or begins after it.
    fn take_exponent(&mut self, text: &'a [u8], is_after_word: bool) {
        if !text.get(self.end).is_some_and(|byte| b"eEdD".contains(byte)) {
            return;
        }
        let start = self.end + 1;
        let is_signed = text.get(start).is_some_and(|byte| b"+-".contains(byte));
        let first = start + usize::from(is_signed);
        let end = first + digits(text, first).len();
        let is_word = text.get(end).is_some_and(u8::is_ascii_alphanumeric);
        if end > first && !is_word && (is_signed || !is_after_word) {
            (self.exponent, self.end) = (&text[start..end], end);
        }
    }

    fn number(&self) -> Option<Number> {
        let all: String = self.digits.iter().chain(self.fraction).map(|byte| char::from(*byte)).collect();
        let significant = all.trim_start_matches('0');
        let is_integer = self.fraction.is_empty() && self.exponent.is_empty();
        if significant.len() > if is_integer { MAX_DIGITS } else { MAX_DECIMALS } {
            return None;
        }
        let mantissa: i128 = if significant.is_empty() { 0 } else { significant.parse().ok()? };
        let exponent = std::str::from_utf8(self.exponent).ok()?;
        let power: i32 = if exponent.is_empty() { 0 } else { exponent.parse().ok()? };
        Some(Number {
            mantissa: if self.is_negative { -mantissa } else { mantissa },
            exponent: power.checked_sub(i32::try_from(self.fraction.len()).ok()?)?,
            width: self.digits.len(),
            start: self.start,
            end: self.end,
        })
    }
}

/// The digits from a place on.
fn digits(text: &[u8], start: usize) -> &[u8] {
    let rest = text.get(start..).unwrap_or_default();
    &rest[..rest.iter().take_while(|byte| byte.is_ascii_digit()).count()]
}

/// The sign that ends some words, if it is no hyphen.
fn sign(words: &[u8], style: Style) -> Option<u8> {
    let [before @ .., sign @ (b'-' | b'+')] = words else { return None };
    let is_sign = match before.last() {
        None => true,
        Some(&MARK) => false,
        Some(byte) => style == Style::Signed || !(byte.is_ascii_alphanumeric() || *byte >= 0x80),
    };
    is_sign.then_some(*sign)
}

/// The numbers of names that differ in these alone.
#[derive(Debug)]
pub(super) struct Reading {
    pub(super) names: Vec<Name>,
    /// Which numbers differ.
    pub(super) varying: Vec<usize>,
}

/// Numbers in the same place of several names, as multiples of a power of 10.
#[derive(Debug, Clone)]
pub(super) struct Column {
    pub(super) values: Vec<i128>,
    pub(super) unit: i32,
}

impl Reading {
    /// `None` if names differ in more.
    pub(super) fn of(paths: &[PathBuf], style: Style) -> Option<Self> {
        let names: Vec<Name> = paths.iter().map(|path| Name::parse(path, style)).collect::<Option<_>>()?;
        let first = names.first()?;
        if names.iter().any(|name| name.words != first.words) {
            return None;
        }
        let mut reading = Self { varying: (0..first.numbers.len()).collect(), names };
        let columns: Vec<Column> = reading.varying.iter().map(|at| reading.column(*at)).collect::<Option<_>>()?;
        reading.varying.retain(|at| columns[*at].values.iter().any(|value| *value != columns[*at].values[0]));
        Some(reading)
    }

    /// The numbers in one place; `None` if they are too far apart.
    pub(super) fn column(&self, at: usize) -> Option<Column> {
        let unit = self.names.iter().map(|name| name.numbers[at].exponent).min()?;
        let values = self.names.iter().map(|name| name.numbers[at].in_units(unit)).collect::<Option<_>>()?;
        Some(Column { values, unit })
    }

    /// The columns that differ.
    pub(super) fn columns(&self) -> Vec<Column> {
        self.varying.iter().filter_map(|at| self.column(*at)).collect()
    }

    /// The words before a number that end in letters: `t` of `img_t`.
    pub(super) fn label(&self, at: usize) -> String {
        let words = self.names[0].words().nth(at).unwrap_or_default();
        let words = String::from_utf8_lossy(words);
        let words = words.rsplit(['/', '\\']).next().unwrap_or_default();
        let words = words.trim_end_matches(|c: char| !c.is_alphabetic());
        words.rsplit(|c: char| !c.is_alphabetic()).next().unwrap_or_default().to_lowercase()
    }
}

impl Column {
    /// Whether no two are the same.
    pub(super) fn is_unique(&self) -> bool {
        let mut sorted = self.values.clone();
        sorted.sort_unstable();
        sorted.windows(2).all(|pair| pair[0] != pair[1])
    }

    /// Whether they are regular in their order.
    pub(super) fn is_regular(&self) -> bool {
        let mut sorted = self.values.clone();
        sorted.sort_unstable();
        let steps: Vec<i128> = sorted.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.first().is_none_or(|first| *first > 0 && steps.iter().all(|step| self.is_near(*step, *first)))
    }

    /// Whether two steps are the same but for the rounding of fractions.
    pub(super) fn is_near(&self, step: i128, other: i128) -> bool {
        let off = (step - other).abs();
        off == 0 || self.unit < 0 && (off <= 1 && other.abs() >= 3 || off <= other.abs() / 1_000_000)
    }

    /// The frames in their order.
    pub(super) fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = (0..self.values.len()).collect();
        order.sort_by_key(|at| self.values[*at]);
        order
    }
}
