// SPDX-License-Identifier: GPL-3.0-or-later
//! The medium below a surface from the surface's colour: albedo inversion.
//!
//! A half space of a scattering medium reflects a share of the light that depends on the single-scattering albedo.
//! Fits of the inverse give the albedo for the wanted colour (Chiang, Kutz and Burley 2016, "Practical and Controllable
//! Subsurface Scattering for Production Path Tracing"). All numbers are those with which Cycles fits them.

use crate::math::vector::Vec3;

/// How radius and colour of a surface give its medium.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Inversion {
    /// "Random Walk": the radius is the mean free path.
    RandomWalk,
    /// "Random Walk (Skin)": the radius is scaled by colour and index of refraction.
    Skin,
    /// "Random Walk" of Blender before 5.2: the radius is about that of the older diffusion profiles.
    Legacy,
}

/// A uniform medium in which paths walk.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Coefficients {
    /// Extinction coefficient.
    pub extinction: Vec3,
    /// Single-scattering albedo.
    pub albedo: Vec3,
    /// Factor on the throughput of a path that enters.
    pub factor: Vec3,
}

/// Least albedo: below it the throughput is lowered instead, so that walks always have a direction to prefer.
const MIN_ALBEDO: f32 = 0.2;

/// Largest albedo.
const MAX_ALBEDO: f32 = 0.999_999;

/// Ratio of a legacy radius to the mean free path: 4π.
const LEGACY: f32 = 0.25 * std::f32::consts::FRAC_1_PI;

impl Coefficients {
    /// The medium of a surface of this colour. `radius`: in scene units; `g`: anisotropy; `ior`: of the boundary.
    pub fn new(method: Inversion, color: Vec3, radius: Vec3, g: f32, ior: f32) -> Self {
        let radius = match method {
            Inversion::RandomWalk => radius,
            Inversion::Legacy => radius * LEGACY,
            Inversion::Skin => radius * color.map(|c| skin_scale(c, ior)),
        };
        let free = radius.map(|r| r.max(1e-16));
        // The fits of the older methods are for scattering forwards.
        let (albedo, extinction) = if method == Inversion::RandomWalk || g < 0.0 {
            (color.map(|c| van_de_hulst(c, g)), free.map(|r| 1.0 / r))
        } else {
            let extinction = free.map(|r| 1.0 / r / (1.0 - g));
            (color.map(|c| fitted(c, g)), extinction)
        };
        let albedo = albedo.map(|a| a.clamp(0.0, MAX_ALBEDO));
        Self {
            extinction,
            albedo: albedo.map(|a| a.max(MIN_ALBEDO)),
            factor: albedo.map(|a| (a / MIN_ALBEDO).min(1.0)),
        }
    }
}

/// The albedo for a colour and an anisotropy: d'Eon, "A Hitchhiker's Guide to Multiple Scattering", eq. 53.7.
fn van_de_hulst(color: f32, g: f32) -> f32 {
    let c = color;
    let s = 4.20863 * c - (9.59217 + 41.6808 * c + 17.7126 * c * c).sqrt() + 4.09712;
    let s2 = s * s;
    let rest = 1.0 - g * s2;
    if rest > 0.0 { (1.0 - s2) / rest } else { 0.0 }
}

/// Coefficients by ascending powers of the anisotropy.
type Polynomial = [f64; 8];

/// The polynomials of the fit for isotropic and forward scattering, in pairs: factor, scale of the arctangent, power.
const FIT: [[Polynomial; 3]; 2] = [
    [
        [
            1.826_052_378_2,
            -1.284_510_564_36,
            -1.799_046_293_12,
            9.193_932_892_02,
            -22.821_558_586_2,
            32.023_487_425_9,
            -23.626_480_333_3,
            7.210_670_026_58,
        ],
        [
            0.0,
            31.149_158_143_3,
            -201.847_017_512,
            841.576_016_723,
            -2_018.092_885_05,
            2_731.715_602_86,
            -1_935.414_242_44,
            559.009_054_474,
        ],
        [
            1.096_861_024_24,
            -0.394_704_063_468,
            1.052_581_159_41,
            -8.839_637_127_26,
            28.864_323_066_1,
            -46.880_291_358_1,
            38.540_283_751_8,
            -12.718_104_253_8,
        ],
    ],
    [
        [
            0.496_310_210_422,
            0.360_146_581_622,
            -2.151_393_097_47,
            17.889_689_921_7,
            -55.298_401_033_3,
            82.065_982_243,
            -58.510_600_857_8,
            15.847_829_502_1,
        ],
        [
            0.0,
            76.731_625_395_2,
            -594.356_773_233,
            2_448.883_420_3,
            -5_576.685_289_98,
            7_116.601_719_12,
            -4_763.544_678_87,
            1_303.531_805_5,
        ],
        [
            2.406_029_994_08,
            -2.518_148_446_09,
            9.184_949_083_56,
            -79.219_170_868_2,
            259.082_868_209,
            -403.613_804_597,
            302.857_124_36,
            -87.437_047_356_7,
        ],
    ],
];

/// Constant and factor of the exponential in the scale of each arctangent.
const SCALES: [[f64; 2]; 2] = [
    [4.985_111_943_85, 0.127_355_959_438],
    [4.231_902_997_01, 0.003_106_039_490_88],
];

/// The albedo for a colour and an anisotropy of 0 to 0.9 by the fit of the older methods: two curves of the form
/// a atan(b c)^d, blended by the fourth root of the colour c.
fn fitted(color: f32, g: f32) -> f32 {
    let (c, g) = (f64::from(color), f64::from(g));
    let value = |p: &Polynomial| p.iter().rev().fold(0.0, |sum, k| sum * g + k);
    let [low, high] = [0, 1].map(|k| {
        let [factor, inner, power] = &FIT[k];
        let scale = SCALES[k][0] + SCALES[k][1] * value(inner).exp();
        value(factor) * (scale * c).atan().powf(value(power))
    });
    let blend = c.powf(0.25);
    ((1.0 - blend) * low + blend * high) as f32
}

/// The factor on the radius of skin of this colour: that of the mean free path in diffusion, √(3 (1 - α)), where α is
/// the albedo for which the dipole of Jensen et al. 2001, "A Practical Model for Subsurface Light Transport", reflects
/// the colour.
fn skin_scale(color: f32, ior: f32) -> f32 {
    let inverse = 1.0 / ior;
    let internal = inverse * (-1.440 * inverse + 0.710) + 0.668 + 0.0636 * ior;
    let a = (4.0 / 3.0) * (1.0 + internal) / (1.0 - internal);
    let alpha = if color < 1e-4 {
        0.0
    } else if color >= 0.995 {
        MAX_ALBEDO
    } else {
        // Bisect as often as Cycles, whose last interval is part of the result.
        let (mut low, mut high, mut middle) = (0.0, 1.0, 0.0);
        for _ in 0..12 {
            middle = 0.5 * (low + high);
            let s = (3.0_f32 * (1.0 - middle)).sqrt();
            let reflected = 0.5 * middle * (1.0 + (-a * s).exp()) * (-s).exp();
            if reflected < color {
                low = middle;
            } else {
                high = middle;
            }
        }
        middle
    };
    (3.0 * (1.0 - alpha)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn albedos_rise_with_the_colour_and_white_scatters_everything() {
        for method in [Inversion::RandomWalk, Inversion::Skin, Inversion::Legacy] {
            for g in [-0.9, 0.0, 0.5, 0.9] {
                let at = |c: f32| Coefficients::new(method, Vec3::splat(c), Vec3::ONE, g, 1.4);
                let total = |c: f32| at(c).albedo.x * at(c).factor.x;
                for k in 0..100 {
                    let c = k as f32 / 100.0;
                    // The fits of the older methods reach 1 before the colour does.
                    let full = method != Inversion::RandomWalk && total(c) >= MAX_ALBEDO;
                    assert!(full || total(c + 0.01) > total(c), "{method:?} {g} {c}");
                }
                assert!(total(1.0) > 0.999, "{method:?} {g}: {}", total(1.0));
                assert!(total(0.0) < 1e-3 && at(0.0).albedo.x == MIN_ALBEDO);
            }
        }
    }

    #[test]
    fn radii_are_mean_free_paths_and_extremes_stay_finite() {
        let of = |method, r: f32, g| {
            Coefficients::new(method, Vec3::splat(0.5), Vec3::splat(r), g, 1.4)
                .extinction
                .x
        };
        assert_eq!(of(Inversion::RandomWalk, 0.25, 0.5), 4.0);
        assert!((of(Inversion::Legacy, 0.25, 0.5) - 4.0 / LEGACY / 0.5).abs() < 1e-3);
        // The dipole reflects half of the light at an albedo of 0.97763.
        assert!((1.0 / of(Inversion::Skin, 1.0, 0.0) - 0.2591).abs() < 2e-3);
        for r in [0.0, f32::MIN_POSITIVE, f32::MAX] {
            assert!(of(Inversion::Skin, r, 0.0).is_finite() && of(Inversion::Legacy, r, 0.0) > 0.0);
        }
    }
}
