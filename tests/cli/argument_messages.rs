//! Messages about missing, misspelt and misplaced arguments say what to do next.

use super::{CONVERT, RENDER, Work, small};

/// The long options that a command's help lists.
fn options(work: &Work, program: &str, command: &str) -> Vec<String> {
    let help = work.run(program, &format!("{command} --help"), b"").ok();
    let indent = |line: &str| line.len() - line.trim_start().len();
    let lines = help.text().lines().filter(|line| line.trim_start().starts_with('-'));
    let long = lines
        .filter(|line| (1..=6).contains(&indent(line)))
        .filter_map(|line| line.split_whitespace().find(|word| word.starts_with("--")));
    let name = |word: &str| word.split(['[', '=']).next().unwrap_or(word).to_string();
    long.map(name).collect()
}

#[test]
fn options_of_another_command_are_named_as_such() {
    let work = Work::new();
    let (convert, render) = (options(&work, CONVERT, "convert"), options(&work, RENDER, ""));
    assert!(convert.len() > 20 && render.len() > 30, "{convert:?} {render:?}");
    let mut tried = 0;
    let others = ["append", "verify", "extract"].map(|command| options(&work, CONVERT, command)).concat();
    let others = [others, vec!["--version".into(), "--generate".into()]].concat();
    for option in render.iter().filter(|option| !convert.contains(option) && !others.contains(option)) {
        let words = [option.as_str(), "is an option of wavesplat-render"];
        work.wavesplat(&format!("convert a.npy -o a.wspl {option}")).fails(2, &words);
        tried += 1;
    }
    for option in convert.iter().filter(|option| !render.contains(option)) {
        let words = [option.as_str(), "is an option of wavesplat convert"];
        work.render(&format!("a.wspl -o a.png {option}")).fails(2, &words);
        tried += 1;
    }
    assert!(tried > 30, "{tried}");
    work.wavesplat("convert a.npy -o a.wspl --against b").fails(2, &["--against is an option of wavesplat verify"]);
    work.wavesplat("convert a.npy -o a.wspl --tolerence 1").fails(2, &["similar", "--tolerance"]);
}

#[test]
fn an_unknown_command_is_answered_with_a_similar_one_or_the_right_command() {
    let work = Work::with_file("");
    work.wavesplat("conver a.npy").fails(2, &["conver", "similar", "'convert'"]);
    work.wavesplat("a.wspl").fails(2, &["wavesplat info a.wspl", "wavesplat-render a.wspl"]);
    work.wavesplat("a.npy").fails(2, &["wavesplat convert a.npy -o run.wspl"]);
    work.wavesplat("render a.wspl").fails(2, &["wavesplat-render makes pictures"]);
}

#[test]
fn messages_about_missing_or_wrong_arguments_give_the_right_form() {
    let work = Work::with_file("");
    work.wavesplat("convert a.npy").fails(2, &["--output <FILE>", "wavesplat convert frames/ -o run.wspl"]);
    work.wavesplat("extract a.wspl").fails(2, &["--output <OUT>", "wavesplat extract run.wspl -o run.npy"]);
    work.render("a.wspl").fails(2, &["--output <OUT>", "wavesplat-render run.wspl -o frame_%04d.png"]);
    work.render("a.npy -o a.png").fails(2, &["a.npy", "convert frames first", "--method direct"]);
    work.render(". -o a.png").fails(2, &["convert frames first", "--method direct"]);
    for (option, words) in [
        ("--tolerance 1per", ["--tolerance", "0.02 or 2%"]),
        ("--threads 0", ["--threads", "at least 1"]),
        ("--memory 5", ["5 bytes", "like 512MiB"]),
        ("--memory 5MiB --window 64", ["MiB; give that", "--window or --block"]),
    ] {
        work.wavesplat(&format!("convert a.npy -o b.wspl {option}")).fails(2, &words);
    }
    assert_eq!(work.names(), ["a.npy", "a.wspl"]);
}

#[test]
fn appending_without_later_frames_is_no_error() {
    let work = Work::with_file("");
    let before = work.read("a.wspl");
    let run = work.wavesplat("append a.wspl a.npy --frames 40:").ok();
    assert!(run.err.contains("no frames after 40 yet"), "{}", run.err);
    assert!(work.read("a.wspl") == before && work.names() == ["a.npy", "a.wspl"]);
    work.wavesplat("append a.wspl a.npy --frames 41:").fails(2, &["--frames", "0 to 39"]);
    work.wavesplat("append a.wspl a.npy --frames 40:50").fails(2, &["--frames", "0 to 39"]);
    assert_eq!(small().frames, 40);
}
