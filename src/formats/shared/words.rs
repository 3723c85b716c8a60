//! Numbers in the text of headers, and messages about text that is wrong.

use std::io::{self, ErrorKind};
use std::str::FromStr;
use wavesplat_core::source::Parsed;

/// A number.
pub(crate) fn number<T: FromStr>(text: &str, what: &str) -> Parsed<T> {
    text.parse().map_err(|_| format!("the {what} {:?} is no number", shortened(text)))
}

/// Numbers separated by white space, however many.
pub(crate) fn list<T: FromStr>(text: &str, what: &str) -> Parsed<Vec<T>> {
    let found = text.split_whitespace().map(|word| word.parse().ok()).collect::<Option<Vec<T>>>();
    found.ok_or_else(|| format!("{what} must be numbers, not {:?}", shortened(text)))
}

/// `count` numbers separated by white space.
pub(crate) fn numbers<T: FromStr>(text: &str, what: &str, count: usize) -> Parsed<Vec<T>> {
    let found = list(text, what).ok().filter(|all| all.len() == count);
    found.ok_or_else(|| format!("{what} must be {count} numbers, not {:?}", shortened(text)))
}

/// As [`numbers`].
pub(crate) fn array<T: FromStr + Copy, const N: usize>(text: &str, what: &str) -> Parsed<[T; N]> {
    numbers(text, what, N).map(|all| std::array::from_fn(|i| all[i]))
}

/// The first characters of a text, for messages: the text may be of any length.
pub(crate) fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

/// A message about what is wrong with a file.
pub(crate) fn wrong(what: String) -> io::Error {
    io::Error::new(ErrorKind::InvalidData, what)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_numbers_as_must_be_are_read() {
        assert_eq!((number("7", "size"), list(" 1\t2 ", "sizes")), (Ok(7), Ok(vec![1, 2])));
        assert_eq!((array("1 -2.5", "a"), numbers("1 -2.5", "a", 2)), (Ok([1.0, -2.5]), Ok(vec![1.0, -2.5])));
        assert_eq!(number::<u8>("x", "size"), Err("the size \"x\" is no number".into()));
        assert_eq!(list::<u8>("1 x", "sizes"), Err("sizes must be numbers, not \"1 x\"".into()));
        assert_eq!(array::<u8, 3>("1 2", "sizes"), Err("sizes must be 3 numbers, not \"1 2\"".into()));
        assert_eq!(shortened(&"e".repeat(50)).len(), 40);
    }
}
