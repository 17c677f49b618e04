// SPDX-License-Identifier: GPL-3.0-or-later
//! Rays through instances.
//!
//! Rays of a batch go together: each walks the upper tree until it meets an instance, then all that are
//! waiting for the same mesh walk that mesh's structure, and so on. So every layout and every way of
//! walking serves as a lower level as it is.

use super::Instances;
use crate::build::object_tree::Kind;
use crate::geom::Aabb;
use crate::outline::Outline;
use crate::scene::Triangles;
use crate::structure::Structure;
use crate::traverse::box_tree::Slabs;
use crate::traverse::frame::{FrameRay, Placed};
use crate::traverse::place::Place;
use crate::traverse::query::{Any, Best, Closest, Count, Notes, Query};
use crate::traverse::{Hit, Ray, RayCounters, Tracer};
use fearless_simd::Level;

/// Rays that go together.
const TOGETHER: usize = 256;

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

impl Instances {
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
            let counters = &mut Count(counters, Notes::Nothing);
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
