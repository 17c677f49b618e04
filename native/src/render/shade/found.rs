// SPDX-License-Identifier: GPL-3.0-or-later
//! Light that a path finds by itself: lamps on its way, surfaces that emit, the world.

use super::super::lights::power_heuristic;
use super::super::path::Path;
use super::super::surface::Surface;
use super::super::vector::Vec3;
use super::{Out, Shader};
use crate::traverse::Hit;

impl<const LIGHTS: bool, const GLOSSY: bool, const GLASS: bool, const SMOOTH: bool>
    Shader<'_, LIGHTS, GLOSSY, GLASS, SMOOTH>
{
    /// Adds the light of lamps that the ray passes before it hits anything else.
    #[inline(always)]
    pub(super) fn meet_lights(&self, d: Vec3, hit: &Hit, path: &Path, out: &mut Out<'_>) {
        let (scene, settings) = (self.scene, self.settings);
        if path.camera && (!self.lamps_seen || (settings.film_transparent && !hit.is_hit())) {
            return;
        }
        out.work.lights_asked += 1;
        let span = [path.passed, path.passed + hit.t];
        let light = scene
            .lights
            .met(path.receiver, d, span, path.pdf, path.kind);
        out.sample
            .add(settings.clamped(path.throughput * light, path.bounce > 1));
    }

    /// Adds the light of the world, which a ray that hits nothing meets.
    #[inline(always)]
    pub(super) fn leave_scene(&self, d: Vec3, path: &Path, out: &mut Out<'_>) {
        let (scene, settings) = (self.scene, self.settings);
        if path.camera && settings.film_transparent {
            return;
        }
        if scene.world.visible.to(path.kind) {
            let mut light =
                scene
                    .world
                    .radiance(&scene.images, &scene.varying, d, path.kind, out.registers);
            if self.features.world && path.pdf.is_finite() {
                let density = scene.lights.world_pdf(path.receiver, d);
                light *= power_heuristic(path.pdf, density);
            }
            out.sample
                .add(settings.clamped(path.throughput * light, path.bounce > 1));
        }
        out.sample.alpha = 1.0;
    }

    /// Adds what the surface emits, seen along `d`.
    #[inline(always)]
    pub(super) fn add_emission(
        &self,
        emission: Vec3,
        (hit, surface, d): (&Hit, &Surface<'_>, Vec3),
        path: &Path,
        out: &mut Out<'_>,
    ) {
        let mut emission = path.throughput * emission;
        if path.pdf.is_finite() {
            let cos = surface.geometric.dot(d).abs();
            let distance = path.passed + hit.t;
            let lights = &self.scene.lights;
            let density = lights.triangle_pdf(path.receiver, hit.triangle, distance, cos);
            emission *= power_heuristic(path.pdf, density);
        }
        out.sample
            .add(self.settings.clamped(emission, path.bounce > 1));
    }
}
