// SPDX-License-Identifier: GPL-3.0-or-later
//! Subsurface scattering: a path enters a surface, walks below it until it meets the same object, and leaves through a
//! Lambertian lobe there (Chiang, Kutz and Burley 2016). Rays of walks go through the structure like all others, which
//! passes the surfaces of other objects on the way.

use crate::light::Receiver;
use crate::material::bsdf::{Bsdf, Entrance};
use crate::math::sampler::Stream;
use crate::math::vector::{Frame, Vec3};
use crate::medium::inversion::Coefficients;
use crate::medium::mixture::divided;
use crate::path::shade::Shader;
use crate::path::shade::output::Output;
use crate::path::shade::scatter::FramedBsdf;
use crate::path::state::Path;
use crate::path::walk::{End, RandomWalk};
use crate::scene::surface::Surface;
use crate::settings::Pass;
use halfspace_ray::{Hit, Ray};

/// Mean free paths below this share of the coordinates are shorter than rounding errors of positions allow: light
/// leaves where it entered. 64 units in the last place (chosen).
const RESOLUTION: f32 = 64.0 * f32::EPSILON;

/// Coordinate beyond which walks are dropped: that of the farthest vertex.
const FARTHEST: f32 = 9.2e18;

impl<
    const GLOSSY: bool,
    const GLASS: bool,
    const SMOOTH: bool,
    const LOBES: usize,
    const EXTRA: bool,
> Shader<'_, GLOSSY, GLASS, SMOOTH, LOBES, EXTRA>
{
    /// Enters a surface. Returns the first ray of the walk, or if light leaves at once, that of the next bounce.
    #[cold]
    #[inline(never)]
    pub(super) fn enter(
        &self,
        surface: &Surface<'_>,
        frame: &Frame,
        entrance: &Entrance,
        path: &mut Path,
        out: &mut Output<'_, EXTRA>,
    ) -> Option<Ray> {
        let Entrance {
            below,
            weight,
            direction,
        } = *entrance;
        if path.camera && self.context.film.fills(Pass::Albedo) {
            out.sample.albedo = weight.array();
        }
        path.camera = false;
        // Directions that the triangle contradicts are lost.
        let d = frame.to_world(direction);
        let d = d.normalized_or(-surface.geometric);
        if d.dot(surface.geometric) >= 0.0 {
            return None;
        }
        let medium = Coefficients::new(
            below.method,
            below.color,
            below.radius,
            below.anisotropy,
            below.ior,
        );
        let longest = medium.extinction.map(|sigma| 1.0 / sigma).max_component();
        if longest < RESOLUTION * surface.point.max_abs() {
            path.throughput = path.throughput * weight;
            return self.leave(surface, frame, path, out);
        }
        // The medium gives the colour that the weight contains.
        path.throughput = path.throughput * divided(weight, below.color) * medium.factor;
        if path.throughput.max_component() <= 0.0 || !path.throughput.is_finite() {
            return None;
        }
        let seed = Stream::new(path.stream()).fork(5);
        let walk = RandomWalk::new(
            &medium,
            below.anisotropy,
            surface.shading,
            surface.object(),
            path.throughput,
            seed,
        );
        out.walk = Some(walk);
        Some(surface.ray(d, walk.left()))
    }

    /// Continues a walk at the end of its ray. Returns the next ray if the path continues.
    #[cold]
    #[inline(never)]
    pub(super) fn walk(
        &self,
        mut walk: RandomWalk,
        ray: &Ray,
        hit: &Hit,
        path: &mut Path,
        out: &mut Output<'_, EXTRA>,
    ) -> Option<Ray> {
        let d = Vec3::from(ray.d);
        if hit.is_hit() {
            // Seen from outside, where the path goes.
            let mut surface = Surface::at::<SMOOTH>(self.scene, hit, -d, Some(ray));
            if surface.object() != walk.object {
                walk.cover(hit.t);
                out.walk = Some(walk);
                let seen = Surface::at::<SMOOTH>(self.scene, hit, d, Some(ray));
                return path.pass_invisible(0.0).then(|| seen.continued(ray, hit));
            }
            let End::Left = walk.end(d, Some(hit.t), &mut path.throughput) else {
                return None;
            };
            out.walk = None;
            if surface.material.maps_normal() {
                self.run_program(&mut surface, -d, hit.t, path, out);
            }
            let frame = surface.frame();
            return self.leave(&surface, &frame, path, out);
        }
        let at = Vec3::from(ray.o) + d * walk.left();
        let End::Scattered(next) = walk.end(d, None, &mut path.throughput) else {
            return None;
        };
        out.walk = Some(walk);
        (at.max_abs() < FARTHEST).then(|| Ray {
            o: at.array(),
            d: next.array(),
            t_min: 0.0,
            t_max: walk.left(),
        })
    }

    /// Leaves through a surface: samples a light and the next direction of a white Lambertian lobe.
    #[inline(never)]
    fn leave(
        &self,
        surface: &Surface<'_>,
        frame: &Frame,
        path: &mut Path,
        out: &mut Output<'_, EXTRA>,
    ) -> Option<Ray> {
        path.receiver = Receiver {
            point: surface.point,
            normal: surface.geometric,
            sets: surface.material.sets.receives,
            each: false,
            bounce: path.bounce,
        };
        let up = frame.to_local(surface.geometric);
        let bsdf = Bsdf::<GLOSSY, GLASS, LOBES>::lambertian(up, surface.normals(frame), frame);
        let framed = FramedBsdf { frame, bsdf: &bsdf };
        let random = path.next_vertex();
        self.sample(surface, framed, random, path, out)
    }
}
