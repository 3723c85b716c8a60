//! Named arrays that the caller holds or computes, such as a dataset of another program, as [`super::ArrayFile`].

use super::{ArrayArchive, ArrayFile, Attributes, Variable, attributes};
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use wavesplat_core::base::description::{self, NumberType, Numbers, Values};
use wavesplat_core::base::error::Result;
use wavesplat_core::base::stored::StoredType;
use wavesplat_core::source::file_header::FileHeader;
use wavesplat_core::source::{Extent, OpenOptions, Parsed};

/// Named arrays that the caller holds or computes: samples, their coordinates and other arrays, as a NetCDF file has them.
///
/// Attributes follow the conventions of NetCDF: `units`, `_FillValue`, `calendar`, `positive` and so on.
pub trait NamedArrays: Send + Sync {
    /// All arrays. Asked once.
    fn arrays(&self) -> Vec<NamedArray>;

    /// Attributes of the whole.
    fn attributes(&self) -> Vec<description::Attribute>;

    /// The numbers of a box of an array without [`NamedArray::values`], little-endian, the last axis fastest.
    ///
    /// # Errors
    /// Why they cannot be had: a sentence that follows the name of the array.
    fn read(&self, name: &str, ranges: &[Range<usize>]) -> std::result::Result<Vec<u8>, String>;
}

/// An array of [`NamedArrays`].
#[derive(Debug, Clone)]
pub struct NamedArray {
    /// Its name, unlike those of the others.
    pub name: String,
    /// The type of its numbers.
    pub ty: ArrayType,
    /// Its dimensions, the slowest first.
    pub dimensions: Vec<description::Dimension>,
    /// Chunk lengths, if reading whole chunks is fastest.
    pub chunk: Option<Vec<usize>>,
    /// Its attributes.
    pub attributes: Vec<description::Attribute>,
    /// Whether its numbers are samples already, all of them valid: valid ranges among its attributes exclude none.
    pub is_decoded: bool,
    /// All its values, if it is small or holds texts.
    pub values: Option<Values>,
}

/// The type of an array's numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ArrayType {
    /// A type that files describe.
    Number(NumberType),
    /// Floats of 16 bits. Only samples may have them.
    Half,
}

impl ArrayType {
    fn number(self) -> Parsed<NumberType> {
        match self {
            Self::Number(ty) => Ok(ty),
            Self::Half => Err("floats of 16 bits are not kept beside the samples".into()),
        }
    }
}

/// The name of the format: the arrays and attributes are those that a NetCDF file would have.
const FORMAT: &str = "NetCDF";

/// Describes the frames of the chosen variable of some arrays. Messages call the arrays `name`.
pub(crate) fn describe(name: &Path, arrays: &Arc<dyn NamedArrays>, options: &OpenOptions) -> Result<FileHeader> {
    let held = Arc::new(Held { arrays: arrays.arrays(), source: arrays.clone() });
    let open = move |_: &Path, _| Ok(Box::new(held.clone()) as Box<dyn ArrayFile>);
    let archive = ArrayArchive::open(FORMAT, name, None, Arc::new(open), options)?;
    Ok(FileHeader { format: FORMAT, ..archive.describe(options, Extent::Whole)? })
}

struct Held {
    arrays: Vec<NamedArray>,
    source: Arc<dyn NamedArrays>,
}

impl Held {
    fn named(&self, name: &str) -> Parsed<&NamedArray> {
        self.arrays.iter().find(|array| array.name == name).ok_or_else(|| format!("there is no array {name}"))
    }

    /// All values of an array.
    fn all(&self, array: &NamedArray) -> Parsed<Values> {
        if let Some(values) = &array.values {
            return Ok(values.clone());
        }
        let whole: Vec<Range<usize>> = lengths(array).into_iter().map(|length| 0..length).collect();
        let ty = array.ty.number()?;
        Ok(Values::Numbers(Numbers::new(ty, &self.source.read(&array.name, &whole)?)))
    }
}

impl ArrayFile for Arc<Held> {
    fn variables(&self) -> Parsed<Vec<Variable>> {
        Ok(self.arrays.iter().map(variable).collect())
    }

    fn read(&self, path: &str, _ty: StoredType, ranges: &[Range<usize>]) -> Parsed<Vec<u8>> {
        let array = self.named(path)?;
        match &array.values {
            None => self.source.read(path, ranges),
            Some(Values::Numbers(numbers)) => {
                let kept: Vec<_> = ranges.iter().map(|range| Some(range.clone().collect())).collect();
                let values = description::select(&Values::Numbers(numbers.clone()), &lengths(array), &kept);
                if let Values::Numbers(part) = values { Ok(part.bytes()) } else { Ok(Vec::new()) }
            }
            Some(_) => Err("its values are no numbers".into()),
        }
    }

    fn described(&self, path: &str) -> Vec<description::Attribute> {
        match path {
            "" => self.source.attributes(),
            path => self.named(path).map(|array| array.attributes.clone()).unwrap_or_default(),
        }
    }

    fn values(&self, path: &str) -> Parsed<Values> {
        self.all(self.named(path)?)
    }

    fn number_type(&self, path: &str) -> Parsed<NumberType> {
        self.named(path)?.ty.number()
    }

    fn growing_axes(&self, path: &str) -> Vec<usize> {
        let Ok(array) = self.named(path) else { return Vec::new() };
        (0..array.dimensions.len()).filter(|axis| array.dimensions[*axis].unlimited).collect()
    }

    fn is_unlimited(&self, dimension: &str) -> bool {
        let all = self.arrays.iter().flat_map(|array| &array.dimensions);
        all.into_iter().any(|known| known.name == dimension && known.unlimited)
    }
}

fn lengths(array: &NamedArray) -> Vec<usize> {
    array.dimensions.iter().map(|dimension| usize::try_from(dimension.length).unwrap_or(usize::MAX)).collect()
}

fn variable(array: &NamedArray) -> Variable {
    Variable {
        path: array.name.clone(),
        sample: stored_type(array),
        lengths: lengths(array),
        dims: array.dimensions.iter().map(|dimension| dimension.name.clone()).collect(),
        scales: Vec::new(),
        chunk: array.chunk.clone(),
        attributes: meaning(array),
    }
}

/// The attributes that say what numbers mean.
fn meaning(array: &NamedArray) -> Attributes {
    let mut found = attributes(&array.attributes);
    found.retain(|name, _| !array.is_decoded || !VALID.contains(&name.as_str()));
    found
}

/// Attributes of the numbers that are valid.
const VALID: [&str; 3] = ["valid_range", "valid_min", "valid_max"];

fn stored_type(array: &NamedArray) -> Parsed<StoredType> {
    match array.ty {
        _ if matches!(array.values, Some(Values::Texts(_))) => Err("text".into()),
        ArrayType::Half => Ok(StoredType::F16),
        ArrayType::Number(ty) => StoredType::from_number(ty).ok_or_else(|| "text".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::open_arrays;
    use wavesplat_core::base::description::Dimension;
    use wavesplat_core::base::grid::Region;
    use wavesplat_core::base::sample::SampleType;
    use wavesplat_core::source::read_frames;

    /// Samples (time, lev, lat, lon) with descending lat; the sample at i is i.
    struct Ocean;

    const LENGTHS: [(&str, u64); 4] = [("time", 3), ("lev", 2), ("lat", 3), ("lon", 2)];

    fn array(name: &str, dimensions: &[usize], values: Option<Vec<f64>>, units: &str) -> NamedArray {
        let dimension = |at: &usize| {
            let (name, length) = LENGTHS[*at];
            Dimension { name: name.into(), length, unlimited: *at == 0 }
        };
        let attributes = vec![description::Attribute { name: "units".into(), value: Values::text(units) }];
        let (dimensions, values) =
            (dimensions.iter().map(dimension).collect(), values.map(|values| Values::floats(&values)));
        let ty = ArrayType::Number(if values.is_some() { NumberType::F64 } else { NumberType::F32 });
        NamedArray { name: name.into(), ty, dimensions, chunk: None, attributes, is_decoded: false, values }
    }

    impl NamedArrays for Ocean {
        fn arrays(&self) -> Vec<NamedArray> {
            vec![
                array("temperature", &[0, 1, 2, 3], None, "K"),
                array("time", &[0], Some(vec![0.0, 6.0, 12.0]), "hours since 2000-01-01"),
                array("lat", &[2], Some(vec![40.0, 35.0, 30.0]), "degrees_north"),
                array("lon", &[3], Some(vec![0.0, 5.0]), "degrees_east"),
            ]
        }

        fn attributes(&self) -> Vec<description::Attribute> {
            vec![description::Attribute { name: "title".into(), value: Values::text("an ocean") }]
        }

        fn read(&self, name: &str, ranges: &[Range<usize>]) -> std::result::Result<Vec<u8>, String> {
            assert_eq!(name, "temperature");
            let [t, z, y, x] = ranges.to_vec().try_into().expect("four axes");
            let mut bytes = Vec::new();
            for (t, z, y) in t.flat_map(|t| {
                let y = y.clone();
                z.clone().flat_map(move |z| y.clone().map(move |y| (t, z, y)))
            }) {
                x.clone().for_each(|x| bytes.extend((((t * 2 + z) * 3 + y) as f32 * 2.0 + x as f32).to_le_bytes()));
            }
            Ok(bytes)
        }
    }

    #[test]
    fn held_arrays_are_an_archive_with_its_coordinates() {
        let mut source = open_arrays("ocean", &(Arc::new(Ocean) as Arc<dyn NamedArrays>), &OpenOptions::default())
            .expect("an archive");
        let archive = source.archive().clone();
        assert_eq!((archive.grid.dims, archive.frames), ([2, 3, 2], Some(3)));
        assert_eq!((archive.times, archive.units.samples.as_deref()), (vec![0.0, 6.0, 12.0], Some("K")));
        let described = archive.description.expect("kept");
        assert_eq!(description::coordinates(&described, 1), Some(vec![30.0, 35.0, 40.0]));
        assert_eq!(described.global.len(), 1);
        let window = source.window(1, 2).expect("two frames");
        let region = Region { start: [0, 0, 1], end: [2, 1, 2] }; // the lowest latitude is stored last
        let samples = read_frames(window.as_ref(), 0..2, &region, SampleType::F32).expect("samples");
        let expected =
            [1.0_f32, 2.0].into_iter().flat_map(|t| [0.0, 1.0].map(|x| ((t * 2.0 + 1.0) * 3.0 + 2.0) * 2.0 + x));
        assert_eq!(samples, expected.flat_map(f32::to_le_bytes).collect::<Vec<_>>());
        window.check_unchanged().expect("there is no file");
    }

    #[test]
    fn a_valid_range_excludes_no_sample_of_decoded_arrays() {
        struct Valid(bool, &'static str);
        impl NamedArrays for Valid {
            fn arrays(&self) -> Vec<NamedArray> {
                let mut samples = array("temperature", &[0, 1, 2, 3], None, "K");
                let value = Values::floats(if self.1 == "valid_range" { &[3.0, 5.0] } else { &[3.0] });
                samples.attributes.push(description::Attribute { name: self.1.into(), value });
                vec![NamedArray { is_decoded: self.0, ..samples }]
            }
            fn attributes(&self) -> Vec<description::Attribute> {
                Vec::new()
            }
            fn read(&self, name: &str, ranges: &[Range<usize>]) -> std::result::Result<Vec<u8>, String> {
                Ocean.read(name, ranges)
            }
        }
        for (name, excluded) in [("valid_range", 9), ("valid_min", 3), ("valid_max", 8)] {
            for is_decoded in [false, true] {
                let arrays = Arc::new(Valid(is_decoded, name)) as Arc<dyn NamedArrays>;
                let mut source = open_arrays("ocean", &arrays, &OpenOptions::default()).expect("an archive");
                let archive = source.archive().clone();
                let window = source.window(0, 1).expect("a frame");
                let bytes =
                    read_frames(window.as_ref(), 0..1, &archive.grid.whole(), SampleType::F32).expect("samples");
                let missing = bytes.chunks(4).filter(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]).is_nan()).count();
                assert_eq!(missing, if is_decoded { 0 } else { excluded }, "{name}");
                let kept = archive.description.expect("kept").attributes;
                assert_eq!(kept.iter().any(|attribute| attribute.name == name), is_decoded, "as samples have it");
            }
        }
    }

    #[test]
    fn a_variable_must_be_chosen_if_there_are_several() {
        struct Two;
        impl NamedArrays for Two {
            fn arrays(&self) -> Vec<NamedArray> {
                ["u", "v"].map(|name| array(name, &[0, 1, 2, 3], None, "m/s")).into()
            }
            fn attributes(&self) -> Vec<description::Attribute> {
                Vec::new()
            }
            fn read(&self, _: &str, _: &[Range<usize>]) -> std::result::Result<Vec<u8>, String> {
                Err("cannot be computed".into())
            }
        }
        let open = |variable: Option<&str>| {
            open_arrays(
                "two",
                &(Arc::new(Two) as Arc<dyn NamedArrays>),
                &OpenOptions { variable: variable.map(String::from), ..OpenOptions::default() },
            )
        };
        assert!(open(None).err().expect("undecided").to_string().contains("several variables"));
        let mut chosen = open(Some("v")).expect("chosen");
        let refused = chosen.window(0, 1).err().expect("not computed").to_string();
        assert!(refused.contains("v at") && refused.contains("cannot be computed"), "{refused}");
    }
}
