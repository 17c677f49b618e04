// SPDX-License-Identifier: GPL-3.0-or-later
//! Construction of the lobes of a material's closures, weighted for the viewing direction.

use crate::material::albedo::Albedo;
use crate::material::bsdf::lobe::Shape;
use crate::material::bsdf::rough::RoughDiffuse;
use crate::material::bsdf::{
    Boundary, Bsdf, Facets, Interface, LobeFilter, MAX_BOUNDARIES, MAX_FACETS, Normals, Seat,
    Vantage,
};
use crate::material::closure::{
    ChannelAlbedo, Closure, LobeGrids, Lobes, MAX_CLOSURES, Reflector, Transmitter, absorbed,
    coat_albedos, compensation_per_channel,
};
use crate::material::film::Film;
use crate::math::vector::{Frame, Vec3};
use crate::values::program::Value;

/// Albedos of facets at the viewing direction.
#[derive(Clone, Copy)]
struct FacetAlbedos {
    /// That of white facets.
    single: Albedo,
    /// That of dielectric ones.
    dielectric: Option<f32>,
}

impl<const GLOSSY: bool, const GLASS: bool, const LOBES: usize> Bsdf<GLOSSY, GLASS, LOBES> {
    /// The lobes seen from `wi`. `registers`: results of the material's program; `inside`: whether the path arrives
    /// at the back of the surface; `filter`: the lobes that the settings keep, and their least width;
    /// `frame`: the shading frame in scene space, for closures with normals or tangents of their own.
    #[inline(always)]
    pub fn new(
        closures: &[Closure],
        registers: &[Value],
        wi: Vec3,
        normals: Normals,
        inside: bool,
        filter: LobeFilter,
        frame: &Frame,
    ) -> Self {
        let mut out = Self::empty();
        out.assemble(closures, registers, wi, normals, inside, filter, frame);
        out
    }

    /// Replaces the lobes by those of [`Self::new`]. The arrays keep what lies beyond the new counts.
    #[inline(always)]
    #[expect(clippy::too_many_arguments, reason = "those of `new`")]
    pub fn assemble(
        &mut self,
        closures: &[Closure],
        registers: &[Value],
        wi: Vec3,
        normals: Normals,
        inside: bool,
        filter: LobeFilter,
        frame: &Frame,
    ) {
        (self.wi, self.normals, self.filter) = (wi, normals, filter);
        (self.facet_count, self.boundary_count) = (0, 0);
        (self.rough_count, self.lobe_count) = (0, 0);
        (self.diffuse, self.translucent) = (Vec3::ZERO, Vec3::ZERO);
        for closure in closures {
            let computed;
            let lobes = match closure.fixed_lobes() {
                Some(lobes) => lobes,
                None => {
                    computed = closure.lobes(registers);
                    &computed
                }
            };
            if LOBES > 0 && closure.needs_lobes() {
                let vantage = Vantage { frame, inside };
                self.add_special(lobes, closure, registers, vantage);
            } else {
                self.add(lobes, closure, inside);
            }
        }
        self.share_samples();
    }

    /// Adds the lobes of one closure, from the coat down to the base. Each layer passes on what it does not
    /// reflect.
    #[inline(always)]
    fn add(&mut self, lobes: &Lobes, closure: &Closure, inside: bool) {
        if lobes.weight <= 0.0 {
            return;
        }
        // The weight of what is below shrinks from layer to layer.
        let weight = self.add_coat(lobes, closure, Vec3::splat(lobes.weight), None);
        self.add_reflections(lobes, closure, weight, None);
        if GLASS
            && let Some(transmitter) = &lobes.glass
            && (self.filter.refractions
                || (self.filter.reflections && transmitter.reflect.is_some()))
        {
            self.add_glass(transmitter, closure, weight, inside, None);
        }
    }

    /// Adds the coat, which reflects first, and returns the weight of everything below: `weight` less reflection and
    /// absorption. `seat`: its frame, if that is not the shading frame.
    #[inline(always)]
    pub(super) fn add_coat(
        &mut self,
        lobes: &Lobes,
        closure: &Closure,
        mut weight: Vec3,
        seat: Option<&Seat>,
    ) -> Vec3 {
        let cos = self.seen(seat).z;
        if GLOSSY
            && let (Some((reflector, absorb)), Some([facets, dielectric])) =
                (&lobes.coat, &closure.grids.coat)
        {
            let (single, dielectric) = coat_albedos(reflector, [facets, dielectric], cos);
            // Without its reflection the coat still absorbs.
            if self.filter.reflections {
                let albedos = FacetAlbedos {
                    single,
                    dielectric: Some(dielectric),
                };
                let reflected = self.add_facets(reflector, weight, albedos, true, seat);
                weight *= (1.0 - reflected).max(0.0);
            }
            if *absorb != Vec3::ONE {
                weight = weight * absorbed(reflector, *absorb, cos);
            }
        }
        weight
    }

    /// Adds metal, then the dielectric layer over the diffuse base. Without facets only the base remains.
    #[inline(always)]
    pub(super) fn add_reflections(
        &mut self,
        lobes: &Lobes,
        closure: &Closure,
        weight: Vec3,
        seat: Option<&Seat>,
    ) {
        let cos = self.seen(seat).z;
        let LobeGrids {
            reflection, layer, ..
        } = &closure.grids;
        let multiscatter = closure.multiscatter;
        if GLOSSY
            && self.filter.reflections
            && let Some(grid) = reflection
            && (lobes.metal.is_some() || lobes.layer.is_some())
        {
            let single = |r: &Reflector| grid.at(r.roughness, 1.0, cos);
            // Metal and layer cover separate shares of the surface, so neither dims the other.
            if let Some(metal) = &lobes.metal {
                let albedos = FacetAlbedos {
                    single: single(metal),
                    dielectric: None,
                };
                self.add_facets(metal, weight, albedos, multiscatter, seat);
            }
            let single = lobes.layer.map(|l| grid.at(l.roughness, 1.0, cos));
            if let (Some(reflector), Some(single)) = (&lobes.layer, single) {
                let dielectric = layer.as_ref().map(|g| {
                    g.at(reflector.roughness, reflector.fresnel.index(), cos)
                        .directional
                });
                let share = reflector.weight.x;
                let albedos = FacetAlbedos { single, dielectric };
                let reflected = self.add_facets(reflector, weight, albedos, multiscatter, seat);
                // Undo the layer's weight in its reflection, because `lobes.diffuse` already contains it.
                let left = 1.0 - reflected / share.max(1e-6);
                self.add_diffuse(lobes, weight * left.max(0.0), seat);
                return;
            }
        }
        self.add_diffuse(lobes, weight, seat);
    }

    /// Adds the diffuse base, and what of it sends light to the other side.
    #[inline(always)]
    fn add_diffuse(&mut self, lobes: &Lobes, weight: Vec3, seat: Option<&Seat>) {
        if GLASS && lobes.translucent != Vec3::ZERO {
            let scale = weight * lobes.translucent;
            match seat {
                None => self.translucent += scale,
                Some(seat) => self.push(seat.frame, Shape::Translucent, scale, scale.mean()),
            }
        }
        if LOBES > 0
            && lobes.subsurface != Vec3::ZERO
            && let Some(seat) = seat
        {
            self.add_subsurface(lobes, seat, weight);
        }
        if let Some(seat) = seat.filter(|seat| seat.turned) {
            return self.push_base(lobes, seat, weight);
        }
        if GLOSSY && lobes.diffuse_roughness > 0.0 && self.rough_count < MAX_CLOSURES {
            self.rough[self.rough_count] = RoughDiffuse::new(
                lobes.diffuse_roughness,
                weight * lobes.diffuse,
                lobes.diffuse_color,
                self.normals.diffuse_cosine(self.wi),
            );
            self.rough_count += 1;
        } else {
            self.diffuse += weight * lobes.diffuse;
        }
    }

    /// Adds glass, which reflects and refracts by the relative index of the side the path arrives from.
    #[inline(always)]
    pub(super) fn add_glass(
        &mut self,
        transmitter: &Transmitter,
        closure: &Closure,
        weight: Vec3,
        inside: bool,
        seat: Option<&Seat>,
    ) {
        let cos = self.seen(seat).z;
        let eta = if inside {
            1.0 / transmitter.ior
        } else {
            transmitter.ior
        };
        let roughness = transmitter.roughness;
        let LobeGrids {
            reflection, glass, ..
        } = &closure.grids;
        // The compensation needs the albedo of the lobe and, for a tinted reflection, of white facets.
        let single = glass
            .as_ref()
            .filter(|_| closure.multiscatter)
            .map(|grids| {
                let single = grids[usize::from(inside)].at(roughness, eta, cos);
                let white = || {
                    let grid = reflection.as_ref();
                    grid.map_or(single, |grid| grid.at(roughness, 1.0, cos))
                };
                transmitter.single(single, white)
            });
        self.add_boundary(transmitter, weight, single, eta, seat);
    }

    /// Returns the viewer in a closure's frame.
    #[inline(always)]
    fn seen(&self, seat: Option<&Seat>) -> Vec3 {
        seat.map_or(self.wi, |seat| seat.wi)
    }

    /// Adds a reflecting lobe and returns the reflected fraction of `weight`. `seat`: its frame, if that is not the
    /// shading frame.
    #[inline(always)]
    fn add_facets(
        &mut self,
        reflector: &Reflector,
        weight: Vec3,
        albedos: FacetAlbedos,
        multiscatter: bool,
        seat: Option<&Seat>,
    ) -> f32 {
        // Estimate the reflected energy, which also is the weight for choosing the lobe.
        let FacetAlbedos { single, dielectric } = albedos;
        let (reflected, compensated) = match seat {
            None => reflector.reflected(self.wi.z, single, dielectric, multiscatter),
            Some(seat) => {
                seat.estimated(reflector)
                    .reflected(seat.wi.z, single, dielectric, multiscatter)
            }
        };
        let scale = weight * reflector.weight * compensated;
        let p = (weight * reflected).mean().max(1e-8);
        if !self.filter.seen {
            return reflected.max_component();
        }
        if let Some(seat) = seat.filter(|seat| seat.apart) {
            self.push_facets(reflector, seat, scale, p);
            return reflected.max_component();
        }
        // A mirror needs no masking term.
        let ggx = reflector.ggx.widened(self.filter.min_width);
        let smooth = ggx.is_smooth();
        // A material that passed its check never exceeds the limit.
        if self.facet_count < MAX_FACETS {
            self.facets[self.facet_count] = Facets {
                ggx,
                smooth,
                lambda_i: if smooth { 0.0 } else { ggx.lambda(self.wi.z) },
                fresnel: reflector.fresnel,
                scale,
                p,
            };
            self.facet_count += 1;
        }
        reflected.max_component()
    }

    /// Adds a refracting lobe. `single`: its albedo, if multiple scattering is compensated.
    #[inline(always)]
    fn add_boundary(
        &mut self,
        transmitter: &Transmitter,
        weight: Vec3,
        single: Option<ChannelAlbedo>,
        eta: f32,
        seat: Option<&Seat>,
    ) {
        if !self.filter.seen {
            return;
        }
        // At an index this close to 1 the half vector is undefined: treat the boundary as a window.
        let window = (transmitter.ior - 1.0).abs() < 1e-4;
        let compensated = match single {
            Some(single) if !(transmitter.ggx.is_smooth() || window) => {
                compensation_per_channel(transmitter.tint, single)
            }
            _ => Vec3::ONE,
        };
        let scale = weight * compensated * transmitter.weight;
        let p = (weight.mean() * transmitter.weight).max(1e-8);
        let tint = if self.filter.refractions {
            transmitter.tint
        } else {
            Vec3::ZERO
        };
        if let Some(seat) = seat.filter(|seat| seat.apart) {
            let interface = Interface {
                eta,
                reflect: transmitter.reflect,
                reflections: self.filter.reflections,
                tint,
                film: seat.film.map(|[thickness, index]| {
                    // Seen from within, all indices are relative to that of the inside.
                    let side = if eta == transmitter.ior {
                        1.0
                    } else {
                        transmitter.ior
                    };
                    Film::new(thickness, index / side)
                }),
            };
            return self.push_boundary(transmitter, seat, interface, scale, p);
        }
        let ggx = transmitter.ggx.widened(self.filter.min_width);
        let smooth = ggx.is_smooth() || window;
        if self.boundary_count < MAX_BOUNDARIES {
            // The weight alone is the estimate, because reflection and refraction together lose little.
            self.boundaries[self.boundary_count] = Boundary {
                ggx,
                smooth,
                lambda_i: if smooth { 0.0 } else { ggx.lambda(self.wi.z) },
                eta,
                scale,
                reflect: transmitter.reflect,
                reflections: self.filter.reflections,
                tint,
                p,
            };
            self.boundary_count += 1;
        }
    }

    /// Makes the lobes' estimated energies the probabilities of sampling them.
    #[inline(always)]
    pub(super) fn share_samples(&mut self) {
        // Add up the energies of the lobes, then divide each by the sum.
        self.diffuse_probability = self.diffuse.mean();
        if GLOSSY {
            for rough in &self.rough[..self.rough_count] {
                self.diffuse_probability += rough.weight.mean();
            }
        }
        let mut total = self.diffuse_probability;
        if GLASS {
            self.translucent_probability = self.translucent.mean();
            total += self.translucent_probability;
        }
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
        total += self.own_lobes().iter().map(|lobe| lobe.p).sum::<f32>();
        self.energy = total;
        if total > 0.0 {
            let norm = 1.0 / total;
            if LOBES > 0 {
                let count = self.lobe_count;
                self.lobes[..count]
                    .iter_mut()
                    .for_each(|lobe| lobe.p *= norm);
            }
            self.diffuse_probability *= norm;
            self.translucent_probability *= norm;
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
