//! Tests of whole files.

mod described;
mod exit;
mod files;
mod hostile;
mod specification;
