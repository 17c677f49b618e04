// SPDX-License-Identifier: GPL-3.0-or-later
//! Scattering at a surface: the BSDF, a light sample and the next direction.

use crate::light::Receiver;
use crate::material::bsdf::{Bsdf, LobeFilter, Scatter};
use crate::math::vector::{Frame, Vec3, angle};
use crate::path::beams::source::Event;
use crate::path::random::{Selection, VertexSamples};
use crate::path::shade::Shader;
use crate::path::shade::output::Output;
use crate::path::state::Path;
use crate::scene::surface::Surface;
use crate::settings::Integrator;
use crate::settings::Pass;
use crate::values::view::Turn;
use crate::values::visibility::RayKind;
use halfspace_ray::Ray;

/// A BSDF and the shading frame in which it is given.
#[derive(Clone, Copy)]
pub(super) struct FramedBsdf<'a, const GLOSSY: bool, const GLASS: bool, const LOBES: usize> {
    pub(super) frame: &'a Frame,
    pub(super) bsdf: &'a Bsdf<GLOSSY, GLASS, LOBES>,
}

impl<
    const GLOSSY: bool,
    const GLASS: bool,
    const SMOOTH: bool,
    const LOBES: usize,
    const EXTRA: bool,
> Shader<'_, GLOSSY, GLASS, SMOOTH, LOBES, EXTRA>
{
    /// Samples a light and the next direction at a surface seen along `d`. Returns the next ray if the path
    /// continues.
    #[inline(always)]
    pub(super) fn scatter(
        &self,
        surface: &Surface<'_>,
        d: Vec3,
        random: VertexSamples,
        path: &mut Path,
        bsdf: &mut Bsdf<GLOSSY, GLASS, LOBES>,
        out: &mut Output<'_, EXTRA>,
    ) -> Option<Ray> {
        let frame = surface.frame();
        if self.is(Integrator::Ambient) {
            out.add_colors(path.throughput, || [Vec3::ONE, Vec3::ZERO, Vec3::ZERO]);
            self.sample_occlusion(surface, &frame, random, path, out);
            return None;
        }
        // Assemble the BSDF in the shading frame, in the memory of the last one.
        let mut wi = frame.to_local(-d);
        let seen = wi.z > 0.0;
        wi.z = wi.z.max(1e-4);
        let normals = surface.normals(&frame);
        bsdf.assemble(
            &surface.material.closures,
            out.registers,
            wi,
            normals,
            surface.inside,
            LobeFilter {
                seen,
                ..self.lobe_filter(path)
            },
            &frame,
        );
        out.work.shaded_glossy += u64::from(bsdf.reflects());
        out.work.shaded_glass += u64::from(bsdf.transmits());
        if path.camera {
            out.add_colors(path.throughput, || bsdf.colors());
            if EXTRA && self.context.film.fills(Pass::Roughness) {
                out.sample.roughness = bsdf.roughness();
            }
        }
        // Light from behind reaches a surface only if it transmits. As in Cycles, the shading normal decides: normals
        // that face away from the triangle's receive light from its other side.
        let normal = if bsdf.transmits() {
            Vec3::ZERO
        } else {
            surface.own
        };
        path.receiver = Receiver {
            point: surface.point,
            normal,
            sets: surface.material.sets.receives,
            // Lobes with frames of their own take longer to evaluate than their samples gain. The scene decides, since
            // passes that are rarely filled come with code for such lobes, and must not change the picture.
            each: !self.features.lobes
                && !self.is(Integrator::Whitted)
                && self.scene.lights.several(),
            bounce: path.bounce,
        };
        let framed = FramedBsdf {
            frame: &frame,
            bsdf,
        };
        self.sample(surface, framed, random, path, out)
    }

    /// Samples a light, then the next direction.
    #[inline(always)]
    pub(super) fn sample(
        &self,
        surface: &Surface<'_>,
        framed: FramedBsdf<'_, GLOSSY, GLASS, LOBES>,
        random: VertexSamples,
        path: &mut Path,
        out: &mut Output<'_, EXTRA>,
    ) -> Option<Ray> {
        let [choose_light, choose_lobe] = random.choices();
        if self.features.lights && framed.bsdf.has_density() {
            let (lights, receiver) = (&self.scene.lights, path.receiver);
            if receiver.each {
                lights.sample_several(
                    receiver,
                    choose_light,
                    |number| random.light_of(number),
                    |light| self.receive(surface, framed, &light, path, out),
                );
            } else if let Some(light) = lights.sample(receiver, choose_light, random.light()) {
                self.receive(surface, framed, &light, path, out);
            }
        }
        let selection = Selection {
            choice: choose_lobe,
            u: random.direction(),
        };
        self.sample_direction(surface, framed, selection, path, out)
    }

    /// Returns what the settings change about the lobes that this path meets.
    #[inline(always)]
    fn lobe_filter(&self, path: &Path) -> LobeFilter {
        // Only lobes met directly after a diffuse bounce make caustics.
        let settings = self.settings;
        let scattered = path.kind == RayKind::Diffuse;
        LobeFilter {
            min_width: settings.min_width(path.min_pdf),
            reflections: settings.caustics_reflective || !scattered,
            refractions: settings.caustics_refractive || !scattered,
            walks: self.is(Integrator::Path),
            seen: true,
        }
    }

    /// Samples the next direction. Returns the next ray if the path continues.
    #[inline(always)]
    fn sample_direction(
        &self,
        surface: &Surface<'_>,
        FramedBsdf { frame, bsdf }: FramedBsdf<'_, GLOSSY, GLASS, LOBES>,
        Selection { choice, u }: Selection,
        path: &mut Path,
        out: &mut Output<'_, EXTRA>,
    ) -> Option<Ray> {
        // Light that enters the surface walks below it.
        if LOBES > 0
            && self.features.subsurface
            && let Some(entrance) = bsdf.entrance(choice, u)
        {
            return self.enter(surface, frame, &entrance, path, out);
        }
        // Without light to be found, the ray after the last bounce is not needed.
        let last = u32::from(path.bounce) == self.settings.max_bounces && !self.last_ray_counts;
        let shows_albedo = path.camera && self.albedo;
        if last && !shows_albedo {
            return None;
        }
        // Sample the BSDF. The expected weight of a sampled direction is the albedo.
        let scatter = bsdf.sample(choice, u)?;
        if shows_albedo {
            out.sample.albedo = scatter.weight.array();
            if last {
                return None;
            }
        }
        // Transform to scene space.
        let direction = frame.to_world(scatter.wo).normalized_or(surface.geometric);
        // Drop directions where shading and geometric normal disagree about the side.
        let across = direction.dot(surface.geometric) < 0.0;
        if across != scatter.through {
            return None;
        }
        // Whitted's rays follow mirrors and clear glass only.
        if self.is(Integrator::Whitted) && scatter.pdf.is_finite() {
            let framed = FramedBsdf { frame, bsdf };
            self.sample_constant_background(surface, framed, &scatter, path, out);
            return None;
        }
        if let Some(extra) = out.extra()
            && extra.parts.is_some()
            && path.bounce == 0
        {
            extra.shares = bsdf.shares_of(&scatter);
        }
        path.throughput = path.throughput * scatter.weight;
        if path.throughput.max_component() <= 0.0 || !path.throughput.is_finite() {
            return None;
        }
        // Start the next segment.
        path.pdf = scatter.pdf;
        path.min_pdf = path.min_pdf.min(scatter.pdf);
        path.passed = 0.0;
        path.camera = false;
        path.clear &= self.clear_glass
            && scatter.kind == RayKind::Transmission
            && (!scatter.pdf.is_finite() || bsdf.is_clear(self.settings.transparent_glass));
        let last = Turn {
            through: scatter.through,
            singular: !scatter.pdf.is_finite(),
        };
        path.scatter(scatter.kind, last);
        if scatter.through {
            out.cross(surface);
        }
        if let Some(ray) = self.beam_ray(surface, direction, &scatter, path, out) {
            return Some(ray);
        }
        Some(surface.ray(direction, f32::INFINITY))
    }

    /// Returns the ray of the beam that a flat polygon mirrors or refracts; `None` if the path's ray is in no beam, or
    /// the surface is not flat or rough. `direction`: that of the single ray.
    #[inline(always)]
    fn beam_ray(
        &self,
        surface: &Surface<'_>,
        direction: Vec3,
        scatter: &Scatter,
        path: &mut Path,
        out: &mut Output<'_, EXTRA>,
    ) -> Option<Ray> {
        let plane = self.context.polygons?.plane(surface.triangle())?;
        // A lobe of its own frame may mirror about another normal than the polygon's.
        if LOBES > 0 || scatter.pdf.is_finite() || !surface.is_flat() {
            return None;
        }
        // Change the beam's source at the plane, and start behind it.
        let event = if scatter.through {
            let eta = scatter.eta;
            Event::Refracted { eta }
        } else {
            Event::Mirrored
        };
        let source = out.source.after(event, plane);
        let ray = source.ray_from(surface, direction)?;
        // Distances count from the polygon, which the ray meets at the beginning of its interval.
        path.passed = -ray.t_min;
        out.next = source;
        let deviation = angle(Vec3::from(ray.d), direction);
        out.work.beam_deviation = out.work.beam_deviation.max(deviation);
        Some(ray)
    }
}
