//! Light on the cells of a slice: sixteen gradients at a time.
//!
//! The gradient of the field is that of its kernels, exactly: with S and P the sums of the weights times the values, and
//! of the weights of present samples,
//!
//! ```text
//! g = S / P        grad g = (grad S - g grad P) / P                                                       (eq 41)
//! ```
//!
//! Where a composite has hardly any gradient g', its direction means nothing. There the colours stay as they are: light
//! counts by the share g'^2 / (g'^2 + faint^2).

use super::GROUP;
use super::filter::Sixteen;
use super::view::SlicedView;
use crate::render::light::Light;

/// The light of one view.
#[derive(Debug, Clone, Copy)]
pub(in crate::render) struct Shader {
    light: Light,
    /// The change per world unit for a change per voxel along b, c and a.
    per: [f32; 3],
    /// Directions to the lamp, to the middle between lamp and viewer, and to the viewer, along b, c and a.
    to_lamp: [f32; 3],
    to_middle: [f32; 3],
    to_viewer: [f32; 3],
    /// The square of a gradient that half counts.
    faint: f32,
}

/// How much of a colour each cell shows, and the white light added to it.
pub(super) struct Lit {
    pub(super) colour: Sixteen,
    pub(super) gloss: Sixteen,
}

impl Shader {
    /// The light of a view. A gradient of `faint` per world unit half counts; surfaces have none.
    pub(in crate::render) fn new(light: Light, view: &SlicedView, faint: f64) -> Self {
        let (to_lamp, to_viewer) = (view.camera.towards(light.azimuth, light.elevation), view.camera.towards(0.0, 0.0));
        let middle: [f64; 3] = std::array::from_fn(|i| to_lamp[i] + to_viewer[i]);
        let length = middle.iter().map(|n| n * n).sum::<f64>().sqrt().max(f64::MIN_POSITIVE);
        let along = |direction: [f64; 3]| view.shear.axes.map(|axis| direction[axis] as f32);
        Self {
            light,
            per: view.per_world_unit().map(|per| per as f32),
            to_lamp: along(to_lamp),
            to_middle: along(middle.map(|n| n / length)),
            to_viewer: along(to_viewer),
            faint: (faint * faint) as f32,
        }
    }

    /// The light of sixteen cells with these gradients per voxel (eq 42).
    #[inline(always)]
    pub(super) fn shade(&self, gradient: &[Sixteen; 3]) -> Lit {
        let mut lit = Lit { colour: [1.0; GROUP], gloss: [0.0; GROUP] };
        let [b, c, a] = gradient;
        for i in 0..GROUP {
            [lit.colour[i], lit.gloss[i]] = self.shade_cell([b[i], c[i], a[i]]);
        }
        lit
    }

    /// The same for one gradient.
    pub(super) fn shade_one(&self, gradient: [f64; 3]) -> [f64; 2] {
        // A direction of the middle size of numbers: squares of others may not be numbers.
        let most = gradient.iter().fold(0.0, |most: f64, n| most.max(n.abs()));
        let scaled = if self.faint == 0.0 && most > 0.0 { gradient.map(|n| n / most) } else { gradient };
        self.shade_cell(scaled.map(|n| n as f32)).map(f64::from)
    }

    #[inline(always)]
    fn shade_cell(&self, gradient: [f32; 3]) -> [f32; 2] {
        let Light { ambient, diffuse, specular, .. } = self.light;
        let [ambient, diffuse, specular] = [ambient, diffuse, specular].map(|part| part as f32);
        let slope = [gradient[0] * self.per[0], gradient[1] * self.per[1], gradient[2] * self.per[2]];
        let square = dot(slope, slope);
        let length = square.max(f32::MIN_POSITIVE).sqrt();
        let turned = if dot(slope, self.to_viewer) < 0.0 { -1.0 } else { 1.0 } / length;
        let lamp = (dot(slope, self.to_lamp) * turned).max(0.0);
        let share = square / (square + self.faint).max(f32::MIN_POSITIVE);
        let gloss = share * specular * thirty_second((dot(slope, self.to_middle) * turned).max(0.0));
        [1.0 + share * (ambient + diffuse * lamp - 1.0), gloss]
    }
}

#[inline(always)]
fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The 32nd power.
#[inline(always)]
fn thirty_second(number: f32) -> f32 {
    let fourth = (number * number) * (number * number);
    let sixteenth = (fourth * fourth) * (fourth * fourth);
    sixteenth * sixteenth
}
