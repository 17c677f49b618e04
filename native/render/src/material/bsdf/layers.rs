// SPDX-License-Identifier: GPL-3.0-or-later
//! Construction of lobes with frames of their own, in scenes where a material needs such lobes.

use crate::material::bsdf::lobe::{Cone, Lobe, Reflectance, STRAIGHT, Shape, UP};
use crate::material::bsdf::rough::RoughDiffuse;
use crate::material::bsdf::{Bsdf, Interface, Seat, Vantage};
use crate::material::bump::reflecting_normal;
use crate::material::closure::{
    Closure, Fresnel, Hair, Lobes, Reflector, SheenLayer, Single, Special, Transmitter,
};
use crate::material::film::{Film, indices_of};
use crate::material::hair::fiber::Fiber;
use crate::material::microfacets::{Distribution, Microfacets};
use crate::material::sheen::Microfibers;
use crate::math::trig::sin_cos_turns;
use crate::math::vector::{Frame, Vec3};
use crate::values::program::Value;

impl<const GLOSSY: bool, const GLASS: bool, const LOBES: usize> Bsdf<GLOSSY, GLASS, LOBES> {
    /// Adds the lobes of one closure, from the sheen down to the base, each in its own frame where that differs from
    /// the shading frame.
    #[inline(never)]
    pub(super) fn add_special(
        &mut self,
        lobes: &Lobes,
        closure: &Closure,
        registers: &[Value],
        vantage: Vantage<'_>,
    ) {
        if lobes.weight <= 0.0 {
            return;
        }
        // Find the frames of coat and closure.
        let special = closure.special(registers);
        let seat = self.seat(closure, &special, vantage.frame);
        let coat_seat = self.coat_seat(closure, &special, vantage.frame);
        let mut weight = Vec3::splat(lobes.weight);
        if let Some(sheen) = special.sheen {
            // Sheen lies along the coat as far as there is one.
            let (base, coat) = (seat.mapped, coat_seat.mapped);
            let share = lobes.coat.map_or(0.0, |(reflector, _)| reflector.weight.x);
            let normal = (base + (coat - base) * share).normalized_or(base);
            weight = self.add_sheen(sheen, normal, weight);
        }
        let weight = self.add_coat(lobes, closure, weight, Some(&coat_seat));
        self.add_reflections(lobes, closure, weight, Some(&seat));
        if let Some(transmitter) = &lobes.glass
            && (self.filter.refractions
                || (self.filter.reflections && transmitter.reflect.is_some()))
        {
            self.add_glass(transmitter, closure, weight, vantage.inside, Some(&seat));
        }
        if let Some(hair) = &special.hair {
            let tangent = vantage.frame.to_local(special.tangent);
            self.add_hair(hair, tangent, weight);
        }
        if let Some(single) = special.single {
            self.add_single(single, &seat, weight * special.color);
        }
    }

    /// Returns the frame of a closure's facets and the normal of its base.
    fn seat(&self, closure: &Closure, special: &Special, shading: &Frame) -> Seat {
        let own = self.normals.own();
        // The normal that the nodes computed, and the same bent so that mirror directions leave the surface.
        let (bent, mapped) = if closure.turned {
            self.bent(special.normal, shading)
        } else {
            let mapped = self.normals.mapped.map_or(own, |[_, mapped]| mapped);
            (UP, mapped)
        };
        let stretched = special.stretch != [1.0; 2];
        let apart = closure.turned
            || stretched
            || special.distribution != Distribution::Ggx
            || special.conductor.is_some()
            || special.film.is_some();
        let frame = if stretched {
            stretched_frame(bent, special, shading)
        } else if closure.turned {
            Frame::around(bent)
        } else {
            STRAIGHT
        };
        Seat {
            frame,
            wi: viewer(&frame, self.wi),
            mapped,
            apart,
            turned: closure.turned,
            distribution: special.distribution,
            stretch: special.stretch,
            conductor: special.conductor,
            film: special.film,
            subsurface: special.subsurface,
        }
    }

    /// Returns the frame of a closure's coat.
    fn coat_seat(&self, closure: &Closure, special: &Special, shading: &Frame) -> Seat {
        let apart = closure.coat_apart;
        let (bent, mapped) = if apart {
            self.bent(special.coat_normal, shading)
        } else {
            (UP, self.normals.own())
        };
        let frame = if apart { Frame::around(bent) } else { STRAIGHT };
        Seat {
            frame,
            wi: viewer(&frame, self.wi),
            mapped,
            apart,
            turned: apart,
            distribution: Distribution::Ggx,
            stretch: [1.0; 2],
            conductor: None,
            film: None,
            subsurface: None,
        }
    }

    /// Returns a normal in scene space, or the surface's if it is 0, in the shading frame: for facets and for the
    /// base.
    fn bent(&self, normal: Vec3, shading: &Frame) -> (Vec3, Vec3) {
        let own = self.normals.own();
        let mapped = shading.to_local(normal).normalized_or(own);
        if mapped == own || (mapped - own).max_abs() < 1e-6 {
            return (own, own);
        }
        let geometric = self.normals.geometric;
        (reflecting_normal(geometric, self.wi, mapped), mapped)
    }

    /// Adds the sheen of a Principled closure, and returns the weight of everything below.
    fn add_sheen(&mut self, sheen: SheenLayer, normal: Vec3, weight: Vec3) -> Vec3 {
        let frame = Frame::around(normal);
        let wi = viewer(&frame, self.wi);
        if let Some((fibers, albedo)) = Microfibers::new(sheen.roughness, wi.z) {
            let scale = weight * sheen.color * albedo;
            self.push_lobe(Lobe {
                frame,
                wi,
                shape: Shape::Fibers(fibers),
                scale,
                p: scale.mean(),
            });
        }
        weight * sheen.below(wi.z)
    }

    /// Adds the lobe of a closure that has only one. `color`: its weight and colour.
    fn add_single(&mut self, single: Single, seat: &Seat, color: Vec3) {
        let base = Frame::around(seat.mapped);
        let wi = viewer(&base, self.wi);
        match single {
            Single::Microfibers(roughness) => {
                if let Some((fibers, albedo)) = Microfibers::new(roughness, wi.z) {
                    let scale = color * albedo;
                    self.push(base, Shape::Fibers(fibers), scale, scale.mean());
                }
            }
            Single::Velvet(roughness) => {
                self.push(base, Shape::Velvet(roughness), color, color.mean());
            }
            Single::ToonDiffuse(cone) => {
                let shape = Shape::ToonDiffuse(Cone::new(cone));
                self.push(base, shape, color, color.mean());
            }
            Single::ToonGlossy(cone) if self.filter.reflections => {
                let shape = Shape::ToonGlossy(Cone::new(cone));
                self.push(seat.frame, shape, color, color.mean());
            }
            Single::ToonGlossy(_) => {}
        }
    }

    /// Adds the lobe about a hair along `tangent`.
    fn add_hair(&mut self, hair: &Hair, tangent: Vec3, weight: Vec3) {
        // The frame along the hair, seen from the viewer.
        let along = tangent.normalized_or(STRAIGHT.x);
        let across = self.wi.cross(along).normalized_or(STRAIGHT.y.cross(along));
        let across = across.normalized_or(Frame::around(along).x);
        let frame = Frame {
            x: along,
            y: across,
            z: along.cross(across),
        };
        let wi = frame.to_local(self.wi);
        let (shape, scale, p) = match hair {
            Hair::Fiber(inputs) => {
                // The normal's part across is the distance of the ray from the axis.
                let offset = self.normals.own().dot(across);
                let fiber = Fiber::new(inputs, wi, offset, self.filter.min_width);
                (Shape::Fiber(fiber), weight, weight.mean())
            }
            Hair::Strand(strand, color) => {
                let scale = weight * *color;
                (Shape::Strand(*strand), scale, scale.mean())
            }
        };
        self.push_lobe(Lobe {
            frame,
            wi,
            shape,
            scale,
            p,
        });
    }

    /// Adds a reflecting lobe in its own frame.
    pub(super) fn push_facets(&mut self, reflector: &Reflector, seat: &Seat, scale: Vec3, p: f32) {
        let alpha = reflector.roughness * reflector.roughness;
        let width = seat.stretch.map(|s| alpha * s);
        let facets = Microfacets::new(seat.distribution, width, self.filter.min_width);
        let reflectance = seat.reflectance(&reflector.fresnel);
        self.push(seat.frame, Shape::Facets(facets, reflectance), scale, p);
    }

    /// Adds a refracting lobe in its own frame.
    pub(super) fn push_boundary(
        &mut self,
        transmitter: &Transmitter,
        seat: &Seat,
        interface: Interface,
        scale: Vec3,
        p: f32,
    ) {
        let alpha = transmitter.roughness * transmitter.roughness;
        let facets = Microfacets::new(seat.distribution, [alpha; 2], self.filter.min_width);
        self.push(seat.frame, Shape::Boundary(facets, interface), scale, p);
    }

    /// Adds the diffuse base about a normal of its own.
    pub(super) fn push_base(&mut self, lobes: &Lobes, seat: &Seat, weight: Vec3) {
        let frame = Frame::around(seat.mapped);
        let scale = weight * lobes.diffuse;
        let wi = self.wi.dot(seat.mapped).max(0.0);
        if lobes.diffuse_roughness > 0.0 {
            let (roughness, color) = (lobes.diffuse_roughness, lobes.diffuse_color);
            let rough = RoughDiffuse::new(roughness, scale, color, wi);
            self.push(frame, Shape::Rough(rough), Vec3::ONE, scale.mean());
        } else {
            self.push(frame, Shape::Lambert, scale, scale.mean());
        }
    }

    /// Adds what scatters light below the surface. Channels in which light has no way are diffuse, and all are where no
    /// light walks.
    pub(super) fn add_subsurface(&mut self, lobes: &Lobes, seat: &Seat, weight: Vec3) {
        let scale = weight * lobes.subsurface;
        let medium = seat.subsurface.filter(|_| self.filter.walks);
        let below = medium.map_or(Vec3::ZERO, |medium| scale * medium.open());
        let diffuse = scale - below;
        if let Some(medium) = medium.filter(|_| below != Vec3::ZERO) {
            self.diffuse += diffuse;
            self.push(seat.frame, Shape::Subsurface(medium), below, below.mean());
        } else if seat.turned {
            let frame = Frame::around(seat.mapped);
            self.push(frame, Shape::Lambert, diffuse, diffuse.mean());
        } else {
            self.diffuse += diffuse;
        }
    }

    /// Adds a lobe with this frame.
    pub(super) fn push(&mut self, frame: Frame, shape: Shape, scale: Vec3, p: f32) {
        // Facets whose normal faces away from the viewer scatter nothing.
        let facets = matches!(
            shape,
            Shape::Facets(..) | Shape::Boundary(..) | Shape::ToonGlossy(_)
        );
        if facets && !(self.filter.seen && frame.z.dot(self.wi) > 0.0) {
            return;
        }
        let wi = viewer(&frame, self.wi);
        self.push_lobe(Lobe {
            frame,
            wi,
            shape,
            scale,
            p,
        });
    }

    /// Adds a lobe; a material that passed its check never exceeds the limit.
    fn push_lobe(&mut self, lobe: Lobe) {
        if self.lobe_count < LOBES && lobe.p > 0.0 && lobe.scale.is_finite() {
            self.lobes[self.lobe_count] = lobe;
            self.lobe_count += 1;
        }
    }
}

impl Seat {
    /// Returns the reflectance of facets with this Fresnel curve, with the film if there is one.
    pub(super) fn reflectance(&self, fresnel: &Fresnel) -> Reflectance {
        let film = self
            .film
            .map(|[thickness, index]| Film::new(thickness, index));
        match (film, self.conductor, *fresnel) {
            (None, None, fresnel) => Reflectance::Plain(fresnel),
            (None, Some(indices), _) => Reflectance::Conductor(indices),
            (Some(film), Some(indices), _) => Reflectance::FilmOnConductor(film, indices),
            (Some(film), None, Fresnel::Metal { f0, .. }) => {
                // A metal of two colours stands for the conductor that reflects them.
                let indices = indices_of(f0, fresnel.at(1.0 / 7.0));
                Reflectance::FilmOnConductor(film, indices)
            }
            (Some(film), None, Fresnel::Dielectric { eta, own, f0, .. }) => {
                Reflectance::FilmOnDielectric(film, eta, f0 * (1.0 / own.max(1e-12)))
            }
        }
    }

    /// Returns a reflector for estimates, whose reflectance is that of the film seen from the viewer, as in Cycles; the mean
    /// reflectance for multiple scattering remains that without a film.
    pub(super) fn estimated(&self, reflector: &Reflector) -> Reflector {
        if self.film.is_none() {
            return *reflector;
        }
        let f = self.reflectance(&reflector.fresnel).at(self.wi.z);
        Reflector {
            fresnel: Fresnel::Metal {
                f0: f,
                edge: f,
                dip: Vec3::ZERO,
            },
            ..*reflector
        }
    }
}

/// Returns the viewer in a lobe's frame, never below it.
fn viewer(frame: &Frame, wi: Vec3) -> Vec3 {
    let mut local = frame.to_local(wi);
    local.z = local.z.max(1e-4);
    local
}

/// Returns the frame about a normal whose x axis is the tangent, rotated.
fn stretched_frame(normal: Vec3, special: &Special, shading: &Frame) -> Frame {
    let any = Frame::around(normal);
    let tangent = shading.to_local(special.tangent);
    let y = normal.cross(tangent).normalized_or(any.y);
    let x = y.cross(normal);
    let (sin, cos) = sin_cos_turns(special.rotation.clamp(0.0, 1.0));
    Frame {
        x: x * cos + y * sin,
        y: y * cos - x * sin,
        z: normal,
    }
}
