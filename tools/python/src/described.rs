//! Descriptions and their values, to and from Python.

use crate::errors::{InputError, borrowed};
use numpy::{IntoPyArray, PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use wavesplat::base::description::{Attribute, AxisRole, Description, Dimension, NumberType, Numbers, Values};

/// Types of numbers by numpy's names.
const TYPES: [(&str, NumberType); 10] = [
    ("uint8", NumberType::U8),
    ("int8", NumberType::I8),
    ("uint16", NumberType::U16),
    ("int16", NumberType::I16),
    ("uint32", NumberType::U32),
    ("int32", NumberType::I32),
    ("uint64", NumberType::U64),
    ("int64", NumberType::I64),
    ("float32", NumberType::F32),
    ("float64", NumberType::F64),
];

pub(crate) fn number_type(dtype: &str) -> PyResult<NumberType> {
    let known = TYPES.into_iter().find(|(name, _)| *name == dtype);
    known.map(|(_, ty)| ty).ok_or_else(|| InputError::new_err(format!("numbers of type {dtype} cannot be kept")))
}

fn dtype(ty: NumberType) -> &'static str {
    TYPES.into_iter().find(|(_, known)| *known == ty).map_or("S1", |(name, _)| name)
}

/// The description as a dict: `source`, `dimensions` [(name, length, unlimited)], `axes` [(dimension, role, reversed)],
/// `attributes`, `global`, and `variables` [(name, dimensions, values, attributes)].
pub(crate) fn to_python<'py>(py: Python<'py>, description: &Description) -> PyResult<Bound<'py, PyDict>> {
    let dimension = |d: &Dimension| (d.name.clone(), d.length, d.unlimited);
    let role = |role: AxisRole| match role {
        AxisRole::Frames => "t",
        AxisRole::X => "x",
        AxisRole::Y => "y",
        AxisRole::Z => "z",
        AxisRole::Single => "single",
    };
    let all = PyDict::new(py);
    all.set_item("source", &description.source)?;
    all.set_item("dimensions", description.dimensions.iter().map(dimension).collect::<Vec<_>>())?;
    let axes = description.axes.iter().map(|axis| (axis.dimension, role(axis.role), axis.reversed));
    all.set_item("axes", axes.collect::<Vec<_>>())?;
    all.set_item("attributes", attributes(py, &description.attributes)?)?;
    all.set_item("global", attributes(py, &description.global)?)?;
    let variables = PyList::empty(py);
    for variable in &description.variables {
        let (name, dimensions) = (&variable.name, variable.dimensions.clone());
        variables.append((name, dimensions, values(py, &variable.values)?, attributes(py, &variable.attributes)?))?;
    }
    all.set_item("variables", variables)?;
    Ok(all)
}

fn attributes<'py>(py: Python<'py>, all: &[Attribute]) -> PyResult<Bound<'py, PyDict>> {
    let found = PyDict::new(py);
    for attribute in all {
        found.set_item(&attribute.name, values(py, &attribute.value)?)?;
    }
    Ok(found)
}

/// Texts as a list, numbers as (bytes, name of their type), times of the frames as the name of their type.
fn values<'py>(py: Python<'py>, values: &Values) -> PyResult<Bound<'py, PyAny>> {
    Ok(match values {
        Values::Texts(texts) => texts.into_pyobject(py)?.into_any(),
        Values::Numbers(numbers) => (numbers.bytes().into_pyarray(py), dtype(numbers.ty)).into_pyobject(py)?.into_any(),
        Values::Times(ty) => dtype(*ty).into_pyobject(py)?.into_any(),
    })
}

/// Values from Python: a list of texts, or (bytes, name of their type).
#[derive(FromPyObject)]
pub(crate) enum GivenValues<'py> {
    Texts(Vec<String>),
    Numbers(Bound<'py, PyArray1<u8>>, String),
}

impl GivenValues<'_> {
    pub(crate) fn values(&self) -> PyResult<Values> {
        Ok(match self {
            Self::Texts(texts) => Values::Texts(texts.clone()),
            Self::Numbers(bytes, dtype) => {
                Values::Numbers(Numbers::new(number_type(dtype)?, bytes.try_readonly().map_err(borrowed)?.as_slice()?))
            }
        })
    }
}

/// Attributes from Python.
pub(crate) fn given_attributes(all: &[(String, GivenValues<'_>)]) -> PyResult<Vec<Attribute>> {
    all.iter().map(|(name, value)| Ok(Attribute { name: name.clone(), value: value.values()? })).collect()
}
