//! An array of a file, and its attributes.

use std::collections::BTreeMap;
use wavesplat_core::base::description::{self, Values};
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::Parsed;

/// An array and its attributes.
#[derive(Debug, Clone)]
pub(crate) struct Variable {
    /// Its name, with those of the groups that it is in.
    pub(crate) path: String,
    /// The type of its numbers, or the name of one that is not supported.
    pub(crate) sample: Parsed<StoredType>,
    /// The slowest axis first.
    pub(crate) lengths: Vec<usize>,
    /// Name of each axis; empty where it has none.
    pub(crate) dims: Vec<String>,
    /// Path of the array that the file ties to each axis as its coordinates; empty where it ties none.
    pub(crate) scales: Vec<String>,
    /// Chunk lengths, if it is stored in chunks.
    pub(crate) chunk: Option<Vec<usize>>,
    pub(crate) attributes: Attributes,
}

pub(crate) type Attributes = BTreeMap<String, Attribute>;

/// The value of an attribute.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Attribute {
    Text(String),
    Texts(Vec<String>),
    Numbers(Vec<f64>),
}

/// The numbers of an attribute; empty if it has none.
pub(crate) fn numbers<'a>(attributes: &'a Attributes, name: &str) -> &'a [f64] {
    match attributes.get(name) {
        Some(Attribute::Numbers(numbers)) => numbers,
        _ => &[],
    }
}

/// The values of attributes that are texts or numbers.
pub(crate) fn attributes(all: &[description::Attribute]) -> Attributes {
    let value = |values: &Values| match values {
        Values::Texts(texts) => match texts.as_slice() {
            [text] => Some(Attribute::Text(text.clone())),
            texts => Some(Attribute::Texts(texts.to_vec())),
        },
        Values::Numbers(numbers) => Some(Attribute::Numbers(numbers.to_f64())),
        Values::Times(_) => None,
    };
    all.iter().filter_map(|a| Some((a.name.clone(), value(&a.value)?))).collect()
}

impl Variable {
    /// The name of something that is not read: `what` it is.
    #[cfg(feature = "hdf5")]
    pub(crate) fn elsewhere(path: String, what: String) -> Self {
        let (lengths, dims, scales, attributes) = (Vec::new(), Vec::new(), Vec::new(), Attributes::new());
        Self { path, sample: Err(what), lengths, dims, scales, chunk: None, attributes }
    }

    pub(crate) fn text(&self, attribute: &str) -> Option<&str> {
        match self.attributes.get(attribute)? {
            Attribute::Text(text) => Some(text.trim()),
            Attribute::Texts(_) | Attribute::Numbers(_) => None,
        }
    }

    pub(crate) fn numbers(&self, attribute: &str) -> &[f64] {
        numbers(&self.attributes, attribute)
    }

    pub(crate) fn number(&self, attribute: &str) -> Option<f64> {
        self.numbers(attribute).first().copied()
    }

    /// Its path, as users name it.
    pub(crate) fn shown(&self) -> &str {
        self.path.trim_start_matches('/')
    }

    /// The last part of its path.
    pub(crate) fn name(&self) -> &str {
        self.path.rsplit('/').next().unwrap_or_default()
    }

    /// The name of the array that the file ties to an axis; empty if it ties none.
    pub(crate) fn scale(&self, axis: usize) -> &str {
        self.scales.get(axis).and_then(|path| path.rsplit('/').next()).unwrap_or_default()
    }

    /// The variable that says where the voxels or frames of an axis are: the one that the file ties to the axis, or else
    /// the one that has the axis' name, and this one only.
    pub(crate) fn coordinate<'a>(&self, axis: usize, all: &'a [Self]) -> Option<&'a Self> {
        let (dim, length) = (self.dims[axis].as_str(), [self.lengths[axis]]);
        let folder = &self.path[..self.path.len() - self.name().len()];
        let tied = |v: &&Self| self.scales.get(axis) == Some(&v.path) && v.lengths == length;
        let is = |v: &&Self| !dim.is_empty() && v.name() == dim && v.lengths == length;
        let near = |v: &&Self| is(v) && v.path.strip_suffix(dim) == Some(folder);
        all.iter().find(tied).or_else(|| all.iter().find(near)).or_else(|| all.iter().find(is))
    }
}
