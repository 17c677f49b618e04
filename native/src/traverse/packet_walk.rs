// SPDX-License-Identifier: GPL-3.0-or-later
//! Walks of a tree by packets of rays; those that no other goes with are walked singly.

use super::batch::{TileWalk, Walk};
use super::blocks::Blocks;
use super::frame::Frame;
use super::packet::{Group, Packet, Width};
use super::query::Counters;
use super::ray::{Hit, Ray};
use crate::scene::Triangles;
use fearless_simd::Simd;
use std::marker::PhantomData;

/// What the nodes of a tree need of the rays of a packet, a ray to a lane.
pub trait Rows: Default {
    /// Takes it from the rays.
    fn fill(&mut self, packet: &Packet);
}

/// A tree that packets can be walked through.
pub trait PacketTree: Sync {
    /// What its nodes need of the rays.
    type Rows: Rows;
    /// A child that waits, and where each ray is in it.
    type Pending;
    /// The walk of its single rays.
    type Single<'a>: Walk
    where
        Self: 'a;

    /// That walk.
    fn single(&self) -> Self::Single<'_>;

    /// Room for all children that may wait.
    fn stack(&self) -> Vec<Self::Pending>;

    /// Walks some rays of a packet. Steps are charged to the first of them.
    fn follow<S: Simd, C: Counters, L: Width>(
        &self,
        simd: S,
        task: (&Triangles, &Blocks, &[Ray]),
        packet: (&mut Packet, &Self::Rows),
        group: Group,
        stack: &mut [Self::Pending],
        counters: &mut [C],
    );
}

/// The walk over one tree by packets of this width.
pub struct Packets<'a, T, L>(&'a T, PhantomData<L>);

impl<'a, T, L> Packets<'a, T, L> {
    /// Over this tree.
    pub fn new(tree: &'a T) -> Self {
        Self(tree, PhantomData)
    }
}

/// The rays, waiting children, and those of a ray alone.
pub struct Scratch<'a, T: PacketTree + 'a> {
    packet: Packet,
    rows: T::Rows,
    stack: Vec<T::Pending>,
    single: <T::Single<'a> as Walk>::Scratch,
}

impl<'a, T: PacketTree, L: Width> TileWalk for Packets<'a, T, L> {
    const RAYS: usize = L::RAYS;
    type Scratch = Scratch<'a, T>;

    fn scratch(&self) -> Self::Scratch {
        Scratch {
            packet: Packet::default(),
            rows: T::Rows::default(),
            stack: self.0.stack(),
            single: self.0.single().scratch(),
        }
    }

    #[inline(always)]
    fn cast_tile<S: Simd, C: Counters>(
        &self,
        simd: S,
        (scene, blocks): (&Triangles, &Blocks),
        (frame, rays): (&Frame, &[Ray]),
        scratch: &mut Self::Scratch,
        write: &mut impl FnMut(usize, Hit),
        counters: &mut [C],
    ) {
        let Scratch {
            packet,
            rows,
            stack,
            single,
        } = scratch;
        let task = (scene, blocks, rays);
        let walk = self.0.single();
        let mut left = packet.fill(frame, rays);
        rows.fill(packet);
        while left != 0 {
            let group = packet.group(left);
            left &= !group.lanes;
            if group.lanes.count_ones() == 1 {
                packet.alone(simd, (&walk, &mut *single), task, group.lead, counters);
            } else {
                let packet = (&mut *packet, &*rows);
                self.0
                    .follow::<S, C, L>(simd, task, packet, group, stack, counters);
            }
        }
        packet.finish(write);
    }
}
