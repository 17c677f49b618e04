// SPDX-License-Identifier: GPL-3.0-or-later
//! Colours of light: of one wavelength, and of black bodies.

use std::sync::LazyLock;

use crate::math::vector::{Vec3, vec3};

/// Colour matching functions of the CIE 1931 standard observer (2°), from 380 nm in steps of 5 nm: CIE 018:2019.
#[rustfmt::skip]
const MATCHING: [[f32; 3]; 81] = [
    [0.001368, 3.9e-05, 0.00645],
    [0.002236, 6.4e-05, 0.01055],
    [0.004243, 0.00012, 0.02005],
    [0.00765, 0.000217, 0.03621],
    [0.01431, 0.000396, 0.06785],
    [0.02319, 0.00064, 0.1102],
    [0.04351, 0.00121, 0.2074],
    [0.07763, 0.00218, 0.3713],
    [0.13438, 0.004, 0.6456],
    [0.21477, 0.0073, 1.0390501],
    [0.2839, 0.0116, 1.3856],
    [0.3285, 0.01684, 1.62296],
    [0.34828, 0.023, 1.74706],
    [0.34806, 0.0298, 1.7826],
    [0.3362, 0.038, 1.77211],
    [0.3187, 0.048, 1.7441],
    [0.2908, 0.06, 1.6692],
    [0.2511, 0.0739, 1.5281],
    [0.19536, 0.09098, 1.28764],
    [0.1421, 0.1126, 1.0419],
    [0.09564, 0.13902, 0.8129501],
    [0.05795, 0.1693, 0.6162],
    [0.03201, 0.20802, 0.46518],
    [0.0147, 0.2586, 0.3533],
    [0.0049, 0.323, 0.272],
    [0.0024, 0.4073, 0.2123],
    [0.0093, 0.503, 0.1582],
    [0.0291, 0.6082, 0.1117],
    [0.06327, 0.71, 0.07825],
    [0.1096, 0.7932, 0.05725],
    [0.1655, 0.862, 0.04216],
    [0.2257499, 0.9148501, 0.02984],
    [0.2904, 0.954, 0.0203],
    [0.3597, 0.9803, 0.0134],
    [0.4334499, 0.9949501, 0.00875],
    [0.5120501, 1.0, 0.00575],
    [0.5945, 0.995, 0.0039],
    [0.6784, 0.9786, 0.00275],
    [0.7621, 0.952, 0.0021],
    [0.8425, 0.9154, 0.0018],
    [0.9163, 0.87, 0.00165],
    [0.9786, 0.8163, 0.0014],
    [1.0263, 0.757, 0.0011],
    [1.0567, 0.6949, 0.001],
    [1.0622, 0.631, 0.0008],
    [1.0456, 0.5668, 0.0006],
    [1.0026, 0.503, 0.00034],
    [0.9384, 0.4412, 0.00024],
    [0.8544499, 0.381, 0.00019],
    [0.7514, 0.321, 0.0001],
    [0.6424, 0.265, 5e-05],
    [0.5419, 0.217, 3e-05],
    [0.4479, 0.175, 2e-05],
    [0.3608, 0.1382, 1e-05],
    [0.2835, 0.107, 0.0],
    [0.2187, 0.0816, 0.0],
    [0.1649, 0.061, 0.0],
    [0.1212, 0.04458, 0.0],
    [0.0874, 0.032, 0.0],
    [0.0636, 0.0232, 0.0],
    [0.04677, 0.017, 0.0],
    [0.0329, 0.01192, 0.0],
    [0.0227, 0.00821, 0.0],
    [0.01584, 0.005723, 0.0],
    [0.0113592, 0.004102, 0.0],
    [0.0081109, 0.002929, 0.0],
    [0.0057903, 0.002091, 0.0],
    [0.0041095, 0.001484, 0.0],
    [0.0028993, 0.001047, 0.0],
    [0.0020492, 0.00074, 0.0],
    [0.00144, 0.00052, 0.0],
    [0.0009999, 0.0003611, 0.0],
    [0.0006901, 0.0002492, 0.0],
    [0.000476, 0.0001719, 0.0],
    [0.0003323, 0.00012, 0.0],
    [0.0002348, 8.48e-05, 0.0],
    [0.0001662, 6e-05, 0.0],
    [0.0001174, 4.24e-05, 0.0],
    [8.31e-05, 3e-05, 0.0],
    [5.87e-05, 2.12e-05, 0.0],
    [4.15e-05, 1.5e-05, 0.0],
];

/// First wavelength and step of [`MATCHING`], nm.
const FIRST: f32 = 380.0;
const STEP: f32 = 5.0;

/// Lowest and highest temperature that have a colour of their own, K: those of Cycles.
const TEMPERATURES: [f32; 2] = [800.0, 12000.0];

/// Number of tabulated colours of black bodies. Linear interpolation between them is exact to 1e-3 (tested).
const ENTRIES: usize = 256;

/// Factor on the colour of one wavelength, which brings all channels to at most 1: that of Cycles.
const WAVELENGTH_SCALE: f32 = 1.0 / 2.52;

/// Converts CIE XYZ to linear Rec. 709 colours (IEC 61966-2-1).
fn to_rgb([x, y, z]: [f32; 3]) -> Vec3 {
    vec3(
        3.240_454_2 * x - 1.537_138_5 * y - 0.498_531_4 * z,
        -0.969_266 * x + 1.876_010_8 * y + 0.041_556 * z,
        0.055_643_4 * x - 0.204_025_9 * y + 1.057_225_2 * z,
    )
}

/// Returns the colour of light of a wavelength in nm; black outside of 380 to 780 nm.
pub fn wavelength(nm: f32) -> Vec3 {
    let x = (nm - FIRST) / STEP;
    if !(x >= 0.0 && x < (MATCHING.len() - 1) as f32) {
        return Vec3::ZERO;
    }
    // Interpolate the matching functions; colours outside of Rec. 709 are clipped.
    let (i, t) = (x as usize, x.fract());
    let xyz = [0, 1, 2].map(|k| MATCHING[i][k] * (1.0 - t) + MATCHING[i + 1][k] * t);
    (to_rgb(xyz) * WAVELENGTH_SCALE).map(|c| c.max(0.0))
}

/// Returns the colour of a black body of this temperature in K, with luminance 1 before clipping to Rec. 709.
pub fn blackbody(kelvin: f32) -> Vec3 {
    static TABLE: LazyLock<[Vec3; ENTRIES]> =
        LazyLock::new(|| std::array::from_fn(|i| integrated(temperature(i as f32))));
    let last = (ENTRIES - 1) as f32;
    let [low, high] = TEMPERATURES;
    // The table is uniform in the reciprocal of the temperature, over which colours vary evenly.
    let kelvin = kelvin.clamp(low, high);
    let x = (1.0 / low - 1.0 / kelvin) / (1.0 / low - 1.0 / high) * last;
    let x = if x.is_finite() {
        x.clamp(0.0, last)
    } else {
        0.0
    };
    let i = (x as usize).min(ENTRIES - 2);
    let t = x - i as f32;
    (TABLE[i] * (1.0 - t) + TABLE[i + 1] * t).map(|c| c.max(0.0))
}

/// Step of the table of [`coherence`], nm of path difference. Periods are above 400 nm, so that linear interpolation is
/// exact to 3e-3.
const DIFFERENCE: f32 = 10.0;

/// Number of entries of that table: beyond 20 µm all channels are below 2e-3 (tested).
const DIFFERENCES: usize = 2048;

/// Returns for each channel the mean phasor of light at a difference of optical paths in nm, weighted by the channel's
/// matching function over the wavelengths; 1 at no difference.
pub fn coherence(difference: f32) -> [[f32; 2]; 3] {
    static TABLE: LazyLock<Vec<[[f32; 2]; 3]>> = LazyLock::new(|| {
        (0..DIFFERENCES)
            .map(|i| mean_phasors(i as f32 * DIFFERENCE))
            .collect()
    });
    let x = difference.max(0.0) / DIFFERENCE;
    if x >= (DIFFERENCES - 1) as f32 {
        return [[0.0; 2]; 3];
    }
    let (i, t) = (x as usize, x.fract());
    let mix = |a: f32, b: f32| a + t * (b - a);
    [0, 1, 2].map(|c| [0, 1].map(|k| mix(TABLE[i][c][k], TABLE[i + 1][c][k])))
}

/// Integrates the phasors of a path difference in nm over the matching functions.
fn mean_phasors(difference: f32) -> [[f32; 2]; 3] {
    let (mut sums, mut total) = ([[0.0_f64; 2]; 3], [0.0_f64; 3]);
    for (i, row) in MATCHING.iter().enumerate() {
        let nm = f64::from(FIRST) + f64::from(STEP) * i as f64;
        let (sin, cos) = (std::f64::consts::TAU * f64::from(difference) / nm).sin_cos();
        let weights = to_rgb(*row).array().map(f64::from);
        for c in 0..3 {
            sums[c][0] += weights[c] * cos;
            sums[c][1] += weights[c] * sin;
            total[c] += weights[c];
        }
    }
    [0, 1, 2].map(|c| [0, 1].map(|k| (sums[c][k] / total[c]) as f32))
}

/// Returns the temperature of a table's entry.
fn temperature(entry: f32) -> f32 {
    let [low, high] = TEMPERATURES;
    let t = entry / (ENTRIES - 1) as f32;
    1.0 / ((1.0 - t) / low + t / high)
}

/// Integrates Planck's law over the matching functions, scaled to luminance 1.
fn integrated(kelvin: f32) -> Vec3 {
    // Second radiation constant, nm K (CODATA 2018).
    const C2: f64 = 1.438_776_877e7;
    let mut xyz = [0.0_f64; 3];
    for (i, row) in MATCHING.iter().enumerate() {
        let nm = f64::from(FIRST) + f64::from(STEP) * i as f64;
        let power = nm.powi(-5) / (C2 / (nm * f64::from(kelvin))).exp_m1();
        for (sum, weight) in xyz.iter_mut().zip(row) {
            *sum += power * f64::from(*weight);
        }
    }
    to_rgb(xyz.map(|sum| (sum / xyz[1]) as f32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_black_bodies_are_tabulated_closely_and_clamped() {
        for kelvin in [800.0, 1200.0, 1903.0, 3333.0, 6500.0, 9100.0, 12000.0] {
            let apart = blackbody(kelvin) - integrated(kelvin).map(|c| c.max(0.0));
            assert!(apart.max_abs() < 1e-3, "{kelvin}: {apart:?}");
        }
        for (odd, known) in [(-1.0, 800.0), (f32::INFINITY, 12000.0), (1e30, 12000.0)] {
            assert_eq!(blackbody(odd), blackbody(known));
        }
        assert!(blackbody(f32::NAN).is_finite());
        // Daylight is nearly white, embers red.
        let white = blackbody(6504.0);
        assert!(
            (white.x - 1.0).abs() < 0.06 && (white.z - 1.0).abs() < 0.06,
            "{white:?}"
        );
        let red = blackbody(1000.0);
        assert!(red.x > 4.0 && red.z == 0.0, "{red:?}");
    }

    #[test]
    fn white_light_loses_its_coherence_with_the_path_difference() {
        assert_eq!(coherence(0.0), [[1.0, 0.0]; 3]);
        for difference in [3.0, 137.0, 1234.5, 5000.0, 20000.0] {
            let (quick, exact) = (coherence(difference), mean_phasors(difference));
            for (a, b) in quick.iter().flatten().zip(exact.iter().flatten()) {
                assert!((a - b).abs() < 3e-3, "{difference}: {a} {b}");
            }
        }
        for far in [20000.0, 1e9, f32::INFINITY] {
            for part in coherence(far).iter().flatten() {
                assert!(part.abs() < 5e-3, "{far}: {part}");
            }
        }
        // Half a wavelength of green turns its phase by half a turn.
        let [_, [re, _], _] = coherence(270.0);
        assert!(re < -0.8, "{re}");
    }

    #[test]
    fn wavelengths_have_their_colours() {
        for (nm, brightest) in [(450.0, 2), (530.0, 1), (650.0, 0)] {
            let c = wavelength(nm).array();
            assert!(
                c[brightest] == wavelength(nm).max_component(),
                "{nm}: {c:?}"
            );
        }
        for nm in [379.0, 780.0, -5.0, f32::NAN, f32::INFINITY] {
            assert_eq!(wavelength(nm), Vec3::ZERO);
        }
    }
}
