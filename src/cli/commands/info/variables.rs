//! Lists the variables of an archive from which the user must choose one.

use crate::{CommonArgs, print};
use serde::Serialize;
use wavesplat_core::base::error::Result;
use wavesplat_core::source::VariableInfo;

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
