//! Tests of whole files.

mod bare;
mod described;
mod exit;
mod files;
mod hostile;
mod specification;
