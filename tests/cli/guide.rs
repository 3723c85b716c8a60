//! README and the guide: every command on these pages runs, every link leads somewhere, and README stays short.
//!
//! A command is a line of a block fenced by `sh`, or inline code of three words or more that begins with a program's name.
//! The commands of a page run in its order, in a folder of its own.

use super::{Archive, CONVERT, Run, Work};
use crate::common::http::Server;
use std::env;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread;

/// How commands begin that this test leaves out, and why.
const NOT_RUN: [(&str, &str); 5] = [
    ("wavesplat view ", "it runs until it is interrupted; tests/viewer runs it"),
    ("cargo ", "a build takes minutes; tools/tests run the tools"),
    ("cc ", "tools/c/tests compiles the examples"),
    ("target/release/wavesplat-tools ", "tools/tests run the tools"),
    ("python3 tools/peers/", "needs the packages of tools/peers/requirements.txt"),
];

/// Runs only where `WAVESPLAT_PYTHON` names a Python with numpy and the packages of tools/python/requirements.txt.
const PYTHON: &str = "python ";

/// The first words of inline code that is a command.
const PROGRAMS: [&str; 5] = ["wavesplat", "wavesplat-render", "cargo", "python", "python3"];

const MOST_WORDS: usize = 1300;

struct Page {
    path: PathBuf,
    text: String,
}

fn root() -> PathBuf {
    env!("CARGO_MANIFEST_DIR").into()
}

/// README first, then the guide.
fn pages() -> Vec<Page> {
    let entries = fs::read_dir(root().join("tools/guide")).unwrap();
    let mut paths = entries.map(|entry| entry.unwrap().path()).collect::<Vec<_>>();
    paths.sort();
    paths.insert(0, root().join("README.md"));
    let page = |path: PathBuf| Page { text: fs::read_to_string(&path).unwrap(), path };
    paths.into_iter().map(page).collect()
}

impl Page {
    /// The lines, with the language of the block that they are in; lines of fences are left out.
    fn lines(&self) -> Vec<(Option<&str>, &str)> {
        let (mut block, mut lines) = (None, Vec::new());
        for line in self.text.lines() {
            match (line.strip_prefix("```"), block) {
                (Some(language), None) => block = Some(language),
                (Some(_), Some(_)) => block = None,
                (None, _) => lines.push((block, line)),
            }
        }
        lines
    }

    fn commands(&self) -> Vec<&str> {
        let of_line = |(block, line)| match block {
            Some("sh") => vec![line],
            Some(_) => Vec::new(),
            None => self.spans(line),
        };
        self.lines().into_iter().flat_map(of_line).filter(|line| !line.trim().is_empty()).collect()
    }

    /// The commands among the inline code of a line.
    fn spans<'a>(&self, line: &'a str) -> Vec<&'a str> {
        let pieces = line.split('`').collect::<Vec<_>>();
        assert!(pieces.len() % 2 == 1, "{}: inline code goes over the end of a line: {line}", self.path.display());
        let spans = pieces.into_iter().skip(1).step_by(2);
        spans.filter(|span| is_command(span)).collect()
    }

    /// The targets of links and pictures.
    fn links(&self) -> Vec<&str> {
        let text = self.lines().into_iter().filter(|(block, _)| block.is_none());
        let targets = text.flat_map(|(_, line)| line.split("](").skip(1));
        targets.map(|rest| rest.split(')').next().unwrap()).collect()
    }

    /// What headings are linked as.
    fn anchors(&self) -> Vec<String> {
        let text = self.lines().into_iter().filter(|(block, line)| block.is_none() && line.starts_with('#'));
        text.map(|(_, line)| anchor(line.trim_start_matches('#').trim())).collect()
    }
}

fn is_command(code: &str) -> bool {
    let words = code.split_whitespace().collect::<Vec<_>>();
    words.len() > 2 && PROGRAMS.contains(&words[0])
}

fn anchor(heading: &str) -> String {
    let kept = heading.chars().filter(|c| c.is_alphanumeric() || " -_".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c.to_ascii_lowercase() }).collect()
}

/// The inputs that the pages name.
fn prepared() -> Work {
    let work = Work::new();
    let frames = Archive::smooth([12, 10, 8], 24);
    frames.write_frames(&work, "frames");
    frames.write_frames(&work, "demo-output/frames");
    Archive::smooth([12, 10, 8], 8).write_frames(&work, "more");
    Archive::smooth([9, 8, 7], 8).write_frames(&work, "signed");
    work.write("long.npy", Archive::smooth([12, 10, 8], 64).npy());
    work.write("other.raw", Archive::smooth([32, 32, 16], 40).bytes());
    for (name, input) in [
        ("run.nc", "netcdf/netcdf4.nc"),
        ("run.h5", "hdf5/openpmd.h5"),
        ("scan.nii.gz", "nifti/4d.nii.gz"),
        ("steps/step_1.vti", "vti/vector.vti"),
        ("steps/step_2.vti", "vti/vector.vti"),
    ] {
        work.write(name, fs::read(root().join("tests/golden/inputs").join(input)).unwrap());
    }
    work.write("tools/python/wspl.py", fs::read(root().join("tools/python/wspl.py")).unwrap());
    damaged(&work);
    stand_ins(&work);
    work
}

/// A file that has lost its end.
fn damaged(work: &Work) {
    work.wavesplat("convert frames -o whole.wspl").ok();
    let whole = work.read("whole.wspl");
    work.write("damaged.wspl", &whole[..whole.len() - 100]);
    fs::remove_file(work.path("whole.wspl")).unwrap();
}

/// Programs that the pages name and that are not wavesplat's.
fn stand_ins(work: &Work) {
    work.write("simulation.raw", Archive::smooth([64, 64, 64], 2).bytes());
    program(work, "simulation", "exec cat simulation.raw");
    program(work, "aws", "exec cat > /dev/null");
    program(work, "ssh", "shift; exec sh -c \"$*\"");
    if let Some(python) = python() {
        program(work, "python", &format!("exec '{python}' \"$@\""));
    }
    if Command::new("ffmpeg").arg("-version").output().is_err() {
        program(work, "ffmpeg", "exec cat > /dev/null");
    }
}

fn python() -> Option<String> {
    env::var("WAVESPLAT_PYTHON").ok()
}

/// Writes a program that is one line of `sh`.
fn program(work: &Work, name: &str, line: &str) {
    let path = format!("bin/{name}");
    work.write(&path, format!("#!/bin/sh\n{line}\n"));
    assert!(Command::new("chmod").arg("+x").arg(work.path(path)).status().unwrap().success());
}

fn is_run(command: &str) -> bool {
    NOT_RUN.iter().all(|(start, _)| !command.starts_with(start)) && (!command.contains(PYTHON) || python().is_some())
}

/// The server of the pages; its only file is a small archive.
const SERVER: &str = "https://data.example.org";

fn server() -> Server {
    let work = Work::new();
    work.write("long.npy", Archive::smooth([12, 10, 8], 64).npy());
    work.wavesplat("convert long.npy -o run.wspl").ok();
    Server::of(work.read("run.wspl"))
}

/// Runs a command with the programs on the path, and with another server.
fn run(work: &Work, server: &Server, command: &str) -> Run {
    let address = format!("http://127.0.0.1:{}", server.port());
    let command = command.replace(SERVER, &address);
    let programs = Path::new(CONVERT).parent().unwrap().to_path_buf();
    let others = env::var_os("PATH").unwrap();
    let path = env::join_paths([work.path("bin"), programs].into_iter().chain(env::split_paths(&others))).unwrap();
    let mut shell = work.command("sh");
    shell.env("PATH", path).env("NO_PROXY", "127.0.0.1").env("AWS_ENDPOINT_URL", address);
    Run::of(&command, shell.args(["-c", &command]).output().unwrap())
}

#[test]
fn every_command_runs() {
    let (pages, server) = (pages(), server());
    thread::scope(|scope| {
        for page in &pages {
            scope.spawn(|| run_page(page, &server));
        }
    });
}

fn run_page(page: &Page, server: &Server) {
    let work = prepared();
    for command in page.commands().into_iter().filter(|command| is_run(command)) {
        let run = run(&work, server, command).ok(); // in a pipeline, the last program
        assert!(!run.err.contains("error:"), "{}: {command}: {}", page.path.display(), run.err);
    }
}

#[test]
fn commands_that_are_left_out_are_on_the_pages() {
    let pages = pages();
    let commands = pages.iter().flat_map(Page::commands).collect::<Vec<_>>();
    for (start, _) in NOT_RUN {
        assert!(commands.iter().any(|command| command.starts_with(start)), "no page has a command '{start}...'");
    }
}

#[test]
fn readme_is_short_and_begins_with_the_demo_and_the_tests() {
    let readme = &pages()[0];
    let words = readme.text.split_whitespace().count();
    assert!(words <= MOST_WORDS, "README has {words} words, more than {MOST_WORDS}");
    let first = ["cargo run --release -p wavesplat-demo", "cargo test"];
    assert_eq!(readme.commands()[..2], first);
}

#[test]
fn every_link_leads_somewhere() {
    for page in pages() {
        for link in page.links().into_iter().filter(|link| !link.starts_with("https://")) {
            let (file, fragment) = link.split_once('#').unwrap_or((link, ""));
            let path = if file.is_empty() { page.path.clone() } else { page.path.parent().unwrap().join(file) };
            assert!(path.exists(), "{}: {link} leads nowhere", page.path.display());
            if !fragment.is_empty() {
                let target = Page { text: fs::read_to_string(&path).unwrap(), path };
                assert!(target.anchors().iter().any(|a| a == fragment), "{}: no heading {link}", page.path.display());
            }
        }
    }
}

#[test]
fn readme_links_every_page_of_the_guide() {
    let pages = pages();
    for page in &pages[1..] {
        let link = page.path.strip_prefix(root()).unwrap().to_str().unwrap();
        assert!(pages[0].links().contains(&link), "README does not link {link}");
    }
}
