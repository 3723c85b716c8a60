//! Checks the layering rules of `src/lib.rs` by reading the sources.

use std::fs;
use std::path::{Path, PathBuf};

/// The packages below `src/`, each with its `lib.rs`, and those below that it may use.
const PACKAGES: [(&str, &[&str]); 6] = [
    ("core", &[]),
    ("formats", &["core"]),
    ("engine", &["core"]),
    ("jobs", &["core", "formats", "engine"]),
    ("cli", &["core", "formats", "engine", "jobs"]),
    ("web", &["core", "formats", "engine", "jobs"]),
];

/// Modules, and those that they may not use although their place would allow it: of their own package, or of one below.
const APART: [(&str, &str, &[&str]); 7] = [
    ("core/wavelet/", "core", &["colour", "source"]),
    ("core/codec/", "core", &["colour", "source"]),
    ("core/view/", "core", &["colour", "source", "wavelet", "codec"]),
    ("formats/", "core", &["codec"]),
    ("engine/remote/", "core", &["colour", "source", "wavelet", "codec", "view"]),
    ("engine/render/", "engine", &["convert"]),
    ("jobs/extract/", "engine", &["convert", "render"]),
];

/// The files below `src/` with `unsafe` code: maps, signals, and JavaScript.
const UNSAFE: [&str; 4] = ["core/base/mapped.rs", "core/base/mapped/signals.rs", "web/exports.rs", "web/host.rs"];

/// The files below `src/` in which third-party crates may be used, where their package has more.
const ALLOWED_FILES: [(&str, &[&str]); 30] = [
    ("memmap2::", &["core/base/mapped.rs", "core/base/zeroed.rs"]),
    ("bytemuck::", &["core/base/zeroed.rs"]),
    ("libc::", &["core/base/mapped/signals.rs"]),
    ("multiversion::", &["core/base/vectors.rs"]),
    ("colorous::", &["core/colour/named.rs"]),
    ("csv::", &["core/colour/table.rs"]),
    ("flate2::", &["formats/", "engine/render/page/block.rs", "jobs/extract/sink.rs"]),
    ("tiff::", &["formats/tif/"]),
    ("hdf5_reader::", &["formats/arrays/hdf5_storage.rs", "formats/hdf5/", "formats/netcdf/"]),
    ("netcdf_reader::", &["formats/netcdf/"]),
    ("zarrs::", &["formats/zarr/"]),
    ("ureq::", &["engine/remote/"]),
    ("rusty_s3::", &["engine/remote/address.rs"]),
    ("configparser::", &["engine/remote/profile.rs"]),
    ("crossbeam_channel::", &["engine/convert/"]),
    (
        "rayon::",
        &[
            "core/base/workers.rs",
            "core/source/scan.rs",
            "core/source/series.rs",
            "engine/file/check.rs",
            "engine/file/skip.rs",
            "engine/file/tiers.rs",
            "engine/file/repack.rs",
            "engine/file/verify.rs",
            "engine/convert/workers.rs",
            "engine/convert/coarse.rs",
            "engine/convert/plan.rs",
            "engine/convert/choose.rs",
            "engine/convert/sampled.rs",
            "engine/render/batches/read.rs",
            "engine/render/batches/sampled.rs",
            "engine/render/renderer.rs",
            "engine/render/sink/mod.rs",
            "engine/render/ray_lengths.rs",
            "engine/render/planes/",
            "engine/render/slices/",
            "engine/render/splat/accumulator.rs",
            "engine/render/splat/footprints.rs",
            "engine/render/splat/lattice/filtered.rs",
            "engine/render/splat/lattice_bands.rs",
            "engine/render/page/block.rs",
            "engine/render/projection/plan.rs",
            "engine/render/projection/weight_sums.rs",
            "engine/render/scenes/coefficients.rs",
            "engine/render/scenes/overview.rs",
            "jobs/extract/mod.rs",
            "jobs/extract/placed.rs",
            "cli/common.rs",
        ],
    ),
    ("png::", &["engine/render/sink/"]),
    ("exr::", &["engine/render/sink/"]),
    ("ab_glyph::", &["engine/render/annotate/"]),
    (
        "base64::",
        &["formats/", "engine/remote/address.rs", "engine/render/page/", "engine/render/sink/page_encoder.rs"],
    ),
    ("clap_complete::", &["cli/generate.rs"]),
    ("clap_mangen::", &["cli/generate.rs"]),
    ("toml::", &["cli/config.rs"]),
    ("axum::", &["cli/view/"]),
    ("hyper::", &["cli/view/server.rs"]),
    ("hyper_util::", &["cli/view/server.rs"]),
    ("tokio::", &["cli/view/"]),
    ("tower_service::", &["cli/view/server.rs"]),
    ("getrandom::", &["cli/view/guard.rs"]),
    ("half::f16", &["core/base/half.rs"]), // its tests
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

/// Folders that list their modules in the order of the data's path: each uses only those listed before it.
const ORDERED: [&str; 27] = [
    "core",
    "core/base",
    "core/wavelet",
    "core/view",
    "formats/arrays",
    "formats/netcdf",
    "formats/npz",
    "formats/open",
    "formats/zarr",
    "formats/vtk_xml/write",
    "engine",
    "engine/file",
    "engine/render",
    "engine/render/batches",
    "engine/render/splat",
    "engine/render/scenes",
    "engine/render/projection",
    "engine/render/planes",
    "engine/render/slices",
    "engine/render/partial",
    "engine/render/page",
    "jobs",
    "jobs/extract",
    "jobs/picture",
    "jobs/picture/values",
    "jobs/picture/plan",
    "jobs/picture/series",
];

/// The `mod.rs` or `lib.rs` of a folder.
fn root<'a>(folder: &str, all: &'a [(String, String)]) -> &'a str {
    let root = if PACKAGES.iter().any(|(package, _)| *package == folder) { "lib" } else { "mod" };
    let (_, code) = all.iter().find(|(path, _)| *path == format!("{folder}/{root}.rs")).expect("a folder with modules");
    code
}

/// The modules of a folder, in the order of its `mod.rs` or `lib.rs`.
fn listed(folder: &str, all: &[(String, String)]) -> Vec<String> {
    modules(root(folder, all))
}

/// The modules that a file names, in order.
fn modules(code: &str) -> Vec<String> {
    let module = |line: &str| Some(line.split("mod ").nth(1)?.strip_suffix(';')?.to_string());
    code.lines().filter(|line| !line.starts_with(' ')).filter_map(module).collect()
}

/// The names that a folder passes on, and the modules that have them.
fn passed_on(folder: &str, all: &[(String, String)]) -> Vec<(String, String)> {
    let passed = |path: &str| {
        let (module, names) = path.split_once("::")?;
        let names = named(names).into_iter().map(|name| (name.to_string(), module.to_string()));
        Some(names.collect::<Vec<_>>())
    };
    root(folder, all).split("use ").skip(1).filter_map(passed).flatten().collect()
}

/// The module that has a name, which its folder may pass on.
fn home<'a>(used: &'a str, passed: &'a [(String, String)]) -> &'a str {
    passed.iter().find(|(name, _)| name == used).map_or(used, |(_, module)| module)
}

/// The modules of a folder that a file below it names. `below` is the file's path from there.
fn siblings<'a>(folder: &str, below: &str, code: &'a str) -> Vec<&'a str> {
    let levels = below.matches('/').count() + usize::from(!below.ends_with("mod.rs"));
    let in_package = folder.split('/').skip(1).map(|room| format!("{room}::")).collect::<String>();
    let (absolute, relative) = (format!("crate::{in_package}"), "super::".repeat(levels));
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
        let (order, passed) = (listed(folder, &all), passed_on(folder, &all));
        assert!(order.len() > 1, "{folder} lists its modules");
        for (path, code) in &all {
            let Some(below) = path.strip_prefix(&format!("{folder}/")) else { continue };
            let own = below.split('/').next().unwrap().trim_end_matches(".rs");
            let Some(at) = order.iter().position(|module| module == own) else { continue };
            for used in siblings(folder, below, code) {
                let Some(other) = order.iter().position(|module| *module == home(used, &passed)) else { continue };
                assert!(other <= at, "src/{path}: {own} is listed before {used} in {folder}, so it may not use it");
            }
        }
    }
}

/// The modules of a folder that each of its modules uses, without tests.
fn uses<'a>(folder: &str, all: &'a [(String, String)]) -> Vec<(String, Vec<String>)> {
    let (order, passed) = (listed(folder, all), passed_on(folder, all));
    let of = |own: &String| {
        let files = all.iter().filter_map(|(path, code)| Some((path.strip_prefix(&format!("{folder}/"))?, code)));
        let files = files.filter(|(below, _)| below.split('/').next().unwrap().trim_end_matches(".rs") == own);
        let files = files.filter(|(below, _)| !below.ends_with("tests.rs") && !below.ends_with("testing.rs"));
        let outside = |code: &'a str| code.split("#[cfg(test)]\nmod tests").next().unwrap();
        let used = files
            .flat_map(|(below, code)| siblings(folder, below, outside(code)))
            .map(|used| home(used, &passed).to_string());
        (own.clone(), used.filter(|used| used != own && order.contains(used)).collect())
    };
    order.iter().map(of).collect()
}

#[test]
fn no_modules_use_each_other_in_a_circle() {
    let all = sources();
    let folders = all.iter().filter_map(|(path, _)| path.strip_suffix("/mod.rs").or(path.strip_suffix("/lib.rs")));
    for folder in folders {
        let mut left = uses(folder, &all);
        loop {
            let lowest = |used: &[String]| used.iter().all(|used| left.iter().all(|(other, _)| other != used));
            let Some(at) = left.iter().position(|(_, used)| lowest(used)) else { break };
            left.remove(at);
        }
        assert!(left.is_empty(), "src/{folder}: a circle among {left:?}");
    }
}

#[test]
fn packages_use_only_those_below_them() {
    for (package, below) in PACKAGES {
        for (path, code) in sources().into_iter().filter(|(path, _)| path.starts_with(&format!("{package}/"))) {
            for (other, _) in PACKAGES.iter().filter(|(other, _)| !below.contains(other)) {
                assert!(!code.contains(&format!("wavesplat_{other}::")), "src/{path} uses {other}");
            }
        }
    }
}

/// Kernels know no frames, files or colours; conversion, rendering and extraction meet in the coefficient file alone.
#[test]
fn some_modules_stay_apart() {
    let all = sources();
    for (folder, package, others) in APART {
        for (path, code) in all.iter().filter(|(path, _)| path.starts_with(folder)) {
            let used = match path.strip_prefix(&format!("{package}/")) {
                Some(below) => siblings(package, below, code),
                None => code.split(&format!("wavesplat_{package}::")).skip(1).flat_map(named).collect(),
            };
            let wrong = used.into_iter().find(|used| others.contains(used));
            assert_eq!(wrong, None, "src/{path} uses a module of {package}");
        }
    }
}

/// Folders whose functions read and write nothing, look at no clock and start no thread.
#[test]
fn kernels_are_pure() {
    let pure = ["core/wavelet/", "core/codec/", "core/view/", "engine/render/splat/"];
    for (path, code) in sources().into_iter().filter(|(path, _)| pure.iter().any(|folder| path.starts_with(folder))) {
        let mut used = code.split("std::").skip(1).flat_map(named);
        let wrong = used.find(|module| ["fs", "time", "io", "env", "thread", "net", "process"].contains(module));
        assert_eq!(wrong, None, "src/{path} uses a module of std");
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
    path.starts_with("cli/") || path.starts_with("bin/")
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
    for (path, code) in sources().into_iter().filter(|(path, _)| !knows_options(path) && path != "core/base/error.rs") {
        assert!(!code.contains("Error::usage") && !code.contains("Error::Usage"), "src/{path}: name the setting");
    }
}

#[test]
fn unsafe_code_is_at_the_edges() {
    for (path, code) in sources() {
        assert!(
            UNSAFE.contains(&path.as_str()) || !code.replace("wasm-unsafe-eval", "").contains("unsafe"),
            "src/{path}"
        );
    }
}

#[test]
fn files_stay_short() {
    for (path, code) in sources() {
        assert!(code.lines().count() <= 500, "src/{path}");
    }
}
