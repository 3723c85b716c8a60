//! Links to files that are not there.

use std::fs;
use std::path::Path;
use wavesplat_core::base::error::Error;

/// Whether a path is a link that leads nowhere.
pub(crate) fn is_lost(path: &Path) -> bool {
    path.is_symlink() && fs::metadata(path).is_err()
}

/// The error of such a link.
pub(crate) fn lost(link: &Path) -> Error {
    let to = fs::read_link(link).unwrap_or_default();
    let gone = |e| Error::input(link, format!("is a link to {}, which cannot be opened: {e}", to.display()));
    fs::metadata(link).map_or_else(gone, |_| Error::input(link, "is a link that leads nowhere"))
}
