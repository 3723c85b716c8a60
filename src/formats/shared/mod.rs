//! What several formats have in common: parts of headers, and encodings of samples.

pub(crate) mod association;
pub(crate) mod base64;
pub(crate) mod component;
pub(crate) mod dataset;
pub(crate) mod deflated;
pub(crate) mod directions;
pub(crate) mod extension;
pub(crate) mod links;
pub(crate) mod meaning;
pub(crate) mod offer;
pub(crate) mod pattern;
pub(crate) mod pieces;
pub(crate) mod relabelled;
pub(crate) mod sequence;
pub(crate) mod text;
pub(crate) mod types;
pub(crate) mod words;
pub(crate) mod xml;
