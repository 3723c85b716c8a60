//! The pictures of a row: which options suit an archive, and how its pixels are coloured.

use crate::sheet::{Image, Rgb};
use wavesplat::cli::OpacityPoints;
use wavesplat::colour::{Norm, Scale, TransferFunction};
use wavesplat::error::{Error, Result};
use wavesplat::render::Mode;
use wavesplat::volume::Grid;

const BACKGROUND: Rgb = [0; 3];
/// A path through this share of the volume's least extent has the opacities that are asked for.
const OPACITY_UNIT: f64 = 1.0 / 8.0;
/// Attenuation by a factor of e takes this share of the volume's least extent.
const ATTENUATION: f64 = 0.5;
/// A logarithm shows no more than so much below the largest.
const DECADES: f64 = 1e-4;
/// Opacities of values of one sign, as they are by default.
const RAMP: &str = "0:0,1:1";
/// Opacities of values of one sign: two shells.
const SHELLS: &str = "0:0,0.2:0,0.25:0.4,0.3:0,0.6:0,0.65:0.8,0.7:0";
/// Of values of both signs: a shell in the middle of each half, and all beyond another.
const SHELLS_OF_BOTH: &str = "0.1:0.8,0.15:0,0.3:0,0.35:0.4,0.4:0,0.6:0,0.65:0.4,0.7:0,0.85:0,0.9:0.8";
/// Of values of both signs: what is far from 0 hides what is behind.
const BOTH_ENDS: &str = "0:1,0.5:0,1:1";

/// What suits the samples of an archive.
pub(super) struct Look {
    /// Whether there are values on both sides of 0.
    both_signs: bool,
    /// The values of the first and the last colour of samples.
    pub(super) range: (f64, f64),
    /// World units.
    thickness: f64,
}

/// A picture of one mode.
pub(super) struct Tile {
    /// The options that give it.
    pub(super) label: String,
    pub(super) mode: Mode,
    /// Attenuation of a projection.
    pub(super) tau: f64,
    /// Of pixels that are values; where samples are coloured, what gives them their colours.
    pub(super) map: TransferFunction,
    norm: Norm,
}

impl Look {
    /// For samples of a range, of which most rays meet no more than `reached`.
    pub(super) fn new((lo, hi): (f64, f64), reached: f64, grid: &Grid) -> Self {
        let both_signs = lo < 0.0 && 0.0 < hi;
        let top = if lo < reached { reached } else { lo + lo.abs().max(1.0) };
        let range = if both_signs { (-top.abs(), top.abs()) } else { (lo, top) };
        let extent = (0..3).map(|a| grid.spacing[a] * grid.dims[a] as f64);
        Self { both_signs, range, thickness: extent.fold(f64::INFINITY, f64::min) }
    }

    /// What suits values of one sign, or of both.
    fn either<T>(&self, one: T, both: T) -> T {
        if self.both_signs { both } else { one }
    }

    /// All that one conversion of the samples gives.
    pub(super) fn tiles(&self) -> Result<Vec<Tile>> {
        let mip = Mode::Mip { slabs: None };
        Ok(vec![
            Tile::of_values(Mode::Projection, "--colormap", self.either("viridis", "coolwarm"))?,
            if self.both_signs { self.attenuated()? } else { Self::logarithm()? },
            Tile::of_values(mip, "--mode mip --colormap", "inferno")?,
            self.composite(self.either(RAMP, BOTH_ENDS))?,
            self.composite(self.either(SHELLS, SHELLS_OF_BOTH))?,
        ])
    }

    /// The paper's way: colours before all else.
    pub(super) fn before_all(&self) -> Result<Tile> {
        let name = self.either("rainbow", "coolwarm");
        let map = TransferFunction::open(name)?.over(self.range)?;
        Ok(Tile { map, ..Tile::of_values(Mode::Projection, "convert --transfer-function", name)? })
    }

    fn logarithm() -> Result<Tile> {
        Ok(Tile { norm: Norm::Log, ..Tile::of_values(Mode::Projection, "--norm log --colormap", "turbo")? })
    }

    fn attenuated(&self) -> Result<Tile> {
        let tau = 1.0 / (ATTENUATION * self.thickness);
        let options = format!("--tau {} --colormap", short(tau));
        Ok(Tile { tau, ..Tile::of_values(Mode::Projection, &options, "coolwarm")? })
    }

    fn composite(&self, opacity: &str) -> Result<Tile> {
        let name = self.either("viridis", "coolwarm");
        let points: OpacityPoints = opacity.parse().map_err(Error::usage)?;
        let transfer = TransferFunction::open(name)?.over(self.range)?;
        let transfer = transfer.with_opacity(&points.0).map_err(Error::usage)?;
        let unit = OPACITY_UNIT * self.thickness;
        let options = format!("--mode composite --opacity-unit {} --opacity {opacity}", short(unit));
        let mode = Mode::Composite { transfer, unit: Some(unit), slabs: None };
        let map = TransferFunction::open(name)?;
        Ok(Tile { label: options, mode, tau: 0.0, map, norm: Norm::Linear })
    }
}

/// A number of three digits.
fn short(value: f64) -> String {
    let rounded: f64 = format!("{value:.2e}").parse().unwrap_or(value);
    rounded.to_string()
}

impl Tile {
    /// With the colours of a map, whose name ends the options.
    fn of_values(mode: Mode, options: &str, map: &str) -> Result<Self> {
        let label = format!("{options} {map}");
        Ok(Self { label, mode, tau: 0.0, map: TransferFunction::open(map)?, norm: Norm::Linear })
    }

    /// The picture in colours: a row has `width` pixels, of as many numbers as they come to.
    pub(super) fn image(&self, picture: &[f32], side: usize) -> Result<Image> {
        let numbers = picture.len() / (side * side);
        let range = if numbers == 1 { self.range(picture) } else { (0.0, 1.0) };
        let scale = Scale::new(&self.map, range, self.norm, BACKGROUND)?;
        let pixels = picture.chunks_exact(numbers).map(|pixel| scale.colour_of_pixel(pixel)).collect();
        Ok(Image { width: side, height: side, pixels })
    }

    /// The values of the first and the last colour: all that there are, to both sides of 0 alike where colours are.
    fn range(&self, picture: &[f32]) -> (f64, f64) {
        let values = || picture.iter().filter(|v| v.is_finite()).map(|v| f64::from(*v));
        let (lo, hi) = (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        match (lo <= hi, self.norm) {
            (false, _) => (0.5, 1.0), // of a picture of nothing
            (_, Norm::Log) if hi > 0.0 => (values().filter(|v| *v > 0.0).fold(hi, f64::min).max(hi * DECADES), hi),
            (_, Norm::Log) => (0.5, 1.0),
            _ if self.map.is_diverging() => (-hi.max(-lo), hi.max(-lo)),
            _ => (lo, hi),
        }
    }
}
