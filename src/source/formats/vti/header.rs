//! What the XML of a `.vti` says.

use crate::source::Parsed;
use crate::source::formats::xml::{attribute, numbers, required};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

/// What an array has one sample for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Association {
    /// Each point of the lattice.
    Points,
    /// Each cell between points.
    Cells,
}

/// One `<DataArray>`, as it is written.
#[derive(Debug)]
pub(super) struct Array {
    pub(super) of: Association,
    pub(super) name: String,
    pub(super) ty: String,
    pub(super) format: String,
    pub(super) components: String,
    /// Where it starts in the appended data.
    pub(super) offset: Option<u64>,
    /// Where its text starts in the file, if it is inline.
    pub(super) text: u64,
}

/// The file, as it is written; what it leaves out has the value that VTK gives it.
#[derive(Debug)]
pub(super) struct Header {
    pub(super) big_endian: bool,
    /// Whether counts before arrays have 64 bits.
    pub(super) wide: bool,
    whole: [i64; 6],
    /// First and last point along x, y, z.
    pub(super) extent: [i64; 6],
    pub(super) spacing: [f64; 3],
    pub(super) origin: [f64; 3],
    pub(super) direction: [f64; 9],
    pub(super) arrays: Vec<Array>,
    /// Names of the active arrays, those of points first.
    pub(super) scalars: Vec<(Association, String)>,
    /// Of the appended data.
    pub(super) encoding: Option<String>,
    pieces: usize,
    inside: Option<Association>,
}

impl Header {
    fn new() -> Self {
        Self {
            big_endian: false,
            wide: false,
            whole: [0; 6],
            extent: [0; 6],
            spacing: [1.0; 3],
            origin: [0.0; 3],
            direction: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            arrays: Vec::new(),
            scalars: Vec::new(),
            encoding: None,
            pieces: 0,
            inside: None,
        }
    }

    /// Points along x, y, z.
    pub(super) fn points(&self) -> Parsed<[usize; 3]> {
        let mut points = [0; 3];
        for (points, ends) in points.iter_mut().zip(self.extent.as_chunks::<2>().0) {
            let last = ends[1].checked_sub(ends[0]).and_then(|n| n.checked_add(1));
            let last = last.filter(|n| *n > 0).and_then(|n| usize::try_from(n).ok());
            *points = last.ok_or_else(|| format!("extent {:?} is empty", self.extent))?;
        }
        Ok(points)
    }

    fn element(&mut self, e: &BytesStart<'_>, text: u64) -> Parsed<()> {
        match e.name().as_ref() {
            "VTKFile" => self.file(e),
            "ImageData" => self.image(e),
            "Piece" => self.piece(e),
            "PointData" => self.section(e, Association::Points),
            "CellData" => self.section(e, Association::Cells),
            "DataArray" => self.array(e, text),
            "AppendedData" => {
                self.encoding = Some(attribute(e, "encoding")?.unwrap_or_else(|| "base64".into()));
                Ok(())
            }
            _ => Ok(()),
        }
    }

    fn file(&mut self, e: &BytesStart<'_>) -> Parsed<()> {
        let ty = required(e, "type")?;
        if ty != "ImageData" {
            return Err(format!("is a VTK file of type {ty}; ImageData is supported"));
        }
        if let Some(compressor) = attribute(e, "compressor")? {
            return Err(format!(
                "is compressed by {compressor}, which is not supported; write it without a compressor"
            ));
        }
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
        self.whole = numbers(&required(e, "WholeExtent")?, "WholeExtent")?;
        if let Some(text) = attribute(e, "Spacing")? {
            self.spacing = numbers(&text, "Spacing")?;
        }
        if let Some(text) = attribute(e, "Origin")? {
            self.origin = numbers(&text, "Origin")?;
        }
        if let Some(text) = attribute(e, "Direction")? {
            self.direction = numbers(&text, "Direction")?;
        }
        Ok(())
    }

    fn piece(&mut self, e: &BytesStart<'_>) -> Parsed<()> {
        self.pieces += 1;
        self.extent = numbers(&required(e, "Extent")?, "Extent")?;
        if self.pieces > 1 {
            return Err("has several pieces; files of one piece are supported".into());
        }
        if self.extent != self.whole {
            return Err(format!("has the piece {:?} of the whole {:?} only", self.extent, self.whole));
        }
        Ok(())
    }

    fn section(&mut self, e: &BytesStart<'_>, of: Association) -> Parsed<()> {
        self.inside = Some(of);
        if let Some(name) = attribute(e, "Scalars")? {
            self.scalars.push((of, name));
        }
        Ok(())
    }

    fn array(&mut self, e: &BytesStart<'_>, text: u64) -> Parsed<()> {
        let Some(of) = self.inside else { return Ok(()) }; // field data
        let name = attribute(e, "Name")?.unwrap_or_default();
        if name == "vtkGhostType" {
            return Ok(()); // VTK's own marks
        }
        let offset = attribute(e, "offset")?;
        let offset = offset.map(|o| o.parse().map_err(|_| format!("array {name}: offset {o:?} is no number")));
        self.arrays.push(Array {
            of,
            ty: required(e, "type")?,
            format: required(e, "format")?,
            components: attribute(e, "NumberOfComponents")?.unwrap_or_else(|| "1".into()),
            offset: offset.transpose()?,
            text,
            name,
        });
        Ok(())
    }

    fn end(&mut self, name: &str) {
        if matches!(name, "PointData" | "CellData") {
            self.inside = None;
        }
    }
}

/// Reads XML that may end after the `<AppendedData>` tag.
pub(super) fn parse(text: &str) -> Parsed<Header> {
    let mut reader = Reader::from_str(text);
    let mut header = Header::new();
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
    if header.pieces == 0 {
        return Err("is no VTK image: it has no <Piece>".into());
    }
    header.scalars.sort_by_key(|(of, _)| *of == Association::Cells);
    Ok(header)
}
