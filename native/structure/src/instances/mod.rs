// SPDX-License-Identifier: GPL-3.0-or-later
//! Two-level scenes: one structure per mesh, and a box tree over the instances of the meshes.
//!
//! The result is bit for bit that of the flattened scene, in which every mesh is copied and its vertices are
//! transformed and rounded for each instance. A ray is transformed to an instance's space and traverses the mesh's
//! tree with error bounds that cover the transform and that rounding ([`Frame::placed`]); each remaining candidate
//! is decided by the exact verdict on the flattened scene's vertices. Triangles are numbered as in the flattened
//! scene: all of the first instance, then all of the second.
//!
//! [`tracing`] holds the traversal, [`tracer`] its use.

mod copies;
pub mod nested;
pub mod top;
mod tracer;
mod tracing;

use crate::instances::copies::Copies;
use crate::instances::top::Top;
pub use crate::instances::tracer::AtLevel;
use crate::structure::Structure;
use halfspace_base::Monitor;
use halfspace_base::error::{Error, Result};
use halfspace_base::memory::check_room;
use halfspace_builders::object::Object;
use halfspace_geom::{Aabb, Transform};
use halfspace_nodes::object_tree::ObjectTree;
use halfspace_ray::Tracer;
use halfspace_ray::frame::Frame;
use halfspace_scene::MeshInstance;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Largest total number of triangles: their numbers are signed 32-bit integers in Python.
const MOST: u64 = (1 << 31) - 2;

/// Meshes, their instances, and the box tree over them.
#[derive(Debug)]
pub struct Instances {
    meshes: Vec<Arc<Structure>>,
    /// Instances that were not dropped.
    places: Vec<MeshInstance>,
    /// Number of the first triangle of each instance, then the number of all triangles.
    firsts: Vec<u32>,
    /// Index into `places` of each instance, or [`NOWHERE`].
    place_of: Vec<u32>,
    /// Mesh of each instance.
    mesh_of: Vec<u32>,
    frame: Frame,
    tree: ObjectTree,
    tree_firsts: Vec<u32>,
    copies: Copies,
    top: Top,
    build_seconds: f64,
}

/// Vertices, shape (n, 3), and triangles, shape (m, 3), of a flattened scene.
pub type Flattened = (Vec<[f32; 3]>, Vec<[u32; 3]>);

/// The map that changes no bit of a point.
const IDENTITY: Transform = Transform {
    linear: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    offset: [0.0; 3],
};

/// Marks a dropped instance in `place_of`.
const NOWHERE: u32 = u32::MAX;

/// An instance of a mesh, as the caller gives it.
#[derive(Debug, Clone, Copy)]
pub struct Instance {
    /// Index of the mesh.
    pub mesh: u32,
    /// Transform from the mesh's space to the scene's.
    pub transform: Transform,
}

impl Instances {
    /// Builds the upper tree. Instances whose transform is singular, not finite or out of the range of f32 are
    /// dropped; their triangles keep their numbers.
    ///
    /// # Errors
    /// [`Error::Shape`] when an index of a mesh is out of range, or when there are more than 2^31 - 2 triangles;
    /// [`Error::Cancelled`] and [`Error::Memory`] as the monitor returns them.
    pub fn build(
        meshes: Vec<Arc<Structure>>,
        instances: &[Instance],
        monitor: &Monitor,
    ) -> Result<Self> {
        Self::build_with(Top::default(), meshes, instances, monitor)
    }

    /// As [`Self::build`], with the upper tree built by `top`.
    ///
    /// # Errors
    /// Those of [`Self::build`].
    pub fn build_with(
        top: Top,
        meshes: Vec<Arc<Structure>>,
        instances: &[Instance],
        monitor: &Monitor,
    ) -> Result<Self> {
        let start = Instant::now();
        let _held = monitor.hold(size_of_val(instances) * 4)?;
        // Number the triangles of all instances.
        let mut firsts = Vec::with_capacity(instances.len() + 1);
        let mut count = 0_u64;
        for (i, instance) in instances.iter().enumerate() {
            let Some(mesh) = meshes.get(instance.mesh as usize) else {
                return Err(Error::Shape(format!(
                    "mesh[{i}]: {} is out of range for {} meshes",
                    instance.mesh,
                    meshes.len()
                )));
            };
            firsts.push(u32::try_from(count).expect("checked below"));
            count += mesh.scene().len() as u64;
            if count > MOST {
                return Err(Error::Shape(format!(
                    "instances: at most {MOST} triangles are possible, instance {i} brings them to {count}"
                )));
            }
        }
        firsts.push(u32::try_from(count).expect("checked above"));
        // Bound each instance in the scene's space, and drop those that cannot be placed.
        let placed: Vec<Option<MeshInstance>> = (instances.par_iter().zip(&firsts))
            .map(|(instance, &first)| {
                let boxes = &meshes[instance.mesh as usize].outline().boxes;
                let mirrored = instance.transform.is_mirrored();
                MeshInstance::new(instance.transform, boxes, instance.mesh, first, mirrored)
            })
            .collect();
        // Compact the placed instances, and map every instance to its index.
        let mut places = Vec::with_capacity(placed.len());
        let mut place_of = vec![NOWHERE; placed.len()];
        for (place, of) in placed.into_iter().zip(&mut place_of) {
            if let Some(place) = place {
                *of = u32::try_from(places.len()).expect("fewer than triangles");
                places.push(place);
            }
        }
        // Build a box tree over the instances with any triangle that can be hit.
        let seen = |place: &MeshInstance| !place.bounds.is_empty();
        let bounds = (places.iter().filter(|place| seen(place)))
            .fold(Aabb::EMPTY, |all, place| all.union(&place.bounds));
        let frame = Frame::new(bounds);
        let copies = Copies::build(&meshes, &places, monitor)?;
        let objects: Vec<_> = (0..)
            .zip(&places)
            .filter(|(_, place)| seen(place))
            .filter_map(|(id, place)| Some((id, copies.bounds(id as usize, place)?)))
            .map(|(id, bounds)| Object {
                bounds: Aabb {
                    min: frame.point(bounds.min),
                    max: frame.point(bounds.max),
                },
                id,
            })
            .collect();
        let tree = top.build(objects, frame.bounds(), monitor)?;
        Ok(Self {
            meshes,
            places,
            firsts,
            place_of,
            mesh_of: instances.iter().map(|instance| instance.mesh).collect(),
            frame,
            tree_firsts: tree.firsts(),
            tree,
            copies,
            top,
            build_seconds: start.elapsed().as_secs_f64(),
        })
    }

    /// Returns the instances in their order; a dropped one has no finite transform.
    pub fn instances(&self) -> impl Iterator<Item = Instance> {
        const NONE: Transform = Transform {
            linear: [[f64::NAN; 3]; 3],
            offset: [f64::NAN; 3],
        };
        (self.mesh_of.iter().enumerate()).map(|(instance, &mesh)| Instance {
            mesh,
            transform: self
                .place(instance)
                .map_or(NONE, |place| place.to_scene.transform),
        })
    }

    /// Returns the number of instances that have a structure of their own or share one, see [`copies`].
    pub fn copied(&self) -> usize {
        self.copies.len()
    }

    /// Returns how the upper tree was built.
    pub fn top(&self) -> Top {
        self.top
    }

    /// Returns the structures of the meshes.
    pub fn meshes(&self) -> &[Arc<Structure>] {
        &self.meshes
    }

    /// Returns the instances that were not dropped.
    pub fn places(&self) -> &[MeshInstance] {
        &self.places
    }

    /// Returns the number of instances, dropped ones included.
    pub fn len(&self) -> usize {
        self.place_of.len()
    }

    /// Returns whether there are no instances.
    pub fn is_empty(&self) -> bool {
        self.place_of.is_empty()
    }

    /// Returns the indices of the dropped instances.
    pub fn dropped(&self) -> impl Iterator<Item = usize> {
        let dropped = self.place_of.iter().enumerate();
        dropped.filter(|(_, place)| **place == NOWHERE).map(|x| x.0)
    }

    /// Returns the wall-clock seconds that the build of the upper tree took.
    pub fn build_seconds(&self) -> f64 {
        self.build_seconds
    }

    /// Returns the number of nodes of the upper tree.
    pub fn nodes(&self) -> usize {
        self.tree.items.len()
    }

    /// Returns the bytes of the upper tree and the instances, without the meshes' structures.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.places)
            + size_of_val(&*self.tree.items)
            + 4 * (self.tree.ids.len() + self.tree_firsts.len())
            + 4 * (self.firsts.len() + 2 * self.place_of.len())
            + self.copies.bytes()
    }

    /// Returns the instance of a triangle, and the triangle's number within its mesh.
    #[inline]
    pub fn locate(&self, id: u32) -> (usize, u32) {
        let after = self.firsts.partition_point(|&first| first <= id);
        // Instances without triangles share their first number with the next instance; this finds the last of
        // them, which has triangles.
        let instance = after - 1;
        (instance, id - self.firsts[instance])
    }

    /// Returns the placed instance, or `None` if it was dropped.
    #[inline]
    pub fn place(&self, instance: usize) -> Option<&MeshInstance> {
        self.places.get(self.place_of[instance] as usize)
    }

    /// Returns all triangles as in the flattened scene: the vertices of one instance after another, and the
    /// triangles. The vertices of dropped instances are NaN.
    ///
    /// # Errors
    /// [`Error::Memory`] when they exceed the free memory.
    pub fn flattened(&self) -> Result<Flattened> {
        let scenes = || (self.mesh_of.iter()).map(|&mesh| self.meshes[mesh as usize].scene());
        // Check the size before the arrays are allocated.
        let vertex_count: usize = scenes().map(|scene| scene.vertices().len()).sum();
        let bytes = 12 * (vertex_count + self.count());
        check_room("the flattened scene", bytes as u64)?;
        if vertex_count > MOST as usize {
            return Err(Error::Memory(format!("more than {MOST} vertices")));
        }
        let mut vertices = Vec::with_capacity(vertex_count);
        let mut triangles = Vec::with_capacity(self.count());
        // Transform the vertices of each instance; reverse the orientation of mirrored triangles.
        for (instance, &mesh) in self.mesh_of.iter().enumerate() {
            let scene = self.meshes[mesh as usize].scene();
            let first = u32::try_from(vertices.len()).expect("checked above");
            let place = self.place(instance);
            // Transform and round the vertices as [`Tracer::corners`] does.
            let point =
                |p: &[f32; 3]| place.map_or([f32::NAN; 3], |x| x.to_scene.transform.point(*p));
            vertices.extend(scene.vertices().iter().map(point));
            let mirrored = place.is_some_and(|place| place.to_scene.mirrored);
            triangles.extend(scene.indices().iter().map(|&[a, b, c]| {
                let [b, c] = if mirrored { [c, b] } else { [b, c] };
                [first + a, first + b, first + c]
            }));
        }
        Ok((vertices, triangles))
    }
}
