// SPDX-License-Identifier: GPL-3.0-or-later
//! Two levels: a structure per mesh, and over the places where the meshes stand a tree of boxes.
//!
//! The answer is bit for bit that of the flattened scene, in which every mesh is copied to all its places
//! and rounded there. A ray goes to an instance's own space, walks the mesh's tree with bounds that allow
//! for the way there and for that rounding ([`Frame::placed`]), and what survives is put to the verdict
//! with its corners as the flattened scene would have them. Triangles are numbered as there: all of the
//! first instance, then all of the second.
//!
//! How rays go through them: [`tracing`].

mod tracing;

pub use self::tracing::AtLevel;
use crate::build::Monitor;
use crate::build::binned::SurfaceArea;
use crate::build::cost::Costs;
use crate::build::object::{self, Object};
use crate::build::object_tree::ObjectTree;
use crate::error::{Error, Result};
use crate::geom::{Aabb, Transform};
use crate::memory::check_room;
use crate::structure::Structure;
use crate::traverse::Tracer;
use crate::traverse::frame::Frame;
use crate::traverse::place::Place;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Triangles of all instances together, at most: their numbers are signed in Python.
const MOST: u64 = (1 << 31) - 2;

/// The upper tree's prices: a leaf is a change of space and a walk of its own.
const COSTS: Costs = Costs {
    step: 1.0,
    leaf: 10.0,
    triangle: 10.0,
    ..Costs::BLOCKS
};

/// Meshes in places.
#[derive(Debug)]
pub struct Instances {
    meshes: Vec<Arc<Structure>>,
    /// Those that can be seen.
    places: Vec<Place>,
    /// Of every instance, the number of its first triangle; then the number of all triangles.
    firsts: Vec<u32>,
    /// Of every instance, its place, or [`NOWHERE`].
    place_of: Vec<u32>,
    /// Of every instance, its mesh.
    mesh_of: Vec<u32>,
    frame: Frame,
    tree: ObjectTree,
    tree_firsts: Vec<u32>,
    build_seconds: f64,
}

/// Vertices and triangles of a flattened scene.
pub type Flattened = (Vec<[f32; 3]>, Vec<[u32; 3]>);

/// An instance that was dropped.
const NOWHERE: u32 = u32::MAX;

/// A mesh in a place, as it is given.
#[derive(Debug, Clone, Copy)]
pub struct Instance {
    /// Which mesh.
    pub mesh: u32,
    /// Where it stands.
    pub transform: Transform,
}

impl Instances {
    /// Builds the upper tree. Instances whose transform is singular, not finite or out of the range of f32 are
    /// dropped; their triangles keep their numbers.
    ///
    /// # Errors
    /// [`Error::Shape`] when an instance names no mesh, or when there are more than 2^31 - 2 triangles;
    /// [`Error::Cancelled`] and [`Error::Memory`] when the monitor says so.
    pub fn build(
        meshes: Vec<Arc<Structure>>,
        instances: &[Instance],
        monitor: &Monitor,
    ) -> Result<Self> {
        let start = Instant::now();
        let _held = monitor.hold(size_of_val(instances) * 4)?;
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
        let placed: Vec<Option<Place>> = (instances.par_iter().zip(&firsts))
            .map(|(instance, &first)| {
                let boxes = &meshes[instance.mesh as usize].outline().boxes;
                let mirrored = instance.transform.is_mirrored();
                Place::new(instance.transform, boxes, (instance.mesh, first), mirrored)
            })
            .collect();
        let mut places = Vec::with_capacity(placed.len());
        let mut place_of = vec![NOWHERE; placed.len()];
        for (place, of) in placed.into_iter().zip(&mut place_of) {
            if let Some(place) = place {
                *of = u32::try_from(places.len()).expect("fewer than triangles");
                places.push(place);
            }
        }
        let seen = |place: &Place| !place.bounds.is_empty();
        let bounds = (places.iter().filter(|place| seen(place)))
            .fold(Aabb::EMPTY, |all, place| all.union(&place.bounds));
        let frame = Frame::new(bounds);
        let objects: Vec<_> = (0..)
            .zip(&places)
            .filter(|(_, place)| seen(place))
            .map(|(id, place)| Object {
                bounds: Aabb {
                    min: frame.point(place.bounds.min),
                    max: frame.point(place.bounds.max),
                },
                id,
            })
            .collect();
        let policy = SurfaceArea {
            costs: COSTS,
            leaf_max: 1,
        };
        let tree = object::build_over(objects, frame.bounds(), &policy, monitor)?;
        Ok(Self {
            meshes,
            places,
            firsts,
            place_of,
            mesh_of: instances.iter().map(|instance| instance.mesh).collect(),
            frame,
            tree_firsts: tree.firsts(),
            tree,
            build_seconds: start.elapsed().as_secs_f64(),
        })
    }

    /// The structures of the meshes.
    pub fn meshes(&self) -> &[Arc<Structure>] {
        &self.meshes
    }

    /// The places of the instances that were not dropped.
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// How many instances there are, dropped ones included.
    pub fn len(&self) -> usize {
        self.place_of.len()
    }

    /// Whether there are no instances at all.
    pub fn is_empty(&self) -> bool {
        self.place_of.is_empty()
    }

    /// The instances that were dropped.
    pub fn dropped(&self) -> impl Iterator<Item = usize> {
        let dropped = self.place_of.iter().enumerate();
        dropped.filter(|(_, place)| **place == NOWHERE).map(|x| x.0)
    }

    /// Seconds that the upper tree took, by the clock.
    pub fn build_seconds(&self) -> f64 {
        self.build_seconds
    }

    /// Nodes of the upper tree.
    pub fn nodes(&self) -> usize {
        self.tree.items.len()
    }

    /// Bytes of the upper tree and the places.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.places)
            + size_of_val(&*self.tree.items)
            + 4 * (self.tree.ids.len() + self.tree_firsts.len())
            + 4 * (self.firsts.len() + 2 * self.place_of.len())
    }

    /// The instance and the number within its mesh of a triangle.
    #[inline]
    pub fn locate(&self, id: u32) -> (usize, u32) {
        let after = self.firsts.partition_point(|&first| first <= id);
        // Of instances without triangles, which share their number with the next, the last is found.
        let instance = after - 1;
        (instance, id - self.firsts[instance])
    }

    /// The place of an instance that was not dropped.
    #[inline]
    pub fn place(&self, instance: usize) -> Option<&Place> {
        self.places.get(self.place_of[instance] as usize)
    }

    /// All triangles as the flattened scene has them: vertices of one instance after another, and triangles.
    /// Dropped instances have no finite vertex.
    ///
    /// # Errors
    /// [`Error::Memory`] when they do not fit into what is free.
    pub fn flattened(&self) -> Result<Flattened> {
        let scenes = || (self.mesh_of.iter()).map(|&mesh| self.meshes[mesh as usize].scene());
        let vertex_count: usize = scenes().map(|scene| scene.vertices().len()).sum();
        let bytes = 12 * (vertex_count + self.count());
        check_room("the flattened scene", bytes as u64)?;
        if vertex_count > MOST as usize {
            return Err(Error::Memory(format!("more than {MOST} vertices")));
        }
        let mut vertices = Vec::with_capacity(vertex_count);
        let mut triangles = Vec::with_capacity(self.count());
        for (instance, &mesh) in self.mesh_of.iter().enumerate() {
            let scene = self.meshes[mesh as usize].scene();
            let first = u32::try_from(vertices.len()).expect("checked above");
            let place = self.place(instance);
            let point =
                |p: &[f32; 3]| place.map_or([f32::NAN; 3], |x| x.in_mesh.transform.point(*p));
            vertices.extend(scene.vertices().iter().map(point));
            let mirrored = place.is_some_and(|place| place.in_mesh.mirrored);
            triangles.extend(scene.indices().iter().map(|&[a, b, c]| {
                let [b, c] = if mirrored { [c, b] } else { [b, c] };
                [first + a, first + b, first + c]
            }));
        }
        Ok((vertices, triangles))
    }
}
