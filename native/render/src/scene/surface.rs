// SPDX-License-Identifier: GPL-3.0-or-later
//! A surface point hit by a ray: position, normals, material.

use crate::material::Material;
use crate::material::bsdf::Normals;
use crate::material::bump::reflecting_normal;
use crate::math::vector::{Frame, Vec3};
use crate::medium::stack::Inside;
use crate::scene::RenderScene;
use crate::scene::attributes::At;
use crate::scene::facet::Facet;
use crate::scene::tube;
use crate::values::shading_point::ShadingPoint;
use crate::values::view::History;
use crate::values::visibility::RayKind;
use halfspace_geom::vec3::{dot, sub, widen};
use halfspace_ray::{Hit, Ray};

/// A surface point hit by a ray.
#[derive(Clone, Copy)]
pub struct Surface<'a> {
    /// Position, rounded once.
    pub point: Vec3,
    /// Geometric normal on the viewer's side; of a tube around a hair that of the round hair.
    pub geometric: Vec3,
    /// Shading normal of the facets, on the viewer's side: bent so that the mirror direction leaves the surface.
    pub shading: Vec3,
    /// Shading normal of the surface, before the material's, on the side of the triangle that the viewer is on. It may
    /// face away from the viewer.
    pub own: Vec3,
    /// Whether the viewer is on the back of the triangle.
    pub inside: bool,
    /// Material of the triangle.
    pub material: &'a Material,
    /// Normal of the diffuse base where it is not that of the facets: the material's, or the surface's own.
    mapped: Option<Vec3>,
    /// Length of the interpolated normal before it was normalized; 1 on flat surfaces.
    length: f32,
    /// Barycentric weights of the triangle's corners.
    weights: [f32; 3],
    triangle: usize,
    corners: [[f32; 3]; 3],
    /// Vector to where rays leave a round hair, if it is one.
    outside: Option<Vec3>,
    /// The triangle and the point on it, from which rays begin.
    pub facet: Facet,
    at: At<'a>,
}

/// Sine of the angle to its triangle up to which a lift is along the triangle, as on cards with normals up (chosen).
const ALONG: f32 = 0.01;

/// Returns geometric and shading normal of a hit, on the front of the triangle.
pub fn outward_normals(scene: &RenderScene, hit: &Hit) -> [Vec3; 2] {
    let corners = scene.tracer.corners(hit.triangle);
    let [a, b, c] = corners.map(Vec3::from);
    let geometric = (b - a).cross(c - a).normalized();
    let Some(normals) = scene.attributes.at(hit.triangle).normals(corners) else {
        return [geometric; 2];
    };
    let [na, nb, nc] = normals.map(Vec3::from);
    let normal = na * (1.0 - hit.u - hit.v) + nb * hit.u + nc * hit.v;
    [geometric, normal.normalized_or(geometric)]
}

impl<'a> Surface<'a> {
    /// The point of `hit` seen along the unit direction `d`. `SMOOTH`: whether the scene has corner normals, which
    /// are otherwise not fetched; `line`: the ray that has hit it, in either direction, if there is one.
    #[inline(always)]
    pub fn at<const SMOOTH: bool>(
        scene: &'a RenderScene,
        hit: &Hit,
        d: Vec3,
        line: Option<&Ray>,
    ) -> Self {
        // Find the point, and turn the normal to the viewer's side.
        let corners = scene.tracer.corners(hit.triangle);
        let w = 1.0 - hit.u - hit.v;
        let facet = Facet::new(corners, [w, hit.u, hit.v], line);
        let point = Vec3::from(facet.point.map(|x| x as f32));
        let normal = Vec3::from(facet.normal.map(|x| x as f32));
        let inside = normal.dot(d) > 0.0;
        let mut geometric = if inside { -normal } else { normal };
        // Look up the triangle's attributes once; both material and normals need them.
        let at = scene.attributes.at(hit.triangle);
        let material = &scene.materials[at.material()];
        // Interpolate the corner normals, and turn them to the side of the viewer. Facets use them bent.
        let (mut own, mut shading, mut length) = (geometric, geometric, 1.0);
        let mut outside = None;
        if SMOOTH && let Some(normals) = at.normals(corners) {
            let [na, nb, nc] = normals.map(Vec3::from);
            let n = na * w + nb * hit.u + nc * hit.v;
            length = n.length();
            own = (if inside { -n } else { n }).normalized_or(geometric);
            // The flat sides of a tube stand for a round hair.
            if material.tube
                && !inside
                && let Some(found) =
                    tube::round(corners.map(Vec3::from), [na, nb, nc], [w, hit.u, hit.v], d)
            {
                (own, geometric, outside) = (found.normal, found.normal, Some(found.lift));
            }
            shading = reflecting_normal(geometric, -d, own);
        }
        Self {
            point,
            geometric,
            shading,
            own,
            inside,
            material,
            mapped: (SMOOTH && shading != own).then_some(own),
            length,
            weights: [w, hit.u, hit.v],
            triangle: hit.triangle as usize,
            corners,
            outside,
            facet,
            at,
        }
    }

    /// Like [`Self::at`], with corner normals if the scene has any.
    pub fn of(scene: &'a RenderScene, hit: &Hit, d: Vec3, line: Option<&Ray>) -> Self {
        if scene.features().smooth_normals {
            Self::at::<true>(scene, hit, d, line)
        } else {
            Self::at::<false>(scene, hit, d, line)
        }
    }

    /// Returns the point as input of the material's program, seen along the unit direction `d`.
    pub fn shading_point(&self, scene: &'a RenderScene, d: Vec3, ray: RayKind) -> ShadingPoint<'a> {
        ShadingPoint {
            varying: &scene.varying,
            row: self.at.row(),
            weights: self.weights,
            position: self.point,
            normal: self.own,
            length: self.length,
            geometric: self.geometric,
            incoming: -d,
            inside: self.inside,
            ray,
            edges: [1, 2].map(|k| Vec3::from(self.corners[k]) - Vec3::from(self.corners[0])),
            footprint: 0.0,
            view: None,
            history: History::default(),
            probes: 0,
            around: None,
            lamp: None,
        }
    }

    /// Sets the shading normal that the material computed. Facets use it bent, so that the mirror direction leaves
    /// the surface.
    pub fn bend(&mut self, normal: Vec3, d: Vec3) {
        // A material that returns the surface's own normal changes nothing.
        let normal = normal.normalized_or(self.own);
        if normal != self.own {
            self.mapped = Some(normal);
            self.shading = reflecting_normal(self.geometric, -d, normal);
        }
    }

    /// Returns the other normals in the shading frame.
    #[inline(always)]
    pub fn normals(&self, frame: &Frame) -> Normals {
        let mapped = self.mapped.map(|mapped| [self.own, mapped]);
        Normals {
            geometric: frame.to_local(self.geometric),
            mapped: mapped.map(|both| both.map(|n| frame.to_local(n))),
        }
    }

    /// Returns the cosine between the viewer, in direction -`d`, and the surface's shading normal, which coats use;
    /// at least 1e-4.
    #[inline(always)]
    pub fn cosine(&self, d: Vec3) -> f32 {
        (-self.own.dot(d)).max(1e-4)
    }

    /// Returns the number of the triangle.
    pub fn triangle(&self) -> u32 {
        self.triangle as u32
    }

    /// Whether a ray of this kind passes: the surface is invisible to it, or it is the inside of a tube around a hair.
    #[inline(always)]
    pub fn is_passed(&self, scene: &RenderScene, kind: RayKind) -> bool {
        !self.material.visible.to(kind) || self.is_inside_strand(scene)
    }

    /// Whether the surface is the inside of a tube around a hair whose material scatters like hair.
    fn is_inside_strand(&self, scene: &RenderScene) -> bool {
        let Some(layer) = self.material.strands.filter(|_| self.inside) else {
            return false;
        };
        // The layer is 1 or, on other surfaces, missing.
        let point = self.shading_point(scene, self.geometric, RayKind::Camera);
        point.attribute(layer)[0] > 0.5
    }

    /// Returns the number of the object.
    pub fn object(&self) -> u32 {
        self.at.object()
    }

    /// Returns the medium inside the object, if the material has a volume.
    pub fn medium_behind(&self) -> Option<Inside> {
        self.material.volume.as_ref()?;
        Some(Inside {
            material: self.at.material() as u32,
            object: self.at.object(),
            triangle: self.triangle(),
        })
    }

    /// Returns the shading frame.
    #[inline(always)]
    pub fn frame(&self) -> Frame {
        Frame::around(self.shading)
    }

    /// Returns the cosine between the triangle's normal and a direction from the viewer.
    #[inline(always)]
    pub fn flat_cosine(&self, d: Vec3) -> f32 {
        let normal = match self.outside {
            Some(_) => Vec3::from(self.facet.normal.map(|x| x as f32)),
            None => self.geometric,
        };
        normal.dot(d).abs()
    }

    /// Whether the surface is a triangle with its own normal everywhere.
    #[inline(always)]
    pub fn is_flat(&self) -> bool {
        self.shading == self.geometric && self.outside.is_none()
    }

    /// Returns the side of the triangle that a direction leaves to: 1 for the front, -1 for the back.
    #[inline(always)]
    fn side(&self, direction: Vec3) -> f64 {
        if self.outside.is_some() {
            let along = dot(self.facet.normal, widen(direction.array()));
            return if along < 0.0 { -1.0 } else { 1.0 };
        }
        let across = direction.dot(self.geometric) < 0.0;
        if across == self.inside { 1.0 } else { -1.0 }
    }

    /// Returns the ray that leaves a round hair in this direction, outside of all sides of its tube; `None` if it is no
    /// hair, or the direction enters it.
    #[inline(always)]
    fn leaving(
        &self,
        direction: Vec3,
        to: &dyn Fn([f32; 3]) -> [f32; 3],
        t_max: f32,
    ) -> Option<Ray> {
        let lift = self.outside?;
        (direction.dot(self.own) > 0.0).then(|| {
            let lift = lift.array().map(f64::from);
            let side = dot(self.facet.normal, lift);
            (self.facet).lifted(lift, if side < 0.0 { -1.0 } else { 1.0 }, to, t_max)
        })
    }

    /// Returns the ray that leaves in this direction.
    #[inline(always)]
    pub fn ray(&self, direction: Vec3, t_max: f32) -> Ray {
        let d = direction.array();
        self.leaving(direction, &|_| d, t_max)
            .unwrap_or_else(|| self.facet.ray(self.side(direction), |_| d, t_max))
    }

    /// Returns the rays that leave in these directions.
    pub fn rays(&self, directions: &[Vec3], t_max: f32) -> Vec<Ray> {
        let starts = [1.0, -1.0].map(|side| self.facet.start(side));
        let ray = |&direction: &Vec3| {
            let d = direction.array();
            self.leaving(direction, &|_| d, t_max).unwrap_or_else(|| {
                let side = self.side(direction);
                let start = starts[usize::from(side < 0.0)];
                self.facet.ray_from(start, side, |_| d, t_max)
            })
        };
        directions.iter().map(ray).collect()
    }

    /// Returns the ray from `eye` through the point that begins here, near the direction `towards`; `None` if rounding
    /// moves it off the triangle.
    pub fn ray_through(&self, eye: Vec3, towards: Vec3) -> Option<Ray> {
        self.facet.ray_through(eye.array(), self.side(towards))
    }

    /// Returns the remainder of a ray behind its hit here.
    #[inline(always)]
    pub fn continued(&self, ray: &Ray, hit: &Hit) -> Ray {
        let side = if self.inside { 1.0 } else { -1.0 };
        self.facet.ray(side, |_| ray.d, ray.t_max - hit.t)
    }

    /// Returns a shadow ray in this direction, or to `target`: then `t_max` is a fraction of the way there. At grazing
    /// light the flat triangle of a smooth surface would shadow itself; there the ray begins at the curved surface
    /// described by the corner normals (Hanika 2021, "Hacking the Shadow Terminator", Ray Tracing Gems II, chapter 4),
    /// blended in below a cosine that the object sets, as in Cycles.
    #[inline(always)]
    pub fn shadow_ray<const SMOOTH: bool>(
        &self,
        direction: Vec3,
        target: Option<Vec3>,
        t_max: f32,
    ) -> Ray {
        let to = |o: [f32; 3]| {
            target
                .map_or(direction, |target| target - Vec3::from(o))
                .array()
        };
        if let Some(ray) = self.leaving(direction, &to, t_max) {
            return ray;
        }
        // Light passes through hair.
        let terminator = self.material.terminator;
        let flat = self.outside.is_some() || self.material.strands.is_some();
        if !SMOOTH || terminator <= 0.0 || flat {
            return self.facet.ray(self.side(direction), to, t_max);
        }
        // The ray leaves to the side of the shading normal that the light is on.
        let cosine = self.own.dot(direction);
        let side = if cosine < 0.0 {
            -self.geometric
        } else {
            self.geometric
        };
        let flat = side.dot(direction);
        // Blend the offset in by both cosines, as Cycles does.
        let amount = if cosine.abs() < terminator {
            2.0 - (flat + cosine.abs()) / terminator
        } else {
            1.0 - flat / terminator
        };
        let amount = amount.clamp(0.0, 1.0);
        if amount == 0.0 {
            return self.facet.ray(self.side(side), to, t_max);
        }
        let lift = self.lift(side) * amount;
        // Light from the far side of the triangle does not meet the triangle itself, unless the lift is above it.
        let is_above = lift.dot(side) > ALONG * lift.length();
        let begin = self.side(if flat < 0.0 && !is_above { -side } else { side });
        let lift = lift.array().map(f64::from);
        self.facet.lifted(lift, begin, &to, t_max)
    }

    /// Returns the vector from the flat point to the curved surface on side `side`.
    fn lift(&self, side: Vec3) -> Vec3 {
        let Some(normals) = self.at.normals(self.corners) else {
            return Vec3::ZERO;
        };
        // Project the point onto each corner's tangent plane, and interpolate the shifts.
        let mut lift = Vec3::ZERO;
        for (k, normal) in normals.into_iter().enumerate() {
            // The normal on the light's side; only points below the tangent plane are lifted.
            let n = Vec3::from(normal).normalized_or(side);
            let n = if n.dot(side) < 0.0 { -n } else { n };
            let from_corner = sub(self.facet.point, widen(self.corners[k]));
            let below = (dot(from_corner, widen(n.array())) as f32).min(0.0);
            lift += n * (-below * self.weights[k].clamp(0.0, 1.0));
        }
        lift
    }
}
