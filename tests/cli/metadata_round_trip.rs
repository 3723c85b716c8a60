//! Extracted archives have the metadata of their sources, as xarray, nibabel, ITK and VTK read them.

use super::{CONVERT, Work};
use crate::common::report;
use std::path::Path;
use std::process::Command;

#[test]
fn archives_come_back_with_all_their_metadata() {
    let Ok(python) = std::env::var("WAVESPLAT_PYTHON") else {
        report("not run: WAVESPLAT_PYTHON names no Python with what tools/python/fixtures.txt lists");
        return;
    };
    let work = Work::new();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tools/python/identical.py");
    let done = Command::new(python).arg(script).arg(CONVERT).arg(work.path("archives")).output().unwrap();
    let (said, wrong) = (String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
    assert!(done.status.success(), "{said}{wrong}");
    assert!(said.lines().filter(|line| line.starts_with("ok ")).count() >= 9, "{said}");
}
