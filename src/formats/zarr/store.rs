//! Zarr stores of version 2: a folder with a folder of chunks for each array. Everything but the samples is written
//! first; each chunk of samples is one zstd frame, of some items of the slowest axes.

use super::layout::{ARRAY, ATTRIBUTES, DIMENSIONS, GROUP, dtype};
use crate::contents::Contents;
use crate::shared::dataset::{Dataset, DatasetVariable, number_type};
use serde_json::{Map, Value, json};
use std::path::{Path, PathBuf};
use wavesplat_core::base::description::{Attribute, NumberType, Numbers, Values};
use wavesplat_core::base::sample::{SampleType, store};

/// Bytes of a chunk before compression, unless one row is longer.
const CHUNK: u64 = 8 << 20;

/// The compression level of the samples: a fast one.
pub(super) const LEVEL: i32 = 3;

/// The lengths of an array and of its chunks, the slowest axis first.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Chunks {
    pub(super) lengths: Vec<u64>,
    pub(super) chunk: Vec<u64>,
}

impl Chunks {
    /// Chunks of consecutive samples: some items of one axis, all of faster axes, one of slower axes.
    pub(super) fn new(lengths: Vec<u64>, size: usize) -> Self {
        let (mut chunk, mut bytes) = (lengths.clone(), size as u64);
        for (axis, length) in lengths.iter().enumerate().rev() {
            let items = (CHUNK / bytes).clamp(1, *length);
            bytes = bytes.saturating_mul(items);
            chunk[axis] = items;
            if items < *length {
                chunk[..axis].fill(1);
                break;
            }
        }
        Self { lengths, chunk }
    }

    /// Samples of a full chunk.
    pub(super) fn samples(&self) -> u64 {
        self.chunk.iter().product()
    }

    /// Name and number of samples of each chunk, in the order of the samples.
    pub(super) fn list(&self) -> Vec<(String, u64)> {
        let counts: Vec<u64> = self.lengths.iter().zip(&self.chunk).map(|(n, chunk)| n.div_ceil(*chunk)).collect();
        (0..counts.iter().product::<u64>()).map(|number| self.numbered(number, &counts)).collect()
    }

    fn numbered(&self, number: u64, counts: &[u64]) -> (String, u64) {
        let (mut left, mut samples, mut names) = (number, 1, Vec::new());
        for axis in (0..counts.len()).rev() {
            let index = left % counts[axis];
            left /= counts[axis];
            samples *= self.chunk[axis].min(self.lengths[axis] - index * self.chunk[axis]);
            names.push(index.to_string());
        }
        names.reverse();
        (if names.is_empty() { "0".into() } else { names.join(".") }, samples)
    }
}

/// A store without its chunks of samples.
#[derive(Debug)]
pub(super) struct Store {
    /// Files by their paths within the store, and their contents.
    pub(super) files: Vec<(PathBuf, Vec<u8>)>,
    /// The consolidated metadata, written last.
    pub(super) metadata: Vec<u8>,
    /// The folder of the samples within the store.
    pub(super) samples: PathBuf,
    pub(super) chunks: Chunks,
}

impl Store {
    pub(super) fn new(contents: &Contents, ty: SampleType) -> Self {
        let dataset = Dataset::new(contents, ty);
        let mut builder = Builder { files: Vec::new(), all: Map::new() };
        builder.add(GROUP, json!({ "zarr_format": 2 }));
        builder.add(ATTRIBUTES, attributes(&dataset.global));
        dataset.variables.iter().for_each(|variable| builder.variable(variable, &dataset.dimensions));
        let samples = &dataset.samples;
        let lengths: Vec<u64> = samples.dimensions.iter().map(|dimension| dataset.dimensions[*dimension].1).collect();
        let chunks = Chunks::new(lengths, ty.size());
        let fill = samples.fill.map_or(Value::Null, |fill| fill_value(ty, fill));
        let compressor = json!({ "id": "zstd", "level": LEVEL });
        let array = array(&chunks, &dtype(number_type(ty)), &fill, &compressor);
        builder.array(&samples.name, array, &samples.attributes, &names(&samples.dimensions, &dataset.dimensions));
        let metadata = json!({ "metadata": builder.all, "zarr_consolidated_format": 1 });
        Self { files: builder.files, metadata: text(&metadata), samples: folder(&samples.name), chunks }
    }
}

struct Builder {
    files: Vec<(PathBuf, Vec<u8>)>,
    /// The metadata of all arrays.
    all: Map<String, Value>,
}

impl Builder {
    fn add(&mut self, name: &str, value: Value) {
        self.files.push((name.into(), text(&value)));
        self.all.insert(name.into(), value);
    }

    fn array(&mut self, name: &str, array: Value, own: &[Attribute], dimensions: &[&str]) {
        let mut all = attributes(own);
        all[DIMENSIONS] = json!(dimensions);
        let folder = folder(name);
        self.add(&folder.join(ARRAY).to_string_lossy(), array);
        self.add(&folder.join(ATTRIBUTES).to_string_lossy(), all);
    }

    /// An array beside the samples, in one chunk without compression.
    fn variable(&mut self, variable: &DatasetVariable, all: &[(String, u64)]) {
        let lengths: Vec<u64> = variable.dimensions.iter().map(|dimension| all[*dimension].1).collect();
        let (dtype, bytes) = bytes_of(&variable.values);
        let chunks = Chunks { chunk: lengths.clone(), lengths };
        let (names, array) = (names(&variable.dimensions, all), array(&chunks, &dtype, &Value::Null, &Value::Null));
        self.array(&variable.name, array, &variable.attributes, &names);
        let chunk = vec!["0"; chunks.lengths.len().max(1)].join(".");
        self.files.push((folder(&variable.name).join(chunk), bytes));
    }
}

/// The folder of an array. Separators in names would lead elsewhere.
fn folder(name: &str) -> PathBuf {
    let plain: String = name.chars().map(|c| if matches!(c, '/' | '\\') { '_' } else { c }).collect();
    Path::new(if matches!(plain.as_str(), "." | "..") { "_" } else { &plain }).into()
}

fn names<'a>(dimensions: &[usize], all: &'a [(String, u64)]) -> Vec<&'a str> {
    dimensions.iter().map(|dimension| all[*dimension].0.as_str()).collect()
}

fn array(chunks: &Chunks, dtype: &str, fill: &Value, compressor: &Value) -> Value {
    json!({
        "zarr_format": 2,
        "shape": chunks.lengths,
        "chunks": chunks.chunk,
        "dtype": dtype,
        "compressor": compressor,
        "fill_value": fill,
        "filters": null,
        "order": "C",
    })
}

fn text(value: &Value) -> Vec<u8> {
    serde_json::to_vec_pretty(value).unwrap_or_default()
}

/// Type and bytes of values. Texts are arrays of characters of four bytes.
fn bytes_of(values: &Values) -> (String, Vec<u8>) {
    match values {
        Values::Numbers(numbers) => (dtype(numbers.ty), numbers.bytes()),
        Values::Times(ty) => (dtype(*ty), Vec::new()), // those of a dataset are numbers
        Values::Texts(texts) => {
            let longest = texts.iter().map(|text| text.chars().count()).max().unwrap_or(0).max(1);
            let padded = |text: &String| {
                let characters: Vec<u32> = text.chars().map(u32::from).collect();
                (0..longest).flat_map(|i| characters.get(i).copied().unwrap_or(0).to_le_bytes()).collect::<Vec<u8>>()
            };
            (format!("<U{longest}"), texts.iter().flat_map(padded).collect())
        }
    }
}

/// A number of a type as JSON. NaN and infinities are written as strings.
fn fill_value(ty: SampleType, fill: f64) -> Value {
    match fill {
        fill if fill.is_nan() => json!("NaN"),
        fill if fill.is_infinite() => json!(if fill > 0.0 { "Infinity" } else { "-Infinity" }),
        fill if ty.is_float() => {
            let mut bytes = vec![0; ty.size()];
            store(ty, &[fill], &mut bytes);
            json!(Numbers::new(number_type(ty), &bytes).to_f64()[0])
        }
        fill => json!(fill as i64),
    }
}

/// Attributes as JSON; numbers that are not finite are left out, since JSON has none.
fn attributes(all: &[Attribute]) -> Value {
    let one = |attribute: &Attribute| Some((attribute.name.clone(), attribute_value(&attribute.value)?));
    Value::Object(all.iter().filter_map(one).collect())
}

/// One value alone, several as a list.
fn attribute_value(values: &Values) -> Option<Value> {
    let all: Vec<Value> = match values {
        Values::Texts(texts) => texts.iter().map(|text| json!(text)).collect(),
        Values::Numbers(numbers) => numbers_json(numbers)?,
        Values::Times(_) => return None,
    };
    Some(if let [only] = all.as_slice() { only.clone() } else { Value::Array(all) })
}

fn numbers_json(numbers: &Numbers) -> Option<Vec<Value>> {
    use NumberType::{F32, F64, I64, U64};
    let words = |bytes: Vec<u8>| bytes.chunks_exact(8).map(|b| u64::from_le_bytes(b.try_into().expect("8"))).collect();
    let all = numbers.to_f64();
    if !all.iter().all(|number| number.is_finite()) {
        return None;
    }
    let words: Vec<u64> = if matches!(numbers.ty, I64 | U64) { words(numbers.bytes()) } else { Vec::new() };
    Some(match numbers.ty {
        I64 => words.into_iter().map(|word| json!(word as i64)).collect(),
        U64 => words.into_iter().map(|word| json!(word)).collect(),
        F32 | F64 => all.into_iter().map(|number| json!(number)).collect(),
        _ => all.into_iter().map(|number| json!(number as i64)).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contents::testing::contents;

    #[test]
    fn chunks_are_consecutive_and_of_some_megabytes() {
        let frames = Chunks::new(vec![100, 128, 128, 128], 4);
        assert_eq!((frames.chunk.as_slice(), frames.list().len()), (&[1, 128, 128, 128][..], 100));
        let small = Chunks::new(vec![40, 10, 14, 20], 4);
        assert_eq!(
            (small.chunk.as_slice(), small.list().as_slice()),
            (&[40, 10, 14, 20][..], &[("0.0.0.0".to_string(), 112_000)][..])
        );
        let large = Chunks::new(vec![2, 1000, 1024, 1024], 4);
        assert_eq!(large.chunk, [1, 2, 1024, 1024]);
        let uneven = Chunks { lengths: vec![3, 5], chunk: vec![1, 2] };
        let names: Vec<(String, u64)> = uneven.list();
        assert_eq!(names[..3], [("0.0".into(), 2), ("0.1".into(), 2), ("0.2".into(), 1)]);
        assert_eq!((names.len(), uneven.samples()), (9, 2));
    }

    #[test]
    fn a_store_has_metadata_of_every_array() {
        let store = Store::new(&Contents { missing: Some(-7.0), ..contents() }, SampleType::I16);
        let all: Value = serde_json::from_slice(&store.metadata).expect("JSON");
        let samples = format!("{}/.zarray", store.samples.display());
        assert_eq!(all["metadata"][&samples]["fill_value"], json!(-7));
        assert_eq!(all["metadata"][&samples]["shape"], json!([3, 3, 4, 5]));
        assert_eq!(all["metadata"]["time/.zattrs"]["_ARRAY_DIMENSIONS"], json!(["time"]));
        assert!(store.files.iter().any(|(path, bytes)| path == Path::new("x/0") && bytes.len() == 40));
    }
}
