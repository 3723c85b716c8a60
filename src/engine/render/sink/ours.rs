//! Recognises pictures that wavesplat made, which may be replaced.

use std::fs::{self, File};
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// Bytes at the start of a file, and at the end of a movie, in which its mark must lie.
const PART: u64 = 1 << 16;

const HTML: &[u8] = b"<!doctype html>";
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";
const EXR: &[u8] = b"\x76\x2f\x31\x01";
const WEBM: &[u8] = b"\x1a\x45\xdf\xa3";
/// Behind the length of an MP4's first box.
const MP4: &[u8] = b"ftyp";
/// The beginning of the software's name in every file.
const SOFTWARE: &[u8] = b"wavesplat";

/// Whether a file is a picture or a report that says that wavesplat made it.
pub fn is_ours(path: &Path) -> bool {
    if !fs::metadata(path).is_ok_and(|file| file.is_file()) {
        return false;
    }
    let (mut start, mut end) = (Vec::new(), Vec::new());
    let mut read = || -> io::Result<()> {
        let mut file = File::open(path)?;
        (&file).take(PART).read_to_end(&mut start)?;
        file.seek(SeekFrom::Start(file.metadata()?.len().saturating_sub(PART)))?;
        file.take(PART).read_to_end(&mut end).map(drop)
    };
    read().is_ok() && (has_mark(&start) || is_movie(&start) && (is_named(&start) || is_named(&end)))
}

/// Whether a file begins as a movie.
fn is_movie(start: &[u8]) -> bool {
    start.starts_with(WEBM) || start.get(4..).is_some_and(|start| start.starts_with(MP4))
}

/// Whether the comment of a movie names us.
fn is_named(part: &[u8]) -> bool {
    let comment = b"Software=wavesplat";
    part.windows(comment.len()).any(|window| window == comment)
}

/// Whether the start of a file has the mark of its format.
fn has_mark(start: &[u8]) -> bool {
    let holds = |text: &[u8]| start.windows(text.len()).any(|window| window == text);
    match start {
        [b'{', ..] => holds(b"\"software\": \"wavesplat-render ") || holds(b"\"software\":\"wavesplat-render "),
        _ if start.starts_with(EXR) => exr_software(start),
        _ if start.starts_with(HTML) => holds(b"name=\"generator\" content=\"wavesplat-render "),
        _ => start.strip_prefix(PNG).is_some_and(png_software),
    }
}

/// Whether one of a PNG's first chunks is the text "Software" with our name.
fn png_software(mut chunks: &[u8]) -> bool {
    while let Some((head, rest)) = chunks.split_first_chunk::<8>() {
        let length = head[..4].iter().fold(0, |length, byte| length << 8 | usize::from(*byte));
        if let Some(name) = rest.get(..length).and_then(|data| software_of(&head[4..], data)) {
            return name.starts_with(SOFTWARE);
        }
        const CHECKSUM: usize = 4;
        chunks = rest.get(length.saturating_add(CHECKSUM)..).unwrap_or_default();
    }
    false
}

/// The text "Software" of a chunk of this kind: plain in Latin-1, or in UTF-8 behind a language and a translated name.
fn software_of<'a>(kind: &[u8], data: &'a [u8]) -> Option<&'a [u8]> {
    match kind {
        b"tEXt" => data.strip_prefix(b"Software\0"),
        b"iTXt" => data.strip_prefix(b"Software\0\0\0")?.splitn(3, |byte| *byte == 0).nth(2),
        _ => None,
    }
}

/// Whether the attribute `software` of an EXR begins with our name: name, type and length stand before the value.
fn exr_software(start: &[u8]) -> bool {
    let name = b"software\0string\0";
    let at = start.windows(name.len()).position(|window| window == name);
    at.and_then(|at| start.get(at + name.len() + 4..)).is_some_and(|value| value.starts_with(SOFTWARE))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(texts: &[&[u8]]) -> Vec<u8> {
        let chunk =
            |kind: &[u8], data: &[u8]| [&(data.len() as u32).swap_bytes().to_le_bytes(), kind, data, &[0; 4]].concat();
        let texts: Vec<u8> = texts.iter().flat_map(|text| chunk(b"tEXt", text)).collect();
        [PNG, &chunk(b"IHDR", &[0; 13]), &texts, &chunk(b"IDAT", b"Software\0wavesplat")].concat()
    }

    #[test]
    fn pictures_are_recognised_by_their_software() {
        assert!(has_mark(&png(&[b"Author\0me", b"Software\0wavesplat-render 0.1.0"])));
        for foreign in [&[][..], &[b"Software\0matplotlib".as_slice()], &[b"Comment\0Software wavesplat"]] {
            assert!(!has_mark(&png(foreign)));
        }
        let exr = |name: &[u8]| [EXR, b"\x02\0\0\0software\0string\0\x05\0\0\0", name].concat();
        assert!(has_mark(&exr(b"wavesplat-render 0.1")) && !has_mark(&exr(b"blender")));
        assert!(has_mark(b"{\n  \"software\": \"wavesplat-render 0.1.0\"}") && !has_mark(b"{\"software\": \"other\"}"));
    }

    #[test]
    fn international_texts_are_recognised() {
        let international = |data: &[u8]| {
            let whole = png(&[data]);
            let at = whole.windows(4).position(|kind| kind == b"tEXt").expect("a text");
            [&whole[..at], b"iTXt", &whole[at + 4..]].concat()
        };
        for ours in [&b"Software\0\0\0\0\0wavesplat-render 0.1"[..], b"Software\0\0\0en\0x\0wavesplat"] {
            assert!(has_mark(&international(ours)));
        }
        let packed = b"Software\0\x01\0\0\0wavesplat";
        for foreign in
            [&b"Software\0\0\0\0\0gimp"[..], packed, b"Software\0\0\0\0wavesplat", b"Title\0\0\0\0\0wavesplat"]
        {
            assert!(!has_mark(&international(foreign)));
        }
    }

    #[test]
    fn files_of_other_kinds_or_without_an_end_are_foreign() {
        let whole = png(&[b"Software\0wavesplat"]);
        for length in 0..whole.len() - 60 {
            assert!(!has_mark(&whole[..length]) || length > 50, "{length}");
        }
        let mut lies = whole;
        lies[8..12].copy_from_slice(&[255; 4]);
        assert!(!has_mark(&lies) && !has_mark(b"\x93NUMPY wavesplat") && !has_mark(b"YUV4MPEG2 wavesplat"));
    }
}
