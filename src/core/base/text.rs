//! Small files of text.

use super::error::{Error, Result};
use super::files;
use std::io::Read;
use std::path::Path;

/// The largest size of a file, so that an endless one cannot exhaust memory.
pub(crate) const MOST_BYTES: u64 = 16 << 20;

/// The text of a file, which is expected to be a `kind`.
///
/// # Errors
/// A file that cannot be read, is empty, too large, or no UTF-8.
pub fn read(path: &Path, kind: &str) -> Result<String> {
    let mut bytes = Vec::new();
    let file = files::open_or_stream(path)?;
    file.take(MOST_BYTES + 1).read_to_end(&mut bytes).map_err(|e| Error::io(path, "reading", e))?;
    from_bytes(bytes, kind).map_err(|what| Error::input(path, what))
}

/// Replaces `%` and two hexadecimal digits by the byte that they stand for. Keeps any other `%`.
pub fn percent_decoded(text: &str) -> Vec<u8> {
    let (mut bytes, mut rest) = (Vec::new(), text.as_bytes());
    while let [first, after @ ..] = rest {
        let code = after.get(..2).and_then(|hex| std::str::from_utf8(hex).ok());
        let byte = code.and_then(|hex| u8::from_str_radix(hex, 16).ok()).filter(|_| *first == b'%');
        bytes.push(byte.unwrap_or(*first));
        rest = if byte.is_some() { &after[2..] } else { after };
    }
    bytes
}

/// The text of the bytes of a file.
pub(crate) fn from_bytes(bytes: Vec<u8>, kind: &str) -> std::result::Result<String, String> {
    if bytes.len() as u64 > MOST_BYTES {
        return Err(format!("is larger than {} MiB, which no {kind} is", MOST_BYTES >> 20));
    }
    let text = String::from_utf8(bytes).map_err(|_| format!("is not text, which a {kind} is expected to be"))?;
    let text = text.strip_prefix('\u{feff}').map_or(text.clone(), String::from); // some editors write it
    if text.trim().is_empty() { Err(format!("is empty, where a {kind} is expected")) } else { Ok(text) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_in_hexadecimal_become_plain() {
        assert_eq!(percent_decoded("a%2Fb%%zz%4"), b"a/b%%zz%4");
    }
}
