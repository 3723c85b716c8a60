//! The house rules of `src/lib.rs`, held by reading the sources.

use std::fs;
use std::path::{Path, PathBuf};

/// The library's rooms from the lowest to the highest; a room may use those on lower floors only.
const FLOORS: [&[&str]; 7] = [
    &["base"],
    &["colour", "wavelet", "view"],
    &["source"],
    &["codec"],
    &["file"],
    &["convert", "render", "extract"],
    &["cli"],
];

/// Where each third-party crate is at home: `src/` and then one of these.
const HOMES: [(&str, &[&str]); 21] = [
    ("memmap2::", &["base/mapped.rs"]),
    ("libc::", &["base/mapped.rs"]),
    ("crossbeam_channel::", &["convert/"]),
    (
        "rayon::",
        &[
            "convert/mod.rs",
            "convert/choose.rs",
            "convert/sampled.rs",
            "source/scan.rs",
            "render/canvas.rs",
            "render/plan.rs",
            "render/weights.rs",
            "extract/mod.rs",
            "file/coefficient_file.rs",
            "file/verify.rs",
            "cli/mod.rs",
        ],
    ),
    ("clap::", &["cli/", "bin/"]),
    ("clap_complete::", &["cli/generate.rs"]),
    ("clap_mangen::", &["cli/generate.rs"]),
    ("toml::", &["cli/config.rs"]),
    ("indicatif::", &["cli/"]),
    ("bytesize::", &["cli/"]),
    ("png::", &["render/sink/"]),
    ("exr::", &["render/sink/"]),
    ("colorous::", &["colour/named.rs"]),
    ("csv::", &["colour/table.rs"]),
    ("spleen_font::", &["render/annotate/"]),
    ("quick_xml::", &["source/formats/", "extract/vti.rs"]),
    ("flate2::", &["source/formats/"]),
    ("hdf5_reader::", &["source/formats/arrays/"]),
    ("netcdf_reader::", &["source/formats/arrays/"]),
    ("zarrs::", &["source/formats/arrays/"]),
    ("half::f16", &["base/half.rs"]), // its tests
];

fn rust_files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path());
    entries
        .flat_map(|p| if p.is_dir() { rust_files(&p) } else { vec![p] })
        .filter(|p| p.extension().is_some_and(|e| e == "rs"))
        .collect()
}

/// Every source file of the library and the programs: (path below `src/`, text without comments).
fn sources() -> Vec<(String, String)> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let files = rust_files(&src);
    assert!(files.len() > 40, "the sources were found");
    files
        .iter()
        .map(|p| {
            let text = fs::read_to_string(p).unwrap();
            let code = text.lines().filter(|l| !l.trim_start().starts_with("//")).collect::<Vec<_>>().join("\n");
            (p.strip_prefix(&src).unwrap().to_string_lossy().into_owned(), code)
        })
        .collect()
}

fn room(path: &str) -> &str {
    path.split('/').next().unwrap().trim_end_matches(".rs")
}

fn floor(room: &str) -> Option<usize> {
    FLOORS.iter().position(|rooms| rooms.contains(&room))
}

#[test]
fn rooms_use_lower_floors_only() {
    for (path, code) in sources() {
        let from = room(&path);
        if matches!(from, "lib" | "bin") {
            continue;
        }
        assert!(!code.contains("crate::{"), "src/{path}: name rooms one by one, so that they can be read here");
        let own = floor(from).unwrap_or_else(|| panic!("{path}: '{from}' has no floor"));
        for used in code.split("crate::").skip(1) {
            let to: String = used.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            let Some(other) = floor(&to) else { continue };
            assert!(to == from || other < own, "src/{path}: {from} may not use {to}");
        }
    }
}

#[test]
fn every_crate_stays_at_home() {
    for (path, code) in sources() {
        for (name, homes) in HOMES {
            let uses = code
                .match_indices(name)
                .any(|(i, _)| !code[..i].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':'));
            let at_home = homes.iter().any(|h| path.starts_with(h));
            assert!(!uses || at_home, "src/{path} uses {name}");
        }
    }
}

#[test]
fn unsafe_code_is_in_one_file() {
    for (path, code) in sources() {
        assert!(path == "base/mapped.rs" || !code.contains("unsafe"), "src/{path}");
    }
}

#[test]
fn files_stay_short() {
    for (path, code) in sources() {
        assert!(code.lines().count() <= 500, "src/{path}");
    }
}
