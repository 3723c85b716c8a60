//! Extensions of file names.

use std::path::Path;

/// Extensions of files that may be in gzip as a whole.
const COMPRESSED: [&str; 3] = ["nii", "hdr", "img"];

/// The extension in lower case, or an empty text. A compressed file keeps its inner extension: `nii.gz`.
pub(crate) fn extension(path: &Path) -> String {
    let last = |path: &Path| path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let (own, inner) = (last(path), last(&path.with_extension("")));
    if own == "gz" && COMPRESSED.contains(&inner.as_str()) { format!("{inner}.gz") } else { own }
}
