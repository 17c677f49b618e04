// SPDX-License-Identifier: GPL-3.0-or-later
//! Walks of a tree by packets of rays; those that no other goes with are walked singly.

use super::batch::{TileWalk, Walk};
use super::blocks::Blocks;
use super::frame::{Frame, FrameRay};
use super::packet::{Group, MOST, Packet, Sixteen, Width};
use super::query::{Counters, Query};
use super::ray::{Hit, Ray};
use crate::scene::Triangles;
use fearless_simd::Simd;
use std::marker::PhantomData;

/// A tree that packets can be walked through.
pub trait PacketTree: Sync {
    /// A child that waits, and where each ray is in it.
    type Pending<'a>
    where
        Self: 'a;
    /// The walk of its single rays.
    type Single<'a>: Walk
    where
        Self: 'a;

    /// That walk.
    fn single(&self) -> Self::Single<'_>;

    /// Room for all children that may wait.
    fn stack(&self) -> Vec<Self::Pending<'_>>;

    /// Walks some rays of a packet. Steps are charged to the first of them.
    fn follow_packet<'a, S: Simd, Q: Query, C: Counters, L: Width>(
        &'a self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        rays: &[Ray],
        packet: (&mut Packet, Group),
        stack: &mut [Self::Pending<'a>],
        counters: &mut [C],
    );
}

/// The walk over one tree by packets of this width.
pub struct Packets<'a, T, Q, L>(&'a T, PhantomData<(Q, L)>);

impl<'a, T, Q, L> Packets<'a, T, Q, L> {
    /// Over this tree.
    pub fn new(tree: &'a T) -> Self {
        Self(tree, PhantomData)
    }
}

/// The rays, waiting children, and those of a ray alone.
pub struct Scratch<'a, T: PacketTree + 'a> {
    packet: Packet,
    stack: Vec<T::Pending<'a>>,
    single: <T::Single<'a> as Walk>::Scratch,
}

impl<'a, T: PacketTree> Scratch<'a, T> {
    /// For walks of this tree.
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
        triangles: (&Triangles, &Blocks),
        rays: (&Frame, &[Ray]),
        scratch: &mut Self::Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let count = rays.1.len();
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

/// Walks one packet. `known` are the best hits that its rays have already, if there are any; the rays end there.
#[inline(always)]
fn cast<'a, S: Simd, T: PacketTree + 'a, Q: Query, C: Counters, L: Width>(
    simd: S,
    tree: &'a T,
    (scene, blocks): (&Triangles, &Blocks),
    (frame, rays): (&Frame, &[Ray]),
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
    while left != 0 {
        let group = packet.group(left);
        left &= !group.lanes;
        if group.lanes.count_ones() == 1 {
            let (i, place) = (group.lead, packet.places[group.lead]);
            // The same hit again, or a better one.
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
                let ray = (&ray, &framed);
                alone::<S, _, Q, C>(simd, &walk, (scene, blocks), ray, single, counters)
            });
            packet.know(i, hit);
        } else {
            let packet = (&mut *packet, group);
            tree.follow_packet::<S, Q, C, L>(simd, (scene, blocks), rays, packet, stack, counters);
        }
    }
    packet.settle::<S, Q, C>(simd, (blocks, rays), counters);
}

/// Walks one ray: one function for packets of all kinds.
#[inline(never)]
fn alone<S: Simd, W: Walk, Q: Query, C: Counters>(
    simd: S,
    walk: &W,
    triangles: (&Triangles, &Blocks),
    ray: (&Ray, &FrameRay<'_>),
    scratch: &mut W::Scratch,
    counters: &mut C,
) -> Hit {
    simd.vectorize(
        #[inline(always)]
        || walk.cast::<S, Q, C>(simd, triangles, ray, scratch, counters),
    )
}

/// Rays that tiles have left over, which go in packets.
pub struct Rest<'a, T: PacketTree + 'a> {
    tree: &'a T,
    scratch: Scratch<'a, T>,
    known: [Hit; MOST],
}

impl<'a, T: PacketTree> Rest<'a, T> {
    /// None yet.
    pub fn new(tree: &'a T) -> Self {
        Self {
            tree,
            scratch: Scratch::new(tree),
            known: [Hit::MISS; MOST],
        }
    }

    /// Walks some rays of a tile, each told by its place in it and the best hit that it has already, where it ends
    /// then.
    #[inline(always)]
    pub fn walk<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        (frame, rays): (&Frame, &[Ray]),
        rest: impl Iterator<Item = (usize, Hit)>,
        (write, counters): (&mut impl FnMut(usize, Hit), &mut [C]),
    ) {
        self.scratch.packet.count = 0;
        for (place, hit) in rest {
            let packet = &mut self.scratch.packet;
            let i = packet.count % MOST;
            packet.places[i] = place;
            if !Q::ANY {
                self.known[i] = hit;
            }
            packet.count += 1;
            if packet.count == MOST {
                self.flush::<S, Q, C>(simd, triangles, (frame, rays), (write, counters));
            }
        }
        self.flush::<S, Q, C>(simd, triangles, (frame, rays), (write, counters));
    }

    #[inline(always)]
    fn flush<S: Simd, Q: Query, C: Counters>(
        &mut self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        rays: (&Frame, &[Ray]),
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

/// A packet of 16: one function for all that have some.
#[inline(never)]
fn outlined<'a, S: Simd, T: PacketTree + 'a, Q: Query, C: Counters>(
    simd: S,
    tree: &'a T,
    triangles: (&Triangles, &Blocks),
    rays: (&Frame, &[Ray]),
    known: Option<&[Hit; MOST]>,
    scratch: &mut Scratch<'a, T>,
    counters: &mut [C],
) {
    simd.vectorize(
        #[inline(always)]
        || cast::<S, T, Q, C, Sixteen>(simd, tree, triangles, rays, known, scratch, counters),
    );
}

#[cfg(test)]
mod tests;
