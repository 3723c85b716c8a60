//! From a request to pictures, partial sums or time series: what `wavesplat-render`, the viewer and Python share.
//!
//! A [`PictureRequest`] says what is asked for, in plain data. A [`Session`] holds the inputs of pictures. [`run()`]
//! resolves the request against it (`plan`), renders and writes.

mod reporter;
pub mod values;
mod request;
mod session;
mod plan;
mod report;
mod partial;
mod series;
mod run;
mod view_request;
mod viewer;

pub use report::Outcome;
pub use reporter::{Caller, Reporter};
pub use request::{PictureRequest, option};
pub use run::run;
pub use session::{Inputs, Session};
pub use view_request::ViewRequest;
pub use viewer::{Saved, ViewerSession};

pub use plan::named_colours::{colours_of_source, open_colours};
pub use request::{MOST_VIEWS, check_fps, check_speed, exclude, is_field};
pub use session::is_coefficient_name;
