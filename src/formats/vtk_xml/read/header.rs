//! The XML of a `.vti`, a `.vtr`, or a list of such pieces.

use super::extent::Extent;
use crate::shared::association::Association;
use crate::shared::words::array;
use crate::shared::xml::{attribute, required};
use crate::vtk_xml::layout::TIME;
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};
use wavesplat_core::source::Parsed;

/// One `<DataArray>`, as it is written.
#[derive(Debug)]
pub(super) struct VtiArray {
    pub(super) of: Association,
    pub(super) name: String,
    pub(super) ty: String,
    pub(super) format: String,
    pub(super) components: usize,
    /// Where it starts in the appended data.
    pub(super) offset: Option<u64>,
    /// Where its text starts in the XML, if it is inline.
    pub(super) text: u64,
}

/// One `<Piece>`: a box of the lattice.
#[derive(Debug)]
pub(super) struct VtiPiece {
    pub(super) extent: Extent,
    /// The file that it is in, if this file is a list of pieces.
    pub(super) source: Option<String>,
    pub(super) arrays: Vec<VtiArray>,
    /// Where its points are along x, y, z, if it is rectilinear.
    pub(super) coordinates: Vec<VtiArray>,
}

/// The file as written, with VTK's defaults for what is left out.
#[derive(Debug)]
pub(super) struct VtiHeader {
    /// Whether its points are at coordinates of their own, not on a lattice.
    pub(super) rectilinear: bool,
    /// Whether it lists pieces that are files of their own.
    pub(super) parallel: bool,
    pub(super) big_endian: bool,
    /// Whether counts before arrays have 64 bits.
    pub(super) wide: bool,
    /// Whether arrays are compressed, by zlib.
    pub(super) compressed: bool,
    /// First and last point along x, y, z.
    pub(super) whole: Extent,
    pub(super) spacing: [f64; 3],
    pub(super) origin: [f64; 3],
    pub(super) direction: [f64; 9],
    pub(super) pieces: Vec<VtiPiece>,
    /// The arrays of every piece of a list.
    declared: Vec<VtiArray>,
    /// Names of the active arrays, those of points first.
    pub(super) scalars: Vec<(Association, String)>,
    /// The time of the file.
    pub(super) time: Option<VtiArray>,
    /// Other arrays that belong to no point or cell, and how many tuples each has.
    pub(super) fields: Vec<(VtiArray, usize)>,
    /// Of the appended data.
    pub(super) encoding: Option<String>,
    inside: Inside,
}

/// Whether the next arrays are of points or cells.
#[derive(Debug, Clone, Copy)]
enum Inside {
    Nothing,
    FieldData,
    Coordinates,
    Samples(Association),
}

impl VtiHeader {
    fn new() -> Self {
        Self {
            rectilinear: false,
            parallel: false,
            big_endian: false,
            wide: false,
            compressed: false,
            whole: Extent::default(),
            spacing: [1.0; 3],
            origin: [0.0; 3],
            direction: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            pieces: Vec::new(),
            declared: Vec::new(),
            scalars: Vec::new(),
            time: None,
            fields: Vec::new(),
            encoding: None,
            inside: Inside::Nothing,
        }
    }

    /// The arrays that every piece has, from the first piece or from the list of pieces.
    pub(super) fn arrays(&self) -> &[VtiArray] {
        let first = self.pieces.iter().find(|piece| !piece.extent.is_empty()).or(self.pieces.first());
        match first {
            Some(piece) if !self.parallel => &piece.arrays,
            _ => &self.declared,
        }
    }

    /// The arrays by their names and numbers of components.
    pub(super) fn names(&self) -> Vec<(&str, usize)> {
        self.arrays().iter().map(|array| (array.name.as_str(), array.components)).collect()
    }

    /// Which of the arrays is the active one.
    pub(super) fn active(&self) -> Option<usize> {
        let place = |(of, name): &(Association, String)| {
            self.arrays().iter().position(|array| array.of == *of && array.name == *name)
        };
        self.scalars.iter().find_map(place)
    }

    fn element(&mut self, e: &BytesStart<'_>, text: u64) -> Parsed<()> {
        match e.name().as_ref() {
            "VTKFile" => self.file(e),
            "ImageData" | "PImageData" | "RectilinearGrid" | "PRectilinearGrid" => self.image(e),
            "Piece" => self.piece(e),
            "PointData" | "PPointData" => self.section(e, Association::Points),
            "CellData" | "PCellData" => self.section(e, Association::Cells),
            "FieldData" => {
                self.inside = Inside::FieldData;
                Ok(())
            }
            "Coordinates" | "PCoordinates" => {
                self.inside = Inside::Coordinates;
                Ok(())
            }
            "DataArray" | "PDataArray" => self.array(e, text),
            "AppendedData" => {
                self.encoding = Some(attribute(e, "encoding")?.unwrap_or_else(|| "base64".into()));
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn file(&mut self, e: &BytesStart<'_>) -> Parsed<()> {
        (self.parallel, self.rectilinear) = match required(e, "type")?.as_str() {
            "ImageData" => (false, false),
            "PImageData" => (true, false),
            "RectilinearGrid" => (false, true),
            "PRectilinearGrid" => (true, true),
            ty => return Err(format!("is a VTK file of type {ty}; ImageData and RectilinearGrid are supported")),
        };
        self.compressed = match attribute(e, "compressor")?.as_deref() {
            None | Some("") => false,
            Some("vtkZLibDataCompressor") => true,
            Some(other) => {
                let hint = "write it with vtkZLibDataCompressor or without a compressor";
                return Err(format!("is compressed by {other}, which is not supported; {hint}"));
            }
        };
        self.big_endian = match attribute(e, "byte_order")?.as_deref() {
            Some("BigEndian") => true,
            Some("LittleEndian") | None => false,
            Some(other) => return Err(format!("byte_order {other:?} is not known")),
        };
        self.wide = match attribute(e, "header_type")?.as_deref() {
            Some("UInt64") => true,
            Some("UInt32") | None => false,
            Some(other) => return Err(format!("header_type {other:?} is not known")),
        };
        Ok(())
    }

    fn image(&mut self, e: &BytesStart<'_>) -> Parsed<()> {
        self.whole = Extent(array(&required(e, "WholeExtent")?, "WholeExtent")?);
        if let Some(text) = attribute(e, "Spacing")? {
            self.spacing = array(&text, "Spacing")?;
        }
        if let Some(text) = attribute(e, "Origin")? {
            self.origin = array(&text, "Origin")?;
        }
        if let Some(text) = attribute(e, "Direction")? {
            self.direction = array(&text, "Direction")?;
        }
        Ok(())
    }

    fn piece(&mut self, e: &BytesStart<'_>) -> Parsed<()> {
        let extent = Extent(array(&required(e, "Extent")?, "Extent")?);
        let source = attribute(e, "Source")?;
        if self.parallel && source.is_none() {
            return Err("has a <Piece> without a Source".into());
        }
        self.pieces.push(VtiPiece { extent, source, arrays: Vec::new(), coordinates: Vec::new() });
        Ok(())
    }

    fn section(&mut self, e: &BytesStart<'_>, of: Association) -> Parsed<()> {
        self.inside = Inside::Samples(of);
        if let Some(name) = attribute(e, "Scalars")? {
            self.scalars.push((of, name));
        }
        Ok(())
    }

    fn array(&mut self, e: &BytesStart<'_>, text: u64) -> Parsed<()> {
        let name = attribute(e, "Name")?.unwrap_or_default();
        let of = match self.inside {
            Inside::Samples(of) if name != "vtkGhostType" => of, // VTK's own marks
            Inside::FieldData => Association::Points,
            Inside::Coordinates => Association::Points,
            _ => return Ok(()),
        };
        let number = |attribute: &str, text: String| format!("array {name}: {attribute} {text:?} is no number");
        let offset = attribute(e, "offset")?.map(|o| o.parse().map_err(|_| number("offset", o)));
        let components = attribute(e, "NumberOfComponents")?.unwrap_or_else(|| "1".into());
        let array = VtiArray {
            of,
            ty: required(e, "type")?,
            format: attribute(e, "format")?.unwrap_or_else(|| "ascii".into()),
            components: components.parse().map_err(|_| number("NumberOfComponents", components))?,
            offset: offset.transpose()?,
            text,
            name,
        };
        match (self.inside, self.pieces.last_mut()) {
            (Inside::FieldData, _) if array.name == TIME => self.time = Some(array),
            (Inside::FieldData, _) => {
                let tuples = attribute(e, "NumberOfTuples")?.and_then(|tuples| tuples.parse().ok());
                self.fields.extend(tuples.map(|tuples| (array, tuples)));
            }
            (Inside::Coordinates, Some(piece)) if !self.parallel => piece.coordinates.push(array),
            (Inside::Coordinates, _) => {} // the files of its pieces say where
            (_, Some(piece)) if !self.parallel => piece.arrays.push(array),
            _ => self.declared.push(array),
        }
        Ok(())
    }

    fn end(&mut self, name: &str) {
        if matches!(
            name,
            "PointData" | "CellData" | "PPointData" | "PCellData" | "FieldData" | "Coordinates" | "PCoordinates"
        ) {
            self.inside = Inside::Nothing;
        }
    }
}

/// Reads XML that may end after the `<AppendedData>` tag.
pub(super) fn parse(text: &str) -> Parsed<VtiHeader> {
    let mut reader = Reader::from_str(text);
    let mut header = VtiHeader::new();
    loop {
        let event = reader.read_event();
        match event.map_err(|e| format!("is not well-formed XML at byte {}: {e}", reader.error_position()))? {
            Event::Start(e) => header.element(&e, reader.buffer_position())?,
            Event::Empty(e) => {
                header.element(&e, reader.buffer_position())?;
                header.end(e.name().as_ref());
            }
            Event::End(e) => header.end(e.name().as_ref()),
            Event::Eof => break,
            _ => {}
        }
    }
    if header.pieces.is_empty() {
        return Err("is no VTK image: it has no <Piece>".into());
    }
    header.scalars.sort_by_key(|(of, _)| *of == Association::Cells);
    Ok(header)
}
