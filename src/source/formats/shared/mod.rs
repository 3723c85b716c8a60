//! What several formats have in common: parts of headers, and encodings of samples.

pub(in crate::source) mod association;
pub(in crate::source) mod base64;
pub(in crate::source) mod component;
pub(in crate::source) mod deflated;
pub(in crate::source) mod directions;
pub(in crate::source) mod pattern;
pub(in crate::source) mod pieces;
pub(in crate::source) mod text;
pub(in crate::source) mod words;
pub(in crate::source) mod xml;
