//! `wavesplat view` and pages of pictures, in a browser and from the outside.

mod browser; // helper: a browser without a window
mod controls; // controls of the page: colours, opacities, slices, keys, saving
mod crowds; // many clients: those without the token, and those that do not read
mod foreign_requests; // requests that no page of the viewer sends
mod interaction; // dragging, the wheel, keys, sliders, playing
mod pages; // pages that hold their pictures
mod pixels_match_program; // pixels of the page are those of `wavesplat-render`
mod random_actions; // a thousand actions, reloads and links
mod request_priority; // which request is answered first
mod running_viewer; // helper: a running `wavesplat view`
mod whole_pages; // pages that need no server

use crate::cli::{Archive, Work};

/// A small archive, converted to `a.wspl` with these options.
fn converted(options: &str) -> Work {
    converted_from(&Archive::smooth([24, 20, 16], 12), options)
}

fn converted_from(archive: &Archive, options: &str) -> Work {
    let work = Work::new();
    work.write("a.npy", archive.npy());
    work.wavesplat(&format!("convert a.npy -o a.wspl {options}")).ok();
    work
}
