//! Reports as JSON.

use serde::Serialize;
use wavesplat_core::base::error::{Error, Result};

/// A report as JSON for people and programs.
pub fn report_text(report: &impl Serialize) -> Result<String> {
    let text = serde_json::to_string_pretty(&Versioned { schema: 1, report });
    text.map(|text| text + "\n").map_err(|e| Error::setting("json", e.to_string()))
}

/// The object that `--json` prints. If the meaning of a key changes, so does `schema`.
#[derive(Debug, Serialize)]
struct Versioned<'a, T> {
    schema: u32,
    #[serde(flatten)]
    report: &'a T,
}
