// SPDX-License-Identifier: GPL-3.0-or-later
//! Construction of the lobes of a material's closures, weighted for the viewing direction.

use crate::bsdf::{Boundary, Bsdf, Facets, MOST_BOUNDARIES, MOST_FACETS, Normals};
use crate::closure::{
    Closure, Fresnel, LobeGrids, Parts, Reflector, Transmitter, absorbed, coat_albedos, regain_each,
};
use crate::ggx::Ggx;
use crate::program::Value;
use crate::vector::Vec3;

impl<const GLOSSY: bool, const GLASS: bool> Bsdf<GLOSSY, GLASS> {
    /// The lobes seen from `wi`. `registers`: results of the material's program; `inside`: whether the path arrives
    /// at the back of the surface.
    #[inline(always)]
    pub fn new(
        closures: &[Closure],
        registers: &[Value],
        wi: Vec3,
        normals: Normals,
        inside: bool,
    ) -> Self {
        // Start with empty lobes in arrays of fixed size: the path allocates nothing.
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

    /// Adds the lobes of one closure, from the coat down to the base. Each layer passes on what it does not
    /// reflect.
    #[inline(always)]
    fn add(&mut self, parts: &Parts, closure: &Closure, inside: bool) {
        if parts.weight <= 0.0 {
            return;
        }
        // The weight of what is below shrinks from layer to layer.
        let mut weight = Vec3::splat(parts.weight);
        let LobeGrids {
            reflection,
            layer,
            coat,
            glass,
        } = &closure.grids;
        let multiscatter = closure.multiscatter;
        // Coat: reflects first, and dims everything below by its reflection and absorption.
        if GLOSSY
            && let (Some((reflector, absorb)), Some([facets, dielectric])) = (&parts.coat, coat)
        {
            let (single, albedo) = coat_albedos(reflector, [facets, dielectric], self.wi.z);
            let reflected = self.add_facets(reflector, weight, single, Some(albedo), true);
            weight *= (1.0 - reflected).max(0.0);
            if *absorb != Vec3::ONE {
                weight = weight * absorbed(reflector, *absorb, self.wi.z);
            }
        }
        // Metal, then the dielectric layer over the diffuse base. Without facets only the base remains.
        if GLOSSY
            && let Some(grid) = reflection
            && (parts.metal.is_some() || parts.layer.is_some())
        {
            let single = |r: &Reflector| grid.at(r.roughness, 1.0, self.wi.z);
            // Metal and layer cover separate shares of the surface, so neither dims the other.
            if let Some(metal) = &parts.metal {
                self.add_facets(metal, weight, single(metal), None, multiscatter);
            }
            let single = parts.layer.map(|l| grid.at(l.roughness, 1.0, self.wi.z));
            if let (Some(reflector), Some(single)) = (&parts.layer, single) {
                let albedo = layer.as_ref().map(|g| {
                    g.at(reflector.roughness, reflector.fresnel.index(), self.wi.z)
                        .0
                });
                let share = reflector.weight.x;
                let reflected = self.add_facets(reflector, weight, single, albedo, multiscatter);
                // Undo the layer's weight in its reflection, because `parts.diffuse` already contains it.
                let left = 1.0 - reflected / share.max(1e-6);
                self.diffuse += weight * parts.diffuse * left.max(0.0);
            } else {
                self.diffuse += weight * parts.diffuse;
            }
        } else {
            self.diffuse += weight * parts.diffuse;
        }
        // Glass: reflects and refracts by the relative index of the side the path arrives from.
        if GLASS && let Some(transmitter) = &parts.glass {
            let eta = if inside {
                1.0 / transmitter.ior
            } else {
                transmitter.ior
            };
            let roughness = transmitter.roughness;
            // The compensation needs the albedo of the lobe and, for a tinted reflection, of white facets.
            let single = glass.as_ref().filter(|_| multiscatter).map(|grids| {
                let single = grids[usize::from(inside)].at(roughness, eta, self.wi.z);
                let white = || {
                    let grid = reflection.as_ref();
                    grid.map_or(single, |grid| grid.at(roughness, 1.0, self.wi.z))
                };
                transmitter.single(single, white)
            });
            self.add_boundary(transmitter, weight, single, eta);
        }
    }

    /// Adds a reflecting lobe and returns the reflected fraction of `weight`. `single`: albedo of white facets and
    /// its mean over the hemisphere; `albedo`: albedo of the dielectric facets.
    #[inline(always)]
    fn add_facets(
        &mut self,
        reflector: &Reflector,
        weight: Vec3,
        single: (f32, f32),
        albedo: Option<f32>,
        multiscatter: bool,
    ) -> f32 {
        // A mirror needs no masking term.
        let Reflector { ggx, fresnel, .. } = *reflector;
        let smooth = ggx.is_smooth();
        // Estimate the reflected energy, which also is the weight for choosing the lobe.
        let (reflected, regained) = reflector.reflected(self.wi.z, single, albedo, multiscatter);
        // A material that passed its check never exceeds the limit.
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

    /// Adds a refracting lobe. `single`: its albedo and mean per channel, if multiple scattering is compensated.
    #[inline(always)]
    fn add_boundary(
        &mut self,
        transmitter: &Transmitter,
        weight: Vec3,
        single: Option<(Vec3, Vec3)>,
        eta: f32,
    ) {
        // At an index this close to 1 the half vector is undefined: treat the boundary as a window.
        let window = (transmitter.ior - 1.0).abs() < 1e-4;
        let smooth = transmitter.ggx.is_smooth() || window;
        let regained = match single {
            Some((single, mean)) if !smooth => regain_each(transmitter.tint, single, mean),
            _ => Vec3::ONE,
        };
        if self.boundary_count < MOST_BOUNDARIES {
            // The weight alone is the estimate, because reflection and refraction together lose little.
            self.boundaries[self.boundary_count] = Boundary {
                ggx: transmitter.ggx,
                smooth,
                lambda_i: if smooth {
                    0.0
                } else {
                    transmitter.ggx.lambda(self.wi.z)
                },
                eta,
                scale: weight * regained * transmitter.weight,
                reflect: transmitter.reflect,
                tint: transmitter.tint,
                p: (weight.mean() * transmitter.weight).max(1e-8),
            };
            self.boundary_count += 1;
        }
    }

    /// Makes the lobes' estimated energies the probabilities of sampling them.
    #[inline(always)]
    fn share_samples(&mut self) {
        // Add up the energies of the lobes, then divide each by the sum.
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
}
