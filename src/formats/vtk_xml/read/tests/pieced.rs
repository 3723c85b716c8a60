//! Tests of images in pieces.

use super::*;

/// The samples of a box of frame 0.
fn part(ty: SampleType, from: [usize; 3], to: [usize; 3]) -> Vec<u8> {
    let all = payload(ty, 0..1, false);
    let voxels = wavesplat_core::base::grid::Region { start: from, end: to };
    voxels.iter().flat_map(|[x, y, z]| all[((z * 5 + y) * 7 + x) * ty.size()..][..ty.size()].to_vec()).collect()
}

fn piece(extent: &str, samples: &[u8]) -> String {
    let text = text(samples, TAGS[0].1, false);
    format!("<Piece Extent=\"{extent}\">{}</Piece>", points(&array("Float32", "format=\"binary\"", &text)))
}

#[test]
fn pieces_make_up_a_frame() {
    let folder = Folder::new();
    let ty = SampleType::F32;
    let boxes = [
        ("2 5 0 4 0 2", [0, 0, 0], [4, 5, 3]),
        ("5 8 0 2 0 2", [3, 0, 0], [7, 3, 3]),
        ("5 8 2 4 0 2", [3, 2, 0], [7, 5, 3]),
    ];
    let pieces = boxes.map(|(extent, from, to)| piece(extent, &part(ty, from, to)));
    let image = |ty: &str, image: &str, inside: &str| {
        let more = "WholeExtent=\"2 8 0 4 0 2\" Origin=\"1 2 3\" Spacing=\"0.5 1 2\"";
        format!("<VTKFile type=\"{ty}\" {}><{image} {more}>{inside}</{image}></VTKFile>", TAGS[0].0)
    };
    let empty = "<Piece Extent=\"0 -1 0 -1 0 -1\"></Piece>";
    let whole = folder.write("a.vti", image("ImageData", "ImageData", &(empty.to_string() + &pieces.concat())));
    check_inputs(std::slice::from_ref(&whole), &OpenOptions::default(), ty, 1);
    check_inputs(&[whole], &OpenOptions { memory: 0, ..OpenOptions::default() }, ty, 1);
    refused(
        &[folder.write("b.vti", image("ImageData", "ImageData", &pieces[..2].concat()))],
        &OpenOptions::default(),
        "leave some",
    );
    let other = pieces[2].replace("\"J\"", "\"K\"");
    let mixed = [pieces[0].as_str(), &pieces[1], &other].concat();
    refused(
        &[folder.write("b.vti", image("ImageData", "ImageData", &mixed))],
        &OpenOptions::default(),
        "without the array J",
    );

    let mut list = "<PPointData Scalars=\"J\"><PDataArray type=\"Float32\" Name=\"J\"/></PPointData>".to_string();
    for (i, piece) in pieces.iter().enumerate() {
        let (extent, ..) = boxes[i];
        folder.write(
            &format!("p{i}.vti"),
            image("ImageData", "ImageData", piece)
                .replace("WholeExtent=\"2 8 0 4 0 2\"", &format!("WholeExtent=\"{extent}\"")),
        );
        list += &format!("<Piece Extent=\"{extent}\" Source=\"p{i}.vti\"/>");
    }
    let list = image("PImageData", "PImageData", &list);
    let file = folder.write("a.pvti", &list);
    for input in [&file, &folder.path("")] {
        check_inputs(std::slice::from_ref(input), &OpenOptions::default(), ty, 1);
    }
    let grid = open(&[file], &OpenOptions::default()).expect("opening").archive().grid;
    assert_eq!((grid.spacing, grid.origin), ([0.5, 1.0, 2.0], [2.0, 2.0, 3.0]));
    for (from, to, words) in [
        ("p1.vti", "a.pvti", "a list of pieces among"),
        ("p1.vti", "gone.vti", "gone.vti: opening"),
        ("p1.vti", "p0.vti", "overlap"),
        ("Float32", "Float64", "without the array J of 1 Float64"),
        ("Extent=\"5 8 0 2 0 2\"", "Extent=\"5 4 0 2 0 2\"", "leave some"),
    ] {
        refused(&[folder.write("a.pvti", list.replace(from, to))], &OpenOptions::default(), words);
    }
}

#[test]
fn more_pieces_than_can_be_compared_are_refused() {
    let folder = Folder::new();
    let image = |ty: &str, inside: &str| {
        let image = format!("<{ty} WholeExtent=\"0 1 0 1 0 1\">{inside}</{ty}>");
        format!("<VTKFile type=\"{ty}\" {}>{image}</VTKFile>", TAGS[0].0)
    };
    let piece =
        "<Piece Extent=\"0 1 0 1 0 1\">".to_string() + &points(&array("UInt8", "format=\"ascii\"", "1")) + "</Piece>";
    folder.write("many.vti", image("ImageData", &piece.repeat(9_000)));
    let source = "<Piece Extent=\"0 1 0 1 0 1\" Source=\"many.vti\"/>";
    let declared = "<PPointData><PDataArray type=\"UInt8\" Name=\"J\"/></PPointData>";
    for (files, pieces) in [(2, 18_000), (20_000, 20_000)] {
        let list = image("PImageData", &(declared.to_string() + &source.repeat(files)));
        let words = format!("has {pieces} pieces or more; up to 16384");
        refused(&[folder.write("a.pvti", list)], &OpenOptions::default(), &words);
    }
}
