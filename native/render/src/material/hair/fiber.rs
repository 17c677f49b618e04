// SPDX-License-Identifier: GPL-3.0-or-later
//! The Principled Hair BSDF: a dielectric cylinder with tilted scales and an absorbing inside. Chiang, Bitterli, Tappan
//! and Burley 2016, "A Practical and Controllable Hair and Fur Model for Production Path Tracing", after Marschner et
//! al. 2003, with the energy-conserving longitudinal lobes of d'Eon et al. 2011.
//!
//! Light is reflected (R), transmitted (TT), reflected inside once (TRT) or more often. Each of these lobes is the
//! product of a longitudinal, an azimuthal and an attenuating term; without absorption they integrate to 1.

use std::f32::consts::{PI, TAU};

use crate::math::fresnel;
use crate::math::vector::{Vec3, vec3};
use crate::medium::mixture::divided;

/// Number of lobes: R, TT, TRT and all others together.
const LOBES: usize = 4;

/// √(π/8), the scale of a logistic distribution for a deviation of 1 (Chiang et al. 2016, §4.1).
const LOGISTIC: f32 = 0.626_657_07;

/// Absorption per concentration of eumelanin and pheomelanin: d'Eon et al. 2011, as Cycles scales them.
const EUMELANIN: Vec3 = vec3(0.506, 0.841, 1.653);
const PHEOMELANIN: Vec3 = vec3(0.343, 0.733, 1.924);

/// The inputs of a fibre.
#[derive(Debug, Clone, Copy)]
pub struct FiberInputs {
    /// Absorption coefficient for a fibre of radius 1.
    pub absorption: Vec3,
    /// Colour of a mass of such hair, whose absorption is added.
    pub color: Vec3,
    /// Share of melanin, whose absorption is added.
    pub melanin: f32,
    /// Share of pheomelanin in it.
    pub redness: f32,
    /// Longitudinal and azimuthal roughness.
    pub roughness: [f32; 2],
    /// How much smoother the reflection is, 0..1.
    pub coat: f32,
    /// Index of refraction.
    pub ior: f32,
    /// Tilt of the scales in radians.
    pub tilt: f32,
}

/// A fibre seen from one direction.
#[derive(Debug, Clone, Copy)]
pub struct Fiber {
    /// Sine and cosine of the viewer's inclination, tilted by the scales, for each lobe.
    viewer: [[f32; 2]; LOBES],
    /// Variance of the longitudinal term of each lobe.
    variance: [f32; LOBES],
    /// Change of azimuth of each lobe but the last.
    turn: [f32; 3],
    /// Scale of the logistic distribution around it.
    scale: f32,
    /// Share of light of each lobe.
    attenuation: [Vec3; LOBES],
    /// Probability of sampling each lobe.
    p: [f32; LOBES],
    /// Estimated colour: that of a mass of hair, and the reflection.
    albedo: Vec3,
}

impl FiberInputs {
    /// The absorption of pigments and colour together.
    fn sigma(&self) -> Vec3 {
        // Concentrations grow without limit as the share of melanin approaches 1.
        let melanin = -(1.0 - self.melanin).clamp(1e-4, 1.0).ln();
        let [dark, red] = [1.0 - self.redness, self.redness].map(|share| melanin * share);
        let colored = self.color.map(|c| {
            let root = c.clamp(1e-6, 1.0).ln() / depth(self.roughness[1]);
            root * root
        });
        let sum = self.absorption + EUMELANIN * dark + PHEOMELANIN * red + colored;
        sum.map(|c| c.clamp(0.0, 1e9))
    }

    /// The index of refraction, at least 1.
    fn index(&self) -> f32 {
        self.ior.clamp(1.0, 1e3)
    }
}

impl Fiber {
    /// The fibre seen from the unit direction `wi`. `offset`: distance of the ray from the axis over the radius, -1..1,
    /// positive on the y axis; `width`: least variance of the lobes.
    pub fn new(inputs: &FiberInputs, wi: Vec3, offset: f32, width: f32) -> Self {
        // Map roughness to variances (Chiang et al. 2016, eq. 7 and 8).
        let [along, around] = inputs.roughness.map(|r| r.clamp(1e-3, 1.0));
        let smooth = ((1.0 - inputs.coat.clamp(0.0, 1.0)) * along).clamp(1e-3, 1.0);
        let v = longitudinal(along).max(width);
        let around = 0.265 * around + 1.194 * around * around + 5.372 * around.powi(22);
        let scale = (around * LOGISTIC).max(width);
        // Refract in the plane of incidence and perpendicular to the hair (Marschner et al. 2003, §4.1).
        let eta = inputs.index();
        let (sin, cos) = (wi.x.clamp(-1.0, 1.0), root(wi.x));
        let h = offset.clamp(-1.0, 1.0);
        let cos_t = root(sin / eta);
        let sin_gamma = h * cos / (eta * eta - sin * sin).sqrt().max(1e-6);
        let cos_gamma = root(sin_gamma);
        let (gamma_o, gamma_t) = (h.asin(), sin_gamma.clamp(-1.0, 1.0).asin());
        // Attenuate by the boundary and along the way through the fibre.
        let (f, _) = fresnel::dielectric(cos * root(h), eta);
        let way = 2.0 * cos_gamma / cos_t.max(1e-6);
        let sigma = inputs.sigma();
        let through = sigma.map(|s| (-s * way).exp());
        let mass = depth(v);
        let attenuation = attenuated(f, through);
        let energy = attenuation.map(Vec3::mean);
        let total: f32 = energy.iter().sum();
        // Tilt the viewer by the scales: twice against the tilt for R, and with it for TT and four times for TRT.
        let tilted = |angle: f32| {
            let (s, c) = angle.sin_cos();
            [sin * c + cos * s, (cos * c - sin * s).abs()]
        };
        let tilt = inputs.tilt;
        Self {
            viewer: [
                tilted(2.0 * tilt),
                tilted(-tilt),
                tilted(-4.0 * tilt),
                [sin, cos],
            ],
            variance: [longitudinal(smooth).max(width), 0.25 * v, 4.0 * v, 4.0 * v],
            turn: [0.0, 1.0, 2.0].map(|p| 2.0 * p * gamma_t - 2.0 * gamma_o + p * PI),
            scale,
            attenuation,
            p: energy.map(|e| if total > 0.0 { e / total } else { 0.25 }),
            albedo: sigma.map(|s| (-s.sqrt() * mass).exp() + f),
        }
    }

    /// Returns the estimated colour, as in Cycles.
    pub fn albedo(&self) -> Vec3 {
        self.albedo
    }

    /// Returns BSDF × |cosine| and the density for a direction.
    pub fn eval(&self, wo: Vec3) -> (Vec3, f32) {
        let (sin, cos) = (wo.x.clamp(-1.0, 1.0), root(wo.x));
        let azimuth = (-wo.y).atan2(wo.z);
        let (mut f, mut pdf) = (Vec3::ZERO, 0.0);
        for p in 0..LOBES {
            let [sin_o, cos_o] = self.viewer[p];
            let along = longitudinal_density([sin, cos], [sin_o, cos_o], self.variance[p]);
            let around = match self.turn.get(p) {
                Some(turn) => trimmed_logistic(wrapped(azimuth - turn), self.scale),
                None => 1.0 / TAU,
            };
            f += self.attenuation[p] * (along * around);
            pdf += self.p[p] * along * around;
        }
        (f, pdf)
    }

    /// Samples a direction. `choice`, `u`: random numbers in [0, 1). Returns also whether the light was reflected at
    /// the front.
    pub fn sample(&self, choice: f32, u: [f32; 2]) -> (Vec3, bool) {
        // Choose a lobe.
        let (mut p, mut left) = (0, choice);
        while p + 1 < LOBES && left >= self.p[p] {
            left -= self.p[p];
            p += 1;
        }
        let left = (left / self.p[p].max(f32::MIN_POSITIVE)).clamp(1e-5, 1.0);
        // Sample the inclination (d'Eon, Marschner and Hanika 2013, "Importance Sampling for Physically-Based Hair
        // Fiber Models", eq. 6 and 7), then the azimuth.
        let [sin_o, cos_o] = self.viewer[p];
        let v = self.variance[p];
        let cos = 1.0 + v * (left + (1.0 - left) * (-2.0 / v).exp()).ln();
        let sin = -cos * sin_o + root(cos) * (TAU * u[1]).cos() * cos_o;
        let sin = sin.clamp(-1.0, 1.0);
        let azimuth = match self.turn.get(p) {
            Some(turn) => turn + sample_logistic(u[0], self.scale),
            None => TAU * u[0],
        };
        let cos = root(sin);
        let (s, c) = azimuth.sin_cos();
        (vec3(sin, -cos * s, cos * c), p == 0)
    }
}

/// The share of light of each lobe, for a reflectance and the transmittance of the inside.
fn attenuated(f: f32, through: Vec3) -> [Vec3; LOBES] {
    let tt = through * ((1.0 - f) * (1.0 - f));
    let inside = through * f;
    let trt = tt * inside;
    // The geometric series of all further reflections.
    let rest = divided(trt * inside, Vec3::ONE - inside);
    [Vec3::splat(f), tt, trt, rest]
}

/// Cosine of an angle with this sine in [-π/2, π/2].
fn root(sin: f32) -> f32 {
    (1.0 - sin * sin).max(0.0).sqrt()
}

/// The variance of the longitudinal terms for a roughness.
fn longitudinal(roughness: f32) -> f32 {
    let r = 0.726 * roughness + 0.812 * roughness * roughness + 3.7 * roughness.powi(20);
    r * r
}

/// The factor between the root of the absorption and the logarithm of a colour, for an azimuthal roughness (Chiang et
/// al. 2016, eq. 9).
fn depth(roughness: f32) -> f32 {
    let x = roughness;
    (((((0.245 * x) + 5.574) * x - 10.73) * x + 2.532) * x - 0.215) * x + 5.969
}

/// The angle within [-π, π].
fn wrapped(angle: f32) -> f32 {
    angle - TAU * ((angle + PI) / TAU).floor()
}

/// The longitudinal term: the density of sine `i` for a viewer `o` (d'Eon et al. 2011, eq. 7). Small variances need its
/// logarithm.
fn longitudinal_density([sin_i, cos_i]: [f32; 2], [sin_o, cos_o]: [f32; 2], v: f32) -> f32 {
    let (cosines, sines) = (cos_i * cos_o / v, sin_i * sin_o / v);
    if v <= 0.1 {
        (log_bessel(cosines) - sines - 1.0 / v + std::f32::consts::LN_2 + (0.5 / v).ln()).exp()
    } else {
        (-sines).exp() * bessel(cosines) / ((1.0 / v).sinh() * 2.0 * v)
    }
}

/// The modified Bessel function of the first kind of order 0 for arguments up to 12, by its series.
fn bessel(x: f32) -> f32 {
    let quarter = 0.25 * x * x;
    let (mut term, mut sum) = (1.0, 1.0);
    for k in 1..24_u8 {
        term *= quarter / (f32::from(k) * f32::from(k));
        sum += term;
    }
    sum
}

/// Its logarithm; large arguments by the asymptotic series.
fn log_bessel(x: f32) -> f32 {
    if x > 12.0 {
        x + 0.5 * (1.0 / (4.0 * x) - TAU.ln() - x.ln())
    } else {
        bessel(x).ln()
    }
}

/// The logistic distribution within [-π, π].
fn trimmed_logistic(x: f32, s: f32) -> f32 {
    let e = (-x.abs() / s).exp();
    let density = e / (s * (1.0 + e) * (1.0 + e));
    density / (1.0 - 2.0 * logistic_below(s))
}

/// The share of the logistic distribution below -π.
fn logistic_below(s: f32) -> f32 {
    1.0 / (1.0 + (PI / s).exp())
}

/// Samples the logistic distribution within [-π, π].
fn sample_logistic(u: f32, s: f32) -> f32 {
    let below = logistic_below(s);
    let share = u * (1.0 - 2.0 * below) + below;
    (-s * (1.0 / share.max(1e-12) - 1.0).ln()).clamp(-PI, PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Inputs without absorption.
    fn clear(roughness: [f32; 2], tilt: f32) -> FiberInputs {
        FiberInputs {
            absorption: Vec3::ZERO,
            color: Vec3::ONE,
            melanin: 0.0,
            redness: 0.0,
            roughness,
            coat: 0.0,
            ior: 1.55,
            tilt,
        }
    }

    /// The direction of an inclination whose azimuth is the viewer's.
    fn viewer(sin: f32) -> Vec3 {
        vec3(sin, 0.0, root(sin))
    }

    #[test]
    fn a_clear_fibre_reflects_and_transmits_all_light() {
        for roughness in [[0.1, 0.1], [0.3, 0.3], [0.3, 0.9], [1.0, 1.0]] {
            for (offset, sin) in [(0.0, 0.0), (0.7, 0.3), (-0.95, -0.8)] {
                let fiber = Fiber::new(&clear(roughness, 0.05), viewer(sin), offset, 0.0);
                let (n, mut sum) = (1000, 0.0);
                for i in 0..n {
                    for j in 0..n {
                        // Uniform in sine and azimuth: the solid angle.
                        let s = -1.0 + 2.0 * (i as f32 + 0.5) / n as f32;
                        let phi = TAU * (j as f32 + 0.5) / n as f32;
                        let c = root(s);
                        let (f, pdf) = fiber.eval(vec3(s, c * phi.sin(), c * phi.cos()));
                        assert!((f.y - pdf).abs() <= 1e-4 * pdf, "{f:?} {pdf}");
                        sum += f64::from(f.y);
                    }
                }
                let total = sum * 4.0 * std::f64::consts::PI / f64::from(n * n);
                assert!(
                    (total - 1.0).abs() < 4e-3,
                    "{roughness:?} {offset} {sin}: {total}"
                );
            }
        }
    }

    #[test]
    fn samples_have_the_density() {
        let mut inputs = clear([0.3, 0.4], 0.05);
        inputs.absorption = vec3(0.2, 0.5, 1.0);
        let fiber = Fiber::new(&inputs, viewer(0.4), 0.5, 0.0);
        // Half spaces get as many samples as their density: compare the mean position with its integral.
        let (n, mut mean, mut expected) = (200, Vec3::ZERO, Vec3::ZERO);
        for i in 0..n {
            for j in 0..n {
                for k in 0..40 {
                    let at = |i: i32, n: i32| (i as f32 + 0.5) / n as f32;
                    let (wo, _) = fiber.sample(at(k, 40), [at(i, n), at(j, n)]);
                    assert!((wo.length() - 1.0).abs() < 1e-4);
                    mean += wo * (1.0 / (n * n * 40) as f32);
                }
                let s = -1.0 + 2.0 * (i as f32 + 0.5) / n as f32;
                let phi = TAU * (j as f32 + 0.5) / n as f32;
                let wo = vec3(s, root(s) * phi.sin(), root(s) * phi.cos());
                expected += wo * (fiber.eval(wo).1 * 2.0 * TAU / (n * n) as f32);
            }
        }
        assert!((mean - expected).length() < 0.01, "{mean:?} {expected:?}");
    }

    #[test]
    fn colours_give_themselves_back_and_melanin_darkens() {
        let mut inputs = clear([0.0, 0.0], 0.0);
        inputs.color = vec3(0.5, 0.25, 1.0);
        // (ln c / 5.969)² without roughness.
        let sigma = inputs.sigma();
        assert!(
            (sigma.x - 0.013_485).abs() < 1e-5 && sigma.z == 0.0,
            "{sigma:?}"
        );
        inputs.color = Vec3::ONE;
        inputs.melanin = 0.5;
        let dark = inputs.sigma();
        assert!(dark.x < dark.y && dark.y < dark.z);
        inputs.redness = 1.0;
        assert!(inputs.sigma().z > dark.z);
    }

    #[test]
    fn extremes_stay_finite() {
        for r in [0.0, 1e-9, 1.0, 5.0] {
            for ior in [0.0, 1.0, 1e9] {
                let mut inputs = clear([r, r], 1.5);
                (inputs.ior, inputs.absorption) = (ior, vec3(0.0, 1e9, f32::MAX));
                for (sin, offset) in [(1.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.9, 7.0)] {
                    let fiber = Fiber::new(&inputs, viewer(sin), offset, 0.0);
                    let (wo, _) = fiber.sample(0.3, [0.99, 0.5]);
                    let (f, pdf) = fiber.eval(wo);
                    assert!(
                        wo.is_finite() && f.is_finite() && pdf >= 0.0,
                        "{r} {ior} {sin}"
                    );
                }
            }
        }
    }
}
