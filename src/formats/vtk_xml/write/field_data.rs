//! VTK's field data: the time of a frame, and the arrays of a source of VTK that belong to no point or cell.

use crate::contents::Contents;
use crate::vtk_xml::layout::{TIME, TYPES};
use quick_xml::escape::escape;
use wavesplat_core::base::description::{Description, NumberType, Numbers, Values, Variable};
use wavesplat_core::base::stored::StoredType;

/// The elements in `<FieldData>`.
pub(crate) fn text(contents: &Contents, time: f64) -> String {
    let time =
        format!(r#"<DataArray type="Float64" Name="{TIME}" NumberOfTuples="1" format="ascii">{time}</DataArray>"#);
    let of_source = contents.description.as_ref().filter(|_| contents.is_from_vtk());
    let arrays = of_source.into_iter().flat_map(|all| all.variables.iter().filter_map(|one| array(all, one)));
    [time].into_iter().chain(arrays).collect::<Vec<_>>().join("\n      ")
}

/// An array of numbers that is not along an axis of voxels.
fn array(description: &Description, variable: &Variable) -> Option<String> {
    let Values::Numbers(numbers) = &variable.values else { return None };
    let is_axis = |dimension: &u32| description.axes.iter().any(|axis| axis.dimension == *dimension);
    if variable.dimensions.iter().any(is_axis) {
        return None;
    }
    let components = variable.dimensions.get(1).map_or(1, |second| description.dimensions[*second as usize].length);
    let (name, ty) = (escape(&variable.name), TYPES.name(StoredType::from_number(numbers.ty)?));
    let tuples = numbers.count() as u64 / components.max(1);
    let attributes =
        format!(r#"type="{ty}" Name="{name}" NumberOfComponents="{components}" NumberOfTuples="{tuples}""#);
    Some(format!(r#"<DataArray {attributes} format="ascii">{}</DataArray>"#, words(numbers)))
}

/// Numbers with all their digits.
fn words(numbers: &Numbers) -> String {
    let bytes = numbers.bytes();
    let words: Vec<String> = match numbers.ty {
        NumberType::I64 => bytes.as_chunks().0.iter().map(|b| i64::from_le_bytes(*b).to_string()).collect(),
        NumberType::U64 => bytes.as_chunks().0.iter().map(|b| u64::from_le_bytes(*b).to_string()).collect(),
        _ => numbers.to_f64().iter().map(f64::to_string).collect(),
    };
    words.join(" ")
}
