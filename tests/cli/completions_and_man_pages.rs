//! Completions and man pages.

use super::Work;

#[test]
fn both_programs_complete_their_options_in_shells() {
    let work = Work::new();
    for shell in ["bash", "zsh", "fish"] {
        let own = work.wavesplat(&format!("generate completions {shell}")).ok();
        assert!(["convert", "tolerance", "skip-damaged"].iter().all(|word| own.text().contains(word)), "{shell}");
        let of_pictures = work.render(&format!("--generate completions-{shell}")).ok();
        assert!(["wavesplat-render", "orbit"].iter().all(|word| of_pictures.text().contains(word)), "{shell}");
    }
    work.wavesplat("generate completions sh").fails(2, &["bash", "zsh", "fish"]);
    work.render("--generate completions").fails(2, &["man", "completions-bash", "completions-zsh"]);
    work.render("a.wspl -o a.png --generate man").fails(2, &["--generate"]);
}

#[cfg(target_os = "linux")]
#[test]
fn shells_accept_the_completions() {
    let work = Work::new();
    let reply =
        "COMP_WORDS=(wavesplat convert --tol); COMP_CWORD=2; _wavesplat wavesplat --tol convert; echo ${COMPREPLY[@]}";
    let line = format!("$WAVESPLAT generate completions bash > c.bash && bash -c '. ./c.bash; {reply}'");
    assert_eq!(work.shell(&line).ok().text(), "--tolerance\n");
}

#[test]
fn there_is_a_man_page_for_each_command() {
    let work = Work::new();
    work.wavesplat("generate man -o .").ok();
    let commands =
        ["append", "convert", "extract", "generate", "info", "merge", "page", "recover", "scan", "verify", "view"];
    let pages: Vec<String> = commands.iter().map(|command| format!("wavesplat-{command}.1")).collect();
    assert_eq!(work.names(), [pages.as_slice(), &["wavesplat.1".into()]].concat());
    let page = String::from_utf8(work.read("wavesplat-convert.1")).unwrap();
    for words in [".TH wavesplat-convert 1", ".SH EXAMPLES\n.nf\nwavesplat convert frames/", "tolerance", "ESTIMATE"] {
        assert!(page.contains(words), "'{words}' in\n{page}");
    }
    work.wavesplat("generate man -o .").fails(2, &["exists already", "--force"]);
    work.wavesplat("generate man -o . --force").ok();
    work.wavesplat("generate man -o new/folder").ok();
    assert!(work.read("new/folder/wavesplat.1") == work.read("wavesplat.1"));
    let page = work.render("--generate man").ok();
    assert!(page.text().contains(".SH EXAMPLES") && page.text().contains("orbit"));
}
