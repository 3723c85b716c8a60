//! Paths that are no files: pipes, devices, sockets and folders. Opening them would wait for ever, or do something.

use super::Work;
use std::os::unix::net::UnixListener;

/// A folder with a file to read, and a pipe that nobody writes, a device, a socket and a folder under each name.
fn work(names: &[&str]) -> Work {
    let work = Work::with_file("");
    work.write(
        "list.nhdr",
        "NRRD0005\ntype: uchar\ndimension: 3\nsizes: 4 4 4\nencoding: raw\ndata file: LIST\np.raw\np.raw\np.raw\np.raw\n",
    );
    work.write("pattern.nhdr", "NRRD0005\ntype: uchar\ndimension: 3\nsizes: 4 4 4\nencoding: raw\ndata file: p.raw\n");
    let mhd = "ObjectType = Image\nNDims = 3\nDimSize = 4 4 4\nElementType = MET_UCHAR\nElementDataFile = p.raw\n";
    work.write("a.mhd", mhd);
    work.write("a.pvd", "<VTKFile type=\"Collection\"><Collection><DataSet file=\"p.vti\"/></Collection></VTKFile>");
    work.write("a.vti.series", r#"{"files": [{"name": "p.vti", "time": 0}]}"#);
    let piece = "<Piece Extent=\"0 3 0 3 0 3\" Source=\"p.vti\"/>";
    let grid = "WholeExtent=\"0 3 0 3 0 3\" GhostLevel=\"0\" Origin=\"0 0 0\" Spacing=\"1 1 1\"";
    let data = "<PPointData><PDataArray type=\"UInt8\" Name=\"a\"/></PPointData>";
    let pvti = format!("<VTKFile type=\"PImageData\"><PImageData {grid}>{data}{piece}</PImageData></VTKFile>");
    work.write("a.pvti", pvti);
    work.write("a.zarr/.zarray", r#"{"zarr_format": 2, "shape": [3, 4, 4, 4], "chunks": [1, 4, 4, 4], "dtype": "|u1", "compressor": null, "fill_value": 0, "order": "C", "filters": null}"#);
    work.shell("mkfifo a.zarr/1.0.0.0").ok();
    for name in names {
        work.shell(&format!(
            "mkfifo {name}; mkdir folder_{name}; ln -s /dev/zero device_{name}; ln -s {name} link_{name}"
        ))
        .ok();
    }
    work
}

const FORMATS: [&str; 14] = [
    "p.npy",
    "p.npz",
    "p.tif",
    "p.h5",
    "p.nc",
    "p.nii",
    "p.nrrd",
    "p.mha",
    "p.vti",
    "p.vtk",
    "p.pvd",
    "p.img.series",
    "p.wspl",
    "p.raw",
];

#[test]
fn frames_that_are_no_files_are_refused() {
    let work = work(&FORMATS);
    for name in FORMATS {
        let layout = if name == "p.raw" { "--dims 4x4x4 --dtype u8" } else { "" };
        for (start, kind) in [("", "a pipe"), ("link_", "a pipe"), ("device_", "a device")] {
            for line in ["convert NAME -o o.wspl", "info NAME", "verify a.wspl --against NAME"] {
                if name == "p.wspl" && line.starts_with("verify") {
                    continue; // refused by its name
                }
                let line = format!("{} {layout}", line.replace("NAME", &format!("{start}{name}")));
                let run = work.wavesplat(&line);
                assert!(
                    run.message().contains(&format!("{name}: is {kind}, not a regular file")),
                    "{line}: {}",
                    run.message()
                );
                assert!(matches!(run.code, Some(2 | 3)), "{line}: {:?}", run.code);
            }
        }
    }
    assert!(!work.names().iter().any(|name| name.starts_with("o.wspl")));
}

#[test]
fn files_that_others_name_must_be_files() {
    let work = work(&["p.raw", "p.vti"]);
    for (name, words) in [
        ("list.nhdr", "p.raw: is a pipe"),
        ("pattern.nhdr", "p.raw: is a pipe"),
        ("a.mhd", "p.raw: is a pipe"),
        ("a.pvd", "p.vti: is a pipe"),
        ("a.vti.series", "p.vti: is a pipe"),
        ("a.pvti", "p.vti: is a pipe"),
        ("a.zarr", "1.0.0.0: is a pipe"),
    ] {
        if name == "a.zarr" && !cfg!(feature = "zarr") {
            continue;
        }
        work.wavesplat(&format!("convert {name} -o o.wspl")).fails(3, &[words]);
    }
}

#[test]
fn settings_are_read_from_files_and_from_streams_of_the_shell() {
    let work = work(&["p", "p.csv", "p.json", "p.toml"]);
    for line in [
        "$WAVESPLAT convert a.npy -o o.wspl --times p",
        "$WAVESPLAT convert a.npy -o o.wspl --scan p",
        "$WAVESPLAT info a.wspl --config p.toml",
        "WAVESPLAT_CONFIG=p $WAVESPLAT info a.wspl",
        "$RENDER a.wspl -o o_%02d.png --colormap p.json",
        "$RENDER a.wspl -o o_%02d.png --mode composite --transfer-function p.csv",
        "$RENDER a.wspl -o o_%02d.png --key-frames p",
        "$WAVESPLAT recover p -o o.wspl",
        "$WAVESPLAT merge p p.csv -o o.wspl",
        "$WAVESPLAT append a.wspl p",
    ] {
        let run = work.shell(&format!("timeout 20 sh -c '{line}'"));
        assert!(run.message().contains("is a pipe, not a regular file"), "{line}: {}", run.message());
    }
    work.wavesplat("convert a.npy -o o.wspl --times folder_p").fails(3, &["is a folder"]);
    let _listening = UnixListener::bind(work.path("socket.npy")).unwrap();
    work.wavesplat("convert socket.npy -o o.wspl").fails(3, &["is a socket"]);
    let times: String = (0..40).map(|n| format!("{n}.5\n")).collect();
    work.write("times", &times);
    work.shell("cat times | $WAVESPLAT convert a.npy -o o.wspl --times /dev/stdin").ok();
    work.shell("exec 9<times; $WAVESPLAT convert a.npy -o o.wspl --force --times /dev/fd/9").ok();
}
