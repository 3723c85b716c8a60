//! The pictures of a row: the options that suit an archive, and the colours of its pixels.

use crate::sheet::{Image, Rgb};
use wavesplat::base::error::{Error, Result};
use wavesplat::base::grid::Grid;
use wavesplat::colour::OpacityPoints;
use wavesplat::colour::{Clear, Distribution, Norm, Scale, TransferFunction};
use wavesplat::render::{Light, Mode, Surface};

const BACKGROUND: Rgb = [0; 3];
/// Rays reach the stated opacities over these shares of the volume's smallest extent: for haze, and for shells, which
/// rays leave sooner.
const HAZE: f64 = 1.0 / 8.0;
const SHELL: f64 = 1.0 / 32.0;
/// The shares of rays, by their largest sample, and of pixels, by their value, that lie within the range of colours.
/// The few others may be far brighter.
const OF_RAYS: f64 = 0.95;
const OF_PIXELS: f64 = 0.99;
/// A logarithmic norm starts at this share of the largest value: smaller values are too close to the error of
/// conversion.
const LEAST: f64 = 10.0 * super::TOLERANCE;
/// Opacities of values of one sign, as they are by default.
const RAMP: &str = "0:0,1:1";
/// Opacities of values of one sign: two shells.
const SHELLS: &str = "0.05:0,0.2:0.5,0.35:0,0.5:0,0.7:0.9,0.9:0";
/// Opacities of values of both signs: a shell on each side of 0 around values far from it.
const SHELLS_OF_BOTH: &str = "0:0.9,0.2:0,0.3:0.5,0.4:0,0.6:0,0.7:0.5,0.8:0,1:0.9";
/// Opacities of values of both signs: values far from 0 hide everything behind.
const BOTH_ENDS: &str = "0:1,0.5:0,1:1";

/// Settings that suit the samples of an archive.
pub(super) struct SampleStyle {
    /// Whether there are values on both sides of 0.
    both_signs: bool,
    /// The values of the first and the last colour of samples.
    pub(super) range: (f64, f64),
    /// The volume's smallest extent in world units.
    thickness: f64,
    /// The samples of the frame.
    samples: Distribution,
    /// The length of a path through the volume, in spacings.
    path: f64,
}

/// A picture of one mode.
pub(super) struct Tile {
    /// The options that give it.
    pub(super) label: String,
    pub(super) mode: Mode,
    /// Colours for pixels that are values; if samples are coloured, the map of their colours.
    pub(super) map: TransferFunction,
    norm: Norm,
}

impl SampleStyle {
    /// Settings for samples of a range. `largest` has the largest sample of each ray.
    pub(super) fn new((lo, hi): (f64, f64), (samples, largest): (Distribution, &[f32]), grid: &Grid) -> Self {
        let both_signs = lo < 0.0 && 0.0 < hi;
        let reached = spread(largest, OF_RAYS).1;
        let range = match both_signs {
            true if reached != 0.0 => (-reached.abs(), reached.abs()),
            true => (lo.min(-hi), hi.max(-lo)),
            false if lo < reached => (lo, reached),
            false if lo.is_finite() => (lo, lo + lo.abs().max(1.0)), // of one value: the first colour
            false => (0.0, 1.0),                                     // of nothing
        };
        let extent = [0, 1, 2].map(|a| grid.spacing[a] * grid.dims[a] as f64).into_iter();
        let path = extent.clone().product::<f64>().cbrt() / grid.largest_spacing();
        Self { both_signs, range, thickness: extent.fold(f64::INFINITY, f64::min), samples, path }
    }

    /// The choice for values of one sign, or of both.
    fn either<T>(&self, one: T, both: T) -> T {
        if self.both_signs { both } else { one }
    }

    /// All that one conversion of the samples gives.
    pub(super) fn tiles(&self) -> Result<Vec<Tile>> {
        let mip = Mode::Mip { slices: None };
        Ok(vec![
            Tile::of_values(Mode::Projection, "--colormap", self.either("viridis", "coolwarm"))?,
            self.other_colours()?,
            Tile::of_values(mip, "--mode mip --colormap", "inferno")?,
            self.composite(self.either(RAMP, BOTH_ENDS), HAZE)?,
            self.composite(self.either(SHELLS, SHELLS_OF_BOTH), SHELL)?,
            self.shaded()?,
            self.surfaces()?,
        ])
    }

    fn colours(&self) -> Result<TransferFunction> {
        TransferFunction::open(self.either("viridis", "coolwarm"))?.over(self.range)
    }

    /// Light on a composite with suggested opacities.
    fn shaded(&self) -> Result<Tile> {
        let points = self.samples.opacities(self.range, self.path);
        let transfer = self.colours()?.with_opacity(&points).map_err(Error::usage)?;
        let (map, light) = (transfer.clone(), Some(Light::default()));
        let mode = Mode::Composite { transfer, unit: None, slices: None, light, planes: Vec::new() };
        Ok(Tile { label: "--mode composite --opacity auto --shade".into(), mode, map, norm: Norm::Linear })
    }

    /// Two surfaces.
    fn surfaces(&self) -> Result<Tile> {
        let (map, (lo, hi)) = (self.colours()?, self.range);
        let surface = |share: f64| {
            let value = lo + share * (hi - lo);
            Surface { value, colour: map.colour(value).unwrap_or_default(), opacity: 0.6 }
        };
        let mode = Mode::Iso { surfaces: [0.3, 0.7].map(surface).to_vec(), light: Light::default(), slices: None };
        Ok(Tile { label: "--iso 30%,70%".into(), mode, map, norm: Norm::Linear })
    }

    /// The paper's way: colours before all else.
    pub(super) fn before_all(&self) -> Result<Tile> {
        let name = self.either("rainbow", "coolwarm");
        let map = TransferFunction::open(name)?.over(self.range)?;
        Ok(Tile { map, ..Tile::of_values(Mode::Projection, "convert --transfer-function", name)? })
    }

    /// A logarithm takes values above 0 alone.
    fn other_colours(&self) -> Result<Tile> {
        if self.range.0 < 0.0 {
            return Tile::of_values(Mode::Projection, "--colormap", "turbo");
        }
        Ok(Tile { norm: Norm::Log, ..Tile::of_values(Mode::Projection, "--norm log --colormap", "plasma")? })
    }

    fn composite(&self, opacity: &str, share: f64) -> Result<Tile> {
        let points: OpacityPoints = opacity.parse().map_err(Error::usage)?;
        let transfer = self.colours()?.with_opacity(&points.0).map_err(Error::usage)?;
        let unit = share * self.thickness;
        let options = format!("--mode composite --opacity-unit {} --opacity {opacity}", short(unit));
        let mode = Mode::Composite { transfer, unit: Some(unit), slices: None, light: None, planes: Vec::new() };
        Ok(Tile { label: options, mode, map: self.colours()?, norm: Norm::Linear })
    }
}

/// A number of three digits.
pub(super) fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.2e}").parse().unwrap_or(value);
    if rounded == 0.0 || (1e-3..1e4).contains(&rounded.abs()) { rounded.to_string() } else { format!("{rounded:e}") }
}

impl Tile {
    /// A tile with the colours of a map. The map's name is added to the options.
    fn of_values(mode: Mode, options: &str, map: &str) -> Result<Self> {
        let label = format!("{options} {map}");
        Ok(Self { label, mode, map: TransferFunction::open(map)?, norm: Norm::Linear })
    }

    /// The picture in colours: `side` rows of as many pixels, each of as many numbers as they come to.
    pub(super) fn image(&self, picture: &[f32], side: usize) -> Result<Image> {
        let numbers = picture.len() / (side * side);
        let range = if numbers == 1 { self.range(picture) } else { (0.0, 1.0) };
        let clear = Clear::empty_space(&Distribution::new(picture.to_vec()), range)
            .filter(|_| numbers == 1 && self.norm == Norm::Linear);
        let scale = Scale::new(&self.map, range, self.norm, BACKGROUND)?.with_clear(clear.map(|(clear, _)| clear));
        let pixels = picture.chunks_exact(numbers).map(|pixel| scale.colour_of_pixel(pixel)).collect();
        Ok(Image { width: side, height: side, pixels })
    }

    /// The values of the first and the last colour; to both sides of 0 alike where colours are.
    fn range(&self, picture: &[f32]) -> (f64, f64) {
        let (lo, hi) = spread(picture, OF_PIXELS);
        match self.norm {
            Norm::Log if hi > 0.0 => (lo.max(hi * LEAST), hi),
            Norm::Log => (0.5, 1.0), // of a picture of nothing
            Norm::Linear if self.map.is_diverging() => (-hi.max(-lo), hi.max(-lo)),
            Norm::Linear => (lo, hi),
        }
    }
}

/// The least of some values, and the value below which this share of them lies; 0 and 1 if there are none.
fn spread(values: &[f32], share: f64) -> (f64, f64) {
    let mut sorted: Vec<f32> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f32::total_cmp);
    let reached = sorted.get((sorted.len() as f64 * share) as usize);
    sorted.first().zip(reached).map_or((0.0, 1.0), |(lo, hi)| ((*lo).into(), (*hi).into()))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn look(range: (f64, f64), largest: &[f32]) -> SampleStyle {
        SampleStyle::new(range, (Distribution::new(largest.to_vec()), largest), &Grid::unit([9, 8, 4]))
    }

    #[test]
    fn values_of_both_signs_have_colours_and_opacities_on_both_sides() {
        let largest: Vec<f32> = (0..100).map(|n| n as f32).collect();
        assert_eq!(look((2.0, 1e9), &largest).range, (2.0, 95.0));
        assert_eq!(look((-9.0, -1.0), &[-9.0, -2.0]).range, (-9.0, -2.0));
        assert_eq!(look((-9.0, 1.0), &[0.0]).range, (-9.0, 9.0));
        assert_eq!(look((f64::INFINITY, f64::NEG_INFINITY), &[f32::NAN]).range, (0.0, 1.0));
        let both = look((-3.0, 1e9), &largest);
        assert_eq!(both.range, (-95.0, 95.0));
        let ends = |tile: &Tile| match &tile.mode {
            Mode::Composite { transfer, .. } => [-95.0, 0.0, 95.0].map(|v| transfer.opacity(v)),
            _ => panic!("{}", tile.label),
        };
        let tiles = both.tiles().unwrap();
        assert_eq!([ends(&tiles[3]), ends(&tiles[4])], [[1.0, 0.0, 1.0], [0.9, 0.0, 0.9]]);
        assert!(tiles[0].map.is_diverging() && tiles.iter().all(|tile| tile.norm == Norm::Linear));
    }

    #[test]
    fn empty_pictures_have_a_range_too() {
        for tile in look((7.0, 7.0), &[7.0, f32::NAN]).tiles().unwrap() {
            for picture in [[f32::NAN; 4], [7.0; 4], [-1.0; 4], [0.0; 4]] {
                assert_eq!(tile.image(&picture, 2).unwrap().pixels.len(), 4, "{}", tile.label);
            }
        }
    }

    #[test]
    fn a_few_pixels_may_be_far_brighter() {
        let mut values = vec![1.0_f32; 200];
        (values[3], values[7]) = (100.0, f32::NAN);
        assert_eq!((spread(&values, OF_PIXELS), spread(&[], OF_PIXELS)), ((1.0, 1.0), (0.0, 1.0)));
    }

    #[test]
    fn numbers_are_short() {
        assert_eq!([0.0, 0.00125, 5.0, -1.7543e6].map(short), ["0", "0.00125", "5", "-1.75e6"]);
    }
}
