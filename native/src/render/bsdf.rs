// SPDX-License-Identifier: GPL-3.0-or-later
//! A material seen from one direction: evaluate it, sample it.
//!
//! Directions are in the shading frame (z = shading normal) and point away from the surface; `wi`
//! is where the path came from (z > 0), `wo` where it goes. `GLOSSY` and `GLASS` say whether the
//! scene has such lobes at all: without them their code is not compiled into the path.

use std::f32::consts::FRAC_1_PI;

use super::fresnel;
use super::material::{Coat, Glass, Material, Metal};
use super::trig::sin_cos_turns;
use super::vector::{Vec3, vec3};

/// A sampled direction.
#[derive(Debug, Clone, Copy)]
pub struct Scatter {
    /// Where the path goes.
    pub wo: Vec3,
    /// BSDF × cosine / density.
    pub weight: Vec3,
    /// Density per solid angle; infinite for a mirror or window, which no light sample can find.
    pub pdf: f32,
}

/// The lobes of a material with their weights for one viewing direction.
pub struct Bsdf<'a, const GLOSSY: bool, const GLASS: bool> {
    wi: Vec3,
    lambda_i: f32,
    smooth: bool,
    material: &'a Material,
    metal: Option<(&'a Metal, Vec3, f32)>,
    coat: Option<(&'a Coat, f32, f32)>,
    glass: Option<(&'a Glass, Vec3, f32)>,
    /// Index of the far side over that of the near side, for the glass.
    eta: f32,
    diffuse: Vec3,
    diffuse_probability: f32,
}

impl<'a, const GLOSSY: bool, const GLASS: bool> Bsdf<'a, GLOSSY, GLASS> {
    /// `inside`: whether the path meets the surface from its back.
    #[inline(always)]
    pub fn new(material: &'a Material, wi: Vec3, inside: bool) -> Self {
        let smooth = material.ggx.is_smooth();
        let mut out = Self {
            wi,
            lambda_i: if (GLOSSY || GLASS) && !smooth {
                material.ggx.lambda(wi.z)
            } else {
                0.0
            },
            smooth,
            material,
            metal: None,
            coat: None,
            glass: None,
            eta: 1.0,
            diffuse: material.diffuse,
            diffuse_probability: 0.0,
        };
        let mut total = 0.0;
        if GLOSSY && let Some((facets, mean)) = &material.facets {
            let single = if smooth { 1.0 } else { facets.at(wi.z) };
            if let Some(metal) = &material.metal {
                let scale = regain(metal.multiple, single, *mean) * metal.weight;
                let p = metal.weight * fresnel::schlick(metal.f0, wi.z).mean();
                out.metal = Some((metal, scale, p));
                total += p;
            }
            if let Some(coat) = &material.coat {
                let scale = regain(Vec3::splat(coat.multiple), single, *mean).x;
                let reflected = if smooth {
                    fresnel::dielectric(wi.z, coat.eta).0
                } else {
                    coat.single.at(wi.z) * scale
                };
                out.diffuse *= (1.0 - reflected).max(0.0);
                let p = coat.weight * reflected;
                out.coat = Some((coat, scale * coat.weight, p));
                total += p;
            }
        }
        if GLASS && let Some(glass) = &material.glass {
            out.eta = if inside { 1.0 / glass.ior } else { glass.ior };
            let side = usize::from(inside);
            let single = if smooth {
                1.0
            } else {
                glass.single[side].at(wi.z)
            };
            let scale = regain(glass.tint, single, glass.mean[side]) * glass.weight;
            out.glass = Some((glass, scale, glass.weight));
            total += glass.weight;
        }
        let diffuse = out.diffuse.mean();
        total += diffuse;
        if total > 0.0 {
            let norm = 1.0 / total;
            out.diffuse_probability = diffuse * norm;
            if let Some((_, _, p)) = &mut out.metal {
                *p *= norm;
            }
            if let Some((_, _, p)) = &mut out.coat {
                *p *= norm;
            }
            if let Some((_, _, p)) = &mut out.glass {
                *p *= norm;
            }
        }
        out
    }

    /// Whether light can pass to the other side.
    #[inline(always)]
    pub fn transmits(&self) -> bool {
        GLASS && self.glass.is_some()
    }

    /// BSDF × |cosine| and the density of [`Self::sample`] for a direction. Mirrors and windows
    /// count nothing here.
    #[inline(always)]
    pub fn eval(&self, wo: Vec3) -> (Vec3, f32) {
        if wo.z > 0.0 {
            self.eval_reflection(wo)
        } else if GLASS && wo.z < 0.0 {
            self.eval_refraction(wo)
        } else {
            (Vec3::ZERO, 0.0)
        }
    }

    #[inline(always)]
    fn eval_reflection(&self, wo: Vec3) -> (Vec3, f32) {
        let lambert = wo.z * FRAC_1_PI;
        let mut f = self.diffuse * lambert;
        let mut pdf = self.diffuse_probability * lambert;
        if (GLOSSY || GLASS) && !self.smooth {
            let h = (self.wi + wo).normalized_or(vec3(0.0, 0.0, 1.0));
            let c = self.wi.dot(h);
            let common = self.material.ggx.d(h) * 0.25 / self.wi.z;
            let seen = common / (1.0 + self.lambda_i);
            let both = common / (1.0 + self.lambda_i + self.material.ggx.lambda(wo.z));
            if let Some((metal, scale, p)) = &self.metal {
                f += fresnel::schlick(metal.f0, c) * *scale * both;
                pdf += p * seen;
            }
            if let Some((coat, scale, p)) = &self.coat {
                f += Vec3::splat(fresnel::dielectric(c, coat.eta).0 * scale * both);
                pdf += p * seen;
            }
            if GLASS && let Some((glass, scale, p)) = &self.glass {
                let (reflectance, _) = fresnel::dielectric(c, self.eta);
                f += *scale * (reflectance * both);
                pdf += p * reflect_probability(reflectance, glass.tint) * seen;
            }
        }
        (f, pdf)
    }

    #[inline(always)]
    fn eval_refraction(&self, wo: Vec3) -> (Vec3, f32) {
        let Some((glass, scale, p)) = &self.glass else {
            return (Vec3::ZERO, 0.0);
        };
        if self.smooth || self.is_window() {
            return (Vec3::ZERO, 0.0);
        }
        let sum = -(wo * self.eta + self.wi);
        let inverse_length = 1.0 / sum.length().max(1e-20);
        let mut h = sum * inverse_length;
        if h.z < 0.0 {
            h = -h;
        }
        let (c, ct) = (self.wi.dot(h), wo.dot(h));
        if c <= 0.0 || ct >= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let (reflectance, _) = fresnel::dielectric(c, self.eta);
        let jacobian = self.eta * inverse_length;
        let common = self.material.ggx.d(h) / self.wi.z * jacobian * jacobian * (c * ct).abs();
        let both = common / (1.0 + self.lambda_i + self.material.ggx.lambda(wo.z));
        let seen = common / (1.0 + self.lambda_i);
        let f = *scale * glass.tint * ((1.0 - reflectance) * both);
        (
            f,
            p * (1.0 - reflect_probability(reflectance, glass.tint)) * seen,
        )
    }

    /// A direction in proportion to the lobes, or `None` when the path ends here. `choice` picks
    /// the lobe.
    #[inline(always)]
    pub fn sample(&self, choice: f32, u: [f32; 2]) -> Option<Scatter> {
        let mut left = choice;
        if GLOSSY && let Some((metal, scale, p)) = &self.metal {
            if left < *p {
                let f = fresnel::schlick(metal.f0, self.wi.z) * *scale;
                return self.sample_reflection(u, f * (1.0 / p));
            }
            left -= p;
        }
        if GLOSSY && let Some((coat, scale, p)) = &self.coat {
            if left < *p {
                let f = fresnel::dielectric(self.wi.z, coat.eta).0 * scale;
                return self.sample_reflection(u, Vec3::splat(f / p));
            }
            left -= p;
        }
        if GLASS
            && let Some((glass, scale, p)) = &self.glass
            && left < *p
        {
            return self.sample_glass(glass, *scale, *p, left / p, u);
        }
        if self.diffuse_probability <= 0.0 {
            return None;
        }
        // Malley's method: a uniform disc lifted onto the hemisphere.
        let (sin, cos) = sin_cos_turns(u[0]);
        let r = u[1].sqrt();
        let wo = vec3(r * cos, r * sin, (1.0 - u[1]).max(0.0).sqrt());
        self.finish(wo)
    }

    #[inline(always)]
    fn sample_reflection(&self, u: [f32; 2], mirror_weight: Vec3) -> Option<Scatter> {
        if self.smooth {
            let wo = vec3(-self.wi.x, -self.wi.y, self.wi.z);
            return Some(Scatter {
                wo,
                weight: mirror_weight,
                pdf: f32::INFINITY,
            });
        }
        let h = self.material.ggx.sample_visible(self.wi, u);
        let wo = h * (2.0 * self.wi.dot(h)) - self.wi;
        if wo.z > 0.0 { self.finish(wo) } else { None }
    }

    #[inline(always)]
    fn sample_glass(
        &self,
        glass: &Glass,
        scale: Vec3,
        p: f32,
        choice: f32,
        u: [f32; 2],
    ) -> Option<Scatter> {
        let h = if self.smooth {
            vec3(0.0, 0.0, 1.0)
        } else {
            self.material.ggx.sample_visible(self.wi, u)
        };
        let c = self.wi.dot(h);
        let (reflectance, cos_t) = fresnel::dielectric(c, self.eta);
        let reflect = reflect_probability(reflectance, glass.tint);
        if choice < reflect {
            let wo = h * (2.0 * c) - self.wi;
            if wo.z <= 0.0 {
                return None;
            }
            if self.smooth {
                let weight = scale * (reflectance / (p * reflect));
                return Some(Scatter {
                    wo,
                    weight,
                    pdf: f32::INFINITY,
                });
            }
            return self.finish(wo);
        }
        let wo = h * (c / self.eta - cos_t) - self.wi * (1.0 / self.eta);
        if wo.z >= 0.0 {
            return None;
        }
        if self.smooth || self.is_window() {
            let weight = scale * glass.tint * ((1.0 - reflectance) / (p * (1.0 - reflect)));
            return Some(Scatter {
                wo,
                weight,
                pdf: f32::INFINITY,
            });
        }
        self.finish(wo)
    }

    #[inline(always)]
    fn finish(&self, wo: Vec3) -> Option<Scatter> {
        let (f, pdf) = self.eval(wo);
        (pdf > 0.0).then(|| Scatter {
            wo,
            weight: f * (1.0 / pdf),
            pdf,
        })
    }

    /// So little refraction that the half vector is undefined: light passes straight on.
    #[inline(always)]
    fn is_window(&self) -> bool {
        (self.eta - 1.0).abs() < 1e-4
    }
}

/// How much brighter than a single bounce the lobe has to be so that no energy is lost, given the
/// albedo `single` of one bounce, its mean and the mean reflectance between facets. Kulla and
/// Conty 2017, appendix, in the form of Cycles' `microfacet_ggx_preserve_energy`.
#[inline(always)]
fn regain(reflectance: Vec3, single: f32, mean: f32) -> Vec3 {
    let missing = (1.0 - single) / single.max(1e-4);
    reflectance.map(|f| 1.0 + f * mean / (1.0 - f * (1.0 - mean)).max(1e-6) * missing)
}

/// Share of the samples of glass that reflect: by energy.
#[inline(always)]
fn reflect_probability(reflectance: f32, tint: Vec3) -> f32 {
    let passed = (1.0 - reflectance) * tint.mean();
    if reflectance + passed > 0.0 {
        reflectance / (reflectance + passed)
    } else {
        1.0
    }
}

#[cfg(test)]
mod tests {
    use super::super::material::MaterialParams;
    use std::f32::consts::TAU;

    use super::super::sampler::PixelSampler;
    use super::*;

    fn compile(params: MaterialParams) -> Material {
        Material::new(&params, 0).unwrap()
    }

    fn view(cos: f32) -> Vec3 {
        vec3((1.0 - cos * cos).sqrt(), 0.0, cos)
    }

    /// Albedo by sampling: the mean weight of `n` samples.
    fn albedo(material: &Material, cos: f32, inside: bool) -> f64 {
        let sampler = PixelSampler::new(3, 5, 7);
        let bsdf = Bsdf::<true, true>::new(material, view(cos), inside);
        let n = 1 << 15;
        let sum: f64 = (0..n)
            .filter_map(|i| bsdf.sample(sampler.pair(i, 0)[0], sampler.pair(i, 1)))
            .map(|s| f64::from(s.weight.mean()))
            .sum();
        sum / f64::from(n)
    }

    const WHITE: [f32; 3] = [1.0; 3];

    #[test]
    fn white_furnace_of_every_lobe() {
        let lobes = [
            (
                "diffuse",
                MaterialParams {
                    specular: 0.0,
                    ..Default::default()
                },
            ),
            (
                "metal",
                MaterialParams {
                    metallic: 1.0,
                    ..Default::default()
                },
            ),
            (
                "glass",
                MaterialParams {
                    transmission: 1.0,
                    ..Default::default()
                },
            ),
            ("coated", MaterialParams::default()),
            (
                "mixed",
                MaterialParams {
                    metallic: 0.3,
                    transmission: 0.5,
                    ..Default::default()
                },
            ),
        ];
        for (name, lobe) in lobes {
            for roughness in [0.0, 0.1, 0.5, 1.0] {
                let material = compile(MaterialParams {
                    base_color: WHITE,
                    roughness,
                    ..lobe.clone()
                });
                for cos in [0.1, 0.4, 0.7, 1.0] {
                    for inside in [false, true] {
                        let a = albedo(&material, cos, inside);
                        assert!(
                            (a - 1.0).abs() < 0.003,
                            "{name} roughness {roughness} cos {cos} inside {inside}: {a}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn the_density_is_that_of_the_samples() {
        // The density integrates to the share of samples that were not lost; checked with uniform
        // directions over the whole sphere.
        let sampler = PixelSampler::new(1, 1, 1);
        for (metallic, transmission) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.3, 0.5)] {
            for inside in [false, true] {
                let material = compile(MaterialParams {
                    metallic,
                    transmission,
                    roughness: 0.6,
                    ..Default::default()
                });
                let bsdf = Bsdf::<true, true>::new(&material, view(0.6), inside);
                let n = 1 << 17;
                let (mut density, mut energy, mut kept, mut sampled) = (0.0, 0.0, 0.0, 0.0);
                for i in 0..n {
                    let u = sampler.pair(i, 4);
                    let z = 1.0 - 2.0 * u[1];
                    let r = (1.0 - z * z).max(0.0).sqrt();
                    let (sin, cos) = (TAU * u[0]).sin_cos();
                    let (f, pdf) = bsdf.eval(vec3(r * cos, r * sin, z));
                    density += f64::from(pdf) * 2.0 * f64::from(TAU);
                    energy += f64::from(f.mean()) * 2.0 * f64::from(TAU);
                    if let Some(s) = bsdf.sample(sampler.pair(i, 0)[0], sampler.pair(i, 1)) {
                        kept += 1.0;
                        sampled += f64::from(s.weight.mean());
                    }
                }
                let n = f64::from(n);
                assert!(
                    (density / n - kept / n).abs() < 0.01,
                    "{metallic} {transmission} {inside}"
                );
                assert!(
                    (energy / n - sampled / n).abs() < 0.01,
                    "{metallic} {transmission} {inside}"
                );
            }
        }
    }

    #[test]
    fn samples_fall_where_the_density_says() {
        // Counts of samples in 12 × 12 bins of the sphere against the density integrated over
        // each bin; the sampler's nets keep the noise of a count far below its square root.
        const BINS: usize = 12;
        let sampler = PixelSampler::new(9, 2, 5);
        for roughness in [0.3, 0.6] {
            for (metallic, transmission) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)] {
                for (inside, cos) in [(false, 0.5), (true, 0.9), (true, 0.5)] {
                    let material = compile(MaterialParams {
                        metallic,
                        transmission,
                        roughness,
                        ..Default::default()
                    });
                    let bsdf = Bsdf::<true, true>::new(&material, view(cos), inside);
                    let bin = |w: Vec3| {
                        let z = ((0.5 * (w.z + 1.0)) * BINS as f32) as usize;
                        let turn = w.y.atan2(w.x) / TAU + 0.5;
                        z.min(BINS - 1) * BINS + ((turn * BINS as f32) as usize).min(BINS - 1)
                    };
                    let n = 1 << 17;
                    let (mut counted, mut integrated) = ([0.0; BINS * BINS], [0.0; BINS * BINS]);
                    for i in 0..n {
                        if let Some(s) = bsdf.sample(sampler.pair(i, 0)[0], sampler.pair(i, 1)) {
                            counted[bin(s.wo)] += 1.0 / f64::from(n);
                        }
                        let u = sampler.pair(i, 4);
                        let z = 1.0 - 2.0 * u[1];
                        let r = (1.0 - z * z).max(0.0).sqrt();
                        let (sin, cos) = (TAU * u[0]).sin_cos();
                        let w = vec3(r * cos, r * sin, z);
                        integrated[bin(w)] +=
                            f64::from(bsdf.eval(w).1) * 2.0 * f64::from(TAU) / f64::from(n);
                    }
                    for (i, (c, p)) in counted.iter().zip(integrated).enumerate() {
                        assert!(
                            (c - p).abs() < 2e-3 + 0.03 * p,
                            "metal {metallic} glass {transmission} rough {roughness} inside {inside} \
                             bin {} {}: {c} {p}",
                            i / BINS,
                            i % BINS
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn reflection_is_reciprocal() {
        // Without the regained energy, which is scaled by the viewing side only (as in Cycles),
        // f(wi, wo) = f(wo, wi).
        let material = compile(MaterialParams {
            metallic: 1.0,
            roughness: 0.5,
            ..Default::default()
        });
        let (a, b) = (
            vec3(0.3, 0.2, 0.933).normalized(),
            vec3(-0.5, 0.4, 0.768).normalized(),
        );
        let value = |wi: Vec3, wo: Vec3| {
            let bsdf = Bsdf::<true, false>::new(&material, wi, false);
            let scale = bsdf.metal.as_ref().unwrap().1.x;
            bsdf.eval(wo).0.x / wo.z / scale
        };
        assert!((value(a, b) / value(b, a) - 1.0).abs() < 1e-4);
    }

    #[test]
    fn a_mirror_reflects_and_a_window_refracts_by_snell() {
        let mirror = compile(MaterialParams {
            metallic: 1.0,
            roughness: 0.0,
            ..Default::default()
        });
        let bsdf = Bsdf::<true, true>::new(&mirror, view(0.6), false);
        let s = bsdf.sample(0.5, [0.1, 0.9]).unwrap();
        assert_eq!((s.wo, s.pdf), (vec3(-0.8, 0.0, 0.6), f32::INFINITY));
        let glass = compile(MaterialParams {
            transmission: 1.0,
            roughness: 0.0,
            base_color: WHITE,
            ..Default::default()
        });
        let bsdf = Bsdf::<true, true>::new(&glass, view(0.6), false);
        let s = bsdf.sample(0.999, [0.1, 0.9]).unwrap();
        assert!((s.wo.x + 0.8 / 1.5).abs() < 1e-6 && s.wo.z < 0.0);
        assert_eq!(bsdf.eval(s.wo).1, 0.0, "a window has no density");
    }
}
