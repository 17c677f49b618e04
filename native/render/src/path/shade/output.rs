// SPDX-License-Identifier: GPL-3.0-or-later
//! The outputs of shading: the light of a sample, its shadow rays and what the passes need.

use crate::film::catcher::{Catch, Caught};
use crate::film::{Batch, Film, Identities, LightParts, PixelSample, Shares};
use crate::math::vector::Vec3;
use crate::medium::stack::Stack;
use crate::path::beams::source::Source;
use crate::path::media::Scratch;
use crate::path::shadow_rays::{Aim, Passing, Scattered, ShadowRays, add_to_group};
use crate::path::state::Path;
use crate::path::walk::RandomWalk;
use crate::path::work::Work;
use crate::scene::surface::Surface;
use crate::settings::{LightPass, LobeKind};
use crate::values::program::Value;
use halfspace_ray::{Hit, Ray};

/// The outputs of shading.
pub(super) struct Output<'a, const EXTRA: bool> {
    pub(super) sample: &'a mut PixelSample,
    /// Data of passes that are rarely filled, if any is.
    pub(super) extra: Option<Extra<'a>>,
    pub(super) shadows: &'a mut ShadowRays,
    /// Registers of a material's program, reused from point to point.
    pub(super) registers: &'a mut Vec<Value>,
    /// Whether the registers hold the results of the program of the surface that the ray has hit; never for rays below
    /// surfaces.
    pub(super) has_run: bool,
    /// Registers of the programs of emitters.
    pub(super) light_registers: &'a mut Vec<Value>,
    pub(super) work: &'a mut Work,
    /// The beam of the ray.
    pub(super) source: Source,
    /// The beam of the next ray.
    pub(super) next: Source,
    /// The media that the ray is in; `None` if the scene has none, or they are not rendered.
    pub(super) media: Option<Stack>,
    /// The walk below a surface that the ray is part of.
    pub(super) walk: Option<RandomWalk>,
    pub(super) scratch: &'a mut Scratch,
    /// Seed of the streams of random numbers within media; set where there are any.
    pub(super) seed: u32,
}

impl<const EXTRA: bool> Output<'_, EXTRA> {
    /// Adds a shadow ray with its light. `scattered`: see [`Self::scattered`]; `surface`: from which it starts, to either
    /// side.
    #[inline(always)]
    pub(super) fn cast(
        &mut self,
        ray: Ray,
        path: &Path,
        value: Vec3,
        scattered: Option<Scattered>,
        surface: Option<&Surface<'_>>,
        aim: Aim,
    ) {
        let left = surface.filter(|_| ray.t_min > 0.0);
        let left = left.map_or(Hit::NONE, Surface::triangle);
        self.shadows.push(ray, path, value, scattered, aim, left);
        if let Some(stack) = self.media {
            let mut passing = Passing::new(stack, self.seed);
            if let Some(surface) = surface.filter(|s| s.geometric.dot(Vec3::from(ray.d)) < 0.0) {
                passing.stack.cross(surface.medium_behind(), surface.inside);
            }
            self.shadows.push_media(passing);
        }
    }

    /// Returns the shares of the lobes of the path's first surface, if rarely filled passes need them.
    #[inline(always)]
    pub(super) fn shares(&self) -> Option<Shares> {
        let extra = self.extra.as_ref().filter(|_| EXTRA);
        extra.map(|extra| extra.shares)
    }

    /// Makes a hole behind media as deep as they transmit.
    #[inline(always)]
    pub(super) fn dim_holes(&mut self, path: &Path) {
        if self.media.is_some() {
            let transmitted = path.throughput.mean().clamp(0.0, 1.0);
            self.sample.alpha = 1.0 - (1.0 - self.sample.alpha) * transmitted;
        }
    }

    /// Crosses a surface into or out of its object.
    #[inline(always)]
    pub(super) fn cross(&mut self, surface: &Surface<'_>) {
        if let Some(stack) = &mut self.media {
            stack.cross(surface.medium_behind(), surface.inside);
        }
    }
}

/// The outputs of shading for passes that are rarely filled.
pub(super) struct Extra<'a> {
    /// The light of the sample by light pass, if such passes are filled.
    pub(super) parts: Option<&'a mut LightParts>,
    /// The shares of the lobes of the path's first surface, if light passes are filled and it has scattered.
    pub(super) shares: Shares,
    /// The light of the sample by light group.
    pub(super) groups: &'a mut [[f32; 3]],
    /// The identities of the first surface, if a matte is filled.
    pub(super) identities: Option<&'a mut Identities>,
    /// The motion of the first surface, if the vector pass is filled.
    pub(super) motion: Option<&'a mut [f32; 5]>,
    /// The outputs of the first surface's material.
    pub(super) outputs: &'a mut [[f32; 4]],
    /// Values of the sample's shadow catcher, if the scene has any.
    caught: Option<&'a mut Caught>,
}

impl<'a> Extra<'a> {
    /// The outputs of a path for passes that are rarely filled, and its sample. Light of shadow catchers is in no light
    /// pass or group, as in Cycles. `unseen`: takes what a path among catchers alone writes.
    pub(super) fn of(
        path: &Path,
        shares: Shares,
        film: &Film,
        batch: &'a mut Batch,
        unseen: &'a mut PixelSample,
    ) -> (&'a mut PixelSample, Self) {
        let slot = path.slot as usize;
        let lit = path.catch == Catch::None;
        let seen = path.catch != Catch::OnlyCatchers;
        let Batch {
            samples,
            parts,
            identities,
            outputs,
            groups,
            motion,
            caught,
        } = batch;
        let sample = if seen { &mut samples[slot] } else { unseen };
        let extra = Self {
            parts: parts.get_mut(slot).filter(|_| lit),
            shares,
            groups: part(groups, slot, film.groups() * usize::from(lit)),
            identities: identities.get_mut(slot).filter(|_| seen),
            motion: motion.get_mut(slot).filter(|_| seen),
            outputs: part(outputs, slot, film.outputs() * usize::from(seen)),
            caught: caught.get_mut(slot),
        };
        (sample, extra)
    }

    /// Adds light that the path finds to what its shadow catcher shows.
    fn catch(&mut self, catch: Catch, light: Vec3) {
        if let Some(caught) = &mut self.caught {
            caught.add(catch, light);
        }
    }
}

/// Returns the `count` values of a slot; none if the count is 0.
fn part<T>(values: &mut [T], slot: usize, count: usize) -> &mut [T] {
    &mut values[slot * count..(slot + 1) * count]
}

impl<'a, const EXTRA: bool> Output<'a, EXTRA> {
    /// Returns what passes that are rarely filled need.
    #[inline(always)]
    pub(super) fn extra(&mut self) -> Option<&mut Extra<'a>> {
        if EXTRA { self.extra.as_mut() } else { None }
    }

    /// Adds light that the path's ray meets. `seen`: the pass of light that the camera sees directly; `group`: returns
    /// the light group of the emitter, called only if such groups are filled.
    #[inline(always)]
    pub(super) fn add_met(
        &mut self,
        light: Vec3,
        path: &Path,
        seen: LightPass,
        group: impl FnOnce() -> u8,
    ) {
        self.sample.add(light);
        let Some(extra) = self.extra() else {
            return;
        };
        extra.catch(path.catch, light);
        if !extra.groups.is_empty() {
            add_to_group(extra.groups, group(), light);
        }
        if let Some(parts) = &mut extra.parts {
            if path.bounce == 0 {
                parts.add(seen, light);
            } else {
                parts.add_scattered(light, &extra.shares, path.bounce > 1);
            }
        }
    }

    /// Returns what light passes, light groups and shadow catchers need of light that the path's vertex scatters, if
    /// there are any.
    /// `shares`: returns the shares of the vertex's lobes, which count at the first one; `group`: returns the light
    /// group of the emitter.
    #[inline(always)]
    pub(super) fn scattered(
        &self,
        path: &Path,
        shares: impl FnOnce() -> Shares,
        group: impl FnOnce() -> u8,
    ) -> Option<Scattered> {
        let extra = self.extra.as_ref().filter(|_| EXTRA)?;
        let divided = extra.parts.is_some();
        if !divided && extra.groups.is_empty() && extra.caught.is_none() {
            return None;
        }
        let indirect = path.bounce > 0;
        let first = divided && !indirect;
        Some(Scattered {
            shares: if first { shares() } else { extra.shares },
            indirect,
            group: group(),
            catch: path.catch,
        })
    }

    /// Adds light that the path's vertex scatters and nothing occludes.
    #[inline(always)]
    pub(super) fn add_unoccluded(&mut self, light: Vec3, scattered: Option<Scattered>) {
        self.sample.add(light);
        if let (Some(extra), Some(of)) = (self.extra(), scattered) {
            extra.catch(of.catch, light);
            add_to_group(extra.groups, of.group, light);
            if let Some(parts) = &mut extra.parts {
                parts.add_scattered(light, &of.shares, of.indirect);
            }
        }
    }

    /// Adds the colours of the path's first surface. `colors`: returns those of the kinds of lobes.
    #[inline(always)]
    pub(super) fn add_colors(&mut self, throughput: Vec3, colors: impl FnOnce() -> [Vec3; 3]) {
        if let Some(extra) = self.extra()
            && let Some(parts) = &mut extra.parts
        {
            let kinds = [LobeKind::Diffuse, LobeKind::Glossy, LobeKind::Transmission];
            for (kind, color) in kinds.into_iter().zip(colors()) {
                parts.add(LightPass::Color(kind), throughput * color);
            }
        }
    }
}
