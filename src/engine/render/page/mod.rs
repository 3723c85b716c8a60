//! Web pages that show pictures: their description, their blocks of pictures, and the page around both.
//!
//! `web/` holds what the browser runs: plain HTML, CSS and JavaScript, compiled into the program. `block.js` reads blocks,
//! `colours.js` turns numbers into pixels, `player.js` shows them with the colour bar (`bar.js`) and the time line (`timeline.js`), `address.js`
//! keeps the state in the address, and `stored.js` finds pictures in the page itself. In the viewer, `live.js` asks for them, and
//! `steer.js` turns what the user does into requests. Who answers is an engine: a server (`server.js`), or the program itself
//! in workers of the page (`workers.js`, and `worker.js` within them).

mod about;
mod block;
mod opening;

pub use about::{About, Sequence};
pub use block::Planes;
pub use opening::{opening, spread};
pub use {about::maps, block::headed};

use base64::Engine as _;
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
/// The scripts for pages that ask for pictures.
const LIVE: &str = concat!(include_str!("web/camera.js"), include_str!("web/live.js"), include_str!("web/steer.js"),);
/// What answers them: a server, or the program in workers.
const SERVER: &str = include_str!("web/server.js");
const WORKERS: &str = include_str!("web/workers.js");
const WORKER: &str = include_str!("web/worker.js");
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
        "sources" => Some("script-src".into()),
        "controls" | "saving" => Some(String::new()),
        _ => None,
    })
}

/// What answers a page that asks for pictures.
#[derive(Debug, Clone, Copy)]
pub enum Engine<'a> {
    /// The server that the page comes from.
    Server,
    /// Workers of the page, which has all that they need.
    Within {
        /// The program for browsers, packed by zlib.
        program: &'a [u8],
        /// A coefficient file.
        file: &'a [u8],
    },
    /// Workers of the page. The program is beside it.
    Beside {
        /// Where files are, besides the page's own host.
        hosts: &'a [String],
    },
}

impl Engine<'_> {
    /// What the page may load and run besides its own scripts, for its content security policy.
    fn sources(self) -> String {
        let workers = "worker-src blob:; script-src 'wasm-unsafe-eval'";
        match self {
            Self::Server => "connect-src 'self'; script-src".into(),
            Self::Within { .. } => workers.into(),
            Self::Beside { hosts } => format!("connect-src 'self' {}; {workers}", hosts.join(" ")),
        }
    }

    fn scripts(self) -> String {
        match self {
            Self::Server => format!("{SCRIPT}{LIVE}{SERVER}{START}"),
            Self::Within { .. } | Self::Beside { .. } => format!("{SCRIPT}{LIVE}{WORKERS}{START}"),
        }
    }

    /// The parts that workers take from the page. They come last, for the page begins to work before they are read.
    fn parts(self) -> String {
        let part = |id: &str, text: &str| format!("<script type=\"text/plain\" id=\"{id}\">{text}</script>\n");
        match self {
            Self::Server => String::new(),
            Self::Beside { .. } => part("worker", WORKER),
            Self::Within { program, file } => {
                part("worker", WORKER) + &part("program", &base64(program)) + &part("file", &base64(file))
            }
        }
    }
}

/// Writes a page that asks an engine for pictures. `facts` is a JSON object.
pub fn write_asking(out: &mut dyn Write, nonce: &str, title: &str, facts: &str, engine: Engine<'_>) -> io::Result<()> {
    fill(out, PAGE, &|name| match name {
        "generator" => Some(concat!("wavesplat ", env!("CARGO_PKG_VERSION")).into()),
        "title" => Some(escaped(title)),
        "style" => Some(STYLE.into()),
        "nonce" => Some(nonce.into()),
        "sources" => Some(engine.sources()),
        "controls" => Some(CONTROLS.into()),
        "saving" => Some(SAVING.trim_end().into()),
        "blocks" => Some(String::new()),
        "parts" => Some(engine.parts()),
        "about" => Some(in_script(facts)),
        "script" => Some(engine.scripts()),
        _ => None,
    })
}

/// Bytes as a text, which `bytesOf` of the page's scripts reads.
pub fn base64(bytes: &[u8]) -> String {
    BASE64.encode(bytes)
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
    writeln!(out, r#"<script type="text/plain" class="block" {attributes}>{}</script>"#, base64(block))
}

/// Ends the page.
pub(crate) fn end(out: &mut dyn Write, nonce: &str, about: &About) -> io::Result<()> {
    let (_, end) = parts();
    let text = in_script(&serde_json::to_string(about)?);
    fill(out, end, &|name| match name {
        "about" => Some(text.clone()),
        "script" => Some(format!("{SCRIPT}{START}")),
        "nonce" => Some(nonce.into()),
        "parts" => Some(String::new()),
        _ => None,
    })
}

fn parts() -> (&'static str, &'static str) {
    PAGE.split_once(BLOCKS).unwrap_or((PAGE, ""))
}

/// A word that only scripts and styles of a page with this content know, the same in every run.
pub fn nonce(content: &[u8]) -> String {
    format!("{:032x}", xxh3_128(content))
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
