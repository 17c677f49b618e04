// SPDX-License-Identifier: GPL-3.0-or-later
//! Light that a scattered or camera ray hits: lamps, emissive surfaces, the background.

use crate::light::{Lit, Reach, power_heuristic};
use crate::math::vector::Vec3;
use crate::path::shade::Shader;
use crate::path::shade::output::Output;
use crate::path::shade::volume::opacity;
use crate::path::shadow_rays::add_to_group;
use crate::path::state::Path;
use crate::settings::LightPass;
use crate::values::program::Value;
use halfspace_ray::Hit;

impl<
    const GLOSSY: bool,
    const GLASS: bool,
    const SMOOTH: bool,
    const LOBES: usize,
    const EXTRA: bool,
> Shader<'_, GLOSSY, GLASS, SMOOTH, LOBES, EXTRA>
{
    /// Adds the light of lamps that the ray hits before the surface.
    #[inline(always)]
    pub(super) fn add_lamps(&self, d: Vec3, hit: &Hit, path: &Path, out: &mut Output<'_, EXTRA>) {
        let (scene, settings) = (self.scene, self.settings);
        // Camera rays see lamps only if one is visible to them, and never on a transparent film's background.
        if path.camera && (!self.camera_sees_lamps || (settings.film_transparent && !hit.is_hit()))
        {
            return;
        }
        let path = &path.before_catcher();
        out.work.lights_tested += 1;
        // Lamps are tested from the last scattering point, whose density applies; the interval is this ray's.
        // The virtual origin of a beam lies behind that point.
        let reach = Reach {
            receiver: path.receiver,
            direction: d,
            span: [path.passed.max(0.0), path.passed + hit.t],
        };
        let lamps = |group, registers: &mut Vec<Value>| {
            let lit = &mut Lit {
                images: &scene.images,
                varying: &scene.varying,
                history: path.history(-path.passed),
                registers,
            };
            let lights = &scene.lights;
            path.throughput * lights.radiance_along(reach, path.pdf, path.kind, group, lit)
        };
        let all = lamps(None, out.light_registers);
        let light = settings.clamped(all, path.bounce > 1);
        out.add_met(light, path, LightPass::Emission, || 0);
        // The limit applies to all lamps together.
        if EXTRA && let Some(extra) = &mut out.extra {
            let kept = light.max_abs() / all.max_abs();
            for group in (1..).take(extra.groups.len()).filter(|_| kept > 0.0) {
                let part = lamps(Some(group), out.light_registers) * kept;
                add_to_group(extra.groups, group, part);
            }
        }
    }

    /// Adds the light of the background to a path whose ray hits nothing.
    #[inline(always)]
    pub(super) fn add_background(&self, d: Vec3, path: &Path, out: &mut Output<'_, EXTRA>) {
        let (scene, settings) = (self.scene, self.settings);
        if path.camera
            && let Some(extra) = out.extra()
            && let Some(motion) = &mut extra.motion
        {
            let [a, b, c, d] = self.context.camera.background_motion(d);
            **motion = [a, b, c, d, 1.0];
        }
        // A transparent film shows no background, also behind glass that it sees through.
        if path.camera && settings.film_transparent {
            out.sample.alpha = opacity(path);
            return;
        }
        if self.clear_glass && path.clear {
            out.sample.alpha -= path.throughput.mean();
            return;
        }
        if EXTRA
            && path.camera
            && let Some(extra) = &mut out.extra
        {
            let (history, registers) = (path.history(0.0), &mut *out.registers);
            let (images, varying) = (&scene.images, &scene.varying);
            let outputs = &mut *extra.outputs;
            (scene.world).output(images, varying, d, history, registers, outputs);
        }
        if scene.world.visible.to(path.kind) {
            let (kind, history) = (path.kind, path.history(0.0));
            let mut light = scene.world.radiance(
                &scene.images,
                &scene.varying,
                d,
                kind,
                history,
                out.registers,
            );
            // Only a background that varies is also sampled as a light.
            if self.features.world && path.pdf.is_finite() {
                let density = scene.lights.world_pdf(path.receiver, d);
                light *= power_heuristic(path.pdf, density);
            }
            let light = settings.clamped(path.throughput * light, path.bounce > 1);
            out.add_met(light, path, LightPass::Environment, || scene.world.group);
        }
        // Scattered paths keep the opacity of the first surface.
        if path.camera {
            out.sample.alpha = 1.0;
        }
    }

    /// Adds the emission of a surface, weighted against light samples of the triangle. `cos`: between the ray and
    /// the geometric normal.
    #[inline(always)]
    pub(super) fn add_emission(
        &self,
        emission: Vec3,
        hit: &Hit,
        cos: f32,
        path: &Path,
        out: &mut Output<'_, EXTRA>,
    ) {
        // The density of light samples refers to the last scattering point too.
        let distance = path.passed + hit.t;
        let lights = &self.scene.lights;
        let weight = lights.triangle_weight(path.receiver, path.pdf, hit.triangle, distance, cos);
        let emission = path.throughput * emission * weight;
        let light = self.settings.clamped(emission, path.bounce > 1);
        let triangle = hit.triangle as usize;
        let group = || self.scene.indices.group(triangle);
        out.add_met(light, path, LightPass::Emission, group);
    }
}
