// SPDX-License-Identifier: GPL-3.0-or-later
//! A material seen from one direction: evaluate it, sample it.
//!
//! Directions are in the shading frame (z = shading normal) and point away from the surface; `wi`
//! is where the path came from (z > 0), `wo` where it goes. `GLOSSY` and `GLASS` say whether the
//! scene has such lobes at all: without them their code is not compiled into the path.

use std::f32::consts::FRAC_1_PI;

use super::closure::{Closure, Fresnel, LobeGrids, Parts, Reflector, Transmitter};
use super::fresnel;
use super::ggx::Ggx;
use super::place::{RayKind, bump_shadow};
use super::program::Value;
use super::trig::sin_cos_turns;
use super::vector::{Frame, Vec3, vec3};
use super::visibility::Visibility;

/// The other normals at the point, in the shading frame, whose z axis is the normal of facets.
#[derive(Debug, Clone, Copy)]
pub struct Normals {
    /// The triangle's, towards the viewer.
    pub geometric: Vec3,
    /// The surface's own and the one the material gave it, where it gave one. Facets take the
    /// latter bent so that a mirror sees nothing inside; the matte base takes it as it is.
    pub mapped: Option<[Vec3; 2]>,
}

impl Normals {
    /// All the same.
    pub const FLAT: Self = Self {
        geometric: vec3(0.0, 0.0, 1.0),
        mapped: None,
    };
}

/// A sampled direction.
#[derive(Debug, Clone, Copy)]
pub struct Scatter {
    /// Where the path goes.
    pub wo: Vec3,
    /// BSDF × cosine / density.
    pub weight: Vec3,
    /// Density per solid angle; infinite for a mirror or window, which no light sample can find.
    pub pdf: f32,
    /// What happened.
    pub kind: RayKind,
}

/// Reflection off facets, for one viewing direction.
#[derive(Clone, Copy)]
struct Facets {
    ggx: Ggx,
    smooth: bool,
    lambda_i: f32,
    fresnel: Fresnel,
    scale: Vec3,
    /// Share of the samples.
    p: f32,
}

/// Reflection and refraction at facets, for one viewing direction.
#[derive(Clone, Copy)]
struct Boundary {
    ggx: Ggx,
    smooth: bool,
    lambda_i: f32,
    /// Index of the far side over that of the near side.
    eta: f32,
    scale: Vec3,
    reflect: Option<Vec3>,
    tint: Vec3,
    p: f32,
}

/// Most facet lobes of a material, and most boundaries.
pub const MOST_FACETS: usize = 12;
const MOST_BOUNDARIES: usize = super::material::MOST_CLOSURES;

/// The lobes of a material with their weights for one viewing direction.
pub struct Bsdf<const GLOSSY: bool, const GLASS: bool> {
    wi: Vec3,
    normals: Normals,
    facets: [Facets; MOST_FACETS],
    facet_count: usize,
    boundaries: [Boundary; MOST_BOUNDARIES],
    boundary_count: usize,
    diffuse: Vec3,
    diffuse_probability: f32,
}

impl<const GLOSSY: bool, const GLASS: bool> Bsdf<GLOSSY, GLASS> {
    /// `registers`: what the material's program has computed. `inside`: whether the path meets the
    /// surface from its back.
    #[inline(always)]
    pub fn new(
        closures: &[Closure],
        registers: &[Value],
        wi: Vec3,
        normals: Normals,
        inside: bool,
    ) -> Self {
        const NO_FACETS: Facets = Facets {
            ggx: Ggx::MIRROR,
            smooth: true,
            lambda_i: 0.0,
            fresnel: Fresnel::Metal {
                f0: Vec3::ZERO,
                edge: Vec3::ZERO,
                dip: Vec3::ZERO,
            },
            scale: Vec3::ZERO,
            p: 0.0,
        };
        const NO_BOUNDARY: Boundary = Boundary {
            ggx: Ggx::MIRROR,
            smooth: true,
            lambda_i: 0.0,
            eta: 1.0,
            scale: Vec3::ZERO,
            reflect: None,
            tint: Vec3::ZERO,
            p: 0.0,
        };
        let mut out = Self {
            wi,
            normals,
            facets: [NO_FACETS; MOST_FACETS],
            facet_count: 0,
            boundaries: [NO_BOUNDARY; MOST_BOUNDARIES],
            boundary_count: 0,
            diffuse: Vec3::ZERO,
            diffuse_probability: 0.0,
        };
        for closure in closures {
            out.add(&closure.parts(registers), closure, inside);
        }
        out.share_samples();
        out
    }

    #[inline(always)]
    fn add(&mut self, parts: &Parts, closure: &Closure, inside: bool) {
        if parts.weight <= 0.0 {
            return;
        }
        let mut weight = Vec3::splat(parts.weight);
        let LobeGrids {
            reflection,
            layer,
            coat,
            glass,
        } = &closure.grids;
        let multiscatter = closure.multiscatter;
        if GLOSSY
            && let (Some((reflector, absorb)), Some([facets, dielectric])) = (&parts.coat, coat)
        {
            let eta = match reflector.fresnel {
                Fresnel::Dielectric { eta, .. } => eta,
                Fresnel::Metal { .. } => 1.0,
            };
            let single = facets.at(reflector.roughness, 1.0, self.wi.z);
            let albedo = dielectric.at(reflector.roughness, eta, self.wi.z).0;
            let reflected = self.add_facets(reflector, weight, single, Some(albedo), true);
            weight *= (1.0 - reflected).max(0.0);
            if *absorb != Vec3::ONE {
                // The way through the coat is longer when seen from the side.
                let (_, cos_t) = fresnel::dielectric(self.wi.z, eta);
                let way = 1.0 / cos_t.max(1e-3);
                let share = reflector.weight.x;
                weight = weight * absorb.map(|c| 1.0 - share + share * c.powf(way));
            }
        }
        if GLOSSY
            && let Some(grid) = reflection
            && (parts.metal.is_some() || parts.layer.is_some())
        {
            let single = |r: &Reflector| grid.at(r.roughness, 1.0, self.wi.z);
            if let Some(metal) = &parts.metal {
                self.add_facets(metal, weight, single(metal), None, multiscatter);
            }
            let single = parts.layer.map(|l| grid.at(l.roughness, 1.0, self.wi.z));
            if let (Some(reflector), Some(single)) = (&parts.layer, single) {
                let eta = match reflector.fresnel {
                    Fresnel::Dielectric { eta, .. } => eta,
                    Fresnel::Metal { .. } => 1.0,
                };
                let albedo = layer
                    .as_ref()
                    .map(|g| g.at(reflector.roughness, eta, self.wi.z).0);
                let share = reflector.weight.x;
                let reflected = self.add_facets(reflector, weight, single, albedo, multiscatter);
                // `diffuse` holds the share already.
                let left = 1.0 - reflected / share.max(1e-6);
                self.diffuse += weight * parts.diffuse * left.max(0.0);
            } else {
                self.diffuse += weight * parts.diffuse;
            }
        } else {
            self.diffuse += weight * parts.diffuse;
        }
        if GLASS && let Some(transmitter) = &parts.glass {
            let single = glass.as_ref().map(|grids| {
                let side = usize::from(inside != (transmitter.ior < 1.0 && grids[0].varies()));
                grids[side].at(transmitter.roughness, transmitter.ior, self.wi.z)
            });
            self.add_boundary(transmitter, weight, single.filter(|_| multiscatter), inside);
        }
    }

    /// Adds a reflecting lobe and returns how much it reflects of what `weight` brings. `single`:
    /// albedo of white facets and its mean; `albedo`: of the dielectric ones.
    #[inline(always)]
    fn add_facets(
        &mut self,
        reflector: &Reflector,
        weight: Vec3,
        single: (f32, f32),
        albedo: Option<f32>,
        multiscatter: bool,
    ) -> f32 {
        let Reflector {
            ggx,
            fresnel,
            multiple,
            ..
        } = *reflector;
        let smooth = ggx.is_smooth();
        let (single, mean) = if smooth { (1.0, 1.0) } else { single };
        let regained = if multiscatter {
            regain(multiple, single, mean)
        } else {
            Vec3::ONE
        };
        let reflected = match (fresnel, albedo) {
            (Fresnel::Dielectric { own, f0, .. }, Some(albedo)) if !smooth => {
                // `Fresnel::at` is linear in the boundary's own reflectance, so its mean is too.
                let rest = (albedo - own * single) / (1.0 - own).max(1e-6);
                f0 * (single - rest) + Vec3::splat(rest)
            }
            _ => fresnel.at(self.wi.z) * single,
        } * regained
            * reflector.weight;
        if self.facet_count < MOST_FACETS {
            self.facets[self.facet_count] = Facets {
                ggx,
                smooth,
                lambda_i: if smooth { 0.0 } else { ggx.lambda(self.wi.z) },
                fresnel,
                scale: weight * reflector.weight * regained,
                p: (weight * reflected).mean().max(1e-8),
            };
            self.facet_count += 1;
        }
        reflected.max_component()
    }

    #[inline(always)]
    fn add_boundary(
        &mut self,
        transmitter: &Transmitter,
        weight: Vec3,
        single: Option<(f32, f32)>,
        inside: bool,
    ) {
        let smooth = transmitter.ggx.is_smooth();
        let regained = match single {
            Some((single, mean)) if !smooth => regain(transmitter.tint, single, mean),
            _ => Vec3::ONE,
        };
        if self.boundary_count < MOST_BOUNDARIES {
            self.boundaries[self.boundary_count] = Boundary {
                ggx: transmitter.ggx,
                smooth,
                lambda_i: if smooth {
                    0.0
                } else {
                    transmitter.ggx.lambda(self.wi.z)
                },
                eta: if inside {
                    1.0 / transmitter.ior
                } else {
                    transmitter.ior
                },
                scale: weight * regained * transmitter.weight,
                reflect: transmitter.reflect,
                tint: transmitter.tint,
                p: (weight.mean() * transmitter.weight).max(1e-8),
            };
            self.boundary_count += 1;
        }
    }

    #[inline(always)]
    fn share_samples(&mut self) {
        self.diffuse_probability = self.diffuse.mean();
        let mut total = self.diffuse_probability;
        if GLOSSY {
            total += self.facets[..self.facet_count]
                .iter()
                .map(|f| f.p)
                .sum::<f32>();
        }
        if GLASS {
            let boundaries = &self.boundaries[..self.boundary_count];
            total += boundaries.iter().map(|b| b.p).sum::<f32>();
        }
        if total > 0.0 {
            let norm = 1.0 / total;
            self.diffuse_probability *= norm;
            if GLOSSY {
                self.facets[..self.facet_count]
                    .iter_mut()
                    .for_each(|f| f.p *= norm);
            }
            if GLASS {
                self.boundaries[..self.boundary_count]
                    .iter_mut()
                    .for_each(|b| b.p *= norm);
            }
        }
    }

    /// Whether light can pass to the other side.
    #[inline(always)]
    pub fn transmits(&self) -> bool {
        GLASS && self.boundary_count > 0
    }

    /// Whether there is a reflecting lobe.
    #[inline(always)]
    pub fn reflects(&self) -> bool {
        GLOSSY && self.facet_count > 0
    }

    /// Whether some lobe has a density, so that light samples are worth a ray.
    #[inline(always)]
    pub fn has_density(&self) -> bool {
        self.diffuse_probability > 0.0
            || (GLOSSY && self.facets[..self.facet_count].iter().any(|f| !f.smooth))
            || (GLASS
                && self.boundaries[..self.boundary_count]
                    .iter()
                    .any(|b| !b.smooth))
    }

    /// BSDF × |cosine| and the density of [`Self::sample`] for a direction. Mirrors and windows
    /// count nothing here.
    #[inline(always)]
    pub fn eval(&self, wo: Vec3) -> (Vec3, f32) {
        self.eval_lit(wo, Visibility::ALL)
    }

    /// The same by the lobes alone that see a light of this visibility.
    #[inline(always)]
    pub fn eval_lit(&self, wo: Vec3, visible: Visibility) -> (Vec3, f32) {
        let (mut f, mut pdf) = if visible.to(RayKind::Diffuse) {
            self.eval_diffuse(wo)
        } else {
            (Vec3::ZERO, 0.0)
        };
        // Facets send nothing through the surface that they should reflect, nor the reverse.
        let above = self.normals.geometric.dot(wo) >= 0.0;
        if let Some([own, _]) = self.normals.mapped
            && (own.dot(wo) >= 0.0) != above
        {
            return (f, pdf);
        }
        if wo.z > 0.0 && above && visible.to(RayKind::Glossy) {
            self.eval_reflection(wo, &mut f, &mut pdf);
        } else if GLASS && wo.z < 0.0 && !above && visible.to(RayKind::Transmission) {
            self.eval_refraction(wo, &mut f, &mut pdf);
        }
        (f, pdf)
    }

    #[inline(always)]
    fn eval_diffuse(&self, wo: Vec3) -> (Vec3, f32) {
        let (cos, lit) = match self.normals.mapped {
            None => (wo.z, 1.0),
            Some([own, mapped]) => (mapped.dot(wo), bump_shadow(own, mapped, wo)),
        };
        if cos <= 0.0 || lit == 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let lambert = cos * FRAC_1_PI;
        (
            self.diffuse * (lambert * lit),
            self.diffuse_probability * lambert,
        )
    }

    #[inline(always)]
    fn eval_reflection(&self, wo: Vec3, f: &mut Vec3, pdf: &mut f32) {
        if (GLOSSY && self.facet_count > 0) || (GLASS && self.boundary_count > 0) {
            let h = (self.wi + wo).normalized_or(vec3(0.0, 0.0, 1.0));
            let c = self.wi.dot(h);
            let densities = |ggx: Ggx, lambda_i: f32| {
                let common = ggx.d(h) * 0.25 / self.wi.z;
                let seen = common / (1.0 + lambda_i);
                (seen, common / (1.0 + lambda_i + ggx.lambda(wo.z)))
            };
            if GLOSSY {
                for facets in &self.facets[..self.facet_count] {
                    if !facets.smooth {
                        let (seen, both) = densities(facets.ggx, facets.lambda_i);
                        *f += facets.fresnel.at(c) * facets.scale * both;
                        *pdf += facets.p * seen;
                    }
                }
            }
            if GLASS {
                for boundary in &self.boundaries[..self.boundary_count] {
                    if let (false, Some(reflect)) = (boundary.smooth, boundary.reflect) {
                        let (seen, both) = densities(boundary.ggx, boundary.lambda_i);
                        let (reflectance, _) = fresnel::dielectric(c, boundary.eta);
                        *f += boundary.scale * reflect * (reflectance * both);
                        *pdf += boundary.p * boundary.reflect_probability(reflectance) * seen;
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn eval_refraction(&self, wo: Vec3, f: &mut Vec3, pdf: &mut f32) {
        for boundary in &self.boundaries[..self.boundary_count] {
            if boundary.smooth || boundary.is_window() {
                continue;
            }
            let eta = boundary.eta;
            let sum = -(wo * eta + self.wi);
            let inverse_length = 1.0 / sum.length().max(1e-20);
            let mut h = sum * inverse_length;
            if h.z < 0.0 {
                h = -h;
            }
            let (c, ct) = (self.wi.dot(h), wo.dot(h));
            if c <= 0.0 || ct >= 0.0 {
                continue;
            }
            let (reflectance, _) = fresnel::dielectric(c, eta);
            let passed = if boundary.reflect.is_some() {
                1.0 - reflectance
            } else {
                1.0
            };
            let jacobian = eta * inverse_length;
            let common = boundary.ggx.d(h) / self.wi.z * jacobian * jacobian * (c * ct).abs();
            let both = common / (1.0 + boundary.lambda_i + boundary.ggx.lambda(wo.z));
            let seen = common / (1.0 + boundary.lambda_i);
            *f += boundary.scale * boundary.tint * (passed * both);
            *pdf += boundary.p * (1.0 - boundary.reflect_probability(reflectance)) * seen;
        }
    }

    /// A direction in proportion to the lobes, or `None` when the path ends here. `choice` picks
    /// the lobe.
    #[inline(always)]
    pub fn sample(&self, choice: f32, u: [f32; 2]) -> Option<Scatter> {
        let mut left = choice;
        if GLOSSY {
            for facets in &self.facets[..self.facet_count] {
                if left < facets.p {
                    return self.sample_facets(facets, u);
                }
                left -= facets.p;
            }
        }
        if GLASS {
            for boundary in &self.boundaries[..self.boundary_count] {
                if left < boundary.p {
                    return self.sample_boundary(boundary, left / boundary.p, u);
                }
                left -= boundary.p;
            }
        }
        if self.diffuse_probability <= 0.0 {
            return None;
        }
        let about = cosine_direction(u);
        let wo = match self.normals.mapped {
            None => about,
            Some([_, mapped]) => Frame::around(mapped).to_world(about),
        };
        self.finish(wo, RayKind::Diffuse)
    }

    #[inline(always)]
    fn sample_facets(&self, facets: &Facets, u: [f32; 2]) -> Option<Scatter> {
        if facets.smooth {
            let weight = facets.fresnel.at(self.wi.z) * facets.scale;
            return Some(Scatter {
                wo: vec3(-self.wi.x, -self.wi.y, self.wi.z),
                weight: weight * (1.0 / facets.p),
                pdf: f32::INFINITY,
                kind: RayKind::Glossy,
            });
        }
        let h = facets.ggx.sample_visible(self.wi, u);
        let wo = h * (2.0 * self.wi.dot(h)) - self.wi;
        if wo.z > 0.0 {
            self.finish(wo, RayKind::Glossy)
        } else {
            None
        }
    }

    #[inline(always)]
    fn sample_boundary(&self, boundary: &Boundary, choice: f32, u: [f32; 2]) -> Option<Scatter> {
        let h = if boundary.smooth {
            vec3(0.0, 0.0, 1.0)
        } else {
            boundary.ggx.sample_visible(self.wi, u)
        };
        let c = self.wi.dot(h);
        let (reflectance, cos_t) = fresnel::dielectric(c, boundary.eta);
        let reflect = boundary.reflect_probability(reflectance);
        if choice < reflect {
            let wo = h * (2.0 * c) - self.wi;
            if wo.z <= 0.0 {
                return None;
            }
            if boundary.smooth {
                let tint = boundary.reflect.unwrap_or(Vec3::ZERO);
                return Some(Scatter {
                    wo,
                    weight: boundary.scale * tint * (reflectance / (boundary.p * reflect)),
                    pdf: f32::INFINITY,
                    kind: RayKind::Glossy,
                });
            }
            return self.finish(wo, RayKind::Glossy);
        }
        if cos_t <= 0.0 {
            // All is reflected, and this boundary does not.
            return None;
        }
        let wo = h * (c / boundary.eta - cos_t) - self.wi * (1.0 / boundary.eta);
        if wo.z >= 0.0 {
            return None;
        }
        if boundary.smooth || boundary.is_window() {
            let passed = if boundary.reflect.is_some() {
                1.0 - reflectance
            } else {
                1.0
            };
            return Some(Scatter {
                wo,
                weight: boundary.scale * boundary.tint * (passed / (boundary.p * (1.0 - reflect))),
                pdf: f32::INFINITY,
                kind: RayKind::Transmission,
            });
        }
        self.finish(wo, RayKind::Transmission)
    }

    #[inline(always)]
    fn finish(&self, wo: Vec3, kind: RayKind) -> Option<Scatter> {
        let (f, pdf) = self.eval(wo);
        (pdf > 0.0).then(|| Scatter {
            wo,
            weight: f * (1.0 / pdf),
            pdf,
            kind,
        })
    }
}

impl Boundary {
    /// So little refraction that the half vector is undefined: light passes straight on.
    #[inline(always)]
    fn is_window(&self) -> bool {
        (self.eta - 1.0).abs() < 1e-4
    }

    /// Share of the samples that reflect: by energy.
    #[inline(always)]
    fn reflect_probability(&self, reflectance: f32) -> f32 {
        let Some(tint) = self.reflect else {
            return 0.0;
        };
        let reflected = reflectance * tint.mean();
        let passed = (1.0 - reflectance) * self.tint.mean();
        if reflected + passed > 0.0 {
            reflected / (reflected + passed)
        } else {
            1.0
        }
    }
}

/// A direction about the z axis in proportion to its cosine: Malley's method, a uniform disc
/// lifted onto the hemisphere.
#[inline(always)]
pub fn cosine_direction(u: [f32; 2]) -> Vec3 {
    let (sin, cos) = sin_cos_turns(u[0]);
    let r = u[1].sqrt();
    vec3(r * cos, r * sin, (1.0 - u[1]).max(0.0).sqrt())
}

/// How much brighter than a single bounce the lobe has to be so that no energy is lost, given the
/// albedo `single` of one bounce, its mean and the mean reflectance between facets. Kulla and
/// Conty 2017, appendix, in the form of Cycles' `microfacet_ggx_preserve_energy`.
#[inline(always)]
fn regain(reflectance: Vec3, single: f32, mean: f32) -> Vec3 {
    let missing = (1.0 - single) / single.max(1e-4);
    reflectance.map(|f| 1.0 + f * mean / (1.0 - f * (1.0 - mean)).max(1e-6) * missing)
}

#[cfg(test)]
mod tests {
    use super::super::albedo::Grids;
    use super::super::closure::{ClosureParams, Input, Kind};
    use super::super::material::{Material, MaterialParams};
    use super::super::program::{Op, Operand, Step};
    use std::f32::consts::TAU;

    use super::super::sampler::PixelSampler;
    use super::*;

    fn compile(params: MaterialParams) -> Material {
        Material::new(&params, 0, &mut Grids::default()).unwrap()
    }

    /// A material of one shader node with a white colour and this roughness.
    fn node(kind: Kind, roughness: f32, more: &[(Input, f32)]) -> Material {
        let mut closure = ClosureParams::new(kind);
        let white = [(Input::Color, 1.0), (Input::Roughness, roughness)];
        for &(input, value) in white.iter().chain(more) {
            closure.inputs[input as usize] = Operand::number(value);
        }
        compile(MaterialParams {
            closures: vec![closure],
            ..Default::default()
        })
    }

    fn seen(material: &Material, wi: Vec3, inside: bool) -> Bsdf<true, true> {
        Bsdf::new(&material.closures, &[], wi, Normals::FLAT, inside)
    }

    fn view(cos: f32) -> Vec3 {
        vec3((1.0 - cos * cos).sqrt(), 0.0, cos)
    }

    /// Albedo by sampling: the mean weight of `n` samples.
    fn albedo(material: &Material, cos: f32, inside: bool) -> f64 {
        let sampler = PixelSampler::new(3, 5, 7);
        let bsdf = seen(material, view(cos), inside);
        let n = 1 << 16;
        let sum: f64 = (0..n)
            .filter_map(|i| bsdf.sample(sampler.pair(i, 0)[0], sampler.pair(i, 1)))
            .map(|s| f64::from(s.weight.mean()))
            .sum();
        sum / f64::from(n)
    }

    const WHITE: [f32; 3] = [1.0; 3];

    #[test]
    fn white_furnace_of_every_shader_node() {
        let principled = |more: &[(Input, f32)]| {
            let more = more.to_vec();
            move |roughness| node(Kind::Principled, roughness, &more)
        };
        type Make = Box<dyn Fn(f32) -> Material>;
        let cases: Vec<(&str, Make)> = vec![
            ("Diffuse", Box::new(|r| node(Kind::Diffuse, r, &[]))),
            ("Glossy", Box::new(|r| node(Kind::Glossy, r, &[]))),
            ("Glass", Box::new(|r| node(Kind::Glass, r, &[]))),
            ("Principled", Box::new(principled(&[]))),
            (
                "without a layer",
                Box::new(principled(&[(Input::Specular, 0.0)])),
            ),
            ("metal", Box::new(principled(&[(Input::Metallic, 1.0)]))),
            (
                "transmission",
                Box::new(principled(&[(Input::Transmission, 1.0)])),
            ),
            (
                "mixed",
                Box::new(principled(&[
                    (Input::Metallic, 0.3),
                    (Input::Transmission, 0.5),
                ])),
            ),
            (
                "coated",
                Box::new(principled(&[
                    (Input::CoatWeight, 1.0),
                    (Input::CoatRoughness, 0.2),
                ])),
            ),
        ];
        for (name, make) in cases {
            for roughness in [0.0, 0.1, 0.5, 1.0] {
                let material = make(roughness);
                let mut wrong = Vec::new();
                for cos in [0.1, 0.4, 0.7, 1.0] {
                    for inside in [false, true] {
                        let a = albedo(&material, cos, inside);
                        if (a - 1.0).abs() > 0.002 {
                            wrong.push((cos, inside, a));
                        }
                    }
                }
                assert!(wrong.is_empty(), "{name} roughness {roughness}: {wrong:?}");
            }
        }
        // The Refraction node loses what its facets shadow, in Cycles as here; smooth, it does not.
        let refraction = node(Kind::Refraction, 0.0, &[]);
        assert!((albedo(&refraction, 0.6, false) - 1.0).abs() < 1e-5);
        assert!(albedo(&node(Kind::Refraction, 0.5, &[]), 0.6, false) < 1.0);
    }

    #[test]
    fn a_furnace_is_white_where_the_inputs_vary_as_well() {
        // Roughness, index and specular from a program: the grids stand in for the tables.
        let mut closure = ClosureParams::new(Kind::Principled);
        for (i, input) in [Input::Roughness, Input::Ior, Input::Specular]
            .into_iter()
            .enumerate()
        {
            closure.inputs[input as usize] = Operand::Register(i as u16);
        }
        closure.inputs[Input::Color as usize] = Operand::number(1.0);
        closure.inputs[Input::Transmission as usize] = Operand::number(0.3);
        let step = Step {
            op: Op::Attribute(0),
            args: Vec::new(),
        };
        let material = compile(MaterialParams {
            closures: vec![closure],
            program: vec![step; 3],
            ..Default::default()
        });
        let sampler = PixelSampler::new(3, 5, 7);
        for (roughness, ior, specular) in [(0.23, 1.33, 0.3), (0.55, 1.6, 0.9), (0.97, 1.45, 0.5)] {
            let registers = [roughness, ior, specular].map(|x: f32| [x; 4]);
            for cos in [0.3, 0.8] {
                let bsdf = Bsdf::<true, true>::new(
                    &material.closures,
                    &registers,
                    view(cos),
                    Normals::FLAT,
                    false,
                );
                let n = 1 << 15;
                let sum: f64 = (0..n)
                    .filter_map(|i| bsdf.sample(sampler.pair(i, 0)[0], sampler.pair(i, 1)))
                    .map(|s| f64::from(s.weight.mean()))
                    .sum();
                let a = sum / f64::from(n);
                assert!(
                    (a - 1.0).abs() < 0.005,
                    "{roughness} {ior} {specular} {cos}: {a}"
                );
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
                let bsdf = seen(&material, view(0.6), inside);
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
                    let bsdf = seen(&material, view(cos), inside);
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
            let bsdf = seen(&material, wi, false);
            let scale = bsdf.facets[0].scale.x;
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
        let bsdf = seen(&mirror, view(0.6), false);
        let s = bsdf.sample(0.5, [0.1, 0.9]).unwrap();
        assert_eq!((s.wo, s.pdf), (vec3(-0.8, 0.0, 0.6), f32::INFINITY));
        let glass = compile(MaterialParams {
            transmission: 1.0,
            roughness: 0.0,
            base_color: WHITE,
            ..Default::default()
        });
        let bsdf = seen(&glass, view(0.6), false);
        let s = bsdf.sample(0.999, [0.1, 0.9]).unwrap();
        assert!((s.wo.x + 0.8 / 1.5).abs() < 1e-6 && s.wo.z < 0.0);
        assert_eq!(bsdf.eval(s.wo).1, 0.0, "a window has no density");
    }
}
