//! Positions along axes that fields of a request hold.

use std::fmt;
use std::str::FromStr;
use wavesplat_core::base::choice::serde_as_text;
use wavesplat_core::base::position::AxisPosition;

/// A plane across an axis: `AXIS=POSITION`.
#[derive(Debug, Clone, PartialEq)]
pub struct SliceSpec {
    /// The name of the axis.
    pub axis: String,
    /// Where the plane cuts it.
    pub position: AxisPosition,
}

impl FromStr for SliceSpec {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (axis, position) = text.split_once('=').ok_or("takes AXIS=PLACE, like x=0.5, z=#12 or lat=45")?;
        Ok(Self { axis: axis.into(), position: position.parse()? })
    }
}

impl fmt::Display for SliceSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.axis, self.position)
    }
}

/// A point: a position along each axis.
#[derive(Debug, Clone, PartialEq)]
pub struct PointSpec(pub [AxisPosition; 3]);

impl FromStr for PointSpec {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let positions = text.split(',').map(str::parse).collect::<std::result::Result<Vec<AxisPosition>, _>>()?;
        positions.try_into().map(Self).map_err(|_| "takes three places X,Y,Z, like 0.5,#12,120m".into())
    }
}

impl fmt::Display for PointSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [x, y, z] = &self.0;
        write!(f, "{x},{y},{z}")
    }
}

serde_as_text!(SliceSpec, PointSpec);
