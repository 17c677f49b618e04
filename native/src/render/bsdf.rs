// SPDX-License-Identifier: GPL-3.0-or-later
//! A material seen from one direction: evaluate it, sample it.
//!
//! Directions are in the shading frame (z = shading normal) and point away from the surface; `wi`
//! is where the path came from (z > 0), `wo` where it goes. `GLOSSY` and `GLASS` say whether the
//! scene has such lobes at all: without them their code is not compiled into the path.

use std::f32::consts::FRAC_1_PI;

use super::closure::{Closure, Fresnel, LobeGrids, Parts, Reflected, Reflector, Transmitter};
use super::fresnel;
use super::ggx::Ggx;
use super::material::{MOST_CLOSURES, MOST_PRINCIPLED};
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
    reflect: Option<Reflected>,
    tint: Vec3,
    p: f32,
}

/// Most facet lobes of a material, and most boundaries.
pub const MOST_FACETS: usize = 3 * MOST_PRINCIPLED + (MOST_CLOSURES - MOST_PRINCIPLED);
const MOST_BOUNDARIES: usize = MOST_CLOSURES;

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
        // With so little refraction the half vector is undefined: light passes straight on.
        let window = (transmitter.ior - 1.0).abs() < 1e-4;
        let smooth = transmitter.ggx.is_smooth() || window;
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
                        *f += boundary.scale * reflect.at(reflectance) * both;
                        *pdf += boundary.p * boundary.reflect_probability(reflectance) * seen;
                    }
                }
            }
        }
    }

    #[inline(always)]
    fn eval_refraction(&self, wo: Vec3, f: &mut Vec3, pdf: &mut f32) {
        for boundary in &self.boundaries[..self.boundary_count] {
            if boundary.smooth {
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
            let jacobian = eta * inverse_length;
            let common = boundary.ggx.d(h) / self.wi.z * jacobian * jacobian * (c * ct).abs();
            let both = common / (1.0 + boundary.lambda_i + boundary.ggx.lambda(wo.z));
            let seen = common / (1.0 + boundary.lambda_i);
            *f += boundary.scale * boundary.passed(reflectance) * both;
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
                let reflected = boundary.reflected(reflectance);
                return Some(Scatter {
                    wo,
                    weight: boundary.scale * reflected * (1.0 / (boundary.p * reflect)),
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
        if boundary.smooth {
            let passed = boundary.passed(reflectance);
            return Some(Scatter {
                wo,
                weight: boundary.scale * passed * (1.0 / (boundary.p * (1.0 - reflect))),
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
    /// What is reflected where the boundary's own reflectance is this.
    #[inline(always)]
    fn reflected(&self, reflectance: f32) -> Vec3 {
        self.reflect.map_or(Vec3::ZERO, |r| r.at(reflectance))
    }

    /// What passes.
    #[inline(always)]
    fn passed(&self, reflectance: f32) -> Vec3 {
        match self.reflect {
            None => self.tint,
            Some(reflect) => self.tint * reflect.rest(reflectance),
        }
    }

    /// Share of the samples that reflect: by energy.
    #[inline(always)]
    fn reflect_probability(&self, reflectance: f32) -> f32 {
        let reflected = self.reflected(reflectance).mean();
        let passed = self.passed(reflectance).mean();
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
mod tests;
