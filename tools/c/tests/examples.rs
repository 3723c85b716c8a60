//! The examples are compiled and run as users would, by the compilers that are there.
#![allow(clippy::print_stderr, reason = "says what is not run")]

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;
use tempfile::TempDir;
use wavesplat::base::progress::Silent;
use wavesplat::extract::{ExtractConfig, extract_into};
use wavesplat::file::CoefficientFile;

/// The folder with the library, built for this test.
fn library() -> PathBuf {
    let test = env::current_exe().expect("a path");
    test.parent().expect("a folder").into()
}

/// Whether a program is there.
fn has(program: &str) -> bool {
    let is_there = Command::new(program).arg("--version").output().is_ok();
    if !is_there {
        eprintln!("not run: there is no {program}");
    }
    is_there
}

/// A file of the sources.
fn source(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Compiles an example in a folder of its own, if the compiler is there.
fn compiled(compiler: &str, options: &[&str], sources: &[&str]) -> Option<TempDir> {
    let folder = has(compiler).then(|| tempfile::tempdir().expect("a folder"))?;
    let mut compile = Command::new(compiler);
    compile.args(["-O2", "-Wall", "-Wextra", "-Werror"]).args(options).arg("-I").arg(source(""));
    compile.args(sources.iter().map(|name| source(name))).args(["-o", "example"]).current_dir(folder.path());
    compile.arg("-L").arg(library()).args(["-lwavesplat_c", "-lm"]);
    let compiled = compile.output().expect("the compiler runs");
    assert!(compiled.status.success(), "{}", String::from_utf8_lossy(&compiled.stderr));
    Some(folder)
}

/// Runs a program in a folder, with the library. Returns what it prints.
fn printed(program: &mut Command, folder: &TempDir) -> String {
    let ran = program.current_dir(folder.path()).env("LD_LIBRARY_PATH", library()).output().expect("it is there");
    let printed = String::from_utf8_lossy(&ran.stdout).into_owned() + &String::from_utf8_lossy(&ran.stderr);
    assert!(ran.status.success(), "{printed}");
    printed
}

fn open(folder: &TempDir, name: &str) -> CoefficientFile {
    CoefficientFile::open(folder.path().join(name)).expect("a file")
}

/// Compiles an example and runs it. Returns what it prints, and the file that it writes; none without the compiler.
fn run(compiler: &str, options: &[&str], sources: &[&str]) -> Option<(String, CoefficientFile)> {
    let folder = compiled(compiler, options, sources)?;
    let printed = printed(&mut Command::new(folder.path().join("example")), &folder);
    Some((printed, open(&folder, "run.wspl")))
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
    let times = &file.metadata().times;
    assert!(times.len() == 64 && times[0] == 0.0 && times[2] - times[1] > times[1] - times[0], "{times:?}");
}

#[test]
fn julia() {
    let Some(folder) = has("julia").then(|| tempfile::tempdir().expect("a folder")) else { return };
    let printed = printed(Command::new("julia").arg(source("examples/heat.jl")), &folder);
    assert!(printed.starts_with("64 frames, largest error of the last one 0.0"), "{printed}");
    let file = open(&folder, "run.wspl");
    assert_eq!((file.grid.dims, file.frames(), file.metadata().times[63]), ([40; 3], 64, 31.5));
    assert!(file.value_range().0 > 1.0, "ghost cells, which are 0, are no part of the frames");
}

/// All samples of a file.
fn samples(file: &CoefficientFile) -> Vec<f64> {
    let mut bytes = vec![0; 8 * file.frames() * file.grid.whole().voxels()];
    extract_into(file, &ExtractConfig::new(file), &mut bytes, &Silent).expect("samples");
    bytes.chunks_exact(8).map(|bytes| f64::from_le_bytes(bytes.try_into().expect("8"))).collect()
}

#[test]
fn mpi() {
    let options = ["-std=c11", "-pedantic"];
    let Some(folder) = has("mpirun").then(|| compiled("mpicc", &options, &["examples/heat_mpi.c"])).flatten() else {
        return;
    };
    let run = |ranks: &str| {
        let mut mpirun = Command::new("mpirun");
        let as_any_user = ["OMPI_ALLOW_RUN_AS_ROOT", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"].map(|name| (name, "1"));
        mpirun.envs(as_any_user).args(["--oversubscribe", "-n", ranks]).arg(folder.path().join("example"));
        printed(&mut mpirun, &folder);
    };
    run("1");
    let (whole, layer) = (open(&folder, "part_0.wspl"), 48 * 48);
    let whole = samples(&whole);
    run("3");
    for (rank, part) in (0..3).map(|rank| (rank, open(&folder, &format!("part_{rank}.wspl")))) {
        assert_eq!((part.grid.dims, part.frames()), ([48, 48, 16], 40));
        assert!((part.grid.origin[2] - 0.16 * rank as f64).abs() < 1e-9);
        let parts = samples(&part);
        for (part, whole) in parts.chunks_exact(16 * layer).zip(whole.chunks_exact(48 * layer)) {
            let whole = &whole[16 * layer * rank..];
            assert!(part.iter().zip(whole).all(|(part, whole)| (part - whole).abs() <= 0.1));
        }
    }
}
