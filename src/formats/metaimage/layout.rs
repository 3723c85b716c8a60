//! The fields of a MetaImage and its types.

use crate::shared::types::Types;
use wavesplat_core::base::stored::StoredType;

/// The format's name, also in descriptions.
pub(super) const NAME: &str = "MetaImage";

/// Fields that mean the same, in lower case.
pub(super) const SPACING: [&str; 2] = ["elementspacing", "elementsize"];
pub(super) const ORIGIN: [&str; 3] = ["offset", "position", "origin"];
pub(super) const TRANSFORM: [&str; 3] = ["transformmatrix", "rotation", "orientation"];
pub(super) const BIG_ENDIAN: [&str; 2] = ["binarydatabyteordermsb", "elementbyteordermsb"];

/// Other fields that say how samples are stored and where.
const OTHERS: [&str; 17] = [
    "objecttype",
    "ndims",
    "dimsize",
    "elementtype",
    "elementnumberofchannels",
    "elementdatafile",
    "headersize",
    "binarydata",
    "compresseddata",
    "compresseddatasize",
    "centerofrotation",
    "elementmin",
    "elementmax",
    "itk_inputfiltername",
    "elementtointensityfunctionslope",
    "elementtointensityfunctionoffset",
    "anatomicalorientation",
];

/// Names of types; `LONG` has 4 bytes on every machine.
pub(super) const TYPES: Types<&str> = Types(&[
    (StoredType::I8, &["MET_CHAR"]),
    (StoredType::U8, &["MET_UCHAR"]),
    (StoredType::I16, &["MET_SHORT"]),
    (StoredType::U16, &["MET_USHORT"]),
    (StoredType::I32, &["MET_INT", "MET_LONG"]),
    (StoredType::U32, &["MET_UINT", "MET_ULONG"]),
    (StoredType::F32, &["MET_FLOAT"]),
    (StoredType::F64, &["MET_DOUBLE"]),
    (StoredType::I64, &["MET_LONG_LONG"]),
    (StoredType::U64, &["MET_ULONG_LONG"]),
]);

/// Whether a field in lower case says how samples are stored or where. Others are kept as texts.
pub(super) fn is_known(field: &str) -> bool {
    let known: [&[&str]; 5] = [&SPACING, &ORIGIN, &TRANSFORM, &BIG_ENDIAN, &OTHERS];
    known.iter().any(|fields| fields.contains(&field))
}
