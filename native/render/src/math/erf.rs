// SPDX-License-Identifier: GPL-3.0-or-later
//! The error function and its inverse.

/// Returns the error function with an error below 2e-7: Abramowitz and Stegun 1964, 7.1.26.
pub fn erf(x: f32) -> f32 {
    let a = x.abs();
    let t = 1.0 / (1.0 + 0.327_591_1 * a);
    let p = t
        * (0.254_829_6
            + t * (-0.284_496_74 + t * (1.421_413_7 + t * (-1.453_152 + t * 1.061_405_4))));
    (1.0 - p * (-a * a).exp()).copysign(x)
}

/// Returns the inverse of the error function for arguments in (-1, 1), with a relative error below 4e-7: Giles 2010,
/// "Approximating the erfinv function", table 5.
pub fn inverse_erf(x: f32) -> f32 {
    const NEAR: [f32; 9] = [
        2.810_226_4e-8,
        3.432_739_4e-7,
        -3.523_387_7e-6,
        -4.391_506_5e-6,
        0.000_218_580_87,
        -0.001_253_725,
        -0.004_177_681_6,
        0.246_640_73,
        1.501_409_4,
    ];
    const FAR: [f32; 9] = [
        -0.000_200_214_26,
        0.000_100_950_56,
        0.001_349_343_2,
        -0.003_673_428_4,
        0.005_739_507_7,
        -0.007_622_461_3,
        0.009_438_870_5,
        1.001_674,
        2.832_976_8,
    ];
    // The logarithm measures the distance from both ends.
    let w = -((1.0 - x) * (1.0 + x)).max(1e-30).ln();
    let (table, t) = if w < 5.0 {
        (NEAR, w - 2.5)
    } else {
        (FAR, w.sqrt() - 3.0)
    };
    x * table.iter().fold(0.0, |sum, c| sum * t + c)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_values_and_the_way_back() {
        for (x, want) in [
            (0.0, 0.0),
            (0.5, 0.520_499_9),
            (1.0, 0.842_700_8),
            (-2.0, -0.995_322_3),
        ] {
            assert!((erf(x) - want).abs() < 3e-7, "{x}: {}", erf(x));
        }
        for i in -95..96 {
            let b = i as f32 / 96.0;
            let back = erf(inverse_erf(b));
            assert!((back - b).abs() < 1e-6, "{b}: {back}");
        }
    }
}
