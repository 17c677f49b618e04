// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of a tree by packets of rays; rays alone in their group take the single-ray traversal.

use crate::packet::{Group, MOST, Packet, Sixteen, Width, leaf};
use fearless_simd::Simd;
use halfspace_leaf::Job;
use halfspace_ray::query::{Counters, Query};
use halfspace_ray::{Hit, RayRef, RaySlice};
use halfspace_trace::batch::{SingleTraversal, TileTraversal};
use halfspace_trace::input::Input;
use std::marker::PhantomData;

/// A tree with a packet traversal.
pub trait PacketTree: Sync {
    /// A stack entry: a node and the interval of each ray in it.
    type Entry<'a>
    where
        Self: 'a;
    /// The single-ray traversal of the same tree.
    type Single<'a>: SingleTraversal
    where
        Self: 'a;

    /// Whether all leaves are in one store, so that a leaf can be named apart from its node.
    const ONE_STORE: bool = true;

    /// Returns the single-ray traversal.
    fn single(&self) -> Self::Single<'_>;

    /// A stack with room for the deepest path.
    fn stack(&self) -> Vec<Self::Entry<'_>>;

    /// Traces one group of a packet. Node visits are counted for the first ray of the group.
    fn trace_group<'a, S: Simd, Q: Query, C: Counters, L: Width>(
        &'a self,
        simd: S,
        input: Input<'_>,
        packet: &mut Packet,
        group: Group,
        stack: &mut [Self::Entry<'a>],
        counters: &mut [C],
    );
}

/// The traversal of one tree by packets of width `L`.
pub struct Packets<'a, T, Q, L> {
    tree: &'a T,
    /// Whether the blocker of the last packet is tested first.
    cache: bool,
    kind: PhantomData<(Q, L)>,
}

impl<'a, T, Q, L> Packets<'a, T, Q, L> {
    /// The packet traversal of `tree`. `cache`: the blocker of the last packet is tested first.
    pub fn new(tree: &'a T, cache: bool) -> Self {
        Self {
            tree,
            cache,
            kind: PhantomData,
        }
    }
}

/// Working memory: the packet, its stack, and that of the single-ray traversal.
pub struct Scratch<'a, T: PacketTree + 'a> {
    packet: Packet,
    stack: Vec<T::Entry<'a>>,
    single: <T::Single<'a> as SingleTraversal>::Scratch,
}

impl<'a, T: PacketTree> Scratch<'a, T> {
    /// Working memory for traversals of `tree`. `cache`: the blocker of the last packet is tested first.
    pub fn new(tree: &'a T, cache: bool) -> Self {
        Self {
            packet: Packet {
                cache: cache && T::ONE_STORE,
                ..Packet::default()
            },
            stack: tree.stack(),
            single: tree.single().scratch(),
        }
    }
}

impl<'a, T: PacketTree, Q: Query, L: Width> TileTraversal for Packets<'a, T, Q, L> {
    const RAYS: usize = L::RAYS;
    type Scratch = Scratch<'a, T>;

    fn scratch(&self) -> Self::Scratch {
        Scratch::new(self.tree, self.cache)
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        triangles: Job<'_>,
        rays: RaySlice<'_>,
        scratch: &mut Self::Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let count = rays.rays.len();
        scratch.packet.count = count;
        for (i, place) in scratch.packet.places.iter_mut().enumerate().take(count) {
            *place = i;
        }
        if L::RAYS == MOST {
            trace_sixteen::<S, T, Q, C>(simd, self.tree, triangles, rays, None, scratch, counters);
        } else {
            trace::<S, T, Q, C, L>(simd, self.tree, triangles, rays, None, scratch, counters);
        }
        for i in 0..count {
            write(i, scratch.packet.hit::<Q>(i));
        }
    }
}

/// Traces one packet. `known`, if given, are hits found before; each ray ends at its own.
#[inline(always)]
fn trace<'a, S: Simd, T: PacketTree + 'a, Q: Query, C: Counters, L: Width>(
    simd: S,
    tree: &'a T,
    triangles: Job<'_>,
    rays: RaySlice<'_>,
    known: Option<&[Hit; MOST]>,
    scratch: &mut Scratch<'a, T>,
    counters: &mut [C],
) {
    let Scratch {
        packet,
        stack,
        single,
    } = scratch;
    let input = Input::new(triangles, rays);
    let mut left = packet.fill(simd, rays.frame, rays.rays, known);
    if Q::ANY && packet.cache {
        left = leaf::try_blocker::<S, Q, C, L>(simd, input, packet, left, counters);
    }
    // Trace group by group, and single rays by their own traversal.
    while left != 0 {
        let group = packet.group(left);
        left &= !group.lanes;
        if group.lanes.count_ones() == 1 {
            let (i, place) = (group.lead, packet.places[group.lead]);
            let mut ray = rays.rays[place];
            // End at the known hit: it is found again, or a better one.
            if let Some(known) = known
                && known[i].is_hit()
            {
                ray.t_max = known[i].t;
            }
            let (traversal, counters) = (tree.single(), &mut counters[place]);
            let hit = rays.frame.ray(&ray).map_or(Hit::MISS, |framed| {
                let ray = RayRef {
                    ray: &ray,
                    frame: &framed,
                };
                alone::<S, _, Q, C>(simd, &traversal, triangles, ray, single, counters)
            });
            packet.set_hit(i, hit);
        } else {
            tree.trace_group::<S, Q, C, L>(simd, input, packet, group, stack, counters);
        }
    }
    packet.decide_deferred::<S, Q, C>(simd, input, counters);
}

/// Traces one ray. Compiled once for packets of all widths.
#[inline(never)]
fn alone<S: Simd, W: SingleTraversal, Q: Query, C: Counters>(
    simd: S,
    traversal: &W,
    triangles: Job<'_>,
    ray: RayRef<'_>,
    scratch: &mut W::Scratch,
    counters: &mut C,
) -> Hit {
    simd.vectorize(
        #[inline(always)]
        || {
            let mut best = traversal.cast::<S, Q, C>(simd, triangles, ray, scratch, counters);
            best.answer(ray)
        },
    )
}

/// Rays that a tile traversal leaves unfinished, collected into packets of 16.
pub struct Remainder<'a, T: PacketTree + 'a> {
    tree: &'a T,
    scratch: Scratch<'a, T>,
    known: [Hit; MOST],
}

impl<'a, T: PacketTree> Remainder<'a, T> {
    /// An empty collection for `tree`. `cache`: the blocker of the last packet is tested first.
    pub fn new(tree: &'a T, cache: bool) -> Self {
        Self {
            tree,
            scratch: Scratch::new(tree, cache),
            known: [Hit::MISS; MOST],
        }
    }

    /// Traces some rays of a tile. `left` gives the index of each in the tile and its best hit so far, where it
    /// ends; `write` receives index and final hit.
    #[inline(always)]
    pub fn trace<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        triangles: Job<'_>,
        rays: RaySlice<'_>,
        left: impl Iterator<Item = (usize, Hit)>,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        self.scratch.packet.count = 0;
        // Collect rays, and trace each packet that is full.
        for (place, hit) in left {
            let packet = &mut self.scratch.packet;
            let i = packet.count % MOST;
            packet.places[i] = place;
            if !Q::ANY {
                self.known[i] = hit;
            }
            packet.count += 1;
            if packet.count == MOST {
                self.flush::<S, Q, C>(simd, triangles, rays, write, counters);
            }
        }
        self.flush::<S, Q, C>(simd, triangles, rays, write, counters);
    }

    /// Traces the collected packet, writes its hits and empties it.
    #[inline(always)]
    fn flush<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        triangles: Job<'_>,
        rays: RaySlice<'_>,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let count = self.scratch.packet.count;
        if count == 0 {
            return;
        }
        let (tree, scratch) = (self.tree, &mut self.scratch);
        let known = (!Q::ANY).then_some(&self.known);
        trace_sixteen::<S, T, Q, C>(simd, tree, triangles, rays, known, scratch, counters);
        let packet = &mut self.scratch.packet;
        for (i, place) in packet.places.iter().enumerate().take(count) {
            write(*place, packet.hit::<Q>(i));
        }
        packet.count = 0;
    }
}

/// Traces a packet of 16. Compiled once for each tree and query, since several callers share it.
#[inline(never)]
fn trace_sixteen<'a, S: Simd, T: PacketTree + 'a, Q: Query, C: Counters>(
    simd: S,
    tree: &'a T,
    triangles: Job<'_>,
    rays: RaySlice<'_>,
    known: Option<&[Hit; MOST]>,
    scratch: &mut Scratch<'a, T>,
    counters: &mut [C],
) {
    simd.vectorize(
        #[inline(always)]
        || trace::<S, T, Q, C, Sixteen>(simd, tree, triangles, rays, known, scratch, counters),
    );
}
