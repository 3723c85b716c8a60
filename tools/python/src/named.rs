//! Named arrays of a dataset in Python, as the library reads them.

use crate::described::{GivenValues, given_attributes, number_type};
use crate::errors::borrowed;
use crate::job::Caller;
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use std::ops::Range;
use std::sync::Arc;
use wavesplat::base::description::{Attribute, Dimension};
use wavesplat::formats::{ArrayType, NamedArray, NamedArrays};

/// An array as Python describes it.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct GivenArray<'py> {
    name: String,
    dtype: String,
    /// Name, length, and whether it may grow.
    dimensions: Vec<(String, u64, bool)>,
    chunk: Option<Vec<usize>>,
    attributes: Vec<(String, GivenValues<'py>)>,
    values: Option<GivenValues<'py>>,
    is_decoded: bool,
}

impl GivenArray<'_> {
    pub(crate) fn array(&self) -> PyResult<NamedArray> {
        let dimension = |(name, length, unlimited): &(String, u64, bool)| Dimension {
            name: name.clone(),
            length: *length,
            unlimited: *unlimited,
        };
        let values = self.values.as_ref().map(GivenValues::values).transpose()?;
        let is_text = matches!(self.values, Some(GivenValues::Texts(_)));
        Ok(NamedArray {
            name: self.name.clone(),
            ty: match self.dtype.as_str() {
                "float16" => ArrayType::Half,
                _ if is_text => ArrayType::Number(wavesplat::base::description::NumberType::Char),
                dtype => ArrayType::Number(number_type(dtype)?),
            },
            dimensions: self.dimensions.iter().map(dimension).collect(),
            chunk: self.chunk.clone(),
            attributes: given_attributes(&self.attributes)?,
            is_decoded: self.is_decoded,
            values,
        })
    }
}

/// Arrays that a Python function reads.
pub(crate) struct PythonArrays {
    arrays: Vec<NamedArray>,
    attributes: Vec<Attribute>,
    /// `read(name, [(start, end), ...])` gives the bytes of a box.
    read: Arc<Py<PyAny>>,
    caller: Caller,
}

impl PythonArrays {
    pub(crate) fn new(arrays: Vec<NamedArray>, attributes: Vec<Attribute>, read: Py<PyAny>, caller: Caller) -> Self {
        Self { arrays, attributes, read: Arc::new(read), caller }
    }
}

impl NamedArrays for PythonArrays {
    fn arrays(&self) -> Vec<NamedArray> {
        self.arrays.clone()
    }

    fn attributes(&self) -> Vec<Attribute> {
        self.attributes.clone()
    }

    fn read(&self, name: &str, ranges: &[Range<usize>]) -> Result<Vec<u8>, String> {
        let ranges: Vec<(usize, usize)> = ranges.iter().map(|range| (range.start, range.end)).collect();
        let (function, name) = (self.read.clone(), name.to_string());
        self.caller.call(move |py| {
            let bytes = function.bind(py).call1((name, ranges))?.cast_into::<PyArray1<u8>>()?;
            Ok(bytes.try_readonly().map_err(borrowed)?.as_slice()?.to_vec())
        })
    }
}
