//! Addresses of files that are on servers.

use crate::base::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Whether a path is the address of a remote file: `https://`, `http://` or `s3://`.
pub fn is_address(path: &Path) -> bool {
    let text = path.to_str().unwrap_or_default();
    let starts = |scheme: &&str| text.get(..scheme.len()).is_some_and(|start| start.eq_ignore_ascii_case(scheme));
    ["https://", "http://", "s3://"].iter().any(starts)
}

/// An error if a file that is to be written is on a server.
///
/// # Errors
/// It is.
pub fn refuse_output(path: &Path) -> Result<()> {
    if is_address(path) {
        let what =
            "files are not written to servers; write to - and pipe that to a program that uploads, like `aws s3 cp -`";
        return Err(Error::path(public_name(path), what));
    }
    Ok(())
}

/// An error if a file that must be local is on a server.
pub fn refuse_address(path: &Path) -> Result<()> {
    if is_address(path) {
        return Err(Error::path(public_name(path), "must be a file of this machine; download it"));
    }
    if path.to_string_lossy().contains("://") && !path.exists() {
        let what = "is no address of a kind that is known: https://, http:// and s3:// are";
        return Err(Error::path(public_name(path), what));
    }
    Ok(())
}

/// An error if frames are on a server.
pub fn refuse_frames(inputs: &[PathBuf]) -> Result<()> {
    let what =
        "frames are not read from servers, only coefficient files; download them, or mount the store as a folder";
    let remote = inputs.iter().find(|input| is_address(input));
    remote.map_or(Ok(()), |input| Err(Error::path(public_name(input), what)))
}

/// An address without its secrets: user name, password, and signatures in the query. Paths stay as they are.
pub fn public_name(address: &Path) -> PathBuf {
    let text = address.to_string_lossy();
    let Some((scheme, rest)) = text.split_once("://") else { return address.into() };
    let rest = rest.split(['?', '#']).next().unwrap_or_default();
    let (host, path) = rest.split_at(rest.find('/').unwrap_or(rest.len()));
    let host = host.rsplit('@').next().unwrap_or_default();
    format!("{scheme}://{host}{path}").into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_told_from_paths() {
        for address in ["https://host/run.wspl", "HTTP://host/a", "s3://bucket/run.wspl"] {
            assert!(is_address(Path::new(address)), "{address}");
        }
        for path in ["run.wspl", "/https://host", "https:/host/a", "file:///a", "é3://a"] {
            assert!(!is_address(Path::new(path)), "{path}");
        }
    }

    #[test]
    fn names_keep_no_secrets() {
        for (address, name) in [
            ("https://me:secret@host:80/a/run.wspl?X-Amz-Signature=1#x", "https://host:80/a/run.wspl"),
            ("https://host", "https://host"),
            ("s3://bucket/a@b/run.wspl", "s3://bucket/a@b/run.wspl"),
            ("runs/what?#1.wspl", "runs/what?#1.wspl"),
        ] {
            assert_eq!(public_name(Path::new(address)), Path::new(name));
        }
    }
}
