// SPDX-License-Identifier: GPL-3.0-or-later
//! Evaluation of the BSDF and of the density with which [`Bsdf::sample`] finds a direction.

use std::f32::consts::FRAC_1_PI;

use crate::material::bsdf::Bsdf;
use crate::material::bump::bump_shadow;
use crate::material::ggx::Ggx;
use crate::math::fresnel;
use crate::math::vector::{Vec3, vec3};
use crate::values::visibility::RayKind;
use crate::values::visibility::Visibility;

impl<const GLOSSY: bool, const GLASS: bool, const LOBES: usize> Bsdf<GLOSSY, GLASS, LOBES> {
    /// Returns BSDF × |cosine| for a direction and the density of [`Self::sample`] there. Mirrors and windows,
    /// whose density is infinite, contribute nothing.
    #[inline(always)]
    pub fn eval(&self, wo: Vec3) -> (Vec3, f32) {
        self.eval_where(wo, Visibility::ALL, false)
    }

    /// Like [`Self::eval`] for a light sample, restricted to the lobes that see a light of this visibility. As in Cycles,
    /// facets receive no light samples from directions about whose side the surface's shading normal and the triangle
    /// disagree.
    #[inline(always)]
    pub fn eval_lit(&self, wo: Vec3, visible: Visibility) -> (Vec3, f32) {
        self.eval_where(wo, visible, true)
    }

    /// Implements both. `lit`: for a light sample.
    #[inline(always)]
    fn eval_where(&self, wo: Vec3, visible: Visibility, lit: bool) -> (Vec3, f32) {
        let (mut f, mut pdf) = if visible.to(RayKind::Diffuse) {
            self.eval_diffuse(wo)
        } else {
            (Vec3::ZERO, 0.0)
        };
        if GLASS && wo.z < 0.0 && visible.to(RayKind::Diffuse) {
            self.eval_translucent(wo, &mut f, &mut pdf);
        }
        for lobe in self.own_lobes() {
            let (value, density) = lobe.eval(wo, &self.normals, visible, lit);
            f += value;
            pdf += lobe.p * density;
        }
        // Facets neither reflect to the far side of the triangle nor refract to the near side.
        let above = self.normals.geometric.dot(wo) >= 0.0;
        if lit
            && let Some([own, _]) = self.normals.mapped
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

    /// The Lambertian and rough diffuse lobes, about the mapped normal if there is one.
    #[inline(always)]
    fn eval_diffuse(&self, wo: Vec3) -> (Vec3, f32) {
        // A mapped normal changes the cosine and shadows facets near the horizon.
        let (cos, lit) = match self.normals.mapped {
            None => (wo.z, 1.0),
            Some([own, mapped]) => (mapped.dot(wo), bump_shadow(own, mapped, wo)),
        };
        if cos <= 0.0 || lit == 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let lambert = cos * FRAC_1_PI;
        let mut f = self.diffuse * (lambert * lit);
        if GLOSSY {
            for rough in &self.rough[..self.rough_count] {
                f += rough.eval(self.wi.dot(wo), cos) * lit;
            }
        }
        (f, self.diffuse_probability * lambert)
    }

    /// Adds the translucent lobe, about the normal of the facets, as in Cycles.
    #[inline(always)]
    fn eval_translucent(&self, wo: Vec3, f: &mut Vec3, pdf: &mut f32) {
        let lit = match self.normals.mapped {
            None => 1.0,
            Some([own, _]) => bump_shadow(own, vec3(0.0, 0.0, 1.0), wo),
        };
        if lit > 0.0 {
            let lambert = -wo.z * FRAC_1_PI;
            *f += self.translucent * (lambert * lit);
            *pdf += self.translucent_probability * lambert;
        }
    }

    /// Adds all rough lobes that reflect.
    #[inline(always)]
    fn eval_reflection(&self, wo: Vec3, f: &mut Vec3, pdf: &mut f32) {
        if (GLOSSY && self.facet_count > 0) || (GLASS && self.boundary_count > 0) {
            // The half vector of reflection.
            let h = (self.wi + wo).normalized_or(vec3(0.0, 0.0, 1.0));
            let c = self.wi.dot(h);
            // D / (4 cos) is common to value and density; G1 = 1/(1 + Λi) makes the density of visible normals, G2
            // = 1/(1 + Λi + Λo) the value (Heitz 2014).
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
                    if !boundary.smooth && boundary.reflect.is_some() {
                        let (seen, both) = densities(boundary.ggx, boundary.lambda_i);
                        let (reflectance, _) = fresnel::dielectric(c, boundary.eta);
                        *f += boundary.scale * boundary.reflected(reflectance) * both;
                        *pdf += boundary.p * boundary.reflect_probability(reflectance) * seen;
                    }
                }
            }
        }
    }

    /// Adds all rough lobes that refract: Walter et al. 2007, eq. 21 with the half vector of eq. 16.
    #[inline(always)]
    fn eval_refraction(&self, wo: Vec3, f: &mut Vec3, pdf: &mut f32) {
        for boundary in &self.boundaries[..self.boundary_count] {
            if boundary.smooth {
                continue;
            }
            let eta = boundary.eta;
            // The half vector of refraction, on the side of the viewer.
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
            // Jacobian of the half vector's density to that of the outgoing direction.
            let jacobian = eta * inverse_length;
            let common = boundary.ggx.d(h) / self.wi.z * jacobian * jacobian * (c * ct).abs();
            let both = common / (1.0 + boundary.lambda_i + boundary.ggx.lambda(wo.z));
            let seen = common / (1.0 + boundary.lambda_i);
            *f += boundary.scale * boundary.passed(reflectance) * both;
            *pdf += boundary.p * (1.0 - boundary.reflect_probability(reflectance)) * seen;
        }
    }
}
