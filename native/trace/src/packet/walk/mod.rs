// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of a tree by packets of rays; rays alone in their group take the single-ray traversal.

use crate::batch::{TileWalk, Walk};
use crate::packet::{Group, MOST, Packet, Sixteen, Width};
use fearless_simd::Simd;
use halfspace_leaf::Job;
use halfspace_ray::query::{Counters, Query};
use halfspace_ray::{Hit, Ray, RayRef, RaySlice};
use std::marker::PhantomData;

/// A tree with a packet traversal.
pub trait PacketTree: Sync {
    /// A stack entry: a node and the interval of each ray in it.
    type Pending<'a>
    where
        Self: 'a;
    /// The single-ray traversal of the same tree.
    type Single<'a>: Walk
    where
        Self: 'a;

    /// Returns the single-ray traversal.
    fn single(&self) -> Self::Single<'_>;

    /// A stack with room for the deepest path.
    fn stack(&self) -> Vec<Self::Pending<'_>>;

    /// Traces one group of a packet. Node visits are counted for the first ray of the group.
    fn follow_packet<'a, S: Simd, Q: Query, C: Counters, L: Width>(
        &'a self,
        simd: S,
        triangles: Job<'_>,
        rays: &[Ray],
        packet: (&mut Packet, Group),
        stack: &mut [Self::Pending<'a>],
        counters: &mut [C],
    );
}

/// The traversal of one tree by packets of width `L`.
pub struct Packets<'a, T, Q, L>(&'a T, PhantomData<(Q, L)>);

impl<'a, T, Q, L> Packets<'a, T, Q, L> {
    /// The packet traversal of `tree`.
    pub fn new(tree: &'a T) -> Self {
        Self(tree, PhantomData)
    }
}

/// Working memory: the packet, its stack, and that of the single-ray traversal.
pub struct Scratch<'a, T: PacketTree + 'a> {
    packet: Packet,
    stack: Vec<T::Pending<'a>>,
    single: <T::Single<'a> as Walk>::Scratch,
}

impl<'a, T: PacketTree> Scratch<'a, T> {
    /// Working memory for traversals of `tree`.
    pub fn new(tree: &'a T) -> Self {
        Self {
            packet: Packet::default(),
            stack: tree.stack(),
            single: tree.single().scratch(),
        }
    }
}

impl<'a, T: PacketTree, Q: Query, L: Width> TileWalk for Packets<'a, T, Q, L> {
    const RAYS: usize = L::RAYS;
    type Scratch = Scratch<'a, T>;

    fn scratch(&self) -> Self::Scratch {
        Scratch::new(self.0)
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
            outlined::<S, T, Q, C>(simd, self.0, triangles, rays, None, scratch, counters);
        } else {
            cast::<S, T, Q, C, L>(simd, self.0, triangles, rays, None, scratch, counters);
        }
        for i in 0..count {
            write(i, scratch.packet.hit::<Q>(i));
        }
    }
}

/// Traces one packet. `known`, if given, are hits found before; each ray ends at its own.
#[inline(always)]
fn cast<'a, S: Simd, T: PacketTree + 'a, Q: Query, C: Counters, L: Width>(
    simd: S,
    tree: &'a T,
    Job { scene, blocks }: Job<'_>,
    RaySlice { frame, rays }: RaySlice<'_>,
    known: Option<&[Hit; MOST]>,
    scratch: &mut Scratch<'a, T>,
    counters: &mut [C],
) {
    let Scratch {
        packet,
        stack,
        single,
    } = scratch;
    let mut left = packet.fill(simd, frame, rays, known);
    // Trace group by group, and single rays by their own traversal.
    while left != 0 {
        let group = packet.group(left);
        left &= !group.lanes;
        if group.lanes.count_ones() == 1 {
            let (i, place) = (group.lead, packet.places[group.lead]);
            // End at the known hit: it is found again, or a better one.
            let t_max = match known {
                Some(known) if known[i].is_hit() => known[i].t,
                _ => rays[place].t_max,
            };
            let ray = Ray {
                t_max,
                ..rays[place]
            };
            let (walk, counters) = (tree.single(), &mut counters[place]);
            let hit = frame.ray(&ray).map_or(Hit::MISS, |framed| {
                let ray = RayRef {
                    ray: &ray,
                    frame: &framed,
                };
                alone::<S, _, Q, C>(simd, &walk, Job { scene, blocks }, ray, single, counters)
            });
            packet.know(i, hit);
        } else {
            let packet = (&mut *packet, group);
            tree.follow_packet::<S, Q, C, L>(
                simd,
                Job { scene, blocks },
                rays,
                packet,
                stack,
                counters,
            );
        }
    }
    packet.settle::<S, Q, C>(simd, (blocks, rays), counters);
}

/// Traces one ray. Compiled once for packets of all widths.
#[inline(never)]
fn alone<S: Simd, W: Walk, Q: Query, C: Counters>(
    simd: S,
    walk: &W,
    triangles: Job<'_>,
    ray: RayRef<'_>,
    scratch: &mut W::Scratch,
    counters: &mut C,
) -> Hit {
    simd.vectorize(
        #[inline(always)]
        || walk.cast::<S, Q, C>(simd, triangles, ray, scratch, counters),
    )
}

/// Rays that a tile traversal leaves unfinished, collected into packets of 16.
pub struct Rest<'a, T: PacketTree + 'a> {
    tree: &'a T,
    scratch: Scratch<'a, T>,
    known: [Hit; MOST],
}

impl<'a, T: PacketTree> Rest<'a, T> {
    /// An empty collection for `tree`.
    pub fn new(tree: &'a T) -> Self {
        Self {
            tree,
            scratch: Scratch::new(tree),
            known: [Hit::MISS; MOST],
        }
    }

    /// Traces some rays of a tile. `rest` gives the index of each in the tile and its best hit so far, where it
    /// ends; `write` receives index and final hit.
    #[inline(always)]
    pub fn walk<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        triangles: Job<'_>,
        RaySlice { frame, rays }: RaySlice<'_>,
        rest: impl Iterator<Item = (usize, Hit)>,
        (write, counters): (&mut impl FnMut(usize, Hit), &mut [C]),
    ) {
        self.scratch.packet.count = 0;
        // Collect rays, and trace each packet that is full.
        for (place, hit) in rest {
            let packet = &mut self.scratch.packet;
            let i = packet.count % MOST;
            packet.places[i] = place;
            if !Q::ANY {
                self.known[i] = hit;
            }
            packet.count += 1;
            if packet.count == MOST {
                self.flush::<S, Q, C>(simd, triangles, RaySlice { frame, rays }, (write, counters));
            }
        }
        self.flush::<S, Q, C>(simd, triangles, RaySlice { frame, rays }, (write, counters));
    }

    /// Traces the collected packet, writes its hits and empties it.
    #[inline(always)]
    fn flush<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        triangles: Job<'_>,
        rays: RaySlice<'_>,
        (write, counters): (&mut impl FnMut(usize, Hit), &mut [C]),
    ) {
        let count = self.scratch.packet.count;
        if count == 0 {
            return;
        }
        let known = (!Q::ANY).then_some(&self.known);
        outlined::<S, T, Q, C>(
            simd,
            self.tree,
            triangles,
            rays,
            known,
            &mut self.scratch,
            counters,
        );
        let packet = &mut self.scratch.packet;
        for (i, place) in packet.places.iter().enumerate().take(count) {
            write(*place, packet.hit::<Q>(i));
        }
        packet.count = 0;
    }
}

/// Traces a packet of 16. Compiled once for each tree and query, since several callers share it.
#[inline(never)]
fn outlined<'a, S: Simd, T: PacketTree + 'a, Q: Query, C: Counters>(
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
        || cast::<S, T, Q, C, Sixteen>(simd, tree, triangles, rays, known, scratch, counters),
    );
}
