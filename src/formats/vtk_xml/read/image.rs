//! A file of VTK's image data, and where its arrays are.

use super::count::Count;
use super::encoded::{EncodedArray, Form};
use super::header::{self, VtiArray, VtiHeader};
use super::skeleton::Skeleton;
use crate::shared::pieces::Packed;
use crate::vtk_xml::layout::TYPES;
use std::io::Read;
use std::path::Path;
use wavesplat_core::base::error::{Error, Result};
use wavesplat_core::base::mapped::{Access, FileBytes};
use wavesplat_core::base::sample;
use wavesplat_core::base::stored::StoredType;

/// A file, and its XML.
pub(super) struct VtiFile {
    pub(super) file: FileBytes,
    pub(super) header: VtiHeader,
    xml: Skeleton,
}

impl VtiFile {
    pub(super) fn open(path: &Path) -> Result<Self> {
        let file = FileBytes::open(path, Access::Read)?;
        let refused = |e| Error::input(path, e);
        let xml = Skeleton::read(&file)?;
        let text = std::str::from_utf8(xml.text()).map_err(|e| refused(format!("is not UTF-8 text: {e}")))?;
        let header = header::parse(text).map_err(refused)?;
        Ok(Self { file, header, xml })
    }

    /// Where an array is, checked to be all there.
    pub(super) fn encoded(&self, array: &VtiArray, ty: StoredType, bytes: usize) -> Result<EncodedArray> {
        let refused = |e| Error::input(self.file.path(), e);
        let VtiHeader { wide, big_endian, compressed, .. } = self.header;
        let count = Count { wide, big_endian };
        let (form, start) = match (array.format.as_str(), self.header.encoding.as_deref()) {
            ("binary", _) => (Form::Base64, self.xml.place(array.text)),
            ("ascii", _) => (Form::Ascii, self.xml.place(array.text)),
            ("appended", Some("raw")) => (Form::Raw, self.appended(array)?),
            ("appended", Some("base64")) => (Form::AppendedBase64, self.appended(array)?),
            ("appended", None) => return Err(refused("ends before its <AppendedData>".into())),
            ("appended", Some(other)) => {
                return Err(refused(format!("appended data in encoding {other:?} is not supported")));
            }
            (other, _) => {
                return Err(refused(format!("data in format {other:?} is not supported; write it appended or binary")));
            }
        };
        let encoded = EncodedArray { start, form, compressed, count, ty, bytes };
        encoded.check(&self.file)?;
        Ok(encoded)
    }

    /// Where an appended array starts: its offset counts from the `_` after the tag.
    fn appended(&self, array: &VtiArray) -> Result<u64> {
        let (mut gap, end) = ([0; 64], self.xml.end());
        let len = usize::try_from(self.file.len().saturating_sub(end)).unwrap_or(gap.len()).min(gap.len());
        let failed = |e| Error::io(self.file.path(), "reading the appended data", e);
        self.file.read_at(end, &mut gap[..len]).map_err(failed)?;
        let mark = gap[..len].iter().position(|b| !b.is_ascii_whitespace()).filter(|at| gap[*at] == b'_');
        let refused = |what| Error::input(self.file.path(), what);
        let mark = mark.ok_or_else(|| refused("its appended data does not start with an underscore"))?;
        let offset = array.offset.ok_or_else(|| refused("its appended array has no offset"))?;
        let start = (end + mark as u64 + 1).checked_add(offset).filter(|start| start.checked_add(8).is_some());
        start.ok_or_else(|| refused("its array's offset is too large"))
    }

    /// The time of the file, if it is given as a floating-point number.
    pub(super) fn time(&self) -> Result<Option<f64>> {
        let Some(array) = &self.header.time else { return Ok(None) };
        let float = TYPES.stored(array.ty.as_str()).filter(|ty| ty.sample().is_float());
        let Some(ty) = float else { return Ok(None) };
        let failed = |e| Error::io(self.file.path(), "reading its TimeValue", e);
        let encoded = self.encoded(array, ty, ty.size())?;
        let mut bytes = vec![0; ty.size()];
        let file = FileBytes::open(self.file.path(), Access::Read)?;
        encoded.open(file).and_then(|mut reader| reader.read_exact(&mut bytes)).map_err(failed)?;
        if self.header.big_endian {
            ty.swap_endian(&mut bytes);
        }
        let mut value = [0.0];
        sample::load(ty.sample(), &bytes, &mut value);
        Ok(Some(value[0]))
    }
}
