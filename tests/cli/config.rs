//! Options from a file.

use super::{CONVERT, RENDER, Work, small};

fn work(config: &str) -> Work {
    let work = Work::new();
    work.write("a.npy", small().npy());
    work.write("run.toml", config);
    work
}

const CONFIG: &str = "\
tolerance = 1e-3
frames = \"0:10\"     # of convert and append
basis = \"haar\"
force = false
quiet = true

[convert]
output = \"a.wspl\"
window = 8
bound = 'rms'
region = \"2:18,:,1:9\"

[extract]
force = true
";

#[test]
fn a_config_file_equals_the_command_line() {
    let work = work(CONFIG);
    let run = work.wavesplat("convert a.npy --config run.toml").ok();
    assert!(run.err.is_empty(), "{}", run.err);
    let said = "--tolerance 1e-3 --frames 0:10 --basis haar --window 8 --bound rms --region 2:18,:,1:9";
    work.wavesplat(&format!("convert a.npy -o b.wspl {said}")).ok();
    assert!(work.read("a.wspl") == work.read("b.wspl"));
    work.write("b.npy", "mine");
    work.wavesplat("extract a.wspl -o b.npy --config run.toml --frames :").ok();
    assert!(work.read("b.npy") != b"mine");
}

#[test]
fn the_command_line_overrides_the_config_file() {
    let work = work(CONFIG);
    let run = work.wavesplat("convert a.npy --config run.toml -o c.wspl --window 4 --basis multi -v --tolerance=0.01");
    run.fails(2, &["--window", "not 4", "multi", "options from run.toml:", "frames"]);
    work.wavesplat("convert a.npy --config run.toml -o c.wspl --window 4 --tolerance=0.01 -v").ok();
    work.wavesplat("convert a.npy -o d.wspl --window 4 --frames 0:10 --basis haar --bound rms --region 2:18,:,1:9")
        .ok();
    assert!(work.read("c.wspl") == work.read("d.wspl"));
    work.write("views.toml", "view = [\"0,0\", \"90,0\"]\nsize = '20x20'\nframes = 0\n");
    assert_eq!(work.render("c.wspl --config views.toml -o %v.png").ok().code, Some(0));
    assert!(work.names().contains(&"1.png".into()));
    work.render("c.wspl --config views.toml -o one.png --view 45,0").ok();
    work.render("c.wspl --frames 0 --size 20x20 --view 45,0 -o said.png").ok();
    assert!(work.read("one.png") == work.read("said.png"), "views of the file are not added to those that were given");
}

#[test]
fn an_environment_variable_of_each_program_names_a_config_file() {
    let work = work("tolerance = 0\n");
    work.write("pictures.toml", "size = \"20x10\"\n");
    work.shell("WAVESPLAT_CONFIG=run.toml $WAVESPLAT convert a.npy -o a.wspl").ok();
    work.wavesplat("convert a.npy -o b.wspl --tolerance 0").ok();
    assert!(work.read("a.wspl") == work.read("b.wspl"));
    work.shell(
        "WAVESPLAT_CONFIG=run.toml WAVESPLAT_RENDER_CONFIG=pictures.toml $RENDER a.wspl --frames 0 -o a.npy --force",
    )
    .ok();
    let header = String::from_utf8_lossy(&work.read("a.npy")[..128]).into_owned();
    assert!(header.contains("(1, 10, 20"), "{header}");
    work.shell("WAVESPLAT_CONFIG=missing.toml $WAVESPLAT info a.wspl --config run.toml").ok();
    work.shell("WAVESPLAT_CONFIG=missing.toml $WAVESPLAT info a.wspl").fails(1, &["missing.toml"]);
    work.shell("WAVESPLAT_CONFIG= $WAVESPLAT info a.wspl").ok();
    work.shell("WAVESPLAT_CONFIG=missing.toml $WAVESPLAT generate completions bash").ok();
}

#[test]
fn errors_in_a_config_file_name_line_and_key() {
    let work = work("");
    let cases: [(&str, &[&str]); 12] = [
        ("\ntolerence = 0.1", &["line 2", "tolerence: no option of wavesplat"]),
        ("missing_value = 7", &["line 1", "missing_value", "write missing-value"]),
        ("[convert]\n\nview = '0,0'", &["line 3", "view: no option of convert"]),
        ("[render]\ntau = 1", &["line 1", "[render]", "is not a command"]),
        ("tolerance = 0.1\nforce = 'yes'", &["line 2", "force: takes true or false"]),
        ("tolerance = true", &["line 1", "tolerance: takes a string or a number"]),
        ("frames = [1, 2]", &["line 1", "frames: takes one value"]),
        ("inputs = 'a.npy'", &["line 1", "inputs", "on the command line"]),
        ("config = 'b.toml'", &["line 1", "config"]),
        ("a = 1\nb = = 2", &["line 2"]),
        ("\n\ntolerance = 'few'", &["--tolerance", "0.02 or 2%", "tolerance is from run.toml, line 3"]),
        ("level = 20", &["--level", "level is from run.toml, line 1"]),
    ];
    for (config, words) in cases {
        work.write("run.toml", config);
        let run = work.wavesplat("convert a.npy -o a.wspl --config run.toml");
        run.fails(2, &[&["run.toml"], words].concat());
    }
    work.wavesplat("convert a.npy -o a.wspl --config nowhere.toml").fails(1, &["nowhere.toml", "reading"]);
    work.write("run.toml", [0xff, 0xfe]);
    work.wavesplat("convert a.npy -o a.wspl --config run.toml").fails(1, &["run.toml", "UTF-8"]);
    assert_eq!(work.names(), ["a.npy", "run.toml"]);
    for program in [CONVERT, RENDER] {
        assert_eq!(work.run(program, "--help --config run.toml", b"").code, Some(0));
    }
}

#[test]
fn info_gives_the_options_that_reproduce_a_file() {
    let work = work("");
    for options in [
        "",
        "--basis learned --space none --window 8 --level 7 --range -2,3",
        "--basis haar --bound relative --floor 0.1 --missing mask --frames 2:30:3 --region 2:18,:,1:9",
        "--bound sampled --samples 20 --seed 7 --missing-value -9999 --block 8",
        "--transfer-function turbo --missing-value 7 --tolerance 0.05",
    ] {
        work.wavesplat(&format!("convert a.npy -o a.wspl --force {options}")).ok();
        let info = work.wavesplat("info a.wspl --json").ok().json();
        let made = info["options"].as_object().unwrap();
        let again: String = made.iter().map(|(name, value)| format!(" --{name}={}", value.as_str().unwrap())).collect();
        work.wavesplat(&format!("convert a.npy -o b.wspl --force {again}")).ok();
        assert!(work.read("a.wspl") == work.read("b.wspl"), "{options}:{again}");
        assert!(work.wavesplat("info a.wspl").ok().text().contains(&format!("made by    convert{again}")), "{again}");
    }
}

#[test]
fn one_file_serves_every_command_of_both_programs() {
    let work = work("");
    let help = work.wavesplat("--help").ok().text().to_string();
    let listed = help.lines().skip_while(|line| !line.starts_with("Commands:")).skip(1).take_while(|l| !l.is_empty());
    let first_lines = listed.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let named = first_lines.filter_map(|line| line.split_whitespace().next());
    let commands: Vec<&str> = named.filter(|command| *command != "help").collect();
    assert!(commands.contains(&"convert") && commands.contains(&"merge"), "{commands:?}");
    let tables: String = commands.iter().map(|command| format!("[{command}]\n")).collect();
    work.write("run.toml", format!("tolerance = 0.1\n{tables}\n[wavesplat-render]\nsize = '20x10'\n"));
    work.wavesplat("convert a.npy -o a.wspl --config run.toml").ok();
    work.render("a.wspl --frames 0 -o own.npy --config run.toml").ok();
    work.render("a.wspl --frames 0 -o said.npy --size 20x10 --tolerance 0.1").ok();
    assert!(work.read("own.npy") == work.read("said.npy"));
    work.write("wrong.toml", "[wavesplat-render]\nsizes = 1\n");
    work.render("a.wspl --config wrong.toml -o x.npy").fails(2, &["line 2", "sizes: no option of wavesplat-render"]);
}
