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

    /// How far the share of the colour and the gloss of a cell may be off, if its gradient per voxel may be off by a vector of the length
    /// `off` per world unit. Where it may be turned to the other side, nothing is known of its direction.
    #[inline(always)]
    pub(super) fn doubt(&self, gradient: [f32; 3], off: f32) -> [f32; 2] {
        let slope = self.per_world_unit(gradient);
        let facing = dot(slope, self.to_viewer);
        self.doubt_of_side(slope, sign_of_seen(facing), off, facing.abs() > off)
    }

    /// [`Self::doubt`] for a gradient of this sign per world unit.
    ///
    /// The directions of two vectors x and y differ by at most 2 |x - y| / (|x| + |y|) ([Dunkl](wavesplat_core::bibliography)).
    #[inline(always)]
    fn doubt_of_side(&self, slope: [f32; 3], sign: f32, off: f32, is_certain: bool) -> [f32; 2] {
        let Light { ambient, diffuse, specular, .. } = self.light;
        let [ambient, diffuse, specular] = [ambient, diffuse, specular].map(|part| part as f32);
        let length = dot(slope, slope).sqrt();
        let turned = sign / length.max(f32::MIN_POSITIVE);
        let turns = if is_certain && length > off { 2.0 * off / (2.0 * length - off) } else { 1.0 };
        let [lamp, middle] = [self.to_lamp, self.to_middle].map(|to| (dot(slope, to) * turned).clamp(0.0, 1.0));
        let (lamp_off, [least, largest]) = (turns.min(lamp.max(1.0 - lamp)), [middle - turns, middle + turns]);
        let [least, gloss, largest] = [least.max(0.0), middle, largest.min(1.0)].map(thirty_second);
        let share = |length: f32| 1.0 - self.faint / (length * length + self.faint).max(f32::MIN_POSITIVE);
        let counts = share(length);
        let counts_off = (share(length + off) - counts).max(counts - share((length - off).max(0.0)));
        let most = counts + counts_off;
        let colour = most * diffuse * lamp_off + counts_off * (ambient + diffuse * lamp - 1.0).abs();
        let of_gloss = most * specular * (largest - gloss).max(gloss - least) + counts_off * specular * gloss;
        [colour, of_gloss].map(|off| off + OF_LIGHT * self.brightest())
    }

    /// The least and the largest share of the colour, each with the gloss, of points of a surface from a share of the way between two
    /// gradients per voxel to another. The gradients may be off by vectors of the length `off` per world unit. Whether the field rises
    /// through the surface may not be certain.
    pub(super) fn between(
        &self,
        [from, to]: [[f32; 3]; 2],
        shares: [f32; 2],
        off: f32,
        rises: Option<bool>,
    ) -> [[f32; 2]; 2] {
        let most = from.iter().chain(&to).fold(f32::MIN_POSITIVE, |most, n| most.max(n.abs()));
        let [middle, half] = [0.5 * (shares[0] + shares[1]), 0.5 * (shares[1] - shares[0])];
        let way: [f32; 3] = std::array::from_fn(|i| to[i] / most - from[i] / most);
        let slope = self.per_world_unit(std::array::from_fn(|i| from[i] / most + middle * way[i]));
        let way = self.per_world_unit(way);
        let off = off / most + half * dot(way, way).sqrt();
        let Some(sign) = rises.map(sign_of_rise).filter(|_| dot(slope, slope).sqrt() > off) else {
            return self.any_direction(); // also that of no gradient
        };
        let (lit, doubt) = (self.lit(slope, sign), self.doubt_of_side(slope, sign, off, true));
        [-1.0, 1.0].map(|sign| std::array::from_fn(|i| (lit[i] + sign * doubt[i]).max(0.0)))
    }

    /// [`Self::between`] if nothing is known of gradients. A point without a gradient keeps its colour.
    fn any_direction(&self) -> [[f32; 2]; 2] {
        let Light { ambient, diffuse, specular, .. } = self.light;
        let [ambient, diffuse, specular] = [ambient, diffuse, specular].map(|part| part as f32);
        let largest = [(ambient + diffuse).max(1.0) + OF_LIGHT, specular + OF_LIGHT];
        [[(ambient - OF_LIGHT).clamp(0.0, 1.0), 0.0], largest]
    }

    /// The change per world unit of a field with this gradient per voxel.
    #[inline(always)]
    fn per_world_unit(&self, gradient: [f32; 3]) -> [f32; 3] {
        [gradient[0] * self.per[0], gradient[1] * self.per[1], gradient[2] * self.per[2]]
    }

    /// The most light that a colour gives.
    pub(super) fn brightest(&self) -> f32 {
        let Light { ambient, diffuse, specular, .. } = self.light;
        ((ambient + diffuse).max(1.0) + specular) as f32
    }

    /// [`Self::shade`] for one gradient.
    pub(super) fn shade_one(&self, gradient: [f64; 3]) -> [f64; 2] {
        self.shade_cell(gradient.map(|n| n as f32)).map(f64::from)
    }

    /// The light of a surface through which the field rises along the ray, or falls. Its own gradient would say less at silhouettes,
    /// where it is that of a place nearby, and may face away.
    pub(super) fn shade_surface(&self, gradient: [f32; 3], rises: bool) -> [f32; 2] {
        // A direction of the middle size of numbers: squares of others may not be numbers.
        let most = gradient.iter().fold(0.0, |most: f32, n| most.max(n.abs()));
        let scaled = if most > 0.0 { gradient.map(|n| n / most) } else { gradient };
        self.lit(self.per_world_unit(scaled), sign_of_rise(rises))
    }

    #[inline(always)]
    fn shade_cell(&self, gradient: [f32; 3]) -> [f32; 2] {
        let slope = self.per_world_unit(gradient);
        self.lit(slope, sign_of_seen(dot(slope, self.to_viewer)))
    }

    /// The light on a gradient of this sign per world unit.
    #[inline(always)]
    fn lit(&self, slope: [f32; 3], sign: f32) -> [f32; 2] {
        let Light { ambient, diffuse, specular, .. } = self.light;
        let [ambient, diffuse, specular] = [ambient, diffuse, specular].map(|part| part as f32);
        let square = dot(slope, slope);
        let turned = sign / square.max(f32::MIN_POSITIVE).sqrt();
        let lamp = (dot(slope, self.to_lamp) * turned).max(0.0);
        let share = square / (square + self.faint).max(f32::MIN_POSITIVE);
        let gloss = share * specular * thirty_second((dot(slope, self.to_middle) * turned).max(0.0));
        [1.0 + share * (ambient + diffuse * lamp - 1.0), gloss]
    }
}

/// The sign that turns a gradient to the viewer.
#[inline(always)]
fn sign_of_seen(facing: f32) -> f32 {
    if facing < 0.0 { -1.0 } else { 1.0 }
}

/// The sign that turns a gradient to the viewer if the field rises along the ray, or falls.
fn sign_of_rise(rises: bool) -> f32 {
    if rises { -1.0 } else { 1.0 }
}

/// The rounding of the light on a cell.
const OF_LIGHT: f32 = 2e-5;

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_gradient_within_a_doubt_has_other_light() {
        let unit = |v: [f32; 3]| v.map(|n| n / dot(v, v).sqrt());
        let mut seed = 7_u32;
        let mut random = || {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 8) as f32 / 8_388_608.0 - 1.0
        };
        for faint in [0.0, 0.3, 4.0] {
            let (per, to_viewer) = ([1.0, 0.5, 2.0], unit([0.3, -0.2, 0.8]));
            let [to_lamp, to_middle] = [unit([0.6, 0.5, 0.4]), unit([0.4, 0.1, 0.7])];
            let shader = Shader { light: Light::default(), per, to_lamp, to_middle, to_viewer, faint };
            let mut used = [0.0_f32; 2];
            for n in 0..60_000 {
                let (gradient, off) = (std::array::from_fn(|_| random()), random().abs().powi(3));
                let turned = unit(std::array::from_fn(|_| random()));
                let length = if n % 2 == 0 { off } else { off * random().abs() };
                let moved = std::array::from_fn(|i| gradient[i] + turned[i] * length / per[i]);
                let side = (n % 3 == 0).then(|| sign_of_rise(n % 2 == 0));
                let lit = |gradient| match side {
                    Some(sign) => shader.lit(shader.per_world_unit(gradient), sign),
                    None => shader.shade_cell(gradient),
                };
                let [from, to] = [gradient, moved].map(lit);
                let doubt = match side {
                    Some(sign) => shader.doubt_of_side(shader.per_world_unit(gradient), sign, off, true),
                    None => shader.doubt(gradient, off),
                };
                for i in 0..2 {
                    let moved = (from[i] - to[i]).abs();
                    assert!(moved <= doubt[i], "{faint}: {gradient:?} by {off}, {from:?} to {to:?}, {doubt:?}");
                    used[i] = used[i].max(moved / doubt[i]);
                }
            }
            assert!(used.iter().all(|used| *used > 0.8), "{faint}: {used:?}");
        }
    }
}
