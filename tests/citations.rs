//! Every citation in the sources leads somewhere: to a work, to a file of the repository, or to an equation.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Folders that are read, and kinds of files in them.
const FOLDERS: [&str; 4] = ["src", "format", "tools", "tests"];
const KINDS: [&str; 3] = ["rs", "md", "py"];

/// A file's prose: the comments of a program, all of another file. Lines are joined by spaces.
struct Prose {
    /// Below the root of the repository.
    path: String,
    text: String,
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &str) -> String {
    fs::read_to_string(root().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// The paths of all files below a folder, without build outputs.
fn files(folder: &str) -> Vec<String> {
    let entries = fs::read_dir(root().join(folder)).unwrap().map(|e| e.unwrap());
    let kept = entries.filter(|e| e.file_name() != "target");
    let below = |e: fs::DirEntry| {
        let path = format!("{folder}/{}", e.file_name().to_string_lossy());
        if e.path().is_dir() { files(&path) } else { vec![path] }
    };
    kept.flat_map(below).collect()
}

fn every_file() -> Vec<String> {
    let mut all: Vec<String> = FOLDERS.into_iter().flat_map(files).collect();
    all.push("README.md".into());
    all
}

fn prose() -> Vec<Prose> {
    let kind = |path: &str| path.rsplit('.').next().unwrap_or_default().to_owned();
    let read = |path: String| {
        let text = read(&path);
        let text = if kind(&path) == "rs" { comments(&text) } else { text.replace('\n', " ") };
        Prose { path, text }
    };
    let kept = every_file().into_iter().filter(|path| KINDS.contains(&kind(path).as_str()));
    let all: Vec<Prose> = kept.map(read).collect();
    assert!(all.len() > 200, "the sources were found");
    all
}

fn comments(source: &str) -> String {
    let comment = |line: &str| {
        let at = line.find("// ").or_else(|| line.find("//!")).or_else(|| line.find("///"))?;
        Some(line[at..].trim_start_matches(['/', '!', ' ']).to_owned())
    };
    source.lines().filter_map(comment).collect::<Vec<_>>().join(" ")
}

/// The keys of the bibliography.
fn works() -> BTreeSet<String> {
    let text = read("src/core/bibliography.md");
    let key = |line: &str| Some(line.strip_prefix("- **\\[")?.split_once("\\]**")?.0.to_owned());
    text.lines().filter_map(key).collect()
}

/// The keys of links to the bibliography.
fn cited(text: &str) -> impl Iterator<Item = &str> {
    let links = text.match_indices("](").filter(|(at, _)| {
        let target = text[at + 2..].split(')').next().unwrap_or_default();
        target.ends_with("::bibliography")
    });
    links.map(|(at, _)| &text[text[..at].rfind('[').map_or(0, |open| open + 1)..at])
}

/// The numbers of a list such as `4`, `(4)`, `1-4`, `1, 2 and 3` at the beginning of a text.
fn numbers(text: &str) -> Vec<u32> {
    let text = text.trim_start_matches([' ', '(']);
    let digits = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    let Ok(number) = text[..digits].parse() else { return Vec::new() };
    let rest = text[digits..].trim_start_matches(')');
    let next = [" and ", ", ", "-", " to "].into_iter().find_map(|between| rest.strip_prefix(between));
    std::iter::once(number).chain(next.into_iter().flat_map(numbers)).collect()
}

/// The numbers that follow a word, or its plural.
fn numbered<'a>(text: &'a str, word: &'a str) -> impl Iterator<Item = u32> + 'a {
    let whole = |at: usize| !text[..at].ends_with(|c: char| c.is_alphanumeric() || c == '_');
    let found = text.match_indices(word).filter(move |(at, _)| whole(*at));
    found.flat_map(move |(at, _)| {
        let rest = &text[at + word.len()..];
        let rest = rest.strip_prefix('s').unwrap_or(rest);
        if rest.starts_with(' ') { numbers(rest) } else { Vec::new() }
    })
}

/// The numbers of the method's equations: each stands in brackets at the end of its line.
fn defined() -> Vec<u32> {
    let number = |line: &str| line.strip_suffix(')')?.rsplit_once(" (eq ")?.1.parse().ok();
    read("src/method.md").lines().filter_map(number).collect()
}

/// The names of files of prose.
fn pages(text: &str) -> impl Iterator<Item = &str> {
    let of_name = |c: char| c.is_alphanumeric() || "._-/".contains(c);
    text.split(move |c| !of_name(c)).map(|name| name.trim_end_matches('.')).filter(|name| name.ends_with(".md"))
}

#[test]
fn cited_works_and_the_bibliography_are_the_same() {
    let (works, mut used) = (works(), BTreeSet::new());
    for Prose { path, text } in prose() {
        for key in cited(&text).filter(|key| key.chars().all(char::is_alphanumeric)) {
            assert!(works.contains(key) || key == "bibliography", "{path}: [{key}] is not in the bibliography");
            used.insert(key.to_owned());
        }
    }
    let unused: Vec<_> = works.difference(&used).collect();
    assert!(unused.is_empty(), "no source cites {unused:?}");
}

#[test]
fn every_equation_that_is_cited_is_in_the_method() {
    let defined = defined();
    let mut sorted = defined.clone();
    sorted.sort_unstable();
    assert_eq!(sorted, (1..=defined.len() as u32).collect::<Vec<_>>(), "every number is given once");
    for Prose { path, text } in prose() {
        for equation in ["eq", "Eq"].into_iter().flat_map(|word| numbered(&text, word)) {
            assert!(defined.contains(&equation), "{path}: eq {equation} is not in src/method.md");
        }
    }
}

#[test]
fn every_page_that_is_named_is_there() {
    let files = every_file();
    let sections = read("src/method.md").split("\n## ").skip(1).flat_map(numbers).collect::<Vec<_>>();
    for Prose { path, text } in prose() {
        for page in pages(&text) {
            let page = format!("/{}", page.trim_start_matches("../"));
            assert!(files.iter().any(|f| format!("/{f}").ends_with(&page)), "{path}: {page} is not there");
        }
        for section in numbered(&text, "method.md section") {
            assert!(sections.contains(&section), "{path}: src/method.md has no section {section}");
        }
    }
}

#[test]
fn citations_are_found() {
    assert_eq!(cited("as [Max](crate::bibliography) and [x](y) say").collect::<Vec<_>>(), ["Max"]);
    assert_eq!(
        numbered("(eq 1-4), eqs 9 and 12; eq (5); assert_eq 7, eq x", "eq").collect::<Vec<_>>(),
        [1, 4, 9, 12, 5]
    );
    assert_eq!(pages("see ../a/B.md, and c.md.").collect::<Vec<_>>(), ["../a/B.md", "c.md"]);
    assert_eq!(comments("a(); // one\n    /// two\n//! three\nb();"), "one two three");
}
