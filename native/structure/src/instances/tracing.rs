// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of two-level scenes.
//!
//! Rays of a batch advance in rounds: each ray traverses the upper tree to the next instance that it may hit, then all
//! rays that reached the same mesh traverse that mesh's structure as one batch. The lower level can therefore be any
//! structure.

use crate::instances::Instances;
use crate::outline::Outline;
use crate::row::Built;
use crate::structure::Structure;
use fearless_simd::Level;
use halfspace_base::Monitor;
use halfspace_geom::Aabb;
use halfspace_nodes::object_tree::ItemKind;
use halfspace_ray::counters::Log;
use halfspace_ray::frame::Placed;
use halfspace_ray::query::{Best, Count, Counters as _, Query};
use halfspace_ray::{FrameRay, Hit, Interval, Ray, RayCounters, RayRef};
use halfspace_scene::{MeshInstance, Triangles};
use halfspace_trace::slabs::Slabs;

/// Number of rays that advance together (chosen).
const TOGETHER: usize = 256;

/// Flag of a stack entry that is a node of the upper tree, not an instance.
const NODE: u32 = 1 << 31;

/// A node of the upper tree or an instance that a ray still has to visit.
#[derive(Clone, Copy)]
struct Entry {
    /// The index of the instance, or that of the node with the flag [`NODE`].
    code: u32,
    /// Distance where the ray enters it.
    enter: f32,
}

/// The entries of a ray; the next one last.
type Stack = Vec<Entry>;

/// The rays of a group that are not done, with their stacks.
struct Group<'g, 'a> {
    states: &'g mut [RayState<'a>],
    stacks: &'g mut [Stack],
    /// Indices of the states of rays that are not done.
    active: &'g [usize],
}

/// The state of a ray in the upper tree.
struct RayState<'a> {
    ray: &'a Ray,
    /// Index of the ray in its group.
    index: usize,
    frame: FrameRay<'static>,
    slabs: Slabs,
    best: Best,
    /// Recorded events or hidden triangles; if there are any, the ray goes through the meshes alone.
    log: Log<'a>,
}

/// A ray that must traverse the mesh of an instance.
#[derive(Clone, Copy)]
struct Call {
    mesh: u32,
    /// Index of the ray's state.
    state: u32,
    /// Index of the ray in the instance's space.
    placed: u32,
}

/// How rays are traced.
#[derive(Clone, Copy)]
pub(super) struct Run<'a> {
    /// The instruction set.
    pub(super) level: Level,
    /// Cancels the rays.
    pub(super) monitor: Option<&'a Monitor>,
}

/// The calls of a round with their rays in the spaces of instances, and reused buffers for the batch of a mesh.
#[derive(Default)]
struct Calls<'a> {
    queued: Vec<Call>,
    placed: Vec<FrameRay<'a>>,
    rays: Vec<Ray>,
    framed: Vec<FrameRay<'a>>,
    counts: Vec<RayCounters>,
}

impl Instances {
    /// Traces rays in groups of [`TOGETHER`]; `write` receives the index and hit of each ray once, and `log` returns
    /// what is recorded or hidden for a ray.
    pub(super) fn trace<'l, Q: Query>(
        &self,
        run: Run<'_>,
        rays: &[Ray],
        write: &mut dyn FnMut(usize, Hit),
        log: &mut dyn FnMut(usize) -> Log<'l>,
        mut counters: Option<&mut [RayCounters]>,
    ) {
        let mut states = Vec::with_capacity(TOGETHER);
        let mut stacks = vec![Vec::new(); TOGETHER.min(rays.len())];
        let mut active = Vec::with_capacity(TOGETHER);
        let mut calls = Calls::default();
        for (group, rays) in rays.chunks(TOGETHER).enumerate() {
            let first = group * TOGETHER;
            states.clear();
            // Start each ray at the root; rays that miss the scene's frame are done.
            for (i, ray) in rays.iter().enumerate() {
                let log = log(first + i);
                let Some(frame) = self.frame.ray(ray) else {
                    write(first + i, Hit::MISS);
                    continue;
                };
                // Stacks are reused from group to group.
                let stack: &mut Stack = &mut stacks[states.len()];
                stack.clear();
                if !self.tree.ids.is_empty() {
                    stack.push(Entry {
                        code: NODE,
                        enter: frame.t_min,
                    });
                }
                states.push(RayState {
                    ray,
                    index: i,
                    slabs: Slabs::new(&frame),
                    best: Best::new(&frame),
                    frame,
                    log,
                });
            }
            active.clear();
            active.extend(0..states.len());
            // Advance all unfinished rays by one instance each round.
            while !active.is_empty() {
                if run.monitor.is_some_and(Monitor::is_cancelled) {
                    return;
                }
                let counters = counters.as_deref_mut();
                let counters = counters.map(|all| &mut all[first..first + rays.len()]);
                let group = Group {
                    states: &mut states,
                    stacks: &mut stacks,
                    active: &active,
                };
                self.round::<Q>(run.level, group, counters, &mut calls);
                active.retain(|&i| {
                    let state: &RayState<'_> = &states[i];
                    let found = state.best.hit();
                    // An any-hit ray is done at its first hit, others when their stack is empty.
                    let done = stacks[i].is_empty() || (Q::ANY && found.is_hit());
                    if done {
                        write(first + state.index, found);
                    }
                    !done
                });
            }
        }
    }

    /// Advances every active ray to the next instance that it may hit, and traces it through that instance's mesh.
    fn round<'a, Q: Query>(
        &'a self,
        level: Level,
        group: Group<'_, '_>,
        mut counters: Option<&mut [RayCounters]>,
        calls: &mut Calls<'a>,
    ) {
        let Group {
            states,
            stacks,
            active,
        } = group;
        calls.queued.clear();
        calls.placed.clear();
        for &i in active {
            let state = &mut states[i];
            let mut unused = RayCounters::default();
            let counters = counters
                .as_deref_mut()
                .map_or(&mut unused, |all| &mut all[state.index]);
            let queue = &mut calls.placed;
            if let Some(mesh) = self.advance::<Q>(state, &mut stacks[i], queue, counters) {
                calls.queued.push(Call {
                    mesh,
                    state: i as u32,
                    placed: calls.placed.len() as u32 - 1,
                });
            }
        }
        // Trace the rays of each mesh as one batch; with a single mesh they are in order.
        let mixed = calls
            .queued
            .windows(2)
            .any(|two| two[0].mesh != two[1].mesh);
        if mixed {
            calls.queued.sort_by_key(|call| call.mesh);
        }
        for batch in calls.queued.chunk_by(|a, b| a.mesh == b.mesh) {
            if !matches!(states[batch[0].state as usize].log, Log::Nothing) {
                for call in batch {
                    let mesh = self.structure(call.mesh);
                    let unused = &mut RayCounters::default();
                    let placed = &calls.placed[call.placed as usize];
                    states[call.state as usize].observe::<Q>(mesh, &mesh.built, placed, unused);
                }
                continue;
            }
            calls.rays.clear();
            let rays = batch.iter().map(|call| *states[call.state as usize].ray);
            calls.rays.extend(rays);
            calls.framed.clear();
            if mixed {
                let placed = |call: &Call| calls.placed[call.placed as usize];
                calls.framed.extend(batch.iter().map(placed));
            }
            let framed = if mixed { &calls.framed } else { &calls.placed };
            calls.counts.clear();
            if counters.is_some() {
                calls.counts.resize(batch.len(), RayCounters::default());
            }
            let counted = counters.is_some().then_some(&mut calls.counts[..]);
            // Each hit shortens the interval of its ray.
            let mut found = |index: usize, hit: Hit| states[batch[index].state as usize].found(hit);
            self.structure(batch[0].mesh).cast_placed::<Q>(
                level,
                &calls.rays,
                framed,
                &mut found,
                counted,
            );
            // Add the mesh's counters to those of each ray.
            if let Some(all) = counters.as_deref_mut() {
                for (call, count) in batch.iter().zip(&calls.counts) {
                    all[states[call.state as usize].index].add(count);
                }
            }
        }
    }

    /// Traverses the upper tree to the next instance whose mesh the ray must traverse. Returns the mesh, and appends
    /// the ray in the instance's space to `placed`; `None` if the stack is empty or an any-hit ray is done.
    fn advance<'a, Q: Query>(
        &'a self,
        state: &mut RayState<'_>,
        stack: &mut Stack,
        placed: &mut Vec<FrameRay<'a>>,
        counters: &mut RayCounters,
    ) -> Option<u32> {
        while let Some(Entry { code, enter }) = stack.pop() {
            // Skip entries beyond the nearest hit, which may have changed since they were pushed.
            if enter > state.best.reach {
                continue;
            }
            if code & NODE == 0 {
                // Transform the ray to the instance's space, or handle the instance here.
                let (instance, mesh) = self.traversed(code);
                let met = enter_mesh::<Q>(instance, mesh, state, placed, counters);
                if Q::ANY && state.best.hit().is_hit() {
                    stack.clear();
                    return None;
                }
                if met {
                    return Some(instance.mesh);
                }
                continue;
            }
            // Intersect the children of an inner node with the ray interval.
            let node = (code & !NODE) as usize;
            let range = Interval::new(state.frame.t_min, state.best.reach);
            let meet = |bounds: &Aabb| state.slabs.meet(bounds, range);
            counters.steps_boxes += 1;
            match self.tree.kind(node) {
                ItemKind::Inner { children, .. } => {
                    let [below, above] = children.map(|child| {
                        let enter = meet(&self.tree.items[child].bounds)?;
                        Some(Entry {
                            code: self.code(child),
                            enter,
                        })
                    });
                    match (below, above) {
                        // Push the nearer child last, so that it is visited first.
                        (Some(a), Some(b)) if a.enter <= b.enter => stack.extend([b, a]),
                        (Some(a), Some(b)) => stack.extend([a, b]),
                        (a, b) => stack.extend(a.or(b)),
                    }
                }
                // Several instances whose boxes share one centre.
                ItemKind::Leaf { count } => {
                    let first = self.tree_firsts[node] as usize;
                    let enter = meet(&self.tree.items[node].bounds);
                    // Visit the instances in any order: they have the same box.
                    let ids = &self.tree.ids[first..first + count];
                    if let Some(enter) = enter {
                        stack.extend(ids.iter().map(|&code| Entry { code, enter }));
                    }
                }
            }
        }
        None
    }

    /// Returns the code of a node on the stack: the instance itself if the node is a leaf with a single instance.
    fn code(&self, node: usize) -> u32 {
        match self.tree.kind(node) {
            ItemKind::Leaf { count: 1 } => self.tree.ids[self.tree_firsts[node] as usize],
            #[expect(clippy::cast_possible_truncation, reason = "fewer nodes than 2^31")]
            _ => NODE | node as u32,
        }
    }
}

/// Transforms a ray to an instance's space; returns whether it must traverse the mesh, and appends it to `placed`
/// then. Before that, tests the mesh's triangles without area, which no tree contains. If the transformed ray has
/// no usable error bound, tests all triangles.
fn enter_mesh<'a, Q: Query>(
    instance: &'a MeshInstance,
    mesh: &'a Structure,
    state: &mut RayState<'_>,
    placed: &mut Vec<FrameRay<'a>>,
    counters: &mut RayCounters,
) -> bool {
    let outline = mesh.outline();
    if !outline.flat.is_empty() && enter_flat::<Q>(mesh, instance, state, counters) {
        return false;
    }
    for (part, built) in mesh.apart().iter().enumerate() {
        if state.enter_apart::<Q>(mesh, instance, part, built, counters) {
            return false;
        }
    }
    // Transform the ray with error bounds.
    match mesh.frame().placed(state.ray, instance, state.best.hit()) {
        Placed::Miss => false,
        Placed::Traverse(framed) => {
            placed.push(framed);
            true
        }
        Placed::ExactOnly => {
            // Without a usable error bound, test all triangles of the mesh.
            let framed = FrameRay::exact_only(instance, state.best.hit());
            state.offer::<Q>(&framed, mesh.scene(), mesh.scene().live(), counters);
            false
        }
    }
}

/// Tests the triangles without area of a mesh; returns whether the traversal may end.
fn enter_flat<Q: Query>(
    mesh: &Structure,
    instance: &MeshInstance,
    state: &mut RayState<'_>,
    counters: &mut RayCounters,
) -> bool {
    let Outline {
        flat, flat_frame, ..
    } = mesh.outline();
    // Transform the ray with the frame of these triangles.
    let (framed, exact_only) = match flat_frame.placed(state.ray, instance, state.best.hit()) {
        Placed::Miss => return false,
        Placed::Traverse(framed) => (framed, false),
        Placed::ExactOnly => (FrameRay::exact_only(instance, state.best.hit()), true),
    };
    let slabs = Slabs::new(&framed);
    // Test the groups whose box the ray may hit.
    flat.iter().any(|group| {
        let bounds = Aabb {
            min: flat_frame.point(group.bounds.min),
            max: flat_frame.point(group.bounds.max),
        };
        // Without finite error bounds every group must be tested.
        let range = Interval::new(framed.t_min, framed.t_max);
        let near = exact_only || slabs.meet(&bounds, range).is_some();
        near && state.offer::<Q>(&framed, mesh.scene(), &group.ids, counters)
    })
}

impl RayState<'_> {
    /// Applies the exact verdict to triangles of a mesh; returns whether the traversal may end.
    fn offer<Q: Query>(
        &mut self,
        framed: &FrameRay<'_>,
        scene: &Triangles,
        ids: &[u32],
        counters: &mut RayCounters,
    ) -> bool {
        // Only the hit is shared: the reach of this copy is in the instance's space, that of the ray in the scene's.
        let mut best = Best::known(self.best.hit());
        let counters = &mut Count::with(counters, self.log.reborrow());
        let ended = ids.iter().any(|&id| {
            counters.test_alone();
            best.offer::<Q, _>(
                RayRef {
                    ray: self.ray,
                    frame: framed,
                },
                id,
                || scene.corners(id),
                counters,
            )
        });
        self.found(best.hit());
        ended
    }

    /// Traces the ray through the tree of one part of a mesh, alone; returns whether the traversal may end.
    fn enter_apart<Q: Query>(
        &mut self,
        mesh: &Structure,
        instance: &MeshInstance,
        part: usize,
        built: &Built,
        counters: &mut RayCounters,
    ) -> bool {
        match built.frame.placed(self.ray, instance, self.best.hit()) {
            Placed::Miss => {}
            Placed::Traverse(framed) => self.observe::<Q>(mesh, built, &framed, counters),
            Placed::ExactOnly => {
                let framed = FrameRay::exact_only(instance, self.best.hit());
                self.offer::<Q>(&framed, mesh.scene(), &mesh.ids_of(part + 1), counters);
            }
        }
        Q::ANY && self.best.hit().is_hit()
    }

    /// Traces the ray alone through a tree of the mesh of an instance, in whose space `placed` is.
    fn observe<Q: Query>(
        &mut self,
        mesh: &Structure,
        built: &Built,
        placed: &FrameRay<'_>,
        counters: &mut RayCounters,
    ) {
        let mut nearest = Hit::MISS;
        let count = Count::with(counters, self.log.reborrow());
        mesh.observe_placed::<Q>(built, self.ray, placed, &mut |_, hit| nearest = hit, count);
        self.found(nearest);
    }

    /// Replaces the nearest hit and shortens the ray interval to it.
    fn found(&mut self, hit: Hit) {
        let reach = self.frame.reach(hit.t).min(self.best.reach);
        self.best = Best::known(hit);
        self.best.reach = reach;
    }
}
