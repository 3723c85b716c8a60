//! VTK's formats of XML: image data (`.vti`), rectilinear grids (`.vtr`), the lists of pieces of either, and ParaView's
//! lists of files (`.pvd`).

mod layout;
mod pvd;
mod read;
mod write;

use super::format::{Choices, Format, Reader};
use super::shared::relabelled::relabelled;
use super::writer::{Axes, OutputFiles, Writer};

/// Image data: points on a lattice.
pub(crate) static VTI: Format = Format {
    writers: &[Writer { name: "vti", place: 4, files: OutputFiles::EachFrame, ..IMAGE }],
    ..Format::new("VTK image data (.vti)", &["vti", "pvti"], READER)
};

/// As image data, but for where the points are.
pub(crate) static VTR: Format = Format {
    writers: &[Writer {
        name: "vtr",
        place: 10,
        label: Some("VTK"),
        files: OutputFiles::EachFrame,
        has_coordinates: true,
        before: |contents, samples, out| write::vtr::write_header(contents, samples, out),
        after: |_, _| write::END.to_vec(),
        ..Writer::PLAIN
    }],
    ..Format::new("VTK rectilinear grid (.vtr)", &["vtr", "pvtr"], READER)
};

/// A list of files and their times.
pub(crate) static PVD: Format = Format {
    writers: &[Writer {
        name: "pvd",
        place: 5,
        files: OutputFiles::List { extension: "vti", write: pvd::write },
        ..IMAGE
    }],
    ..Format::new("list of files", &["pvd"], Reader::List(pvd::read))
};

const READER: Reader = Reader::Frames(
    Ok(|path, options, _| {
        let header = read::describe(path, options.variable.as_deref())?;
        relabelled(path, header, options.axes.as_deref())
    }),
    Choices::Variables(read::offer),
);

const IMAGE: Writer = Writer {
    label: Some("VTK"),
    axes: Axes::LatticeIfNeeded,
    before: |contents, samples, out| {
        let as_source = Axes::LatticeIfNeeded.are_of_lattice(contents);
        let lattice = if as_source { contents.lattice() } else { contents.straight_lattice() };
        write::vti::write_header(contents, &lattice, samples, out)
    },
    after: |_, _| write::END.to_vec(),
    ..Writer::PLAIN
};
