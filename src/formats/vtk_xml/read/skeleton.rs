//! The XML of a file without the samples that are stored in it as text, which may not fit in memory.

use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::FileBytes;

const PIECE: usize = 64 << 10; // bytes read at a time
const KEPT: usize = 64; // bytes of a text that stay
const MOST: usize = 64 << 20; // bytes of what is left
const MOST_CUTS: usize = MOST >> 4; // of 16 bytes each
const TAG: &[u8] = b"<AppendedData";

/// The XML up to the end of the `<AppendedData>` tag or of the file.
#[derive(Debug, Default)]
pub(super) struct Skeleton {
    text: Vec<u8>,
    /// Places in the text, and bytes that are left out before each.
    cuts: Vec<(u64, u64)>,
    left_out: u64,
    /// Whether the last byte was a `-`. The next byte shows whether it is the sign of a number.
    sign: bool,
    /// Bytes since the last `>`, if no `<` came.
    outside: Option<usize>,
    /// Where the tag of the appended data starts.
    appended: Option<usize>,
}

impl Skeleton {
    /// Reads the XML of a file, up to the appended data.
    pub(super) fn read(file: &FileBytes) -> Result<Self> {
        let mut skeleton = Self::default();
        let (mut at, mut piece) = (0, vec![0; PIECE]);
        while at < file.len() {
            let len = usize::try_from(file.len() - at).unwrap_or(PIECE).min(PIECE);
            file.read_at(at, &mut piece[..len]).map_err(|e| Error::io(file.path(), "reading its XML", e))?;
            if piece[..len].iter().any(|byte| skeleton.ends_with(*byte)) {
                break;
            }
            if skeleton.text.len() > MOST || skeleton.cuts.len() > MOST_CUTS {
                return Err(Error::input(file.path(), format!("its XML does not end within {MOST} bytes")));
            }
            at += len as u64;
        }
        if std::mem::take(&mut skeleton.sign) {
            skeleton.keep(b'-');
        }
        Ok(skeleton)
    }

    /// Takes the next byte, and says whether it ends the XML.
    fn ends_with(&mut self, byte: u8) -> bool {
        let inside_text = self.outside.is_some_and(|bytes| bytes >= KEPT);
        if std::mem::take(&mut self.sign) {
            match byte.is_ascii_alphanumeric() || byte == b'.' {
                true => self.left_out += 1,
                false => self.keep(b'-'), // of a comment, say
            }
        }
        if inside_text && byte == b'-' {
            self.sign = true;
            return false;
        }
        let samples = byte.is_ascii_alphanumeric() || byte.is_ascii_whitespace() || b"+/=.".contains(&byte);
        if inside_text && samples {
            self.left_out += 1;
            return false;
        }
        self.keep(byte);
        if byte == b'a' && self.text.ends_with(TAG) {
            self.appended = Some(self.text.len());
        }
        byte == b'>' && self.appended.is_some()
    }

    fn keep(&mut self, byte: u8) {
        if self.cuts.last().map_or(0, |(_, left_out)| *left_out) != self.left_out {
            self.cuts.push((self.text.len() as u64, self.left_out));
        }
        self.text.push(byte);
        self.outside = match (byte, self.outside) {
            (b'<', _) => None,
            (b'>', _) => Some(0),
            (_, bytes) => bytes.map(|bytes| bytes + 1),
        };
    }

    /// The rest of the text.
    pub(super) fn text(&self) -> &[u8] {
        &self.text
    }

    /// Where a byte of the text is in the file.
    pub(super) fn place(&self, at: u64) -> u64 {
        let before = self.cuts.partition_point(|(place, _)| *place <= at);
        at + before.checked_sub(1).map_or(0, |last| self.cuts[last].1)
    }

    /// Where the text ends in the file.
    pub(super) fn end(&self) -> u64 {
        self.text.len() as u64 + self.left_out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Folder;
    use wavesplat_core::base::mapped::Access;

    #[test]
    fn long_texts_are_left_out_and_places_are_those_of_the_file() {
        let long = "Ab+/ 0.5\n".repeat(10_000);
        let name = "n".repeat(100);
        let comment = format!("<!-- > {long} -->");
        let bytes = format!("<a><b name=\"{name}\">{long}</b>{comment}<c>{long}</c><AppendedData x=\"y\">_\0\0");
        let folder = Folder::new();
        let file = FileBytes::open(&folder.write("a.vti", &bytes), Access::Read).expect("a file");
        let skeleton = Skeleton::read(&file).expect("reading");
        let text = String::from_utf8(skeleton.text().to_vec()).expect("text");
        assert!(text.len() < 700 && text.contains(&name) && text.contains("-->"), "{text}");
        assert_eq!(skeleton.end(), bytes.find('_').expect("there") as u64);
        for tag in ["<a>", "<b ", "</b>", "<!--", "<c>", "</c>", "<App"] {
            let [here, there] = [&text, &bytes].map(|text| text.find(tag).expect("a tag") as u64);
            assert_eq!(skeleton.place(here), there, "{tag}");
        }
        let after = text.find("<c>").expect("a tag") as u64 + 3;
        assert_eq!(skeleton.place(after), bytes.find("<c>").expect("a tag") as u64 + 3);
    }

    #[test]
    fn signs_of_numbers_are_left_out() {
        let folder = Folder::new();
        let read = |bytes: &str| {
            let file = FileBytes::open(&folder.write("a.vti", bytes), Access::Read).expect("a file");
            Skeleton::read(&file)
        };
        let bytes = format!("<a>{}</a><!-- > {} - --><b>-", "-1.5e-07 -.5 -nan\n".repeat(10_000), "-1 ".repeat(10_000));
        let skeleton = read(&bytes).expect("reading");
        let text = String::from_utf8(skeleton.text().to_vec()).expect("text");
        assert!(text.len() < 300 && text.contains("</a><!-- >") && text.ends_with("---><b>-"), "{text}");
        assert!(skeleton.cuts.len() < 10, "{:?}", skeleton.cuts);
        for tag in ["</a>", "<!--", "-->", "<b>-"] {
            assert_eq!(skeleton.place(text.find(tag).expect(tag) as u64), bytes.find(tag).expect(tag) as u64, "{tag}");
        }
        assert_eq!(skeleton.end(), bytes.len() as u64);
        let cuts = format!("<a>{}", "-1 -".repeat(20) + &"- ".repeat(MOST_CUTS + PIECE));
        assert!(crate::testing::message(read(&cuts)).contains("does not end"));
    }
}
