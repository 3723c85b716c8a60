//! Checks the order of the benchmark's modules by reading the sources: a module may only use those listed before it in
//! `mod.rs`.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

/// The folders of the benchmark below `src/`, with the path that names their modules.
const FOLDERS: [(&str, &str); 2] = [("bench", "crate::bench::"), ("bench/size", "crate::bench::size::")];

fn src(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src").join(path)
}

/// A source file without comments.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    text.lines().filter(|line| !line.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n")
}

/// The modules that a folder's `mod.rs` declares, in order.
fn modules(folder: &str) -> Vec<String> {
    let text = code(&src(folder).join("mod.rs"));
    let names = text.lines().filter_map(|line| line.split_once("mod ")?.1.strip_suffix(';'));
    names.map(Into::into).collect()
}

fn rust_files(path: &Path) -> Vec<PathBuf> {
    if path.is_file() {
        return vec![path.into()];
    }
    let entries = fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path());
    entries.flat_map(|path| rust_files(&path)).collect()
}

/// The first name of every path that starts with `prefix`.
fn used(code: &str, prefix: &str) -> Vec<String> {
    let names = code.split(prefix).skip(1).filter(|rest| !rest.starts_with('*'));
    names.map(|rest| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()).collect()
}

/// Checks one module of a folder. `super::` names the folder's modules in a file of the folder, and in the `mod.rs` of a
/// folder inside it.
fn check(folder: &str, prefix: &str, modules: &[String], module: &str) {
    let at = modules.iter().position(|m| m == module).unwrap();
    let file = src(folder).join(format!("{module}.rs"));
    let inner = src(folder).join(module);
    let direct = if file.is_file() { file } else { inner.join("mod.rs") };
    let files = if inner.is_dir() { rust_files(&inner) } else { vec![direct.clone()] };
    assert!(!files.is_empty(), "{folder}: {module} was found");
    for path in files {
        let text = code(&path);
        let outside = text.split("#[cfg(test)]").next().unwrap();
        let mut names = used(outside, prefix);
        if path == direct {
            names.extend(used(outside, "super::").into_iter().filter(|name| name != "super"));
        }
        for name in names {
            let other = modules.iter().position(|m| *m == name);
            let other = other.unwrap_or_else(|| panic!("{}: '{name}' is no module; name its module", path.display()));
            assert!(other <= at, "{}: {module} may not use {name}", path.display());
        }
    }
}

#[test]
fn modules_of_the_benchmark_use_only_earlier_ones() {
    for (folder, prefix) in FOLDERS {
        let modules = modules(folder);
        assert!(modules.len() > 5, "{folder}: the modules were found");
        modules.iter().for_each(|module| check(folder, prefix, &modules, module));
    }
}
