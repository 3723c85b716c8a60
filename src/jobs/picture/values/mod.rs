//! Values of a request, each with the text that options and files of options accept.

mod automatic;
mod choices;
mod hex_colour;
mod position;
mod surfaces;
mod view_angles;

pub use automatic::{BeyondSpec, ClearSpec, Detail, Exaggeration};
pub use choices::{Convention, ModeName, Theme};
pub use hex_colour::HexColour;
pub use position::{PointSpec, SliceSpec};
pub use surfaces::SurfaceList;
pub use view_angles::ViewAngles;
