//! [sRGB](crate::bibliography) and CIE L\*a\*b\* ([CIE15](crate::bibliography)) under D65 light.

use super::Colour;

/// X, Y and Z of white.
const WHITE: [f64; 3] = [0.9505, 1.0, 1.089];

/// Converts to L* (0 to 100), a* and b*.
pub(super) fn from_rgb(colour: Colour) -> [f64; 3] {
    let [r, g, b] = colour.map(linear);
    let xyz = [
        0.4124 * r + 0.3576 * g + 0.1805 * b,
        0.2126 * r + 0.7152 * g + 0.0722 * b,
        0.0193 * r + 0.1192 * g + 0.9505 * b,
    ];
    let [x, y, z] = std::array::from_fn(|i| root(xyz[i] / WHITE[i]));
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

/// Converts to a colour. Colours outside sRGB are dimmed until they fit.
pub(super) fn to_rgb([l, a, b]: [f64; 3]) -> Colour {
    let y = (l + 16.0) / 116.0;
    let roots = [a / 500.0 + y, y, y - b / 200.0];
    let [x, y, z]: [f64; 3] = std::array::from_fn(|i| cube(roots[i]) * WHITE[i]);
    let colour = [
        3.2406 * x - 1.5372 * y - 0.4986 * z,
        -0.9689 * x + 1.8758 * y + 0.0415 * z,
        0.0557 * x - 0.2040 * y + 1.0570 * z,
    ];
    let colour = colour.map(gamma);
    let most = colour.into_iter().fold(1.0, f64::max);
    colour.map(|c| (c / most).max(0.0))
}

fn linear(c: f64) -> f64 {
    if c > 0.04045 { libm::pow((c + 0.055) / 1.055, 2.4) } else { c / 12.92 }
}

fn gamma(c: f64) -> f64 {
    if c > 0.003_130_8 { 1.055 * libm::pow(c, 1.0 / 2.4) - 0.055 } else { 12.92 * c }
}

fn root(v: f64) -> f64 {
    if v > 0.008_856 { libm::cbrt(v) } else { 7.787 * v + 16.0 / 116.0 }
}

fn cube(v: f64) -> f64 {
    let cubed = v * v * v;
    if cubed > 0.008_856 { cubed } else { (v - 16.0 / 116.0) / 7.787 }
}
