// SPDX-License-Identifier: GPL-3.0-or-later
//! The point a ray meets: position, normals, material.

use super::attributes::At;
use super::bsdf::Normals;
use super::material::Material;
use super::place::{Place, RayKind, reflecting_normal};
use super::scene::RenderScene;
use super::vector::{Frame, Vec3, offset_origin};
use crate::traverse::{Hit, Ray};

/// A surface point seen along a ray.
pub struct Surface<'a> {
    /// Position, from the corners, so that its error is a few units in the last place.
    pub point: Vec3,
    /// Geometric normal, towards the viewer.
    pub geometric: Vec3,
    /// Shading normal of facets, towards the viewer.
    pub shading: Vec3,
    /// Whether the viewer is on the back of the triangle.
    pub inside: bool,
    /// Its material.
    pub material: &'a Material,
    /// Shading normal of the surface itself.
    own: Vec3,
    /// The one that the material gives it.
    mapped: Option<Vec3>,
    weights: [f32; 3],
    triangle: usize,
    corners: [[f32; 3]; 3],
    at: At<'a>,
}

/// Shading normals are bent towards the viewer until this cosine, lest interpolation turns a
/// surface black (or a division by it blows up) where it is seen at a grazing angle.
const LEAST_COSINE: f32 = 0.01;

/// Below this cosine towards the light the origin of a shadow ray starts to move: Cycles' default
/// "geometry offset".
const TERMINATOR: f32 = 0.1;

impl<'a> Surface<'a> {
    /// The point of `hit` seen along the unit direction `d`. `SMOOTH`: whether the scene has
    /// corner normals; without them none is fetched.
    #[inline(always)]
    pub fn at<const SMOOTH: bool>(scene: &'a RenderScene, hit: &Hit, d: Vec3) -> Self {
        let corners = scene.tracer.corners(hit.triangle);
        let [a, b, c] = corners.map(Vec3::from);
        let w = 1.0 - hit.u - hit.v;
        let point = a * w + b * hit.u + c * hit.v;
        let normal = (b - a).cross(c - a).normalized();
        let inside = normal.dot(d) > 0.0;
        let geometric = if inside { -normal } else { normal };
        let at = scene.attributes.at(hit.triangle);
        let material = &scene.materials[at.material()];
        let mut shading = geometric;
        if SMOOTH && let Some(normals) = at.normals(corners) {
            let [na, nb, nc] = normals.map(Vec3::from);
            let n = na * w + nb * hit.u + nc * hit.v;
            shading = (if inside { -n } else { n }).normalized_or(geometric);
            let cosine = -shading.dot(d);
            if cosine < LEAST_COSINE {
                shading = (shading - d * (LEAST_COSINE - cosine)).normalized_or(geometric);
            }
        }
        Self {
            point,
            geometric,
            shading,
            inside,
            material,
            own: shading,
            mapped: None,
            weights: [w, hit.u, hit.v],
            triangle: hit.triangle as usize,
            corners,
            at,
        }
    }

    /// The same, with corner normals where the scene has any.
    pub fn of(scene: &'a RenderScene, hit: &Hit, d: Vec3) -> Self {
        if scene.features().smooth_normals {
            Self::at::<true>(scene, hit, d)
        } else {
            Self::at::<false>(scene, hit, d)
        }
    }

    /// The point as the material's program sees it, along the unit direction `d`.
    pub fn place(&self, scene: &'a RenderScene, d: Vec3, ray: RayKind) -> Place<'a> {
        Place {
            varying: &scene.varying,
            triangle: self.triangle,
            weights: self.weights,
            point: self.point,
            normal: self.own,
            geometric: self.geometric,
            incoming: -d,
            inside: self.inside,
            ray,
        }
    }

    /// Takes the shading normal that the material gives; for facets bent back where a mirror would
    /// look inside.
    pub fn bend(&mut self, normal: Vec3, d: Vec3) {
        let normal = normal.normalized_or(self.own);
        if normal != self.own {
            self.mapped = Some(normal);
            self.shading = reflecting_normal(self.geometric, -d, normal);
        }
    }

    /// The other normals in the shading frame.
    #[inline(always)]
    pub fn normals(&self, frame: &Frame) -> Normals {
        let mapped = self.mapped.map(|mapped| [self.own, mapped]);
        Normals {
            geometric: frame.to_local(self.geometric),
            mapped: mapped.map(|both| both.map(|n| frame.to_local(n))),
        }
    }

    /// Cosine between the way back along the unit direction `d` and the surface's own normal, which a coat has.
    #[inline(always)]
    pub fn cosine(&self, d: Vec3) -> f32 {
        (-self.own.dot(d)).max(1e-4)
    }

    /// The shading frame.
    #[inline(always)]
    pub fn frame(&self) -> Frame {
        Frame::around(self.shading)
    }

    /// Origin of a ray that leaves in this direction: on the side of the surface it goes to.
    #[inline(always)]
    pub fn leave(&self, direction: Vec3) -> Vec3 {
        let across = direction.dot(self.geometric) < 0.0;
        offset_origin(
            self.point,
            if across {
                -self.geometric
            } else {
                self.geometric
            },
        )
    }

    /// What is left of a ray behind its hit here.
    #[inline(always)]
    pub fn beyond(&self, ray: &Ray, hit: &Hit) -> Ray {
        Ray {
            o: offset_origin(self.point, -self.geometric).array(),
            d: ray.d,
            t_min: 0.0,
            t_max: ray.t_max - hit.t,
        }
    }

    /// Origin of a shadow ray. On smooth surfaces, where the light grazes, the flat triangle would
    /// shade itself in facets; there the origin is lifted onto the curved surface that the corner
    /// normals describe (Hanika 2021, "Hacking the Shadow Terminator", Ray Tracing Gems II,
    /// chapter 4), faded in below a cosine of 0.1 as Cycles does.
    #[inline(always)]
    pub fn leave_to_light<const SMOOTH: bool>(&self, direction: Vec3) -> Vec3 {
        if !SMOOTH {
            return self.leave(direction);
        }
        let cosine = self.own.dot(direction);
        let side = if cosine < 0.0 {
            -self.geometric
        } else {
            self.geometric
        };
        let flat = side.dot(direction);
        let amount = if cosine.abs() < TERMINATOR {
            2.0 - (flat + cosine.abs()) / TERMINATOR
        } else {
            1.0 - flat / TERMINATOR
        };
        let amount = amount.clamp(0.0, 1.0);
        let origin = offset_origin(self.point, side);
        if amount == 0.0 {
            return origin;
        }
        origin + self.lift(side) * amount
    }

    /// From the flat point to the curved surface, on the side `side`.
    fn lift(&self, side: Vec3) -> Vec3 {
        let Some(normals) = self.at.normals(self.corners) else {
            return Vec3::ZERO;
        };
        let corners = self.corners.map(Vec3::from);
        let [a, b, c] = corners;
        let area = (b - a).cross(c - a);
        let scale = 1.0 / area.length2().max(f32::MIN_POSITIVE);
        let weight = |p: Vec3, q: Vec3| (p - self.point).cross(q - self.point).dot(area) * scale;
        let weights = [weight(b, c), weight(c, a), weight(a, b)];
        let mut lift = Vec3::ZERO;
        for k in 0..3 {
            let n = Vec3::from(normals[k]).normalized_or(side);
            let n = if n.dot(side) < 0.0 { -n } else { n };
            let below = (self.point - corners[k]).dot(n).min(0.0);
            lift += n * (-below * weights[k].clamp(0.0, 1.0));
        }
        lift
    }
}
