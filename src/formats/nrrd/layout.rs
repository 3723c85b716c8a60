//! The magic of a NRRD, and its types.

use crate::shared::types::Types;
use wavesplat_core::base::stored::StoredType;

/// The format's name, also in descriptions.
pub(super) const NAME: &str = "NRRD";

/// How every NRRD starts.
pub(super) const MAGIC: &[u8] = b"NRRD000";

/// Names of types in lower case.
pub(super) const TYPES: Types<&str> = Types(&[
    (StoredType::I8, &["int8", "int8_t", "signed char"]),
    (StoredType::U8, &["uint8", "uint8_t", "uchar", "unsigned char"]),
    (StoredType::I16, &["int16", "int16_t", "short", "short int", "signed short", "signed short int"]),
    (StoredType::U16, &["uint16", "uint16_t", "ushort", "unsigned short", "unsigned short int"]),
    (StoredType::I32, &["int32", "int32_t", "int", "signed int"]),
    (StoredType::U32, &["uint32", "uint32_t", "uint", "unsigned int"]),
    (StoredType::F32, &["float"]),
    (StoredType::F64, &["double"]),
    (
        StoredType::I64,
        &["int64", "int64_t", "longlong", "long long", "long long int", "signed long long", "signed long long int"],
    ),
    (StoredType::U64, &["uint64", "uint64_t", "ulonglong", "unsigned long long", "unsigned long long int"]),
]);
