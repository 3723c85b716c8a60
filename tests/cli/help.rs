//! What the programs say about themselves.

use super::Work;

#[test]
fn every_command_has_help_with_examples() {
    let work = Work::new();
    for command in ["", "convert", "info", "verify", "extract"] {
        let run = work.wavesplat(&format!("{command} --help")).ok();
        assert!(run.text().contains("Examples:") && run.text().contains("Usage:"), "{command}");
        assert!(run.err.is_empty());
    }
    let run = work.render("--help").ok();
    assert!(run.text().contains("Examples:") && run.text().contains("--splat-error"));
}

#[test]
fn an_estimate_is_not_sold_as_a_guarantee() {
    let run = Work::new().wavesplat("convert --help").ok();
    let text = run.text().split_whitespace().collect::<Vec<_>>().join(" ");
    for words in ["AN ESTIMATE, NOT A GUARANTEE", "--floor", "zeros must come back as zeros", "--samples", "--seed"] {
        assert!(text.contains(words), "'{words}' in\n{text}");
    }
}

#[test]
fn versions_are_told() {
    let work = Work::new();
    let version = env!("CARGO_PKG_VERSION");
    assert_eq!(work.wavesplat("--version").ok().text(), format!("wavesplat {version}\n"));
    assert_eq!(work.render("--version").ok().text(), format!("wavesplat-render {version}\n"));
}

#[test]
fn without_arguments_there_is_help_and_code_2() {
    let work = Work::new();
    work.wavesplat("").fails(2, &["Usage:", "convert"]);
    work.render("").fails(2, &["Usage:", "Examples:"]);
}
