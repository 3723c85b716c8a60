//! Invalid requests: exit code 2, a message that names the option, and no output.

use super::{Work, small};

#[test]
fn bad_values_of_convert_are_named() {
    let work = Work::new();
    work.write("a.npy", small().npy());
    let cases: [(&str, &[&str]); 45] = [
        ("--tolerance -1", &["--tolerance", "0 to 1"]),
        ("--tolerance nan", &["--tolerance", "0 to 1"]),
        ("--tolerance much", &["--tolerance"]),
        ("--max-error -1", &["--max-error", "0 or more", "unit"]),
        ("--max-error nan", &["--max-error", "finite"]),
        ("--max-error inf", &["--max-error", "finite"]),
        ("--max-error much", &["--max-error", "number", "NAME=NUMBER"]),
        ("--max-error temp=0.1,salt=", &["--max-error", "NAME=NUMBER"]),
        ("--max-error temp=0.1,temp=0.2", &["--max-error", "temp twice"]),
        ("--max-error 0.1 --tolerance 0.01", &["--tolerance", "--max-error", "give one"]),
        ("--max-error 0.1 --range 0,1", &["--range", "--max-error", "give one"]),
        ("--max-error 0.1 --bound relative", &["--max-error", "--bound pointwise or rms"]),
        ("--max-error 0.1 --bound sampled", &["--max-error", "--bound pointwise or rms"]),
        ("--max-error 0.1 --transfer-function turbo", &["--max-error", "--transfer-function"]),
        ("--basis haar --window 30", &["--window", "not 30", "haar", "32"]),
        ("--window 0", &["--window", "not 0"]),
        ("--basis multi --window 32", &["--window", "not 32", "multi", "33"]),
        ("--basis fourier", &["--basis", "haar", "multi"]),
        ("--range 2,1", &["--range", "lower"]),
        ("--range 1", &["--range", "2 numbers"]),
        ("--bound exact", &["--bound", "pointwise", "rms", "relative", "sampled"]),
        ("--floor 1", &["--floor", "--bound relative"]),
        ("--floor 1 --bound sampled", &["--floor", "--bound relative"]),
        ("--bound relative --floor -1", &["--floor", "0 or more"]),
        ("--bound relative --floor nan", &["--floor", "0 or more"]),
        ("--bound relative --floor inf", &["--floor", "0 or more"]),
        ("--bound relative --range 0,1", &["--range", "--bound relative", "each sample"]),
        ("--bound sampled --range 0,1", &["--range", "--bound sampled", "pixels"]),
        ("--bound rms --samples 5", &["--samples", "--bound sampled"]),
        ("--seed 5", &["--seed", "--bound sampled"]),
        ("--bound sampled --samples 0", &["--samples", "1"]),
        ("--bound sampled --seed -1", &["--seed"]),
        ("--region 0:21,:,:", &["--region", "20x14x10"]),
        ("--region 4:4,:,:", &["--region", "20x14x10"]),
        ("--region 0:4", &["--region", "x0:x1"]),
        ("--frames 40:50", &["--frames", "0 to 39"]),
        ("--frames 5:2", &["--frames"]),
        ("--frames x", &["--frames", "a:b"]),
        ("--memory 1KiB", &["--memory", "MiB"]),
        ("--memory much", &["--memory", "512MiB"]),
        ("--block 0", &["--block"]),
        ("--level 99", &["--level", "19"]),
        ("--threads 0", &["--threads"]),
        ("--dims 3x3x3", &["a.npy", "--dims"]),
        ("--spacing 0,1,1", &["--spacing", "positive"]),
    ];
    for (options, words) in cases {
        work.wavesplat(&format!("convert a.npy -o a.wspl {options}")).fails(2, words);
        assert_eq!(work.names(), ["a.npy"], "{options}");
    }
}

#[test]
fn bad_values_of_render_are_named() {
    let work = Work::with_file("");
    let cases: [(&str, &[&str]); 24] = [
        ("--view x", &["--view", "two angles"]),
        ("--size 0x5", &["--size", "1 to"]),
        ("--size 5", &["--size", "512x512"]),
        ("--size 90000x90000", &["pixels"]),
        ("--memory 1KiB", &["--memory", "MiB"]),
        ("--colormap jet", &["--colormap jet", "viridis", "turbo", "rainbow"]),
        ("--colormap maps.xml", &["--colormap maps.xml", ".json", ".csv"]),
        ("--range 2,1", &["--range", "lower"]),
        ("--range 1,1", &["--range", "shows nothing", "not 1,1"]),
        ("--norm sqrt", &["--norm", "linear", "log"]),
        ("--norm log --range=-1,1 --colormap grey", &["--norm", "above 0", "-1,1", "--range", "--norm linear"]),
        ("--annotate", &["--annotate", "npy", "--colormap"]),
        ("--annotate --format gray16", &["--annotate", "gray16", "no colours"]),
        ("--frames 99", &["--frames", "0 to 39"]),
        ("--region 0:21,:,:", &["--region", "20x14x10"]),
        ("--tau -1", &["--tau", "0 or more"]),
        ("--sigma 0", &["--sigma", "above 0"]),
        ("--scale 0", &["--scale", "above 0"]),
        ("--roll nan", &["--roll", "finite"]),
        ("--splat-error -1", &["--splat-error", "0 or more"]),
        ("--background red", &["--background", "ffffff"]),
        ("--format bmp", &["--format", "png npy y4m rgb24 gray16"]),
        ("--fps 0", &["--fps"]),
        ("--center 1,2", &["--center", "3 numbers"]),
    ];
    for (options, words) in cases {
        work.render(&format!("a.wspl -o out.npy {options}")).fails(2, words);
        assert_eq!(work.names(), ["a.npy", "a.wspl"], "{options}");
    }
}

#[test]
fn an_extension_without_a_format_is_refused_with_the_known_ones() {
    let work = Work::with_file("");
    work.render("a.wspl -o out.xyz").fails(2, &["out.xyz", ".xyz", ".png", ".apng", "npy y4m rgb24 gray16 exr"]);
    work.wavesplat("extract a.wspl -o out.xyz").fails(2, &["out.xyz", ".npy", ".raw"]);
    work.write("in.xyz", [7; 300]);
    let remedy = "for headerless data type --dims NXxNYxNZ --dtype TYPE. Known formats: .npy, .npz, .nrrd";
    work.wavesplat("convert in.xyz -o b.wspl").fails(2, &["in.xyz", remedy, ".vti"]);
    work.piped("convert - -o b.wspl", &[7; 300]).fails(2, &["-:", "--dims"]);
    work.wavesplat("convert a.wspl a.npy -o b.wspl").fails(2, &["a.wspl", "coefficient file already"]);
    assert_eq!(work.names(), ["a.npy", "a.wspl", "in.xyz"]);
}

#[test]
fn other_videos_are_refused_with_the_pipe_that_makes_them() {
    let work = Work::with_file("");
    for ending in ["mov", "avi", "mkv", "MKV"] {
        let pipe = format!("wavesplat-render a.wspl -o - --format y4m | ffmpeg -i - run.{ending}");
        work.render(&format!("a.wspl -o run.{ending}")).fails(2, &[".mp4", &pipe]);
    }
    work.render("a.wspl --size 20x20 -o run.mkv --format y4m").ok();
}

#[test]
fn an_existing_file_is_replaced_only_when_forced() {
    let work = Work::with_file("");
    let before = work.read("a.wspl");
    work.wavesplat("convert a.npy -o a.wspl --tolerance 0.1").fails(2, &["a.wspl", "exists", "--force"]);
    assert!(work.read("a.wspl") == before);
    work.wavesplat("convert a.npy -o a.wspl --tolerance 0.1 --force").ok();
    assert!(work.read("a.wspl") != before);
    work.write("b.npy", "mine");
    work.write("f_03.png", "mine");
    work.wavesplat("extract a.wspl -o b.npy").fails(2, &["b.npy", "--force"]);
    work.render("a.wspl -o b.npy").fails(2, &["b.npy", "--force"]);
    work.render("a.wspl --size 20x20 --frames 3 -o f_%02d.png").fails(2, &["f_03.png", "--force"]);
    assert!(work.read("b.npy") == b"mine" && work.read("f_03.png") == b"mine");
    work.render("a.wspl --size 20x20 --frames 3 -o f_%02d.png --force").ok();
    let first = work.read("f_03.png");
    work.render("a.wspl --size 20x20 --frames 3 --view top -o f_%02d.png").ok();
    assert!(work.read("f_03.png") != first, "a picture of our own is replaced");
    work.render("a.wspl --size 20x20 -o all.apng").ok();
    work.render("a.wspl --size 20x20 --view 0,0 -o all.apng").ok();
    work.wavesplat("extract a.wspl -o b.npy --force").ok();
    assert!(work.read("b.npy").len() > 1000 && work.read("f_03.png").len() > 100);
    work.wavesplat("convert a.npy -o . --force").fails(2, &["folder"]);
    assert_eq!(work.names(), ["a.npy", "a.wspl", "all.apng", "b.npy", "f_03.png"]);
}

#[test]
fn inputs_that_contradict_each_other_are_refused() {
    let work = Work::with_file("");
    work.wavesplat("convert a.npy ./a.npy -o b.wspl").fails(2, &["a.npy", "twice"]);
    work.wavesplat("convert a.npy - -o b.wspl").fails(2, &["-", "only input"]);
    work.wavesplat("convert no*.npy -o b.wspl").fails(2, &["no*.npy", "no file"]);
    work.render("a.npy a.wspl -o b.npy").fails(2, &["--method direct"]);
    work.render("- --method direct -o b.npy --dims 2x2x2 --dtype u8").fails(2, &["standard input"]);
    assert_eq!(work.names(), ["a.npy", "a.wspl"]);
}
