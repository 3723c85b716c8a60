//! Annotations drawn into pictures: the box of the volume, values along its edges, a colour bar, and the time of the frame.
//!
//! The box and the axes lie behind the picture; everything else lies in the margins that [`margins`] gives. A part that does not fit
//! is left out.

mod text;
mod ticks;
mod canvas;
mod layout;
mod title;
mod volume;
mod axis;
mod bar;

pub use canvas::over;
pub use layout::{Margins, Parts, line, margins};
pub use text::Letters;
pub use ticks::round_values;
pub use volume::{AxisLabels, VolumeAxes};

use crate::render::{Surface, ViewReport};
use canvas::{Canvas, Rectangle};
use layout::{has_axes, has_bar, has_time};
use title::Title;
use wavesplat_core::base::grid::Grid;
use wavesplat_core::base::time_labels::TimeLabels;
use wavesplat_core::colour::{Rgb, Scale};
use wavesplat_core::view::camera::{Camera, View};

/// The annotations of a run's pictures.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Annotation {
    /// The parts that are drawn.
    pub parts: Parts,
    /// A title above the volume, or empty.
    pub title: String,
    /// Name and unit of the values, beside the colour bar; or empty.
    pub values: String,
    /// The times of frames. Frames without a time show their number.
    pub times: TimeLabels,
    /// The axes of the volume, for its box and the values along it.
    pub axes: Option<VolumeAxes>,
    /// The isosurfaces, which are listed instead of a colour bar.
    pub surfaces: Vec<Surface>,
    /// The slices that share each picture; none if it has one view.
    pub panels: Vec<Panel>,
}

/// A slice in its own part of the picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Panel {
    /// The view whose picture has it there.
    pub view: View,
    /// The axis that it cuts.
    pub axis: usize,
    /// Where it cuts the axis, in voxels.
    pub at: f64,
}

/// A finished picture, in which annotations are drawn.
pub(crate) struct Finished<'a> {
    pub(crate) pixels: &'a mut [Rgb],
    /// Width and height in pixels.
    pub(crate) size: [usize; 2],
    pub(crate) background: Rgb,
    pub(crate) frame: usize,
    pub(crate) view: Option<&'a ViewReport>,
    /// Whether the picture says from where it is seen.
    pub(crate) with_angles: bool,
    /// The colours of values, for a colour bar.
    pub(crate) scale: Option<&'a Scale>,
    /// How opaque each pixel is, 0 to 1.
    pub(crate) opacity: &'a dyn Fn(usize) -> f64,
}

impl Annotation {
    /// The labels of a picture, from the longest to the shortest: time and angles, or the time alone.
    fn labels(&self, frame: usize, angles: Option<&ViewReport>) -> Vec<String> {
        let times = if self.parts.time { self.stamps(frame).to_vec() } else { Vec::new() };
        let angles = angles.map(angles_of);
        let both = angles.iter().flat_map(|angles| times.iter().map(move |time| format!("{time}   {angles}")));
        both.chain(angles.clone()).chain(times.iter().cloned()).collect()
    }

    /// The time of a frame, or its number.
    pub fn stamp(&self, frame: usize) -> String {
        let [long, _] = self.stamps(frame);
        long
    }

    /// The long and the short label of a frame.
    fn stamps(&self, frame: usize) -> [String; 2] {
        if let Some(date) = self.times.date(frame) {
            let day = date.split(' ').next().unwrap_or_default().to_string();
            return [date, day];
        }
        match (self.times.text(frame), self.times.number(frame)) {
            (Some(long), Some(short)) => [format!("t = {long}"), format!("t = {short}")],
            _ => [format!("frame {frame}"), format!("{frame}")],
        }
    }

    /// Draws all parts. Returns the places of texts and of the colour bar.
    pub(crate) fn draw(&self, picture: Finished<'_>) -> Vec<Rectangle> {
        let Finished { pixels, size, background, frame, view, with_angles, scale, opacity } = picture;
        let mut canvas = Canvas::new(pixels, size, background);
        if has_time(size) {
            self.draw_texts(&mut canvas, frame, view.filter(|_| with_angles));
        }
        if let Some(scale) = scale.filter(|_| self.parts.bar && has_bar(size)) {
            match self.surfaces[..] {
                [] => bar::draw(&mut canvas, scale, &self.values),
                _ => bar::draw_surfaces(&mut canvas, &self.surfaces, &self.values),
            }
        }
        if let (Some(axes), Some(view)) = (&self.axes, view) {
            self.draw_volumes(&mut canvas, axes, view, size, opacity);
        }
        canvas.taken
    }

    /// Draws the box and the axes, which are the same for all frames of a view, as if nothing lay in front of them.
    pub(crate) fn draw_still(&self, pixels: &mut [Rgb], size: [usize; 2], background: Rgb, view: &ViewReport) {
        let mut canvas = Canvas::new(pixels, size, background);
        if let Some(axes) = &self.axes {
            self.draw_volumes(&mut canvas, axes, view, size, &|_| 0.0);
        }
    }

    /// The box and the axes of each panel, or of the only view.
    fn draw_volumes(
        &self,
        canvas: &mut Canvas<'_>,
        axes: &VolumeAxes,
        view: &ViewReport,
        size: [usize; 2],
        opacity: &dyn Fn(usize) -> f64,
    ) {
        if self.panels.is_empty() {
            let camera = camera(&axes.grid, size, view);
            camera.iter().for_each(|camera| draw_volume(self.parts, canvas, axes, camera, opacity));
        }
        for (n, panel) in self.panels.iter().enumerate() {
            let Ok(camera) = Camera::new(&panel.view, &axes.grid) else { continue };
            if self.parts.axes && has_axes(size) {
                axes.write_place(canvas, &camera, panel);
            }
            let parts = Parts { triad: false, scale: self.parts.scale && n == 0, ..self.parts };
            draw_volume(parts, canvas, axes, &camera, opacity);
        }
    }

    /// The title at the top, and the longest of the labels that fits at the top left.
    fn draw_texts(&self, canvas: &mut Canvas<'_>, frame: usize, angles: Option<&ViewReport>) {
        let size = canvas.letters.size;
        for text in self.labels(frame, angles) {
            let half = canvas.letters.width(&text) / 2.0;
            if canvas.write(&text, [SIDE * size + half, size]) {
                break;
            }
        }
        if let Some(title) = self.placed_title(&canvas.letters, canvas.size()[0], frame, angles) {
            title.write(canvas, size);
        }
    }

    /// Where the title stands: at the same place for all frames.
    fn placed_title(&self, letters: &Letters, width: f64, frame: usize, angles: Option<&ViewReport>) -> Option<Title> {
        let side = SIDE * letters.size;
        let fits = |text: &String| side + letters.width(text) <= width;
        let ends = |frame: usize| self.labels(frame, angles).into_iter().find(fits).map(|text| letters.width(&text));
        let longest = [frame].into_iter().chain(self.some_frames()).filter_map(ends).fold(0.0, f64::max);
        let left = if longest > 0.0 { longest + side + letters.size } else { side };
        Title::new(&self.title, letters, width, [left, width - side])
    }

    /// Frames among which one has about the longest label.
    fn some_frames(&self) -> impl Iterator<Item = usize> {
        const FRAMES: usize = 32;
        let count = self.times.times().len();
        let step = count.div_ceil(FRAMES).max(1);
        (0..count).step_by(step).chain(count.checked_sub(1)).chain((count == 0).then_some(999))
    }

    /// The beginning of the title that pictures of a size show, if they do not show it whole.
    pub fn cut_title(&self, size: [usize; 2], frame: usize) -> Option<String> {
        let letters = Letters::new(layout::line(size));
        let title = self.placed_title(&letters, size[0] as f64, frame, None).filter(|_| has_time(size))?;
        Some(title.text).filter(|text| *text != self.title)
    }
}

/// The box behind the picture, and the axes beside it.
fn draw_volume(
    parts: Parts,
    canvas: &mut Canvas<'_>,
    axes: &VolumeAxes,
    camera: &Camera,
    opacity: &dyn Fn(usize) -> f64,
) {
    if parts.bounds {
        let (size, ink, width) = (canvas.letters.size, canvas.ink, canvas.width);
        let mut shares = vec![0.0_f64; canvas.pixels.len()];
        axes.draw_box(camera, size, |x, y, share| {
            let at = y as usize * width + x as usize;
            shares[at] = shares[at].max(share);
        });
        for (at, share) in shares.into_iter().enumerate().filter(|(_, share)| *share > 0.0) {
            if canvas.is_taken(at) {
                continue;
            }
            canvas.pixels[at] = over(canvas.pixels[at], ink, BOX * share * (1.0 - opacity(at)));
        }
    }
    if parts.scale && has_bar(camera.size) {
        axes.draw_scale(canvas, camera);
    }
    if has_axes(camera.size) {
        behind(canvas, opacity, |canvas| {
            if parts.axes {
                axes.draw_axes(canvas, camera);
            }
            if parts.triad {
                axes.draw_triad(canvas, camera);
            }
        });
    }
}

/// From where a view is seen, in letters.
pub(crate) fn angles_of(view: &ViewReport) -> String {
    format!("{}°, {}°", volume::text(view.azimuth), volume::text(view.elevation))
}

/// Draws behind the picture, so that it shows where the picture is transparent.
fn behind(canvas: &mut Canvas<'_>, opacity: &dyn Fn(usize) -> f64, draw: impl FnOnce(&mut Canvas<'_>)) {
    let (before, texts) = (canvas.pixels.to_vec(), canvas.taken.clone());
    draw(canvas);
    let drawn = std::mem::replace(&mut canvas.taken, texts);
    for (at, before) in before.into_iter().enumerate() {
        if canvas.pixels[at] != before {
            let share = if canvas.is_taken(at) { 0.0 } else { 1.0 - opacity(at) };
            canvas.pixels[at] = over(before, canvas.pixels[at], share);
        }
    }
    canvas.taken = drawn;
}

/// The distance of texts from the side of a picture, in lines of letters.
const SIDE: f64 = 0.6;

/// How much lines of the box differ from the background.
const BOX: f64 = 0.6;

/// The camera of a view.
pub(crate) fn camera(grid: &Grid, size: [usize; 2], view: &ViewReport) -> Option<Camera> {
    let &ViewReport { azimuth, elevation, roll, scale, center, .. } = view;
    let view = View { azimuth, elevation, roll, size, scale: Some(scale), center: Some(center) };
    Camera::new(&view, grid).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use wavesplat_core::colour::{Norm, TransferFunction};

    fn scale(range: (f64, f64), norm: Norm) -> Scale {
        let map = TransferFunction::open("rainbow").expect("a known map");
        Scale::new(&map, range, norm, [9; 3]).expect("a range")
    }

    fn annotation() -> Annotation {
        let grid = Grid::unit([20, 10, 15]);
        let axes = VolumeAxes { grid, region: grid.whole(), rim: 0.0, exaggeration: 1.0, labels: Default::default() };
        let (title, values) = ("a run".into(), "speed (m s⁻¹)".into());
        Annotation { parts: Parts::ALL, title, values, axes: Some(axes), ..Annotation::default() }
    }

    fn drawn(annotation: &Annotation, size: [usize; 2], scale: Option<&Scale>) -> Vec<Rgb> {
        let mut pixels = vec![[9; 3]; size[0] * size[1]];
        let view = ViewReport { azimuth: 30.0, elevation: 20.0, scale: 0.02 * size[0] as f64, ..ViewReport::default() };
        let (background, opacity) = ([9; 3], |_| 0.0);
        let picture = Finished {
            pixels: &mut pixels,
            size,
            background,
            frame: 12,
            view: Some(&view),
            with_angles: false,
            scale,
            opacity: &opacity,
        };
        annotation.draw(picture);
        pixels
    }

    #[test]
    fn a_bar_has_the_last_colour_at_its_top_and_the_first_at_its_bottom() {
        let pixels = drawn(&annotation(), [200, 160], Some(&scale((0.0, 1.0), Norm::Linear)));
        let row = |colour: Rgb| pixels.iter().position(|pixel| *pixel == colour).expect("the colour") / 200;
        assert!(row([255, 0, 0]) < row([0, 0, 255]));
    }

    #[test]
    fn pictures_of_any_size_take_what_fits() {
        let (annotation, linear) = (annotation(), scale((-1e300, 1e300), Norm::Linear));
        for (width, height) in (1..90).flat_map(|w| [(w, 90), (90, w), (w, w), (w, 1), (1, w)]) {
            drawn(&annotation, [width, height], Some(&linear));
        }
        for (range, norm) in [((2.0, 2.0), Norm::Linear), ((1e6, 1e6 + 1.0), Norm::Linear), ((1e-3, 1e3), Norm::Log)] {
            assert!(drawn(&annotation, [300, 200], Some(&scale(range, norm))).iter().any(|pixel| *pixel != [9; 3]));
        }
        let none = Annotation { parts: Parts::NONE, title: String::new(), ..annotation };
        assert!(drawn(&none, [300, 200], Some(&linear)).iter().all(|pixel| *pixel == [9; 3]), "nothing is drawn");
    }

    /// Angles and sizes that differ from case to case.
    fn cases() -> impl Iterator<Item = ([usize; 2], ViewReport)> {
        (0..400_u32).map(|n| {
            let part = |step: f64| (f64::from(n) * step).fract();
            let size = [part(0.618), part(0.755)].map(|share| 60 + (share * 700.0) as usize);
            let scale = (0.005 + 0.06 * part(0.569)) * size[0] as f64;
            let (azimuth, elevation) = (360.0 * part(0.324), 180.0 * part(0.471) - 90.0);
            (size, ViewReport { azimuth, elevation, scale, ..ViewReport::default() })
        })
    }

    #[test]
    fn texts_never_overlap() {
        let (annotation, scale) = (annotation(), scale((-3e-5, 2e-5), Norm::Linear));
        for (size, view) in cases() {
            let mut pixels = vec![[9; 3]; size[0] * size[1]];
            let (background, opacity) = ([9; 3], |_: usize| 0.0);
            let (view, scale) = (Some(&view), Some(&scale));
            let picture = Finished {
                pixels: &mut pixels,
                size,
                background,
                frame: 1234,
                view,
                with_angles: true,
                scale,
                opacity: &opacity,
            };
            let taken = annotation.draw(picture);
            for (n, a) in taken.iter().enumerate() {
                let within = (0..2).all(|i| a[0][i] >= 0.0 && a[1][i] <= size[i] as f64);
                let alone = taken[n + 1..].iter().all(|b| (0..2).any(|i| a[1][i] <= b[0][i] || b[1][i] <= a[0][i]));
                assert!(within && alone, "{size:?} {view:?}: {taken:?}");
            }
        }
    }

    #[test]
    fn the_box_lies_behind_the_picture() {
        let annotation =
            Annotation { parts: Parts { bounds: true, ..Parts::NONE }, title: String::new(), ..annotation() };
        let size = [120, 100];
        let view = ViewReport { azimuth: 30.0, elevation: 20.0, scale: 3.0, ..ViewReport::default() };
        let changed = |opaque: f64| {
            let (mut pixels, opacity) = (vec![[9; 3]; size[0] * size[1]], |_: usize| opaque);
            let picture = Finished {
                pixels: &mut pixels,
                size,
                background: [9; 3],
                frame: 0,
                view: Some(&view),
                with_angles: false,
                scale: None,
                opacity: &opacity,
            };
            annotation.draw(picture);
            pixels.iter().map(|pixel| usize::from(pixel[0] - 9)).sum::<usize>()
        };
        assert!(changed(1.0) == 0 && changed(0.5) > 0 && changed(0.0) > changed(0.5));
    }

    #[test]
    fn frames_show_their_time_or_their_number() {
        let stamps = |unit: Option<&str>| {
            let times = vec![0.0, 0.0125, 0.1 + 0.2, 1_051_956.0];
            let timed = Annotation { times: TimeLabels::new(times, unit, None), ..Annotation::default() };
            (0..5).map(|frame| timed.stamps(frame)).collect::<Vec<_>>()
        };
        let long = |unit| stamps(unit).into_iter().map(|[long, _]| long).collect::<Vec<_>>();
        assert_eq!(long(None), ["t = 0", "t = 0.0125", "t = 0.3", "t = 1051956", "frame 4"]);
        assert_eq!(stamps(Some("s"))[1], ["t = 0.0125 s", "t = 0.0125"]);
        assert_eq!(stamps(Some("hours since 1900-01-01"))[3], ["2020-01-03 12:00:00", "2020-01-03"]);
        assert_eq!(long(Some("months since 1900-01-01"))[1], "t = 0.0125 months since 1900-01-01");
    }
}
