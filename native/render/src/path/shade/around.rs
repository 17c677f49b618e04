// SPDX-License-Identifier: GPL-3.0-or-later
//! The rays of nodes that explore what lies around a surface point, traced one by one while its program runs.

use std::cell::{Cell, RefCell};

use crate::math::sampler::PixelSampler;
use crate::math::vector::Vec3;
use crate::path::shade::output::Output;
use crate::path::state::Path;
use crate::path::wavefront::Context;
use crate::scene::RenderScene;
use crate::scene::surface::{Surface, outward_normals};
use crate::values::rays::{Met, Purpose, SHARP, Search, Surroundings};
use crate::values::shading_point::ShadingPoint;
use crate::values::visibility::RayKind;
use halfspace_ray::selection::{Filtered, HitFilter};
use halfspace_ray::{Hit, HitKey, Ray};

/// Distance from the point to be shaded up to which a ray begins there, relative to its largest coordinate: programs
/// compute positions in world space and back.
const HERE: f32 = 16.0 * f32::EPSILON;

/// First pair of random numbers for these nodes, far behind those of the vertices of a path.
const FIRST_PAIR: u32 = 1 << 24;

/// Runs the program of a surface, which may trace rays from `point`. Not generic in the features, and never inlined,
/// because few scenes need it.
#[cold]
#[inline(never)]
pub(super) fn run<const EXTRA: bool>(
    context: &Context<'_>,
    sample: u32,
    surface: &Surface<'_>,
    point: ShadingPoint<'_>,
    path: &Path,
    out: &mut Output<'_, EXTRA>,
) {
    let scene = context.scene;
    let (sampler, vertex) = path.numbers();
    let around = Around {
        scene,
        surface,
        object: scene.attributes.at(surface.triangle()).object(),
        sampler,
        sample,
        vertex,
        sharp: path.min_pdf >= SHARP,
        rays: Cell::new(0),
    };
    // The point lives as long as its surroundings.
    let mut explorer = point;
    explorer.around = Some(&around);
    let program = &surface.material.program;
    program.run(&scene.images, &explorer, out.registers);
    out.work.rays_programs += around.rays.get();
}

/// The surroundings of a surface point that a path has reached.
struct Around<'a> {
    scene: &'a RenderScene,
    surface: &'a Surface<'a>,
    object: u32,
    sampler: PixelSampler,
    sample: u32,
    /// Number of the path's vertex.
    vertex: u32,
    sharp: bool,
    /// Number of rays traced.
    rays: Cell<u64>,
}

impl Around<'_> {
    /// Traces rays once, with a filter that does not depend on the order of their hits.
    fn sift(&self, rays: &[Ray], filter: HitFilter<'_>) -> Vec<Hit> {
        let mut hits = vec![Hit::MISS; rays.len()];
        self.scene.tracer.sift(rays, &mut hits, filter);
        self.rays.set(self.rays.get() + rays.len() as u64);
        hits
    }

    /// Returns the nearest hit that counts.
    fn first(&self, ray: Ray, counts: impl Fn(u32) -> bool) -> Option<Hit> {
        let kept = |_: usize, hit: &Hit| match counts(hit.triangle) {
            true => Filtered::Kept,
            false => Filtered::Passed,
        };
        let [hit] = self.sift(&[ray], &kept)[..] else {
            return None;
        };
        hit.is_hit().then_some(hit)
    }

    /// Returns the number of rays without a hit that counts.
    fn missing(&self, rays: &[Ray], counts: impl Fn(u32) -> bool) -> usize {
        let met: Vec<_> = rays.iter().map(|_| Cell::new(false)).collect();
        self.sift(rays, &|i, hit| {
            if !counts(hit.triangle) {
                return Filtered::Passed;
            }
            met[i].set(true);
            Filtered::Ended
        });
        met.iter().filter(|met| !met.get()).count()
    }

    /// Returns all hits that count with the indices of their rays: the nearest of each ray, then the next ones. Of several
    /// at one distance only the one with the smallest number.
    fn each(&self, rays: &[Ray], counts: impl Fn(u32) -> bool) -> Vec<(usize, Hit)> {
        let found = RefCell::new(Vec::new());
        self.sift(rays, &|i, hit| {
            if counts(hit.triangle) {
                found.borrow_mut().push((i, *hit));
            }
            Filtered::Passed
        });
        // Sort the hits ray by ray, and number those of each ray.
        let mut found = found.into_inner();
        let key = |hit: &Hit| HitKey::new(hit.t, hit.triangle);
        found.sort_unstable_by(|a, b| a.0.cmp(&b.0).then(key(&a.1).order(key(&b.1))));
        found.dedup_by(|a, b| a.0 == b.0 && a.1.t == b.1.t);
        let mut numbered: Vec<(usize, usize, Hit)> = Vec::with_capacity(found.len());
        for (ray, hit) in found {
            let number = match numbered.last() {
                Some(&(before, last, _)) if last == ray => before + 1,
                _ => 0,
            };
            numbered.push((number, ray, hit));
        }
        // The sort is stable: hits of equal number keep the order of their rays.
        numbered.sort_by_key(|&(number, ..)| number);
        numbered
            .into_iter()
            .map(|(_, ray, hit)| (ray, hit))
            .collect()
    }

    /// Whether a triangle belongs to the point's object.
    fn is_own(&self, triangle: u32) -> bool {
        self.scene.attributes.at(triangle).object() == self.object
    }

    /// Whether rays of this kind see a triangle.
    fn is_seen(&self, triangle: u32, kind: RayKind) -> bool {
        let material = self.scene.attributes.at(triangle).material();
        self.scene.materials[material].visible.to(kind)
    }

    /// Returns what a hit has met.
    fn met(&self, ray: &Ray, hit: &Hit) -> Met {
        let [geometric, normal] = outward_normals(self.scene, hit);
        Met {
            distance: hit.t,
            position: Vec3::from(ray.o) + Vec3::from(ray.d) * hit.t,
            geometric,
            normal,
            own: self.is_own(hit.triangle),
        }
    }
}

impl Surroundings for Around<'_> {
    fn free(&self, directions: &[Vec3], length: f32, local: bool) -> usize {
        let rays = self.surface.rays(directions, length);
        if local {
            return self.missing(&rays, |triangle| self.is_own(triangle));
        }
        if self.scene.features().hidden {
            return self.missing(&rays, |triangle| self.is_seen(triangle, RayKind::Shadow));
        }
        let mut occluded = vec![false; rays.len()];
        self.scene.tracer.occluded(&rays, &mut occluded, None);
        self.rays.set(self.rays.get() + rays.len() as u64);
        occluded.iter().filter(|&&occluded| !occluded).count()
    }

    fn nearest(&self, search: Search) -> Option<Met> {
        let Search {
            origin,
            direction,
            span: [t_min, t_max],
            local,
        } = search;
        // A ray from the point itself, up to rounding, does not meet the point's own triangle.
        let point = self.surface.point;
        let here = (origin - point).max_abs() <= HERE * point.max_abs();
        let ray = if here {
            let ray = self.surface.ray(direction, t_max);
            Ray {
                t_min: ray.t_min.max(t_min),
                ..ray
            }
        } else {
            Ray {
                o: origin.array(),
                d: direction.array(),
                t_min,
                t_max,
            }
        };
        let hit = self.first(ray, |triangle| {
            if local {
                self.is_own(triangle)
            } else {
                self.is_seen(triangle, RayKind::Plain)
            }
        })?;
        Some(self.met(&ray, &hit))
    }

    fn each_local(&self, searches: &[Search], found: &mut dyn FnMut(usize, Met)) {
        let ray = |search: &Search| Ray {
            o: search.origin.array(),
            d: search.direction.array(),
            t_min: search.span[0],
            t_max: search.span[1],
        };
        let rays: Vec<_> = searches.iter().map(ray).collect();
        for (index, hit) in self.each(&rays, |triangle| self.is_own(triangle)) {
            found(index, self.met(&rays[index], &hit));
        }
    }

    fn pair(&self, purpose: Purpose, index: u32, count: u32) -> [f32; 2] {
        // Each sample of the pixel continues the sequence of those before it.
        let pair = FIRST_PAIR + 2 * self.vertex + purpose as u32;
        let number = self.sample.wrapping_mul(count).wrapping_add(index);
        self.sampler.pair(number, pair)
    }

    fn is_sharp(&self) -> bool {
        self.sharp
    }
}
