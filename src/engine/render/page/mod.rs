//! Web pages that show pictures: their description, their blocks of pictures, and the page around both.
//!
//! `web/` holds what the browser runs: plain HTML, CSS and JavaScript, compiled into the program. `block.js` reads blocks,
//! `colours.js` turns numbers into pixels, `player.js` shows them with the colour bar (`bar.js`) and the time line (`timeline.js`), `address.js`
//! keeps the state in the address, and `stored.js` finds pictures in the page itself. In the viewer, `live.js` asks its server for them, and
//! `steer.js` turns what the user does into requests.

mod about;
mod block;
mod opening;

pub use about::{About, Sequence};
pub use block::Planes;
pub use opening::{opening, spread};
pub use {about::maps, block::headed};

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;
use std::io::{self, Write};
use xxhash_rust::xxh3::xxh3_128;

const PAGE: &str = include_str!("web/page.html");
const STYLE: &str = include_str!("web/page.css");
const SCRIPT: &str = concat!(
    include_str!("web/block.js"),
    include_str!("web/colours.js"),
    include_str!("web/address.js"),
    include_str!("web/bar.js"),
    include_str!("web/timeline.js"),
    include_str!("web/player.js"),
    include_str!("web/stored.js"),
);
/// The scripts for pages that ask a server for pictures.
const LIVE: &str = concat!(include_str!("web/camera.js"), include_str!("web/live.js"), include_str!("web/steer.js"),);
const CONTROLS: &str = include_str!("web/controls.html");
const SAVING: &str = include_str!("web/saving.html");
/// Begins to show pictures.
const START: &str = include_str!("web/start.js");

/// Where the blocks of pictures stand in the page.
const BLOCKS: &str = "{blocks}";

/// Begins a page that holds its pictures.
pub(crate) fn begin(out: &mut dyn Write, generator: &str, nonce: &str, about: &About) -> io::Result<()> {
    let (start, _) = parts();
    let title = if about.title.is_empty() { &about.values } else { &about.title };
    let title = if title.is_empty() { "wavesplat" } else { title };
    fill(out, start, &|name| match name {
        "generator" => Some(escaped(generator)),
        "title" => Some(escaped(title)),
        "style" => Some(STYLE.into()),
        "nonce" => Some(nonce.into()),
        "sources" | "controls" | "saving" => Some(String::new()),
        _ => None,
    })
}

/// A page that asks its server for pictures. `facts` is a JSON object.
pub fn live(nonce: &str, facts: &str) -> io::Result<String> {
    let mut out = Vec::new();
    fill(&mut out, PAGE, &|name| match name {
        "generator" => Some(concat!("wavesplat ", env!("CARGO_PKG_VERSION")).into()),
        "title" => Some("wavesplat".into()),
        "style" => Some(STYLE.into()),
        "nonce" => Some(nonce.into()),
        "sources" => Some("connect-src 'self'; ".into()),
        "controls" => Some(CONTROLS.into()),
        "saving" => Some(SAVING.trim_end().into()),
        "blocks" => Some(String::new()),
        "about" => Some(in_script(facts)),
        "script" => Some(format!("{SCRIPT}{LIVE}{START}")),
        _ => None,
    })?;
    String::from_utf8(out).map_err(io::Error::other)
}

/// A JSON text for a script element, where "<" could begin its end tag.
fn in_script(json: &str) -> String {
    json.replace('<', "\\u003c")
}

/// Writes a block of `count` pictures of a sequence, from the picture `first` on.
pub(crate) fn write_block(
    out: &mut dyn Write,
    sequence: usize,
    first: usize,
    count: usize,
    block: &[u8],
) -> io::Result<()> {
    let attributes = format!(r#"data-sequence="{sequence}" data-first="{first}" data-count="{count}""#);
    writeln!(out, r#"<script type="text/plain" class="block" {attributes}>{}</script>"#, BASE64.encode(block))
}

/// Ends the page.
pub(crate) fn end(out: &mut dyn Write, nonce: &str, about: &About) -> io::Result<()> {
    let (_, end) = parts();
    let text = in_script(&serde_json::to_string(about)?);
    fill(out, end, &|name| match name {
        "about" => Some(text.clone()),
        "script" => Some(format!("{SCRIPT}{START}")),
        "nonce" => Some(nonce.into()),
        _ => None,
    })
}

fn parts() -> (&'static str, &'static str) {
    PAGE.split_once(BLOCKS).unwrap_or((PAGE, ""))
}

/// A word that only scripts and styles of this page know, the same in every run.
pub(crate) fn nonce(about: &About) -> String {
    format!("{:032x}", xxh3_128(format!("{about:?}").as_bytes()))
}

/// A text with no letters that markup begins with.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Writes a template, with texts in place of the `{names}` that have one.
fn fill(out: &mut dyn Write, template: &str, text: &dyn Fn(&str) -> Option<String>) -> io::Result<()> {
    let mut pieces = template.split('{');
    out.write_all(pieces.next().unwrap_or_default().as_bytes())?;
    for piece in pieces {
        match piece.split_once('}').and_then(|(name, rest)| Some((text(name)?, rest))) {
            Some((text, rest)) => write!(out, "{text}{rest}")?,
            None => write!(out, "{{{piece}")?,
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn templates_take_texts_once_and_keep_other_braces() {
        let mut out = Vec::new();
        let text = |name: &str| (name == "a").then(|| "{a}{b}".to_string());
        fill(&mut out, "x{a}y{c}{ z } { {a}", &text).expect("a text");
        assert_eq!(String::from_utf8(out).expect("letters"), "x{a}{b}y{c}{ z } { {a}{b}");
    }

    #[test]
    fn texts_of_files_never_become_markup() {
        assert_eq!(escaped("<b a=\"&\">"), "&lt;b a=&quot;&amp;&quot;&gt;");
    }
}
