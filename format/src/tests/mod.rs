//! Tests of whole files.

mod exit;
mod files;
mod hostile;
mod specification;
