//! The Python literals in headers of `.npy`: strings, whole numbers, truth values, tuples, lists, dictionaries.

/// Largest depth of brackets: deeper text could overflow the stack.
const MAX_NESTING: usize = 8;

/// A value, and the text that it was read from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Literal<'a> {
    pub(super) source: &'a str,
    pub(super) value: Value<'a>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Value<'a> {
    /// The text between the quotes, with escapes not decoded.
    Text(&'a str),
    Number(u64),
    Truth(bool),
    /// A tuple or a list.
    Sequence(Vec<Literal<'a>>),
    Dictionary(Vec<(Literal<'a>, Literal<'a>)>),
}

/// Parses a text that is one value.
///
/// # Errors
/// The reason, in words that follow "its npy header".
pub(super) fn parse(text: &str) -> Result<Literal<'_>, String> {
    let mut parser = Parser { text, at: 0, depth: 0 };
    let value = parser.literal()?;
    parser.skip_blanks();
    if parser.at == text.len() { Ok(value) } else { Err(parser.wrong("the end")) }
}

struct Parser<'a> {
    text: &'a str,
    /// Start of the rest, in bytes; always between characters.
    at: usize,
    /// Brackets that are open.
    depth: usize,
}

impl<'a> Parser<'a> {
    fn literal(&mut self) -> Result<Literal<'a>, String> {
        self.skip_blanks();
        let start = self.at;
        let value = match self.next() {
            Some(quote @ (b'\'' | b'"')) => self.text(quote),
            Some(b'0'..=b'9') => self.number(),
            Some(b'(') => self.items(b')', Self::literal).map(Value::Sequence),
            Some(b'[') => self.items(b']', Self::literal).map(Value::Sequence),
            Some(b'{') => self.items(b'}', Self::pair).map(Value::Dictionary),
            _ => self.truth(),
        }?;
        Ok(Literal { source: &self.text[start..self.at], value })
    }

    fn text(&mut self, quote: u8) -> Result<Value<'a>, String> {
        let start = self.at + 1;
        let mut escaped = false;
        for (i, byte) in self.text.bytes().enumerate().skip(start) {
            if byte == quote && !escaped {
                self.at = i + 1;
                return Ok(Value::Text(&self.text[start..i]));
            }
            escaped = byte == b'\\' && !escaped;
        }
        Err("has a string without an end".into())
    }

    fn number(&mut self) -> Result<Value<'a>, String> {
        let rest = &self.text[self.at..];
        let digits = &rest[..rest.bytes().take_while(u8::is_ascii_digit).count()];
        self.at += digits.len();
        digits.parse().map(Value::Number).map_err(|_| format!("has numbers that are too large: {digits:.40}"))
    }

    fn truth(&mut self) -> Result<Value<'a>, String> {
        let words = [("True", true), ("False", false)];
        let found = words.into_iter().find(|(word, _)| self.text[self.at..].starts_with(word));
        let (word, truth) = found.ok_or_else(|| self.wrong("a value"))?;
        self.at += word.len();
        Ok(Value::Truth(truth))
    }

    /// Items with commas between them, up to a closing bracket; a comma may follow the last one.
    fn items<T>(&mut self, close: u8, item: fn(&mut Self) -> Result<T, String>) -> Result<Vec<T>, String> {
        self.at += 1;
        self.depth += 1;
        if self.depth > MAX_NESTING {
            return Err("is nested too deeply".into());
        }
        let mut items = Vec::new();
        while !self.takes(close) {
            items.push(item(self)?);
            if !self.takes(b',') && self.next() != Some(close) {
                return Err(self.wrong(&format!("',' or '{}'", char::from(close))));
            }
        }
        self.depth -= 1;
        Ok(items)
    }

    fn pair(&mut self) -> Result<(Literal<'a>, Literal<'a>), String> {
        let key = self.literal()?;
        if !self.takes(b':') {
            return Err(self.wrong("':'"));
        }
        Ok((key, self.literal()?))
    }

    /// Skips blanks and then a byte, if it is next.
    fn takes(&mut self, byte: u8) -> bool {
        self.skip_blanks();
        let is_next = self.next() == Some(byte);
        self.at += usize::from(is_next);
        is_next
    }

    fn next(&self) -> Option<u8> {
        self.text.as_bytes().get(self.at).copied()
    }

    fn skip_blanks(&mut self) {
        let rest = &self.text[self.at..];
        self.at = self.text.len() - rest.trim_ascii_start().len();
    }

    fn wrong(&self, expected: &str) -> String {
        format!("is damaged: expected {expected} at byte {} of its text", self.at)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Result<Value<'_>, String> {
        parse(text).map(|literal| literal.value)
    }

    #[test]
    fn values_are_read_with_the_text_they_are_from() {
        assert_eq!(value(" 'a\\'b' "), Ok(Value::Text("a\\'b")));
        assert_eq!(value("\"'\""), Ok(Value::Text("'")));
        assert_eq!(value("''"), Ok(Value::Text("")));
        assert_eq!(value("18446744073709551615"), Ok(Value::Number(u64::MAX)));
        assert_eq!(value("True"), Ok(Value::Truth(true)));
        assert_eq!(value("()"), Ok(Value::Sequence(Vec::new())));
        let literal = parse("{ 'a' : [1, (2,),] , }\n").expect("a dictionary");
        assert_eq!(literal.source, "{ 'a' : [1, (2,),] , }");
        let Value::Dictionary(pairs) = literal.value else { panic!("a dictionary") };
        assert_eq!((pairs[0].0.source, pairs[0].1.source, pairs.len()), ("'a'", "[1, (2,),]", 1));
        let Value::Sequence(items) = &pairs[0].1.value else { panic!("a list") };
        assert_eq!((items[0].source, items[1].source), ("1", "(2,)"));
    }

    #[test]
    fn other_text_is_refused_with_its_place() {
        let refused = |text: &str, words: &str| {
            let error = value(text).expect_err(text);
            assert!(error.contains(words), "{text}: {error}");
        };
        refused("", "expected a value at byte 0");
        refused("-1", "expected a value at byte 0");
        refused("(1 2)", "expected ',' or ')' at byte 3");
        refused("(,)", "expected a value at byte 1");
        refused("(1,,)", "expected a value at byte 3");
        refused("(1]", "expected ',' or ')' at byte 2");
        refused("{'a' 1}", "expected ':' at byte 5");
        refused("{1}", "expected ':'");
        refused("[1", "expected ',' or ']' at byte 2");
        refused("1 1", "expected the end at byte 2");
        refused("'é", "without an end");
        refused("é", "expected a value");
        refused("18446744073709551616", "too large");
        refused(&"[".repeat(60_000), "nested");
    }

    #[test]
    fn brackets_are_counted_only_while_they_are_open() {
        assert!(value(&format!("[{}]", "[],".repeat(100))).is_ok());
        let nested = |depth| "[".repeat(depth) + &"]".repeat(depth);
        assert!(value(&nested(MAX_NESTING)).is_ok() && value(&nested(MAX_NESTING + 1)).is_err());
    }
}
