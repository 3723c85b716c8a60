//! Records: structures as bytes and back. The only user of bincode.
//!
//! bincode 2.0.1 needs a size limit and a check for trailing bytes. Without the limit it aborts on nine hostile bytes,
//! and it ignores bytes after a value.

use crate::bytes::{ParseResult, ensure};
use crate::limits::MAX_METADATA;
use bincode::{Decode, Encode, config};

/// Fixed-width little-endian integers, at most [`MAX_METADATA`] bytes.
const CONFIG: config::Configuration<config::LittleEndian, config::Fixint, config::Limit<MAX_METADATA>> =
    config::standard().with_little_endian().with_fixed_int_encoding().with_limit::<MAX_METADATA>();

/// Decodes a record that must take up all of `bytes`.
pub(crate) fn decode_exact<T: Decode<()>>(bytes: &[u8], what: &str) -> ParseResult<T> {
    let decoded = bincode::decode_from_slice::<T, _>(bytes, CONFIG);
    let (record, used) = decoded.map_err(|e| format!("not a {what}: {e}"))?;
    ensure(used == bytes.len(), || format!("{} bytes after the record", bytes.len() - used))?;
    Ok(record)
}

/// Encodes a record; `what` names it in errors.
pub(crate) fn encode(record: &impl Encode, what: &str) -> ParseResult<Vec<u8>> {
    bincode::encode_to_vec(record, CONFIG).map_err(|e| format!("{what}: {e}"))
}
