//! Lists the variables of an archive from which the user must choose one.

use crate::base::error::Result;
use crate::cli::{CommonArgs, print};
use crate::source::VariableInfo;
use serde::Serialize;

/// The keys of `--json`.
#[derive(Debug, Serialize)]
struct Info<'a> {
    variables: &'a [VariableInfo],
}

pub(super) fn run(variables: &[VariableInfo], common: &CommonArgs) -> Result<()> {
    if common.json {
        return common.report(&Info { variables }, false);
    }
    let lines: String = variables.iter().map(|variable| format!("  {variable}\n")).collect();
    print(&format!("several variables\n{lines}choose one with --variable NAME\n"))
}
