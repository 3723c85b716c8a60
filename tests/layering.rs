//! Checks the layering rules of `src/lib.rs` by reading the sources.

use std::fs;
use std::path::{Path, PathBuf};

/// The library's modules from the lowest to the highest layer. A module may only use lower ones.
const LAYERS: [&[&str]; 8] = [
    &["base"],
    &["colour", "wavelet", "view", "remote"],
    &["source"],
    &["formats", "codec"],
    &["file"],
    &["convert", "render", "extract"],
    &["picture"],
    &["cli"],
];

/// The files below `src/` in which each third-party crate may be used.
const ALLOWED_FILES: [(&str, &[&str]); 34] = [
    ("memmap2::", &["base/mapped.rs", "base/zeroed.rs"]),
    ("bytemuck::", &["base/zeroed.rs"]),
    ("libc::", &["base/mapped.rs"]),
    ("multiversion::", &["base/vectors.rs"]),
    ("crossbeam_channel::", &["convert/"]),
    (
        "rayon::",
        &[
            "convert/mod.rs",
            "convert/plan.rs",
            "convert/choose.rs",
            "convert/sampled.rs",
            "source/scan.rs",
            "render/batches/read.rs",
            "render/batches/sampled.rs",
            "render/renderer.rs",
            "render/planes/",
            "render/slices/",
            "render/splat/accumulator.rs",
            "render/splat/footprints.rs",
            "render/splat/lattice/filtered.rs",
            "render/splat/lattice_bands.rs",
            "render/page/block.rs",
            "render/projection/plan.rs",
            "render/projection/weight_sums.rs",
            "render/scenes/overview.rs",
            "extract/mod.rs",
            "file/fetch.rs",
            "file/check.rs",
            "file/coefficient_file.rs",
            "file/repack.rs",
            "file/verify.rs",
            "cli/common.rs",
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
    ("ab_glyph::", &["render/annotate/"]),
    ("quick_xml::", &["formats/"]),
    ("flate2::", &["formats/", "extract/sink.rs", "render/page/block.rs"]),
    ("tiff::", &["formats/tif/"]),
    ("hdf5_reader::", &["formats/arrays/hdf5_storage.rs", "formats/hdf5/", "formats/netcdf/"]),
    ("netcdf_reader::", &["formats/netcdf/"]),
    ("zarrs::", &["formats/zarr/"]),
    ("axum::", &["cli/view/"]),
    ("hyper::", &["cli/view/server.rs"]),
    ("hyper_util::", &["cli/view/server.rs"]),
    ("tokio::", &["cli/view/server.rs"]),
    ("tower_service::", &["cli/view/server.rs"]),
    ("getrandom::", &["cli/view/guard.rs"]),
    ("base64::", &["formats/", "remote/address.rs", "render/page/", "render/sink/page_encoder.rs"]),
    ("ureq::", &["remote/"]),
    ("rusty_s3::", &["remote/address.rs"]),
    ("configparser::", &["remote/profile.rs"]),
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

fn folder_of(path: &str) -> &str {
    path.split('/').next().unwrap().trim_end_matches(".rs")
}

fn layer(folder: &str) -> Option<usize> {
    LAYERS.iter().position(|folders| folders.contains(&folder))
}

#[test]
fn modules_use_only_lower_layers() {
    let all = sources();
    let order = modules(&all.iter().find(|(path, _)| path == "lib.rs").expect("src/lib.rs").1);
    let at = |folder: &str| order.iter().position(|module| module == folder);
    for (path, code) in &all {
        let from = folder_of(path);
        if matches!(from, "lib" | "bin") {
            continue;
        }
        assert!(!code.contains("crate::{"), "src/{path}: name modules one by one, so that they can be read here");
        let own = layer(from).unwrap_or_else(|| panic!("{path}: '{from}' is in no layer"));
        for used in code.split("crate::").skip(1) {
            let to: String = used.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
            let Some(other) = layer(&to) else { continue };
            assert!(to == from || other < own, "src/{path}: {from} may not use {to}");
            assert!(at(&to) <= at(from), "src/{path}: lib.rs lists {from} before {to}, so it may not use it");
        }
    }
}

/// Folders whose `mod.rs` lists the modules in the order of the data's path: each uses only those listed before it.
const ORDERED: [&str; 11] = [
    "base",
    "formats/arrays",
    "view",
    "file",
    "render",
    "render/batches",
    "render/splat",
    "render/scenes",
    "render/projection",
    "picture",
    "picture/plan",
];

/// The modules of a folder, in the order of its `mod.rs`.
fn listed(folder: &str, all: &[(String, String)]) -> Vec<String> {
    let (_, code) = all.iter().find(|(path, _)| *path == format!("{folder}/mod.rs")).expect("a folder with a mod.rs");
    modules(code)
}

/// The modules that a file names, in order.
fn modules(code: &str) -> Vec<String> {
    let module = |line: &str| Some(line.split("mod ").nth(1)?.strip_suffix(';')?.to_string());
    code.lines().filter(|line| !line.starts_with(' ')).filter_map(module).collect()
}

/// The modules of a folder that a file below it names. `below` is the file's path from there.
fn siblings<'a>(folder: &str, below: &str, code: &'a str) -> Vec<&'a str> {
    let levels = below.matches('/').count() + usize::from(!below.ends_with("mod.rs"));
    let (absolute, relative) = (format!("crate::{}::", folder.replace('/', "::")), "super::".repeat(levels));
    let from_root = code.split(absolute.as_str()).skip(1);
    // A longer chain of `super` leaves the folder.
    let leaves = |at: usize| code[..at].ends_with("super::") || code[at + relative.len()..].starts_with("super");
    let from_here = code.match_indices(&relative).filter(|(at, _)| !leaves(*at));
    from_root.chain(from_here.map(|(at, _)| &code[at + relative.len()..])).flat_map(named).collect()
}

/// The names that a path goes on with: one, or a list in braces.
fn named(rest: &str) -> Vec<&str> {
    let word = |item: &str| item.len() - item.trim_start_matches(|c: char| c.is_alphanumeric() || c == '_').len();
    let Some(list) = rest.strip_prefix('{') else { return vec![&rest[..word(rest)]] };
    let list = &list[..list.find(';').unwrap_or(list.len())];
    list.split(',').map(str::trim_start).map(|item| &item[..word(item)]).collect()
}

#[test]
fn modules_are_listed_from_the_lowest_to_the_highest() {
    let all = sources();
    for folder in ORDERED {
        let order = listed(folder, &all);
        assert!(order.len() > 1, "{folder} lists its modules");
        for (path, code) in &all {
            let Some(below) = path.strip_prefix(&format!("{folder}/")) else { continue };
            let own = below.split('/').next().unwrap().trim_end_matches(".rs");
            let Some(at) = order.iter().position(|module| module == own) else { continue };
            for used in siblings(folder, below, code) {
                let Some(other) = order.iter().position(|module| module == used) else { continue };
                assert!(
                    other <= at,
                    "src/{path}: {own} is listed before {used} in {folder}/mod.rs, so it may not use it"
                );
            }
        }
    }
}

#[test]
fn every_crate_is_used_only_where_it_is_listed() {
    for (path, code) in sources() {
        for (name, allowed) in ALLOWED_FILES {
            let uses = code
                .match_indices(name)
                .any(|(i, _)| !code[..i].ends_with(|c: char| c.is_alphanumeric() || c == '_' || c == ':'));
            let is_allowed = allowed.iter().any(|file| path.starts_with(file));
            assert!(!uses || is_allowed, "src/{path} uses {name}");
        }
    }
}

/// Whether a path is of the programs or of what they share: only these know options.
fn knows_options(path: &str) -> bool {
    matches!(folder_of(path), "bin" | "cli")
}

#[test]
fn only_programs_name_options() {
    for (path, code) in sources().into_iter().filter(|(path, _)| !knows_options(path)) {
        let mut after = code.split("--").skip(1);
        let option = after.find(|text| text.starts_with(|c: char| c.is_ascii_lowercase()));
        let option = option.map(|text| text.split_whitespace().next().unwrap_or_default());
        assert_eq!(option, None, "src/{path}: errors and notes name fields; cli/messages.rs makes options of them");
    }
}

#[test]
fn only_programs_have_errors_of_usage() {
    for (path, code) in sources().into_iter().filter(|(path, _)| !knows_options(path) && path != "base/error.rs") {
        assert!(!code.contains("Error::usage") && !code.contains("Error::Usage"), "src/{path}: name the setting");
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
