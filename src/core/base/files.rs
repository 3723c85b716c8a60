//! Opens files for reading, but only if they are files. Opening a pipe may wait for ever, and opening a device may do
//! something: such paths are refused before they are opened, wherever they come from.

use super::error::{Error, Result};
use super::system::FileTypeExt;
use std::fs::{self, File, FileType};
use std::io::Read;
use std::path::Path;

/// Opens a regular file for reading.
///
/// # Errors
/// A file that cannot be opened, a pipe, a device, a socket, or a folder.
pub fn open(path: &Path) -> Result<File> {
    check(path)?;
    File::open(path).map_err(|e| Error::io(path, "opening", e))
}

/// The bytes of a regular file.
///
/// # Errors
/// As [`open`], or a file that cannot be read.
pub fn read(path: &Path) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    open(path)?.read_to_end(&mut bytes).map_err(|e| Error::io(path, "reading", e))?;
    Ok(bytes)
}

/// Opens a regular file, or a stream that this process already has: shells give `/dev/fd/63` for `<(command)`.
///
/// # Errors
/// As [`open`].
pub fn open_or_stream(path: &Path) -> Result<File> {
    if !is_own_stream(path) {
        return open(path);
    }
    File::open(path).map_err(|e| Error::io(path, "opening", e))
}

/// An error unless this is a regular file.
///
/// # Errors
/// A path that cannot be looked at, a pipe, a device, a socket, or a folder.
pub fn check(path: &Path) -> Result<()> {
    let kind = fs::metadata(path).map_err(|e| Error::io(path, "opening", e))?.file_type();
    if kind.is_file() {
        return Ok(());
    }
    let advice = if kind.is_fifo() { "; commands that read pipes take - for standard input" } else { "" };
    Err(Error::input(path, format!("is a {}, not a regular file{advice}", name(kind))))
}

fn name(kind: FileType) -> &'static str {
    match kind {
        kind if kind.is_dir() => "folder",
        kind if kind.is_fifo() => "pipe",
        kind if kind.is_socket() => "socket",
        _ => "device",
    }
}

/// Whether a path is that of an open stream of this process. A terminal or a pipe there was opened by who started it.
fn is_own_stream(path: &Path) -> bool {
    let is_stream = |kind: FileType| kind.is_fifo() || kind.is_socket() || kind.is_char_device();
    let named = path == Path::new("/dev/stdin") || ["/dev/fd", "/proc/self/fd"].iter().any(|all| path.starts_with(all));
    named && fs::metadata(path).is_ok_and(|about| is_stream(about.file_type()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::net::UnixListener;

    #[test]
    fn only_files_are_opened() {
        let folder = tempfile::tempdir().expect("a folder");
        let [file, pipe, socket, link] = ["file", "pipe", "socket", "link"].map(|name| folder.path().join(name));
        fs::write(&file, "text").expect("written");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
        let _listening = UnixListener::bind(&socket).expect("a socket");
        std::os::unix::fs::symlink(&pipe, &link).expect("a link");
        assert_eq!(read(&file).expect("a file"), b"text");
        let cases = [(pipe.as_path(), "a pipe"), (&link, "a pipe"), (&socket, "a socket"), (folder.path(), "a folder")];
        for (path, words) in cases.into_iter().chain([(Path::new("/dev/zero"), "a device")]) {
            for refused in [open(path).map(drop), read(path).map(drop), open_or_stream(path).map(drop)] {
                let error = refused.expect_err("no file").to_string();
                assert!(error.contains(words) && error.contains("not a regular file"), "{error}");
            }
        }
        assert!(matches!(open(&folder.path().join("none")), Err(Error::Io { .. })));
    }
}
