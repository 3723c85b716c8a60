//! Pages that need no server: they have the program, as WebAssembly, and read coefficient files by themselves.
//!
//! `program.zz` is `src/web`, as `tools/release/program.sh` builds it and packs it by zlib.

use super::request::PictureRequest;
use super::viewer::{FileOfPage, ViewerSession, shown_name};
use std::ffi::OsStr;
use std::fs::File;
use std::io;
use std::path::Path;
use wavesplat_core::base::address::{is_address, public_name};
use wavesplat_core::base::error::{Error, Note, Remedy, Result};
use wavesplat_core::base::files;
use wavesplat_core::base::output::{Output, OutputFolder, Takes};
use wavesplat_engine::file::CoefficientFile;
use wavesplat_engine::render::page::{self, Engine};

/// The program for browsers.
static PROGRAM: &[u8] = include_bytes!("program.zz");
/// Its name beside a page.
const PROGRAM_NAME: &str = "wavesplat.zz";

/// The largest file that a page holds: browsers take no texts beyond half a gigabyte.
const MOST_WITHIN: u64 = 256 << 20;

/// Bytes of memory for coarse pictures, and for others.
const MEMORY: [usize; 2] = [256 << 20, 512 << 20];

/// The file of a page.
struct Shown<'a> {
    viewer: &'a ViewerSession,
    /// Its path or address.
    path: &'a Path,
    name: String,
    file: CoefficientFile,
}

/// Writes a page that holds a file.
///
/// # Errors
/// An input that is no coefficient file, or too large, or that cannot be read, and settings that name other files.
pub fn write_page(viewer: &ViewerSession, output: &Path, replace: bool) -> Result<()> {
    let shown = Shown::new(viewer)?;
    if shown.file.bytes() > MOST_WITHIN {
        let most = MOST_WITHIN >> 20;
        let what = format!("a page holds at most {most} MiB; a folder with files beside the page takes more");
        return Err(Error::input(shown.file.path(), what));
    }
    let (bytes, facts) = (shown.file.stored()?, shown.facts(None)?);
    let mut out = Output::create(output, replace)?;
    write(&mut out, &shown.name, &facts, Engine::Within { program: PROGRAM, file: &bytes })?;
    out.commit()
}

/// Writes a folder with a page, the program, and copies of local files. The page reads ranges of these, and of files at
/// `https://` addresses.
///
/// # Errors
/// As [`write_page`], files of the same name, and a folder that is there and not one of these.
pub fn write_site(viewers: &[ViewerSession], path: &Path, replace: bool) -> Result<()> {
    // Without a slash at the end, and the folder itself instead of a link.
    let path = path.canonicalize().unwrap_or_else(|_| path.components().collect());
    refuse_other(&path, replace)?;
    let paths = viewers.iter().flat_map(|viewer| viewer.session.paths());
    let hosts = paths.filter_map(|path| host(path)).collect::<Result<Vec<_>>>()?;
    let all = viewers.iter().map(Shown::new).collect::<Result<Vec<_>>>()?;
    if let Some(twin) = (1..all.len()).find(|n| all[..*n].iter().any(|other| other.name == all[*n].name)) {
        return Err(Error::setting("inputs", format!("two have the name {}", all[twin].name)));
    }
    let folder = OutputFolder::create(&path, PROGRAM_NAME, Takes::Whole, replace)?;
    folder.write(PROGRAM_NAME, PROGRAM)?;
    let facts = all.iter().map(|shown| shown.facts(Some(shown.put(&folder)?))).collect::<Result<Vec<_>>>()?;
    let title = all.iter().map(|shown| shown.name.as_str()).collect::<Vec<_>>().join(", ");
    let facts = format!(r#"{{"live":true,"archives":[{}]}}"#, facts.join(","));
    let mut out = Output::create(&folder.place("index.html"), false)?;
    write(&mut out, &title, &facts, Engine::Beside { hosts: &hosts })?;
    out.commit()?;
    let _ = std::fs::remove_dir(&path); // unless something is in it
    folder.commit()
}

/// An error unless a folder can have this name: there is none, an empty one, or, to replace, one that this wrote and that has
/// nothing else in it.
fn refuse_other(path: &Path, replace: bool) -> Result<()> {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    if let Some(missing) = parent.filter(|parent| !parent.is_dir()) {
        return Err(Error::path(path, format!("there is no folder {}", missing.display())));
    }
    let is_empty = || std::fs::read_dir(path).is_ok_and(|mut all| all.next().is_none());
    if !path.exists() || is_empty() {
        return Ok(());
    }
    let page = std::fs::read_to_string(path.join("index.html")).unwrap_or_default();
    if !path.is_dir() || page.is_empty() || !path.join(PROGRAM_NAME).is_file() {
        return Err(Error::path(path, "exists already, and is no folder of a page"));
    }
    let listed =
        |name: &OsStr| page.contains(&format!("\"file\":{{\"name\":{}", serde_json::json!(name.to_string_lossy())));
    let is_own = |name: &OsStr| name == "index.html" || name == PROGRAM_NAME || listed(name);
    let names =
        std::fs::read_dir(path).and_then(|all| all.map(|entry| Ok(entry?.file_name())).collect::<io::Result<Vec<_>>>());
    let names = names.map_err(|e| Error::io(path, "reading", e))?;
    if let Some(other) = names.iter().find(|name| !is_own(name)) {
        return Err(Error::path(path.join(other), "is not a part of the page: move it away, or write another folder"));
    }
    if replace { Ok(()) } else { Err(Error::path(path, Note::with("exists already", Remedy::Replace))) }
}

fn write(out: &mut Output, title: &str, facts: &str, engine: Engine<'_>) -> Result<()> {
    let nonce = page::nonce(facts.as_bytes());
    page::write_asking(out, &nonce, title, facts, engine).map_err(|e| Error::io(out.path(), "writing", e))
}

impl<'a> Shown<'a> {
    fn new(viewer: &'a ViewerSession) -> Result<Self> {
        let [path] = viewer.session.paths() else {
            return Err(Error::setting("inputs", "a page shows coefficient files: convert frames first"));
        };
        refuse_files(&viewer.base)?;
        Ok(Self { viewer, path, name: shown_name(path), file: viewer.session.file(false)? })
    }

    /// The facts about the scene for a page that finds the file at an address, or within itself.
    fn facts(&self, url: Option<String>) -> Result<String> {
        let program = url.is_some().then(|| format!("{PROGRAM_NAME}?{}", &page::nonce(PROGRAM)[..8])); // no old one of a cache
        self.viewer.facts_with(Some(FileOfPage {
            name: self.name.clone(),
            url,
            program,
            length: self.file.bytes(),
            request: self.viewer.base.clone(),
            memory: MEMORY,
            preview: None,
        }))
    }

    /// Copies a local file to a folder. Returns the address of the file for a page there.
    fn put(&self, folder: &OutputFolder) -> Result<String> {
        if is_address(self.path) {
            return Ok(self.path.to_string_lossy().into_owned());
        }
        let place = folder.place(&self.name);
        if self.name == "index.html" || place.exists() {
            return Err(Error::setting(
                "inputs",
                format!("{} has the name of a file of the page: rename it", self.name),
            ));
        }
        let failed = |e| Error::io(self.path, "copying", e);
        let mut from = files::open(self.path)?;
        let copied = File::create(&place).and_then(|mut to| io::copy(&mut from, &mut to)).map_err(failed)?;
        self.file.check_unchanged()?;
        if copied != self.file.bytes() {
            return Err(Error::changed(self.path, "changed while it was being copied"));
        }
        let version = &self.file.id().to_string()[..8]; // no old bytes of a cache
        Ok(format!("./{}?{version}", encoded(&self.name)))
    }
}

/// The origin of an address: scheme, host and port. None for a path.
fn host(path: &Path) -> Option<Result<String>> {
    let address = is_address(path).then(|| path.to_string_lossy())?;
    let refused = |what: &str| Err(Error::setting("inputs", format!("{}: {what}", public_name(path).display())));
    let Some((scheme @ ("https" | "http"), rest)) = address.split_once("://") else {
        return Some(refused("browsers read files at https:// and http:// only"));
    };
    if public_name(path).as_os_str() != OsStr::new(&*address) {
        return Some(refused("a page would tell everybody its user name, or what follows ? or #"));
    }
    let host = rest.split('/').next().unwrap_or_default();
    let is_plain = |letter: char| letter.is_ascii_alphanumeric() || "-.:".contains(letter);
    let has_other = "has a host with other letters than a-z, digits, dots and dashes";
    Some(if host.chars().all(is_plain) { Ok(format!("{scheme}://{host}")) } else { refused(has_other) })
}

/// An error if a setting names a file: the page would not have it.
fn refuse_files(settings: &PictureRequest) -> Result<()> {
    let is_file = |name: &Option<String>| name.as_ref().is_some_and(|name| Path::new(name).is_file());
    let named = [
        ("key_frames", settings.key_frames.is_some()),
        ("error_image", settings.error_image.is_some()),
        ("sidecar", settings.sidecar.is_some()),
        ("colormap", is_file(&settings.colormap)),
        ("transfer_function", is_file(&settings.transfer_function)),
    ];
    let named = named.into_iter().find(|(_, is_named)| *is_named);
    named.map_or(Ok(()), |(field, _)| Err(Error::setting(field, "a page reads and writes no other files")))
}

/// A name as a part of an address.
fn encoded(name: &str) -> String {
    let letter = |byte: u8| match byte {
        b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' => char::from(byte).to_string(),
        _ => format!("%{byte:02X}"),
    };
    name.bytes().map(letter).collect()
}

#[cfg(test)]
mod tests {
    use super::encoded;

    #[test]
    fn names_are_parts_of_addresses() {
        assert_eq!(encoded("run-1_a.wspl"), "run-1_a.wspl");
        assert_eq!(encoded("50% a#1?é:.wspl"), "50%25%20a%231%3F%C3%A9%3A.wspl");
    }
}
