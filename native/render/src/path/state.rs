// SPDX-License-Identifier: GPL-3.0-or-later
//! The state of a path between two vertices.

use crate::film::catcher::Catch;
use crate::light::Receiver;
use crate::math::sampler::PixelSampler;
use crate::math::vector::Vec3;
use crate::path::random::VertexSamples;
use crate::settings::Settings;
use crate::values::view::{Bounces, History, Turn};
use crate::values::visibility::RayKind;
use halfspace_ray::{Hit, Ray};

/// Largest number of surfaces that a path, or a shadow ray, passes because they are invisible to it; ends rays that
/// never advance.
pub const MAX_INVISIBLE: u16 = 1000;

/// A path between two of its vertices.
#[derive(Clone, Copy)]
pub struct Path {
    /// Factor on all light the path finds from here on.
    pub throughput: Vec3,
    /// Density per solid angle of the last direction; infinite after a mirror.
    pub pdf: f32,
    /// Density of the least probable direction so far; infinite before the first bounce.
    pub min_pdf: f32,
    /// Point where the path scattered last.
    pub receiver: Receiver,
    /// Distance from there to the origin of the current ray, which starts anew at each surface passed.
    pub passed: f32,
    /// Length of the camera ray in front of the near clipping plane, which programs do not count; 0 after a bounce.
    pub clipped: f32,
    sampler: PixelSampler,
    /// Index of the pixel's sample.
    sample: u32,
    /// Index of the path's pixel sample in the tile's batch.
    pub slot: u32,
    /// Number of times the path has scattered.
    pub bounce: u16,
    /// Number of surfaces that the path has hit, scattering or not: each has its own random numbers.
    vertex: u16,
    /// Number of transparent surfaces passed.
    transparent: u16,
    /// Number of surfaces passed that are invisible to the path's rays.
    invisible: u16,
    /// Whether the current ray still is the camera ray.
    pub camera: bool,
    /// Whether the path has only gone through what a transparent film sees through.
    pub clear: bool,
    /// Whether the path began at a shadow catcher.
    pub catch: Catch,
    /// How the path scattered last.
    pub kind: RayKind,
    last: Turn,
    /// Number of portals passed.
    portals: u16,
    /// Number of bounces by kind.
    bounces: Bounces,
    /// Number of times the path has scattered in volumes.
    pub volume_bounces: u16,
    /// The triangle that the current ray has left, or [`Hit::NONE`].
    pub left: u32,
}

impl Path {
    /// The path of a camera ray, of sample number `sample` of its pixel.
    pub fn from_camera(ray: &Ray, sampler: PixelSampler, sample: u32, slot: u32) -> Self {
        Self {
            throughput: Vec3::ONE,
            pdf: f32::INFINITY,
            min_pdf: f32::INFINITY,
            receiver: Receiver {
                point: Vec3::from(ray.o),
                normal: Vec3::ZERO,
                sets: u32::MAX,
                each: false,
                bounce: 0,
            },
            passed: 0.0,
            clipped: ray.t_min,
            sampler,
            sample,
            slot,
            bounce: 0,
            vertex: 0,
            transparent: 0,
            invisible: 0,
            camera: true,
            clear: true,
            catch: Catch::None,
            kind: RayKind::Camera,
            last: Turn::default(),
            portals: 0,
            bounces: Bounces::default(),
            volume_bounces: 0,
            left: Hit::NONE,
        }
    }

    /// Splits the path of a camera ray at a shadow catcher: it goes on in the whole scene. Returns the path that goes
    /// on among catchers alone, with the same random numbers.
    pub fn split(&mut self) -> Self {
        self.catch = Catch::Whole;
        Self {
            catch: Catch::OnlyCatchers,
            ..*self
        }
    }

    /// Returns the path as which lamps that it meets are seen: before any catcher, if its ray is the camera ray.
    #[inline(always)]
    pub fn before_catcher(&self) -> Self {
        let catch = if self.camera { Catch::None } else { self.catch };
        Self { catch, ..*self }
    }

    /// Scatters with a ray of this kind.
    #[inline(always)]
    pub fn scatter(&mut self, kind: RayKind, last: Turn) {
        self.kind = kind;
        self.last = last;
        self.clipped = 0.0;
        self.bounce += 1;
        // Count the bounce by its kind.
        let Bounces {
            all,
            diffuse,
            glossy,
            transmission,
        } = &mut self.bounces;
        *all = all.saturating_add(1);
        let count = match kind {
            RayKind::Diffuse => diffuse,
            RayKind::Glossy => glossy,
            RayKind::Transmission => transmission,
            RayKind::Volume => {
                self.volume_bounces += 1;
                return;
            }
            RayKind::Camera | RayKind::Shadow | RayKind::Plain => return,
        };
        *count = count.saturating_add(1);
    }

    /// Returns what programs would know if the path scattered with a ray of this kind, at this distance along it.
    #[inline(always)]
    pub fn history_after(&self, kind: RayKind, distance: f32) -> History {
        let mut next = *self;
        next.scatter(kind, Turn::default());
        History {
            length: distance,
            ..next.history(0.0)
        }
    }

    /// Returns what programs know of a shadow ray from the path's vertex.
    #[inline(always)]
    pub fn shadow_history(&self) -> History {
        History {
            portals: self.portals,
            bounces: self.bounces,
            ..History::default()
        }
    }

    /// Returns what programs know of the path, at this distance along its ray.
    #[inline(always)]
    pub fn history(&self, distance: f32) -> History {
        History {
            length: self.passed + distance - self.clipped,
            transparent: self.transparent,
            portals: self.portals,
            last: self.last,
            bounces: self.bounces,
        }
    }

    /// Returns the index of the pixel's sample.
    pub fn sample(&self) -> u32 {
        self.sample
    }

    /// Returns the random numbers of the next vertex.
    #[inline(always)]
    pub fn next_vertex(&mut self) -> VertexSamples {
        // Each vertex has its own dimensions, whether the path scatters there or passes.
        let samples = VertexSamples::new(self.sampler, self.sample, self.vertex);
        self.vertex += 1;
        samples
    }

    /// Returns the seed of a stream of random numbers for the current ray.
    pub fn stream(&self) -> u32 {
        self.sampler.stream(self.sample, u32::from(self.vertex))
    }

    /// Returns the random numbers of the pixel, and the number of the next vertex.
    pub fn numbers(&self) -> (PixelSampler, u32) {
        (self.sampler, u32::from(self.vertex))
    }

    /// Passes a surface at this distance that is invisible to the ray. Returns whether the path may continue.
    #[inline(always)]
    pub fn pass_invisible(&mut self, distance: f32) -> bool {
        self.invisible += 1;
        self.passed += distance;
        self.invisible < MAX_INVISIBLE
    }

    /// Goes through a portal, behind which light samples find nothing.
    pub fn go_through(&mut self) {
        self.portals = self.portals.saturating_add(1);
        self.pdf = f32::INFINITY;
        self.pass(0.0);
        (self.passed, self.clipped) = (0.0, 0.0);
    }

    /// Passes a transparent surface at this distance.
    #[inline(always)]
    pub fn pass(&mut self, distance: f32) {
        self.transparent += 1;
        self.passed += distance;
    }

    /// Returns the number of transparent surfaces passed.
    #[inline(always)]
    pub fn passed_surfaces(&self) -> u16 {
        self.transparent
    }

    /// Whether the path has passed as many transparent surfaces as it may, so that the next one only emits. As in Cycles,
    /// a limit of 0 is one of 1.
    #[inline(always)]
    pub fn has_passed_all(&self, settings: &Settings) -> bool {
        u32::from(self.transparent) >= settings.transparent_bounces.max(1)
    }

    /// Returns whether no surface scatters the path any more. Light that a medium scatters as the last of its bounces
    /// comes from lights alone, as in Cycles.
    #[inline(always)]
    pub fn is_at_limit(&self, settings: &Settings) -> bool {
        let Bounces {
            diffuse,
            glossy,
            transmission,
            ..
        } = self.bounces;
        u32::from(self.bounce) > settings.max_bounces
            || u32::from(self.volume_bounces) > settings.volume_bounces
            || u32::from(diffuse) > settings.diffuse_bounces
            || u32::from(glossy) > settings.glossy_bounces
            || u32::from(transmission) > settings.transmission_bounces
    }

    /// Russian roulette, from the second bounce on. Returns whether the path continues; if so, its throughput is
    /// divided by the probability. The first bounce carries most of the indirect light: ending it costs more noise than
    /// it saves time. The square root ends fewer dim paths, which suits images seen through a view transform. Both as in
    /// Cycles.
    #[inline(always)]
    pub fn survives(&mut self, roulette: f32) -> bool {
        if self.bounce < 2 {
            return true;
        }
        // The probability depends on the throughput only, not on the light found so far.
        let survive = self.throughput.max_component().sqrt().min(1.0);
        if roulette >= survive {
            return false;
        }
        self.throughput *= 1.0 / survive;
        true
    }
}
