//! From a request to pictures, partial sums or time series: what `wavesplat-render`, the viewer and Python share.
//!
//! A [`PictureRequest`] says what is asked for, in plain data. A [`Session`] holds the inputs of pictures. [`run()`]
//! resolves the request against it (`plan`), renders and writes.
//!
//! To add an option of pictures:
//!
//! 1. Add its field and default to [`PictureRequest`] (`request.rs`), and say there which fields exclude it.
//! 2. Add the option to a group in `cli/render/groups.rs`, and the field to `Cli::request` (`cli/render/args.rs`).
//! 3. Use the field in the step of `plan` that it concerns: the steps are listed in `plan/mod.rs`.
//! 4. Test it in `tests/cli`, and name it in `tools/guide/pictures.md`. Python takes the field as a keyword.
//!
//! If partial sums must agree on it, add it to `PictureSetup` (`engine/render/partial/head.rs`); if a picture's text must
//! tell it, to `plan/provenance.rs`; if the viewer changes it, to `FIELDS` in `view_request.rs`, and to `request` and `state` in
//! `engine/render/page/web/live.js` and `restore` in `steer.js`.
//!
//! To add a mode, that is, another kind of picture:
//!
//! 1. Implement `Renderer` (`engine/render/renderer.rs`) in a folder of `engine/render`, and choose it by its variant of
//!    `Mode` in `engine/render/mod.rs`.
//! 2. Add its name to [`values::ModeName`], and make the variant from the request in `plan/modes.rs`. The compiler then
//!    lists the steps of `plan` that must know it.
//! 3. For the viewer, add it to `controls.html` with an icon of `page.html`, to `steer.js`, and its colours to `coloursOf` in `live.js`
//!    (`engine/render/page/web`).

mod reporter;
pub mod values;
mod request;
mod distributions;
mod session;
mod plan;
mod report;
mod partial;
mod series;
mod run;
mod view_request;
mod viewer;
mod question;
#[cfg(not(target_family = "wasm"))] // it holds the program for browsers
mod whole_page;

pub use question::Question;
pub use report::Outcome;
pub use reporter::{Caller, Reporter};
pub use request::PictureRequest;
pub use run::run;
pub use session::{Inputs, Session};
pub use view_request::ViewRequest;
pub use viewer::ViewerSession;
#[cfg(not(target_family = "wasm"))]
pub use whole_page::{write_page, write_site};

pub use plan::named_colours::{colours_of_source, open_colours};
pub use request::{MOST_VIEWS, check_fps, check_speed, exclude, is_field};
pub use session::is_coefficient_name;
