//! `wavesplat view` and pages of pictures, in a browser and from the outside.

mod browser;
mod controls;
mod hands;
mod pages;
mod pixels;
mod requests;
mod served;
mod turns;

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
