//! Figure 5: a row for each method, and a row for the difference of each from the first.

use super::{Demo, Run};
use crate::sheet::{BACKGROUND, Image, Style, difference_colour, difference_images};
use wavesplat_core::base::error::Result;
use wavesplat_core::colour::{Norm, Scale, TransferFunction};
use wavesplat_core::source::CHANNELS;

/// The frames that are shown.
const SHOWN: [usize; 4] = [5, 10, 15, 20];
const STYLE: Style = Style::LIGHT;

/// Draws the runs with three channels. The first one is the reference.
pub(super) fn draw(demo: &Demo, runs: &[Run], colours: &TransferFunction) -> Result<()> {
    let means = Scale::new(colours, (0.0, 1.0), Norm::Linear, BACKGROUND)?;
    let bound = runs.iter().map(Run::bound).fold(0.0, f64::max);
    let [pictures, differences] = bars(colours.range().1, bound);
    let sheets = [
        STYLE.with_bar(&methods(demo, runs, &means), &pictures, |share| means.colour_at(share)),
        STYLE.with_bar(&errors(demo, runs, bound), &differences, difference_colour),
    ];
    STYLE.stacked(&sheets).save(&demo.figure(), true)
}

/// The labels of the bars of pictures and of differences.
fn bars(largest: f64, bound: f64) -> [[String; 3]; 2] {
    let pictures = [format!("{:.0} A/mm²", largest / 1e6), "|J|".into(), "0".into()];
    [pictures, [format!("{bound:.2}, the bound"), "difference".into(), "0".into()]]
}

/// A row for each method with its pictures of the shown frames.
fn methods(demo: &Demo, runs: &[Run], means: &Scale) -> Image {
    let [width, height] = demo.size;
    let mut rows = Vec::new();
    for (letter, run) in ('a'..).zip(runs) {
        let numbers = shown(run, demo.size);
        for (frame, picture) in SHOWN.iter().zip(numbers.as_chunks::<3>().0.chunks_exact(width * height)) {
            let image = Image::from_fn(width, height, |x, y| means.colour_of_pixel(&picture[y * width + x]));
            rows.push(named(&image, &format!("({letter}) {}, frame {frame}", run.name)));
        }
    }
    STYLE.contact_sheet(&rows, SHOWN.len())
}

/// A row for each other method with its differences from the first. A pixel shows its channel that differs most.
fn errors(demo: &Demo, runs: &[Run], bound: f64) -> Image {
    let truth = shown(&runs[0], demo.size);
    let mut rows = Vec::new();
    for (letter, run) in ('a'..).skip(runs.len()).zip(&runs[1..]) {
        let images = difference_images(&truth, &shown(run, demo.size), (demo.size, CHANNELS.len()), bound);
        for (frame, image) in SHOWN.iter().zip(images) {
            rows.push(named(&image, &format!("({letter}) |{} − (a)|, frame {frame}", run.name)));
        }
    }
    STYLE.contact_sheet(&rows, SHOWN.len())
}

fn named(image: &Image, name: &str) -> Image {
    STYLE.titled(image, &[name])
}

/// The shown frames of all pictures.
fn shown(run: &Run, [width, height]: [usize; 2]) -> Vec<f32> {
    let numbers = width * height * CHANNELS.len();
    SHOWN.iter().flat_map(|f| &run.pictures[f * numbers..(f + 1) * numbers]).copied().collect()
}
