// SPDX-License-Identifier: GPL-3.0-or-later
//! Two levels: a structure per mesh, and over the places where the meshes stand a tree of boxes.
//!
//! The answer is bit for bit that of the flattened scene, in which every mesh is copied to all its places
//! and rounded there. A ray goes to an instance's own space, walks the mesh's tree with bounds that allow
//! for the way there and for that rounding ([`Frame::placed`]), and what survives is put to the verdict
//! with its corners as the flattened scene would have them. Triangles are numbered as there: all of the
//! first instance, then all of the second.
//!
//! Rays of a batch go together: each walks the upper tree until it meets an instance, then all that are
//! waiting for the same mesh walk that mesh's structure, and so on. So every layout and every way of
//! walking serves as a lower level as it is.

use crate::build::Monitor;
use crate::build::binned::SurfaceArea;
use crate::build::cost::Costs;
use crate::build::object::{self, Object};
use crate::build::object_tree::{Kind, ObjectTree};
use crate::error::{Error, Result};
use crate::geom::{Aabb, Transform};
use crate::memory::check_room;
use crate::outline::Outline;
use crate::scene::Triangles;
use crate::structure::Structure;
use crate::traverse::box_tree::Slabs;
use crate::traverse::frame::{Frame, FrameRay, Placed};
use crate::traverse::place::Place;
use crate::traverse::query::{Any, Best, Closest, Count, Query};
use crate::traverse::{Hit, Ray, RayCounters, Tracer};
use fearless_simd::Level;
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// Triangles of all instances together, at most: their numbers are signed in Python.
const MOST: u64 = (1 << 31) - 2;

/// Rays that go together.
const TOGETHER: usize = 256;

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

    /// The same on a given instruction set instead of the best one.
    pub fn at_level(&self, level: Level) -> AtLevel<'_> {
        AtLevel {
            instances: self,
            level,
        }
    }

    fn trace<Q: Query>(
        &self,
        level: Level,
        rays: &[Ray],
        mut write: impl FnMut(usize, Hit),
        mut counters: Option<&mut [RayCounters]>,
    ) {
        let mut walkers = Vec::with_capacity(TOGETHER);
        let mut stacks = vec![Vec::new(); TOGETHER.min(rays.len())];
        let mut active = Vec::with_capacity(TOGETHER);
        let mut calls = Calls::default();
        for (group, rays) in rays.chunks(TOGETHER).enumerate() {
            let first = group * TOGETHER;
            walkers.clear();
            for (i, ray) in rays.iter().enumerate() {
                let Some(frame) = self.frame.ray(ray) else {
                    write(first + i, Hit::MISS);
                    continue;
                };
                let stack: &mut Stack = &mut stacks[walkers.len()];
                stack.clear();
                if !self.tree.ids.is_empty() {
                    stack.push((NODE, frame.t_min));
                }
                walkers.push(Walker {
                    ray,
                    index: i,
                    slabs: Slabs::new(&frame),
                    best: Best::new(&frame),
                    frame,
                });
            }
            active.clear();
            active.extend(0..walkers.len());
            while !active.is_empty() {
                let counters = counters.as_deref_mut();
                let counters = counters.map(|all| &mut all[first..first + rays.len()]);
                let rays = (&mut walkers[..], &mut stacks[..], &active[..]);
                self.round::<Q>(level, rays, counters, &mut calls);
                active.retain(|&i| {
                    let walker: &Walker<'_> = &walkers[i];
                    let found = walker.best.hit();
                    let done = stacks[i].is_empty() || (Q::ANY && found.is_hit());
                    if done {
                        write(first + walker.index, found);
                    }
                    !done
                });
            }
        }
    }

    /// Takes every active walker to the next instance that it may hit, and through that one's mesh.
    fn round<'a, Q: Query>(
        &'a self,
        level: Level,
        (walkers, stacks, active): (&mut [Walker<'_>], &mut [Stack], &[usize]),
        mut counters: Option<&mut [RayCounters]>,
        calls: &mut Calls<'a>,
    ) {
        calls.waiting.clear();
        for &i in active {
            let walker = &mut walkers[i];
            let mut unused = RayCounters::default();
            let counters = counters
                .as_deref_mut()
                .map_or(&mut unused, |all| &mut all[walker.index]);
            if let Some((mesh, ray)) = self.advance::<Q>(walker, &mut stacks[i], counters) {
                calls.waiting.push((mesh, i, ray));
            }
        }
        calls.waiting.sort_by_key(|call| call.0);
        for call in calls.waiting.chunk_by(|a, b| a.0 == b.0) {
            calls.rays.clear();
            calls
                .rays
                .extend(call.iter().map(|(_, i, _)| *walkers[*i].ray));
            calls.framed.clear();
            calls.framed.extend(call.iter().map(|(.., ray)| *ray));
            calls.counts.clear();
            if counters.is_some() {
                calls.counts.resize(call.len(), RayCounters::default());
            }
            let counted = counters.is_some().then_some(&mut calls.counts[..]);
            let mut found = |place: usize, hit: Hit| walkers[call[place].1].found(hit);
            self.meshes[call[0].0 as usize].walk_placed::<Q>(
                level,
                (&calls.rays, &calls.framed),
                &mut found,
                counted,
            );
            if let Some(all) = counters.as_deref_mut() {
                for ((_, i, _), count) in call.iter().zip(&calls.counts) {
                    all[walkers[*i].index].add(count);
                }
            }
        }
    }

    /// Walks the upper tree to the next instance whose mesh the ray has to walk: the mesh, and the ray in its
    /// space.
    fn advance<'a, Q: Query>(
        &'a self,
        walker: &mut Walker<'_>,
        stack: &mut Stack,
        counters: &mut RayCounters,
    ) -> Option<(u32, FrameRay<'a>)> {
        while let Some((code, enter)) = stack.pop() {
            if enter > walker.best.reach {
                continue;
            }
            if code & NODE == 0 {
                let place = &self.places[code as usize];
                let met = self.enter::<Q>(place, walker, counters);
                if Q::ANY && walker.best.hit().is_hit() {
                    stack.clear();
                    return None;
                }
                if let Some(ray) = met {
                    return Some((place.mesh, ray));
                }
                continue;
            }
            let node = (code & !NODE) as usize;
            let range = (walker.frame.t_min, walker.best.reach);
            let meet = |bounds: &Aabb| walker.slabs.meet(bounds, range);
            counters.steps_axis += 1;
            match self.tree.kind(node) {
                Kind::Inner { children, .. } => {
                    let [below, above] = children.map(|child| {
                        let enter = meet(&self.tree.items[child].bounds)?;
                        Some((self.code(child), enter))
                    });
                    match (below, above) {
                        // The nearer one last, so that it is the next.
                        (Some(a), Some(b)) if a.1 <= b.1 => stack.extend([b, a]),
                        (Some(a), Some(b)) => stack.extend([a, b]),
                        (a, b) => stack.extend(a.or(b)),
                    }
                }
                // Instances in one and the same spot.
                Kind::Leaf { count } => {
                    let first = self.tree_firsts[node] as usize;
                    let enter = meet(&self.tree.items[node].bounds);
                    let ids = &self.tree.ids[first..first + count];
                    stack.extend(
                        enter
                            .into_iter()
                            .flat_map(|at| ids.iter().map(move |&id| (id, at))),
                    );
                }
            }
        }
        None
    }

    /// What stands for a node on the stack: the instance itself, where it is a leaf of one.
    fn code(&self, node: usize) -> u32 {
        match self.tree.kind(node) {
            Kind::Leaf { count: 1 } => self.tree.ids[self.tree_firsts[node] as usize],
            #[expect(clippy::cast_possible_truncation, reason = "fewer nodes than 2^31")]
            _ => NODE | node as u32,
        }
    }

    /// Takes a ray into an instance's space. Triangles that no tree holds are tested on the way; so are all,
    /// when nothing is certain about the ray there.
    fn enter<'a, Q: Query>(
        &self,
        place: &'a Place,
        walker: &mut Walker<'_>,
        counters: &mut RayCounters,
    ) -> Option<FrameRay<'a>> {
        let mesh = &self.meshes[place.mesh as usize];
        let outline = mesh.outline();
        if !outline.flat.is_empty() && enter_flat::<Q>(mesh, place, walker, counters) {
            return None;
        }
        match mesh.frame().placed(walker.ray, place, walker.best.hit()) {
            Placed::Miss => None,
            Placed::Walk(framed) => Some(framed),
            Placed::Blind => {
                let framed = FrameRay::blind(place, walker.best.hit());
                walker.offer::<Q>(&framed, mesh.scene(), mesh.scene().live(), counters);
                None
            }
        }
    }
}

/// Tests the triangles without area; says whether the walk may end.
fn enter_flat<Q: Query>(
    mesh: &Structure,
    place: &Place,
    walker: &mut Walker<'_>,
    counters: &mut RayCounters,
) -> bool {
    let Outline {
        flat, flat_frame, ..
    } = mesh.outline();
    let (framed, blind) = match flat_frame.placed(walker.ray, place, walker.best.hit()) {
        Placed::Miss => return false,
        Placed::Walk(framed) => (framed, false),
        Placed::Blind => (FrameRay::blind(place, walker.best.hit()), true),
    };
    let slabs = Slabs::new(&framed);
    flat.iter().any(|(bounds, ids)| {
        let bounds = Aabb {
            min: flat_frame.point(bounds.min),
            max: flat_frame.point(bounds.max),
        };
        let near = blind || slabs.meet(&bounds, (framed.t_min, framed.t_max)).is_some();
        near && walker.offer::<Q>(&framed, mesh.scene(), ids, counters)
    })
}

impl Walker<'_> {
    /// Puts triangles of a mesh to the verdict; says whether the walk may end.
    fn offer<Q: Query>(
        &mut self,
        framed: &FrameRay<'_>,
        scene: &Triangles,
        ids: &[u32],
        counters: &mut RayCounters,
    ) -> bool {
        let mut best = Best::known(self.best.hit());
        let ended = ids.iter().any(|&id| {
            counters.tests += 1;
            let counters = &mut Count(counters, None);
            best.offer::<Q, _>((self.ray, framed), id, || scene.corners(id), counters)
        });
        self.found(best.hit());
        ended
    }

    /// Takes over the best hit so far.
    fn found(&mut self, hit: Hit) {
        let reach = self.frame.reach(hit.t).min(self.best.reach);
        self.best = Best::known(hit);
        self.best.reach = reach;
    }
}

/// Set for nodes of the upper tree on the stack, as opposed to instances.
const NODE: u32 = 1 << 31;

/// What is still to visit, and where the ray enters it; the next one last.
type Stack = Vec<(u32, f32)>;

/// A ray on its way through the upper tree.
struct Walker<'a> {
    ray: &'a Ray,
    /// Its place in the group.
    index: usize,
    frame: FrameRay<'static>,
    slabs: Slabs,
    best: Best,
}

/// Rays that are to walk a mesh, and room for handing them over.
#[derive(Default)]
struct Calls<'a> {
    /// Mesh, walker, the ray in the instance's space.
    waiting: Vec<(u32, usize, FrameRay<'a>)>,
    rays: Vec<Ray>,
    framed: Vec<FrameRay<'a>>,
    counts: Vec<RayCounters>,
}

/// Instances whose rays run on a given instruction set.
pub struct AtLevel<'a> {
    instances: &'a Instances,
    level: Level,
}

impl Tracer for AtLevel<'_> {
    fn count(&self) -> usize {
        self.instances.count()
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        self.instances.corners(id)
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        assert_eq!(rays.len(), hits.len(), "one answer per ray");
        let write = |i: usize, hit: Hit| hits[i] = hit;
        self.instances
            .trace::<Closest>(self.level, rays, write, counters);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        assert_eq!(rays.len(), occluded.len(), "one answer per ray");
        let write = |i: usize, hit: Hit| occluded[i] = hit.is_hit();
        self.instances
            .trace::<Any>(self.level, rays, write, counters);
    }
}

impl Tracer for Instances {
    fn count(&self) -> usize {
        *self.firsts.last().expect("one more than instances") as usize
    }

    fn corners(&self, id: u32) -> [[f32; 3]; 3] {
        let (instance, local) = self.locate(id);
        let corners = self.meshes[self.mesh_of[instance] as usize]
            .scene()
            .corners(local);
        let placed = self
            .place(instance)
            .and_then(|place| place.in_mesh.corners(corners));
        placed.unwrap_or([[f32::NAN; 3]; 3])
    }

    fn closest(&self, rays: &[Ray], hits: &mut [Hit], counters: Option<&mut [RayCounters]>) {
        self.at_level(Level::new()).closest(rays, hits, counters);
    }

    fn occluded(&self, rays: &[Ray], occluded: &mut [bool], counters: Option<&mut [RayCounters]>) {
        self.at_level(Level::new())
            .occluded(rays, occluded, counters);
    }
}
