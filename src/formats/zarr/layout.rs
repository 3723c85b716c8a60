//! The files of a Zarr store, and the names of its types.

use std::path::{Path, PathBuf};
use wavesplat_core::base::description::NumberType;
use wavesplat_core::base::npy::numpy_name;
use wavesplat_core::base::stored::StoredType;

/// The metadata of a group, of an array and of its attributes in version 2.
pub(super) const GROUP: &str = ".zgroup";
pub(super) const ARRAY: &str = ".zarray";
pub(super) const ATTRIBUTES: &str = ".zattrs";

/// The file with the consolidated metadata.
pub(super) const METADATA: &str = ".zmetadata";

/// The attribute with the names of an array's dimensions in version 2.
pub(super) const DIMENSIONS: &str = "_ARRAY_DIMENSIONS";

/// The file with the metadata of a folder that is a store.
pub(crate) fn metadata_file(folder: &Path) -> Option<PathBuf> {
    let names = ["zarr.json", METADATA, GROUP, ARRAY].into_iter();
    names.map(|name| folder.join(name)).find(|path| path.is_file())
}

/// The name of a type in version 2, which is NumPy's.
pub(super) fn dtype(ty: NumberType) -> String {
    let order = if ty.size() == 1 { '|' } else { '<' };
    StoredType::from_number(ty).map_or_else(|| "|S1".into(), |ty| format!("{order}{}", numpy_name(ty)))
}
