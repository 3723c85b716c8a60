//! The description of the source: dimensions, coordinates, attributes, orientation (FORMAT.md, section 6). Nothing in
//! the rest of the file depends on it.

use crate::bytes::{ParseResult, ensure};
use crate::limits::{MAX_DESCRIPTION, MAX_DESCRIPTION_ITEMS};
use crate::metadata::Metadata;
use crate::planes::{pack_planes, unpack_planes};
use crate::record::{decode_exact, encode};
use crate::{Error, Result};
use bincode::{Decode, Encode};

/// The description of the source besides its samples.
#[derive(Debug, Clone, Default, PartialEq, Encode, Decode)]
pub struct Description {
    /// Name of the source's format.
    pub source: String,
    /// Dimensions of the samples' array and of the variables.
    pub dimensions: Vec<Dimension>,
    /// The axes of the samples' array in the source, the slowest first.
    pub axes: Vec<ArrayAxis>,
    /// Attributes of the samples.
    pub attributes: Vec<Attribute>,
    /// Attributes of the whole source.
    pub global: Vec<Attribute>,
    /// Coordinates and other small arrays.
    pub variables: Vec<Variable>,
    /// Where voxels are in a world whose axes are not those of the array.
    pub orientation: Option<Orientation>,
}

/// A named length.
#[derive(Debug, Clone, PartialEq, Eq, Encode, Decode)]
pub struct Dimension {
    /// Its name; empty if it has none.
    pub name: String,
    /// Number of items along it.
    pub length: u64,
    /// Whether the source could grow along it.
    pub unlimited: bool,
}

/// An axis of the samples' array.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Encode, Decode)]
pub struct ArrayAxis {
    /// Index of its dimension.
    pub dimension: u32,
    /// Its role.
    pub role: AxisRole,
    /// Whether the source stores it from the last voxel to the first.
    pub reversed: bool,
}

/// The role of an axis of the samples' array. New roles are only appended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Encode, Decode)]
pub enum AxisRole {
    /// Frames.
    Frames,
    /// Voxels along x.
    X,
    /// Voxels along y.
    Y,
    /// Voxels along z.
    Z,
    /// Nothing: its length is 1.
    Single,
}

impl AxisRole {
    /// The axis of voxels that it counts: 0 for x, 1 for y, 2 for z.
    pub fn voxels(self) -> Option<usize> {
        match self {
            Self::X => Some(0),
            Self::Y => Some(1),
            Self::Z => Some(2),
            Self::Frames | Self::Single => None,
        }
    }

    /// The role of the axis of voxels `axis`, 0 to 2.
    pub fn of_voxels(axis: usize) -> Self {
        [Self::X, Self::Y, Self::Z][axis]
    }
}

/// A named value.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct Attribute {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: Values,
}

/// A small array beside the samples.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Indices of its dimensions, the slowest first; none for a single value.
    pub dimensions: Vec<u32>,
    /// As many values as its dimensions say.
    pub values: Values,
    /// Its attributes.
    pub attributes: Vec<Attribute>,
}

/// Values of an attribute or a variable. New kinds are only appended.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub enum Values {
    /// Texts.
    Texts(Vec<String>),
    /// Numbers.
    Numbers(Numbers),
    /// The times of the frames, as numbers of this type.
    Times(NumberType),
}

/// A type of numbers. New types are only appended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Encode, Decode)]
#[allow(missing_docs, reason = "the names say it")]
pub enum NumberType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
    /// A byte of text.
    Char,
}

impl NumberType {
    /// Bytes of a number.
    pub fn size(self) -> usize {
        match self {
            Self::U8 | Self::I8 | Self::Char => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }
}

/// Numbers of one type, packed as byte planes of the differences between neighbours.
#[derive(Debug, Clone, PartialEq, Eq, Encode, Decode)]
pub struct Numbers {
    /// Their type.
    pub ty: NumberType,
    packed: Vec<u8>,
}

impl Numbers {
    /// Packs little-endian numbers. Bytes after the last whole number are dropped.
    pub fn new(ty: NumberType, bytes: &[u8]) -> Self {
        let (size, mut packed, mut before) = (ty.size(), Vec::with_capacity(bytes.len()), 0);
        let differences = bytes.chunks_exact(size).flat_map(|number| {
            let number = word(number);
            let difference = number.wrapping_sub(std::mem::replace(&mut before, number));
            difference.to_le_bytes().into_iter().take(size)
        });
        pack_planes(&differences.collect::<Vec<u8>>(), size, &mut packed);
        Self { ty, packed }
    }

    /// The little-endian bytes.
    pub fn bytes(&self) -> Vec<u8> {
        let (size, mut before) = (self.ty.size(), 0_u64);
        let mut bytes = unpack_planes(&self.packed, size);
        for number in bytes.chunks_exact_mut(size) {
            before = before.wrapping_add(word(number));
            number.copy_from_slice(&before.to_le_bytes()[..size]);
        }
        bytes
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.packed.len() / self.ty.size()
    }

    /// The numbers as floats; those of 64-bit integers may be rounded.
    pub fn to_f64(&self) -> Vec<f64> {
        self.bytes().chunks_exact(self.ty.size()).map(|number| as_f64(self.ty, number)).collect()
    }
}

/// An integer of up to 8 little-endian bytes.
fn word(bytes: &[u8]) -> u64 {
    bytes.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte))
}

fn as_f64(ty: NumberType, bytes: &[u8]) -> f64 {
    let word = word(bytes);
    match ty {
        NumberType::U8 | NumberType::U16 | NumberType::U32 | NumberType::U64 | NumberType::Char => word as f64,
        NumberType::I8 => f64::from(word as i8),
        NumberType::I16 => f64::from(word as i16),
        NumberType::I32 => f64::from(word as i32),
        NumberType::I64 => word as i64 as f64,
        NumberType::F32 => f64::from(f32::from_bits(word as u32)),
        NumberType::F64 => f64::from_bits(word),
    }
}

/// An affine map from the indices of a voxel in the source's array to a world.
#[derive(Debug, Clone, PartialEq, Encode, Decode)]
pub struct Orientation {
    /// The directions in which the world's axes ascend, such as `right-anterior-superior`; empty if unknown.
    pub space: String,
    /// World position of index (0, 0, 0).
    pub first: [f64; 3],
    /// World direction of each axis of the array, the fastest first. Often of length 1, but it need not be.
    pub directions: [[f64; 3]; 3],
    /// A step along each axis is its direction times this.
    pub spacing: [f64; 3],
}

impl Description {
    /// Encodes the record.
    ///
    /// # Errors
    /// [`Error::Invalid`] if it contradicts itself or the metadata, [`Error::TooLarge`] if it exceeds the limit.
    pub fn encode(&self, metadata: &Metadata) -> Result<Vec<u8>> {
        self.check(metadata).map_err(Error::Invalid)?;
        self.encoded()
    }

    /// The bytes of the record.
    fn encoded(&self) -> Result<Vec<u8>> {
        let bytes = encode(self, "description").map_err(Error::Invalid)?;
        let (size, limit) = (bytes.len() as u64, MAX_DESCRIPTION as u64);
        if size > limit {
            return Err(Error::TooLarge { what: "bytes of the description".into(), size, limit });
        }
        decode_exact::<Self>(&bytes, "description").map_err(Error::Invalid)?; // near the limit, decoding needs memory within it too
        Ok(bytes)
    }

    /// Whether the record can be stored in a file.
    ///
    /// # Errors
    /// As [`Self::encode`], without a look at the metadata.
    pub fn check_size(&self) -> Result<()> {
        self.encoded().map(drop)
    }

    /// Decodes and checks a record that must take up all of `bytes`, for the file with this metadata.
    ///
    /// # Errors
    /// [`Error::Invalid`] with the reason.
    pub fn decode(bytes: &[u8], metadata: &Metadata) -> Result<Self> {
        Self::parse(bytes, metadata).map_err(Error::Invalid)
    }

    pub(crate) fn parse(bytes: &[u8], metadata: &Metadata) -> ParseResult<Self> {
        let description: Self = decode_exact(bytes, "description")?;
        description.check(metadata)?;
        Ok(description)
    }

    fn check(&self, metadata: &Metadata) -> ParseResult {
        let attributes = self.variables.iter().map(|variable| variable.attributes.len()).sum::<usize>();
        let items = self.dimensions.len() + self.axes.len() + self.variables.len() + attributes;
        let items = items + self.attributes.len() + self.global.len();
        ensure(items <= MAX_DESCRIPTION_ITEMS, || format!("{items} items, at most {MAX_DESCRIPTION_ITEMS}"))?;
        self.check_axes(metadata)?;
        let named = |what: String, checked: ParseResult| checked.map_err(|e| format!("{what}: {e}"));
        for variable in &self.variables {
            named(format!("variable {}", variable.name), self.check_variable(variable, metadata))?;
        }
        let of_variables = self.variables.iter().flat_map(|variable| &variable.attributes);
        for attribute in self.attributes.iter().chain(&self.global).chain(of_variables) {
            let fixed = !matches!(attribute.value, Values::Times(_));
            named(format!("attribute {}", attribute.name), ensure(fixed, || "times are no value".into()))?;
            named(format!("attribute {}", attribute.name), attribute.value.check())?;
        }
        let finite = |o: &Orientation| {
            o.first.iter().chain(&o.spacing).chain(o.directions.iter().flatten()).all(|n| n.is_finite())
        };
        ensure(self.orientation.as_ref().is_none_or(finite), || "an orientation that is not finite".into())
    }

    fn check_axes(&self, metadata: &Metadata) -> ParseResult {
        for (number, axis) in self.axes.iter().enumerate() {
            let length = self.length(axis.dimension)?;
            let expected = match axis.role {
                AxisRole::Frames => metadata.frames,
                AxisRole::Single => 1,
                role => role.voxels().map_or(0, |axis| metadata.dims[axis]),
            };
            ensure(length == expected, || format!("axis {number} has {length} items instead of {expected}"))?;
            let earlier = self.axes[..number].iter();
            let twice = earlier.clone().any(|other| other.role == axis.role && axis.role != AxisRole::Single);
            let shared = earlier.clone().any(|other| other.dimension == axis.dimension);
            ensure(!twice && !shared, || format!("axis {number} repeats another"))?;
        }
        Ok(())
    }

    fn check_variable(&self, variable: &Variable, metadata: &Metadata) -> ParseResult {
        let lengths = variable.dimensions.iter().map(|dimension| self.length(*dimension));
        let count = lengths.clone().try_fold(1, |count: u64, n| Ok::<_, String>(count.saturating_mul(n?)))?;
        let held = match &variable.values {
            Values::Texts(texts) => texts.len() as u64,
            Values::Numbers(numbers) => numbers.count() as u64,
            Values::Times(_) => metadata.frames,
        };
        if matches!(variable.values, Values::Times(_)) {
            let of_frames = self.axes.iter().find(|axis| axis.role == AxisRole::Frames).map(|axis| axis.dimension);
            let is_along = variable.dimensions.iter().copied().eq(of_frames) || variable.dimensions.is_empty();
            ensure(is_along, || "times along another axis than that of frames".into())?;
        }
        variable.values.check()?;
        ensure(held == count, || format!("{held} values instead of {count}"))
    }

    fn length(&self, dimension: u32) -> ParseResult<u64> {
        let found = self.dimensions.get(dimension as usize).map(|dimension| dimension.length);
        found.ok_or_else(|| format!("there is no dimension {dimension}"))
    }
}

impl Values {
    /// One text.
    pub fn text(text: impl Into<String>) -> Self {
        Self::Texts(vec![text.into()])
    }

    /// Numbers of type [`NumberType::F64`].
    pub fn floats(numbers: &[f64]) -> Self {
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        Self::Numbers(Numbers::new(NumberType::F64, &bytes))
    }

    fn check(&self) -> ParseResult {
        match self {
            Self::Numbers(Numbers { ty, packed }) => {
                ensure(packed.len().is_multiple_of(ty.size()), || "a number is cut short".into())
            }
            Self::Texts(_) | Self::Times(_) => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::metadata;

    /// Four axes in an unusual order, a reversed one, and a variable of each kind.
    fn description() -> Description {
        let m = metadata();
        let dimension = |name: &str, length| Dimension { name: name.into(), length, unlimited: name == "time" };
        let lengths = [("x", m.dims[0]), ("time", m.frames), ("y", m.dims[1]), ("depth", m.dims[2]), ("nv", 2)];
        let roles = [AxisRole::X, AxisRole::Frames, AxisRole::Y, AxisRole::Z];
        let axis = |(dimension, role): (u32, AxisRole)| ArrayAxis { dimension, role, reversed: role == AxisRole::Y };
        let variable = |name: &str, dimensions: &[u32], values: Values| {
            let attributes = vec![Attribute { name: "units".into(), value: Values::text("m") }];
            Variable { name: name.into(), dimensions: dimensions.to_vec(), values, attributes }
        };
        let depths: Vec<f64> = (0..m.dims[2] * 2).map(|i| (i * i) as f64 / 8.0).collect();
        Description {
            source: "NetCDF".into(),
            dimensions: lengths.iter().map(|(name, length)| dimension(name, *length)).collect(),
            axes: (0..).zip(roles).map(axis).collect(),
            attributes: vec![Attribute { name: "valid".into(), value: Values::floats(&[0.5, 2.0]) }],
            global: vec![Attribute { name: "names".into(), value: Values::Texts(vec!["a".into(), String::new()]) }],
            variables: vec![
                variable("time", &[1], Values::Times(NumberType::I64)),
                variable("depth_bounds", &[3, 4], Values::floats(&depths)),
                variable("crs", &[], Values::Numbers(Numbers::new(NumberType::I32, &[7, 0, 0, 0]))),
            ],
            orientation: Some(Orientation {
                space: "RAS".into(),
                first: [1.0; 3],
                directions: [[0.5; 3]; 3],
                spacing: [2.0; 3],
            }),
        }
    }

    #[test]
    fn record_round_trips_and_survives_hostile_bytes() {
        let (metadata, description) = (metadata(), description());
        let bytes = description.encode(&metadata).expect("valid");
        assert_eq!(Description::parse(&bytes, &metadata).expect("whole"), description);
        assert!((0..bytes.len()).all(|len| Description::parse(&bytes[..len], &metadata).is_err()));
        for at in 0..bytes.len().saturating_sub(8) {
            let mut hostile = bytes.clone();
            hostile[at..at + 8].copy_from_slice(&u64::MAX.to_le_bytes());
            let _ = Description::parse(&hostile, &metadata);
        }
    }

    #[test]
    fn contradictions_are_refused() {
        type Change = fn(&mut Description);
        let changes: [(Change, &str); 9] = [
            (|d| d.variables[0].dimensions = vec![0], "times along another axis"),
            (|d| d.dimensions[0].length += 1, "axis 0 has"),
            (|d| d.axes[1].role = AxisRole::X, "axis 1"),
            (|d| d.axes[3].dimension = 9, "there is no dimension 9"),
            (|d| d.variables[0].dimensions.push(4), "variable time"),
            (|d| d.variables[2].values = Values::floats(&[]), "0 values instead of 1"),
            (|d| d.attributes[0].value = Values::Times(NumberType::F64), "attribute valid"),
            (|d| d.global = vec![d.global[0].clone(); MAX_DESCRIPTION_ITEMS], "items, at most"),
            (
                |d| {
                    d.orientation = Some(Orientation {
                        space: String::new(),
                        first: [f64::NAN; 3],
                        directions: [[0.0; 3]; 3],
                        spacing: [1.0; 3],
                    });
                },
                "finite",
            ),
        ];
        for (change, expected) in changes {
            let mut description = description();
            change(&mut description);
            let error = description.encode(&metadata()).expect_err(expected).to_string();
            assert!(error.contains(expected), "{error}");
        }
        let mut huge = description();
        huge.global = vec![Attribute { name: "long".into(), value: Values::text("x".repeat(MAX_DESCRIPTION)) }];
        assert!(huge.check_size().is_err());
    }

    #[test]
    fn numbers_keep_their_bits() {
        let numbers = [f64::NAN, -0.0, 1e300, 0.1, 0.2, 0.3].map(f64::to_le_bytes).concat();
        for ty in [NumberType::F64, NumberType::U8, NumberType::I16, NumberType::U32, NumberType::F32] {
            let packed = Numbers::new(ty, &numbers);
            assert_eq!((packed.bytes(), packed.count()), (numbers.clone(), numbers.len() / ty.size()));
        }
        assert_eq!(Numbers::new(NumberType::I16, &[0xff, 0xff, 2, 0]).to_f64(), [-1.0, 2.0]);
        assert_eq!(Numbers::new(NumberType::I64, &(-5_i64).to_le_bytes()).to_f64(), [-5.0]);
    }
}
