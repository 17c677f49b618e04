// SPDX-License-Identifier: GPL-3.0-or-later
//! Sampling of the BSDF: directions in which the path continues.

use crate::material::bsdf::lobe::{Direction, Lobe, Shape};
use crate::material::bsdf::{Boundary, Bsdf, Facets, Scatter};
use crate::material::closure::Subsurface;
use crate::math::fresnel;
use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Frame, Vec3, vec3};
use crate::values::visibility::{RayKind, Visibility};

/// Where a path enters a surface to walk below it.
pub struct Entrance {
    /// The medium.
    pub below: Subsurface,
    /// Factor on the throughput: the lobe's albedo over its probability.
    pub weight: Vec3,
    /// Direction in which the path enters, in the shading frame.
    pub direction: Vec3,
}

impl<const GLOSSY: bool, const GLASS: bool, const LOBES: usize> Bsdf<GLOSSY, GLASS, LOBES> {
    /// Samples a direction by the lobes' probabilities; `None` ends the path. `choice`: random number in [0, 1)
    /// that selects the lobe; `u`: two random numbers in [0, 1) for the direction.
    #[inline(always)]
    pub fn sample(&self, choice: f32, u: [f32; 2]) -> Option<Scatter> {
        let Direction {
            wo,
            kind,
            through,
            single,
            kept,
        } = self.direction(choice, u)?;
        // Evaluate all lobes at a direction of a density, so that the weight is that of the whole mixture.
        let (weight, pdf, eta) = match single {
            Some((weight, eta)) => (weight, f32::INFINITY, eta),
            None => {
                let (mut f, mut pdf) = self.eval(wo);
                if let Some((value, density)) = kept {
                    f += value;
                    pdf += density;
                }
                (f * (1.0 / pdf), pdf, 1.0)
            }
        };
        (pdf > 0.0).then_some(Scatter {
            wo,
            weight,
            pdf,
            kind,
            through,
            eta,
        })
    }

    /// Samples a direction of one lobe.
    #[inline(always)]
    fn direction(&self, choice: f32, u: [f32; 2]) -> Option<Direction> {
        // Subtract probabilities until the remainder lies within a lobe; the diffuse one comes last.
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
        for lobe in self.own_lobes() {
            if left < lobe.p {
                let sampled = lobe.sample(left / lobe.p, u)?;
                return Some(if lobe.is_hair() {
                    self.about_hair(lobe, sampled)
                } else {
                    sampled
                });
            }
            left -= lobe.p;
        }
        // Translucent lobe: about the normal of the facets, to the other side.
        let about = cosine_direction(u);
        if GLASS && left < self.translucent_probability {
            return Some(Direction::rough(-about, RayKind::Diffuse, true));
        }
        if self.diffuse_probability <= 0.0 {
            return None;
        }
        // Diffuse lobes: about the mapped normal, if there is one.
        let wo = match self.normals.mapped {
            None => about,
            Some([_, mapped]) => Frame::around(mapped).to_world(about),
        };
        Some(Direction::rough(wo, RayKind::Diffuse, false))
    }

    /// Returns the entrance to a walk below the surface, if `choice` selects one instead of a direction. `choice`, `u`: as
    /// for [`Self::sample`].
    #[inline(never)]
    pub fn entrance(&self, choice: f32, u: [f32; 2]) -> Option<Entrance> {
        // Entrances lie where those lobes do in `sample`.
        let facets = self.facets[..self.facet_count].iter().map(|f| f.p);
        let boundaries = self.boundaries[..self.boundary_count].iter().map(|b| b.p);
        let mut left = choice - facets.sum::<f32>() - boundaries.sum::<f32>();
        if left < 0.0 {
            return None;
        }
        for lobe in self.own_lobes() {
            if left < lobe.p {
                let Shape::Subsurface(below) = lobe.shape else {
                    return None;
                };
                let local = below.enter(lobe.wi, left / lobe.p, u);
                return Some(Entrance {
                    below,
                    weight: lobe.scale * (1.0 / lobe.p),
                    direction: lobe.frame.to_world(local),
                });
            }
            left -= lobe.p;
        }
        None
    }

    /// Completes a direction that a lobe about a hair sampled: the triangle decides on the side to which the path goes. A
    /// direction that light samples leave out for the sake of the normal is kept, as in Cycles.
    #[inline(never)]
    fn about_hair(&self, lobe: &Lobe, sampled: Direction) -> Direction {
        let wo = sampled.wo;
        let left_out = lobe.eval(wo, &self.normals, Visibility::ALL, true).1 <= 0.0;
        Direction {
            through: self.normals.geometric.dot(wo) < 0.0,
            kept: left_out.then(|| {
                let (value, density) = lobe.value(lobe.frame.to_local(wo));
                (value * lobe.scale, lobe.p * density)
            }),
            ..sampled
        }
    }

    /// Samples a reflecting lobe.
    #[inline(always)]
    fn sample_facets(&self, facets: &Facets, u: [f32; 2]) -> Option<Direction> {
        // A mirror has a single direction and an infinite density.
        if facets.smooth {
            let weight = facets.fresnel.at(self.wi.z) * facets.scale;
            return Some(Direction {
                wo: vec3(-self.wi.x, -self.wi.y, self.wi.z),
                kind: RayKind::Glossy,
                through: false,
                single: Some((weight * (1.0 / facets.p), 1.0)),
                kept: None,
            });
        }
        let h = facets.ggx.sample_visible(self.wi, u);
        let wo = h * (2.0 * self.wi.dot(h)) - self.wi;
        (wo.z > 0.0).then(|| Direction::rough(wo, RayKind::Glossy, false))
    }

    /// Samples a refracting lobe; `choice` in [0, 1) selects reflection or refraction.
    #[inline(always)]
    fn sample_boundary(&self, boundary: &Boundary, choice: f32, u: [f32; 2]) -> Option<Direction> {
        // Choose a facet, then reflect or refract in proportion to the energies.
        let h = if boundary.smooth {
            vec3(0.0, 0.0, 1.0)
        } else {
            boundary.ggx.sample_visible(self.wi, u)
        };
        let c = self.wi.dot(h);
        let (reflectance, cos_t) = fresnel::dielectric(c, boundary.eta);
        let reflect = boundary.reflect_probability(reflectance);
        if choice < reflect {
            // Reflect; directions below the surface are lost.
            let wo = h * (2.0 * c) - self.wi;
            if wo.z <= 0.0 {
                return None;
            }
            if boundary.smooth {
                let reflected = boundary.reflected(reflectance);
                let weight = boundary.scale * reflected * (1.0 / (boundary.p * reflect));
                return Some(Direction {
                    wo,
                    kind: RayKind::Glossy,
                    through: false,
                    single: Some((weight, 1.0)),
                    kept: None,
                });
            }
            return Some(Direction::rough(wo, RayKind::Glossy, false));
        }
        if cos_t <= 0.0 {
            // Total reflection at a boundary that only refracts.
            return None;
        }
        // Refract about the facet normal; a direction above the surface is lost.
        let wo = h * (c / boundary.eta - cos_t) - self.wi * (1.0 / boundary.eta);
        if wo.z >= 0.0 {
            return None;
        }
        if boundary.smooth {
            let passed = boundary.passed(reflectance);
            let weight = boundary.scale * passed * (1.0 / (boundary.p * (1.0 - reflect)));
            return Some(Direction {
                wo,
                kind: RayKind::Transmission,
                through: true,
                single: Some((weight, boundary.eta)),
                kept: None,
            });
        }
        Some(Direction::rough(wo, RayKind::Transmission, true))
    }
}

/// Samples a direction about the z axis with density cosine / π: Malley's method, a uniform disc projected up to
/// the hemisphere.
#[inline(always)]
pub fn cosine_direction(u: [f32; 2]) -> Vec3 {
    let (sin, cos) = sin_cos_turns(u[0]);
    let r = u[1].sqrt();
    vec3(r * cos, r * sin, (1.0 - u[1]).max(0.0).sqrt())
}
