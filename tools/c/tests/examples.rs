//! The examples are compiled and run as users would, by the compilers that are there.
#![allow(clippy::print_stderr, reason = "says what is not run")]

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;
use wavesplat::file::CoefficientFile;

/// The folder with the library, built for this test.
fn library() -> PathBuf {
    let test = env::current_exe().expect("a path");
    test.parent().expect("a folder").into()
}

/// Compiles an example and runs it in a folder of its own. Returns what it prints, and the file that it writes; none without the
/// compiler.
fn run(compiler: &str, options: &[&str], sources: &[&str]) -> Option<(String, CoefficientFile)> {
    if Command::new(compiler).arg("--version").output().is_err() {
        eprintln!("not run: there is no {compiler}");
        return None;
    }
    let (folder, library) = (tempfile::tempdir().expect("a folder"), library());
    let (here, program) = (Path::new(env!("CARGO_MANIFEST_DIR")), folder.path().join("example"));
    let mut compile = Command::new(compiler);
    compile.args(["-O2", "-Wall", "-Wextra", "-Werror"]).args(options).arg("-I").arg(here);
    compile.args(sources.iter().map(|source| here.join(source))).arg("-o").arg(&program).current_dir(folder.path());
    compile.arg("-L").arg(&library).args(["-lwavesplat_c", "-lm"]);
    let compiled = compile.output().expect("the compiler runs");
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    let ran = Command::new(&program).current_dir(folder.path()).env("LD_LIBRARY_PATH", &library).output();
    let ran = ran.expect("it was compiled");
    let printed = String::from_utf8_lossy(&ran.stdout).into_owned() + &String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{printed}");
    Some((printed, CoefficientFile::open(folder.path().join("run.wspl")).expect("a file")))
}

#[test]
fn c() {
    let Some((printed, file)) = run("cc", &["-std=c11", "-pedantic"], &["examples/heat.c"]) else { return };
    assert!(printed.starts_with("100 frames, largest error of the last one 0.0"), "{printed}");
    let metadata = file.metadata();
    assert_eq!((metadata.variable.as_deref(), file.grid.dims), (Some("temperature"), [48; 3]));
    assert_eq!((metadata.times[99], file.grid.spacing), (49.5, [0.01; 3]));
    assert!(metadata.windows.iter().all(|window| window.reached <= 0.05));
}

#[test]
fn cpp() {
    let Some((printed, file)) = run("c++", &["-std=c++17", "-pedantic"], &["examples/heat.cpp"]) else { return };
    assert!(printed.starts_with("64 frames, largest error of the last one 0.0"), "{printed}");
    assert_eq!((file.grid.dims, file.frames()), ([40; 3], 64));
}

#[test]
fn fortran() {
    let sources = ["wavesplat.f90", "examples/heat.f90"];
    let Some((printed, file)) = run("gfortran", &["-std=f2018"], &sources) else { return };
    assert_eq!(printed.trim(), "64 frames");
    assert_eq!((file.grid.dims, file.frames()), ([40; 3], 64));
    assert!(file.value_range().0 > 1.0, "ghost cells, which are 0, are no part of the frames");
}
