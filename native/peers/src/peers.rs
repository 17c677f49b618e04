// SPDX-License-Identifier: GPL-3.0-or-later
//! Tracers in Rust, and tinybvh through its crate. Each traces its rays one after another.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::Bvh;
use glam::Vec3A;
use nalgebra::{Point3, Vector3};
use obvhs::BvhBuildParams;
use obvhs::bvh2::Bvh2;
use obvhs::cwbvh::CwBvh;
use obvhs::ray::RayHit;
use obvhs::triangle::Triangle;
use parry3d::math::Vector;
use parry3d::query::RayCast;
use parry3d::shape::{CompositeShapeRef, TriMesh};
use tinybvh_rs::{Intersector, bvh as tiny};
#[cfg(target_feature = "avx2")]
use tinybvh_rs::{bvh8_cpu, mbvh};

use crate::{Hit, MISS, Mesh, NONE, Ray, Tracer};

/// The weights of the second and third corner at the point where a ray meets a triangle's plane.
fn weights([a, b, c]: [[f32; 3]; 3], ray: &Ray, t: f32) -> (f32, f32) {
    let [a, b, c] = [a, b, c].map(Vec3A::from_array);
    let (first, second) = (b - a, c - a);
    let point = Vec3A::from_array(ray.origin) + t * Vec3A::from_array(ray.direction) - a;
    let normal = first.cross(second);
    let area = normal.length_squared();
    (
        point.cross(second).dot(normal) / area,
        first.cross(point).dot(normal) / area,
    )
}

// tinybvh

self_cell::self_cell!(
    /// A tree with the positions that it refers to.
    struct Owned {
        owner: Vec<[f32; 4]>,
        #[not_covariant]
        dependent: Tree,
    }
);

type Tree<'a> = tiny::BVH<'a>;

/// The positions of all corners, as tinybvh takes them.
fn positions(mesh: &Mesh) -> Vec<[f32; 4]> {
    mesh.corners()
        .flatten()
        .map(|[x, y, z]| [x, y, z, 0.0])
        .collect()
}

/// A ray of tinybvh whose interval ends at `t_max`. The direction keeps its length.
fn tiny_ray(ray: &Ray) -> tinybvh_rs::Ray {
    let hit = tinybvh_rs::Intersection {
        t: ray.t_max.min(tinybvh_rs::INFINITE),
        ..Default::default()
    };
    // As tinybvh makes them: -0.0 counts as positive, as in its choice of near planes.
    let reciprocal = |x: f32| match x {
        x if x.abs() > 1e-12 => 1.0 / x,
        x if x >= 0.0 => tinybvh_rs::INFINITE,
        _ => -tinybvh_rs::INFINITE,
    };
    tinybvh_rs::Ray {
        origin: ray.origin,
        dir: ray.direction,
        r_d: ray.direction.map(reciprocal),
        hit,
        ..Default::default()
    }
}

/// The answer that tinybvh leaves in a ray.
fn tiny_hit(asked: &tinybvh_rs::Ray, answered: &tinybvh_rs::Ray) -> Hit {
    let hit = answered.hit;
    if hit.t < asked.hit.t {
        Hit {
            t: hit.t,
            triangle: hit.prim,
            u: hit.u,
            v: hit.v,
        }
    } else {
        MISS
    }
}

/// The nearest hits of rays by an intersector of tinybvh.
fn tiny_closest(tree: &impl Intersector, rays: &[tinybvh_rs::Ray]) -> Vec<Hit> {
    let nearest = |asked: &tinybvh_rs::Ray| {
        let mut ray = *asked;
        tree.intersect(&mut ray);
        tiny_hit(asked, &ray)
    };
    rays.iter().map(nearest).collect()
}

/// The binary tree of tinybvh. Its crate has no any-hit query: nearest hits answer those.
pub struct TinyBinary(Owned);

// The crate's trees are without a thread's state; queries only read.
#[expect(
    unsafe_code,
    reason = "the crate declares no marker traits for its C++ objects"
)]
mod marks {
    use super::TinyBinary;
    #[cfg(target_feature = "avx2")]
    use super::TinyWide;
    unsafe impl Send for TinyBinary {}
    unsafe impl Sync for TinyBinary {}
    #[cfg(target_feature = "avx2")]
    unsafe impl<const SPLITS: bool> Send for TinyWide<SPLITS> {}
    #[cfg(target_feature = "avx2")]
    unsafe impl<const SPLITS: bool> Sync for TinyWide<SPLITS> {}
}

impl Tracer for TinyBinary {
    type Rays = Vec<tinybvh_rs::Ray>;

    fn build(mesh: Mesh) -> Result<Self, String> {
        let made = Owned::try_new(positions(&mesh), |corners| {
            tiny::BVH::new(corners.as_slice().into())
        });
        made.map(Self).map_err(|error| format!("{error:?}"))
    }

    fn rays(rays: &[Ray]) -> Self::Rays {
        rays.iter().map(tiny_ray).collect()
    }

    fn closest(&self, rays: &Self::Rays) -> Vec<Hit> {
        self.0.with_dependent(|_, tree| tiny_closest(tree, rays))
    }

    fn occluded(&self, rays: &Self::Rays) -> Vec<bool> {
        Tracer::closest(self, rays)
            .iter()
            .map(|hit| hit.triangle != NONE)
            .collect()
    }
}

/// The tree with eight children of tinybvh, which needs AVX2. Its crate has no any-hit query either.
#[cfg(target_feature = "avx2")]
pub struct TinyWide<const SPLITS: bool>(bvh8_cpu::BVH);

#[cfg(target_feature = "avx2")]
impl<const SPLITS: bool> Tracer for TinyWide<SPLITS> {
    type Rays = Vec<tinybvh_rs::Ray>;

    fn build(mesh: Mesh) -> Result<Self, String> {
        let corners = positions(&mesh);
        let of = if SPLITS {
            tiny::BVH::new_hq
        } else {
            tiny::BVH::new
        };
        let made = || -> Result<_, tinybvh_rs::Error> {
            let mut binary = of(corners.as_slice().into())?;
            // Leaves of the wide tree have at most four triangles.
            binary.split_leaves(4);
            bvh8_cpu::BVH::new(&mbvh::BVH::new(&binary))
        };
        made().map(Self).map_err(|error| format!("{error:?}"))
    }

    fn rays(rays: &[Ray]) -> Self::Rays {
        rays.iter().map(tiny_ray).collect()
    }

    fn closest(&self, rays: &Self::Rays) -> Vec<Hit> {
        tiny_closest(&self.0, rays)
    }

    fn occluded(&self, rays: &Self::Rays) -> Vec<bool> {
        Tracer::closest(self, rays)
            .iter()
            .map(|hit| hit.triangle != NONE)
            .collect()
    }
}

// obvhs

/// Triangles of obvhs, in the order of the leaves, with their ids.
struct Leaves {
    triangles: Vec<Triangle>,
    corners: Vec<[[f32; 3]; 3]>,
    ids: Vec<u32>,
}

impl Leaves {
    /// All triangles of a mesh as obvhs has them.
    fn all(mesh: &Mesh) -> Vec<Triangle> {
        mesh.corners()
            .map(|[a, b, c]| Triangle {
                v0: a.into(),
                v1: b.into(),
                v2: c.into(),
            })
            .collect()
    }

    fn ordered(mesh: &Mesh, all: &[Triangle], ids: Vec<u32>) -> Self {
        let corners: Vec<_> = mesh.corners().collect();
        let triangles = ids.iter().map(|&id| all[id as usize]).collect();
        Self {
            triangles,
            corners: ids.iter().map(|&id| corners[id as usize]).collect(),
            ids,
        }
    }

    fn test(&self, ray: &obvhs::ray::Ray, place: usize) -> f32 {
        self.triangles[place].intersect(ray)
    }

    fn hit(&self, asked: &Ray, found: &RayHit) -> Hit {
        let place = found.primitive_id as usize;
        if place >= self.ids.len() {
            return MISS;
        }
        let (u, v) = weights(self.corners[place], asked, found.t);
        Hit {
            t: found.t,
            triangle: self.ids[place],
            u,
            v,
        }
    }
}

/// Rays in both forms.
fn obvhs_rays(rays: &[Ray]) -> Vec<(Ray, obvhs::ray::Ray)> {
    let converted =
        |ray: &Ray| obvhs::ray::Ray::new(ray.origin.into(), ray.direction.into(), 0.0, ray.t_max);
    rays.iter().map(|ray| (*ray, converted(ray))).collect()
}

/// A tracer over one of the trees of obvhs, whose queries have the same names.
macro_rules! obvhs_tracer {
    ($(#[$doc:meta])* $name:ident, $tree:ty, $build:path) => {
        $(#[$doc])*
        pub struct $name($tree, Leaves);

        impl Tracer for $name {
            type Rays = Vec<(Ray, obvhs::ray::Ray)>;

            fn build(mesh: Mesh) -> Result<Self, String> {
                let all = Leaves::all(&mesh);
                let tree = $build(&all, BvhBuildParams::slow_build(), &mut Default::default());
                let leaves = Leaves::ordered(&mesh, &all, tree.primitive_indices.clone());
                Ok(Self(tree, leaves))
            }

            fn rays(rays: &[Ray]) -> Self::Rays {
                obvhs_rays(rays)
            }

            fn closest(&self, rays: &Self::Rays) -> Vec<Hit> {
                let nearest = |(asked, ray): &(Ray, obvhs::ray::Ray)| {
                    let mut found = RayHit::none();
                    let test = |ray: &obvhs::ray::Ray, place: usize| self.1.test(ray, place);
                    self.0.ray_traverse(*ray, &mut found, test);
                    self.1.hit(asked, &found)
                };
                rays.iter().map(nearest).collect()
            }

            fn occluded(&self, rays: &Self::Rays) -> Vec<bool> {
                let test = |ray: &obvhs::ray::Ray, place: usize| self.1.test(ray, place);
                rays.iter().map(|(_, ray)| !self.0.ray_traverse_miss(*ray, test)).collect()
            }
        }
    };
}

obvhs_tracer!(
    /// The binary tree of obvhs.
    ObvhsBinary,
    Bvh2,
    obvhs::bvh2::builder::build_bvh2_from_tris
);
obvhs_tracer!(
    /// The tree of obvhs with eight compressed children.
    ObvhsWide,
    CwBvh,
    obvhs::cwbvh::builder::build_cwbvh_from_tris
);

// bvh

/// A triangle with its number, and its node in the tree.
struct Shape {
    corners: [Point3<f32>; 3],
    id: u32,
    node: usize,
}

impl Bounded<f32, 3> for Shape {
    fn aabb(&self) -> Aabb<f32, 3> {
        let [a, b, c] = &self.corners;
        Aabb::empty().grow(a).grow(b).grow(c)
    }
}

impl BHShape<f32, 3> for Shape {
    fn set_bh_node_index(&mut self, node: usize) {
        self.node = node;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

/// The tree of the crate `bvh`.
pub struct BvhCrate(Bvh<f32, 3>, Vec<Shape>);

/// A ray of the crate, whose direction is of length 1, the length of the one that was asked, and the interval's end.
type Measured = (bvh::ray::Ray<f32, 3>, f32, f32);

impl BvhCrate {
    /// The hit of one triangle, which the crate tests from its front only, in lengths of the ray's own direction.
    fn test(ray: &bvh::ray::Ray<f32, 3>, shape: &Shape) -> Hit {
        let [a, b, c] = &shape.corners;
        let front = ray.intersects_triangle(a, b, c);
        let back = ray.intersects_triangle(a, c, b);
        match (front.distance, back.distance) {
            (t, _) if (0.0..f32::INFINITY).contains(&t) => Hit {
                t,
                triangle: shape.id,
                u: front.u,
                v: front.v,
            },
            (_, t) if (0.0..f32::INFINITY).contains(&t) => Hit {
                t,
                triangle: shape.id,
                u: back.v,
                v: back.u,
            },
            _ => MISS,
        }
    }
}

impl Tracer for BvhCrate {
    type Rays = Vec<Measured>;

    fn build(mesh: Mesh) -> Result<Self, String> {
        let shape = |(id, corners): (usize, [[f32; 3]; 3])| Shape {
            corners: corners.map(Point3::from),
            id: u32::try_from(id).unwrap_or(NONE),
            node: 0,
        };
        let mut shapes: Vec<_> = mesh.corners().enumerate().map(shape).collect();
        Ok(Self(Bvh::build(&mut shapes), shapes))
    }

    fn rays(rays: &[Ray]) -> Self::Rays {
        let converted = |ray: &Ray| {
            let direction = Vector3::from(ray.direction);
            let length = direction.norm();
            (
                bvh::ray::Ray::new(Point3::from(ray.origin), direction),
                length,
                ray.t_max * length,
            )
        };
        rays.iter().map(converted).collect()
    }

    fn closest(&self, rays: &Self::Rays) -> Vec<Hit> {
        let nearest = |(ray, length, end): &Measured| {
            let mut best = Hit { t: *end, ..MISS };
            // Boxes come about in the order of their entry; none that begins behind the best hit, with room for rounding,
            // has a nearer one.
            for shape in self.0.nearest_traverse_iterator(ray, &self.1) {
                let entry = ray
                    .intersection_slice_for_aabb(&shape.aabb())
                    .map_or(0.0, |(entry, _)| entry);
                if best.triangle != NONE && entry > best.t * (1.0 + 4.0 * f32::EPSILON) {
                    break;
                }
                let hit = Self::test(ray, shape);
                if hit.t < best.t {
                    best = hit;
                }
            }
            if best.triangle == NONE {
                MISS
            } else {
                Hit {
                    t: best.t / length,
                    ..best
                }
            }
        };
        rays.iter().map(nearest).collect()
    }

    fn occluded(&self, rays: &Self::Rays) -> Vec<bool> {
        let blocked = |(ray, _, end): &Measured| {
            self.0
                .traverse_iterator(ray, &self.1)
                .any(|shape| Self::test(ray, shape).t <= end.min(f32::MAX))
        };
        rays.iter().map(blocked).collect()
    }
}

// parry

/// A mesh of parry.
pub struct Parry(TriMesh);

impl Tracer for Parry {
    type Rays = Vec<(Ray, parry3d::query::Ray)>;

    fn build(mesh: Mesh) -> Result<Self, String> {
        let vertices = mesh
            .vertices
            .iter()
            .map(|&[x, y, z]| Vector::new(x, y, z))
            .collect();
        TriMesh::new(vertices, mesh.triangles)
            .map(Self)
            .map_err(|error| error.to_string())
    }

    fn rays(rays: &[Ray]) -> Self::Rays {
        let vector = |[x, y, z]: [f32; 3]| Vector::new(x, y, z);
        let converted =
            |ray: &Ray| parry3d::query::Ray::new(vector(ray.origin), vector(ray.direction));
        rays.iter().map(|ray| (*ray, converted(ray))).collect()
    }

    fn closest(&self, rays: &Self::Rays) -> Vec<Hit> {
        let nearest = |(asked, ray): &(Ray, parry3d::query::Ray)| {
            let found = CompositeShapeRef(&self.0).cast_local_ray(ray, asked.t_max, true);
            found.map_or(MISS, |(triangle, t)| {
                let corners = self.0.triangle(triangle);
                let (u, v) = weights(
                    [corners.a, corners.b, corners.c].map(|at| at.to_array()),
                    asked,
                    t,
                );
                Hit { t, triangle, u, v }
            })
        };
        rays.iter().map(nearest).collect()
    }

    fn occluded(&self, rays: &Self::Rays) -> Vec<bool> {
        let blocked = |(asked, ray): &(Ray, parry3d::query::Ray)| {
            self.0.intersects_local_ray(ray, asked.t_max)
        };
        rays.iter().map(blocked).collect()
    }
}
