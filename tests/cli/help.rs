//! The programs' help texts.

use super::{Run, Work};

#[test]
fn every_command_has_help_with_examples() {
    let work = Work::new();
    for command in ["", "convert", "append", "info", "verify", "extract", "recover"] {
        begins_with_examples(&work.wavesplat(&format!("{command} --help")).ok());
    }
    let run = work.render("--help").ok();
    begins_with_examples(&run);
    assert!(run.text().contains("--splat-error"));
}

/// Checks for at least two examples, after the description of the command and before its options.
fn begins_with_examples(run: &Run) {
    let (before, help) = run.text().split_once("Examples:\n").unwrap();
    assert!(before.contains("Usage:") && !before.contains("--help"), "{before}");
    let examples = help.lines().take_while(|line| line.starts_with("  ")).filter(|line| line.contains("wavesplat"));
    assert!(examples.count() >= 2 && help.contains("--help") && run.err.is_empty(), "{help}");
}

#[test]
fn long_help_has_headings() {
    let headings = ["Output:", "Error bound:", "Input:", "How it is coded", "Common options:"];
    let run = Work::new().wavesplat("convert --help").ok();
    let places =
        headings.map(|heading| run.text().find(&format!("\n{heading}")).unwrap_or_else(|| panic!("{heading}")));
    assert!(places.is_sorted(), "{}", run.text());
}

#[test]
fn short_help_has_the_options_that_most_people_need() {
    let work = Work::new();
    let (short, long) = (work.wavesplat("convert -h").ok(), work.wavesplat("convert --help").ok());
    let options = |run: &Run| run.text().lines().filter(|line| line.trim_start().starts_with('-')).count();
    for words in ["--output", "--tolerance", "--max-error", "--variable", "--dims", "--resume", "\nError bound:"] {
        assert!(short.text().contains(words), "'{words}' in\n{}", short.text());
    }
    assert!(options(&short) < 20 && options(&long) > 40, "{} and {}", options(&short), options(&long));
    assert!(short.text().ends_with("--help lists all options.\n"), "{}", short.text());
    assert!(!long.text().contains("lists all options"), "{}", long.text());
}

#[test]
fn an_estimate_is_not_reported_as_a_guarantee() {
    let run = Work::new().wavesplat("convert --help").ok();
    let text = run.text().split_whitespace().collect::<Vec<_>>().join(" ");
    for words in ["AN ESTIMATE, NOT A GUARANTEE", "--floor", "zeros must come back as zeros", "--samples", "--seed"] {
        assert!(text.contains(words), "'{words}' in\n{text}");
    }
}

#[test]
fn version_options_print_the_version() {
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
