// SPDX-License-Identifier: GPL-3.0-or-later
//! The lobes of a material's closures, weighted for the viewing direction.

use super::super::closure::{
    Closure, Fresnel, LobeGrids, Parts, Reflector, Transmitter, absorbed, coat_albedos, regain_each,
};
use super::super::ggx::Ggx;
use super::super::program::Value;
use super::super::vector::Vec3;
use super::{Boundary, Bsdf, Facets, MOST_BOUNDARIES, MOST_FACETS, Normals};

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
            let (single, albedo) = coat_albedos(reflector, [facets, dielectric], self.wi.z);
            let reflected = self.add_facets(reflector, weight, single, Some(albedo), true);
            weight *= (1.0 - reflected).max(0.0);
            if *absorb != Vec3::ONE {
                weight = weight * absorbed(reflector, *absorb, self.wi.z);
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
                let albedo = layer.as_ref().map(|g| {
                    g.at(reflector.roughness, reflector.fresnel.index(), self.wi.z)
                        .0
                });
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
            let eta = if inside {
                1.0 / transmitter.ior
            } else {
                transmitter.ior
            };
            let roughness = transmitter.roughness;
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
        let Reflector { ggx, fresnel, .. } = *reflector;
        let smooth = ggx.is_smooth();
        let (reflected, regained) = reflector.reflected(self.wi.z, single, albedo, multiscatter);
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
        single: Option<(Vec3, Vec3)>,
        eta: f32,
    ) {
        // With so little refraction the half vector is undefined: light passes straight on.
        let window = (transmitter.ior - 1.0).abs() < 1e-4;
        let smooth = transmitter.ggx.is_smooth() || window;
        let regained = match single {
            Some((single, mean)) if !smooth => regain_each(transmitter.tint, single, mean),
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
                eta,
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
}
