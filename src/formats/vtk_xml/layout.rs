//! The names of types in VTK's XML.

use crate::shared::types::Types;
use wavesplat_core::base::stored::StoredType;

pub(super) const TYPES: Types<&str> = Types(&[
    (StoredType::U8, &["UInt8"]),
    (StoredType::I8, &["Int8"]),
    (StoredType::U16, &["UInt16"]),
    (StoredType::I16, &["Int16"]),
    (StoredType::U32, &["UInt32"]),
    (StoredType::I32, &["Int32"]),
    (StoredType::U64, &["UInt64"]),
    (StoredType::I64, &["Int64"]),
    (StoredType::F32, &["Float32"]),
    (StoredType::F64, &["Float64"]),
]);

/// The name of image data in a description.
pub(super) const IMAGE_DATA: &str = "VTK image data";

/// The name of a rectilinear grid in a description.
pub(super) const RECTILINEAR_GRID: &str = "VTK rectilinear grid";

/// The field with the time of a file.
pub(super) const TIME: &str = "TimeValue";
