// SPDX-License-Identifier: GPL-3.0-or-later
//! Packet traversal of all nodes that cut the intervals of rays ([`crate::visits`]): eight rays at once, one to a lane.
//! A ray keeps its lane, and is active in a node while its interval there is not empty.

use crate::packet::boxes::slabs;
use crate::packet::leaf::{self, Active};
use crate::packet::traversal::PacketTree;
use crate::packet::{self, Group, MOST, Packet, Width};
use crate::tile::Row;
use crate::visits::{Cut, FAR, INV, Inside, LANES, Lanes, NEAR, Nodes, Visitor};
use fearless_simd::{Simd, SimdBase, SimdMask, f32x8};
use halfspace_nodes::grid::Grid;
use halfspace_nodes::octree_nodes::Octree;
use halfspace_nodes::plane_tree::MAX_DEPTH;
use halfspace_nodes::slab_node::SlabNode;
use halfspace_nodes::slab_tree::SlabTree;
use halfspace_nodes::slab_wide::WideSlabs;
use halfspace_nodes::slant_tree::SlantTree;
use halfspace_nodes::wide_tree::WideTree;
use halfspace_ray::query::{Counters, Query};
use halfspace_single::grid;
use halfspace_single::objects::intervals::IntervalTraversal;
use halfspace_single::octants::param;
use halfspace_single::steps::SingleSteps;
use halfspace_single::steps::planes::PlaneSteps;
use halfspace_trace::input::Input;

/// A stack entry: a node and the interval of each ray in it.
#[derive(Clone, Copy)]
pub struct NodeEntry<P> {
    node: P,
    enter: Row,
    leave: Row,
}

/// A stack with room for the deepest path.
fn stack<T: Nodes>(tree: &T) -> Vec<NodeEntry<T::Node>> {
    let blank = NodeEntry {
        node: tree.root(),
        enter: [0.0; MOST],
        leave: [0.0; MOST],
    };
    // Each level leaves at most all children but one on the stack, and the lowest level writes all of its own above.
    vec![blank; (MAX_DEPTH + 3) * T::CHILDREN]
}

/// The rays of a group in a node, and their stack.
struct Visit<'a, P> {
    /// Per axis the columns of [`Lanes::axis`] but the reach.
    axes: &'a [[Row; 3]; 3],
    packet: &'a Packet,
    group: Group,
    /// Number of rays of a packet.
    rays: usize,
    /// The node, and the interval of each ray in it.
    own: NodeEntry<P>,
    stack: &'a mut [NodeEntry<P>],
    size: usize,
}

/// Eight neighbouring rays of a packet.
struct Octet<'a, S: Simd> {
    simd: S,
    axes: &'a [[Row; 3]; 3],
    packet: &'a Packet,
    /// The first of them.
    first: usize,
    inside: Inside<S>,
}

impl<S: Simd> Octet<'_, S> {
    #[inline(always)]
    fn load(&self, row: &Row) -> f32x8<S> {
        f32x8::from_slice(self.simd, &row[self.first..self.first + LANES])
    }
}

impl<S: Simd> Lanes<S> for Octet<'_, S> {
    #[inline(always)]
    fn inside(&self) -> Inside<S> {
        self.inside
    }

    #[inline(always)]
    fn axis(&self, axis: usize) -> [f32x8<S>; 4] {
        let rows = &self.axes[axis];
        let mut columns = [self.load(&self.packet.reach); 4];
        for column in [INV, NEAR, FAR] {
            columns[column] = self.load(&rows[column]);
        }
        columns
    }

    #[inline(always)]
    fn origins(&self) -> [f32x8<S>; 4] {
        let [x, y, z] = &self.packet.o;
        [
            self.load(x),
            self.load(y),
            self.load(z),
            self.load(&self.packet.oblique_pad),
        ]
    }

    #[inline(always)]
    fn directions(&self) -> [f32x8<S>; 3] {
        let [x, y, z] = &self.packet.d;
        [self.load(x), self.load(y), self.load(z)]
    }

    #[inline(always)]
    fn reach(&self) -> f32x8<S> {
        self.load(&self.packet.reach)
    }
}

impl<P: Copy> Visitor<P> for Visit<'_, P> {
    #[inline(always)]
    fn octant(&self) -> usize {
        (self.group.signs & 7) as usize
    }

    #[inline(always)]
    fn lead(&self) -> [f32; 3] {
        let [x, y, z] = &self.packet.d;
        let lead = self.group.lead;
        [x[lead], y[lead], z[lead]]
    }

    #[inline(always)]
    fn distribute<S: Simd, const N: usize>(
        &mut self,
        simd: S,
        children: [Option<P>; N],
        cut: &impl Cut<S, N>,
    ) {
        let base = self.size;
        let mut live = [0_u64; N];
        for first in (0..self.rays).step_by(LANES) {
            let lanes = first..first + LANES;
            let octet = Octet {
                simd,
                axes: self.axes,
                packet: self.packet,
                first,
                inside: Inside {
                    enter: f32x8::from_slice(simd, &self.own.enter[lanes.clone()]),
                    leave: f32x8::from_slice(simd, &self.own.leave[lanes.clone()]),
                },
            };
            // Write all children; those that no ray meets are removed below.
            let parts = cut.cut(simd, &octet);
            for (child, part) in parts.iter().enumerate() {
                let entry = &mut self.stack[base + child];
                part.enter.store_slice(&mut entry.enter[lanes.clone()]);
                part.leave.store_slice(&mut entry.leave[lanes.clone()]);
                live[child] |= part.enter.simd_le(part.leave).to_bitmask() << first;
            }
        }
        // Keep the children that some ray meets, without gaps.
        for (child, node) in children.into_iter().enumerate() {
            let met = live[child] & self.group.lanes != 0;
            if let (Some(node), true) = (node, met) {
                if self.size != base + child {
                    self.stack[self.size] = self.stack[base + child];
                }
                self.stack[self.size].node = node;
                self.size += 1;
            }
        }
    }
}

/// Per axis the slab coefficients of all rays.
#[inline(always)]
fn axes<S: Simd, L: Width>(simd: S, packet: &Packet) -> [[Row; 3]; 3] {
    let mut axes = [[[0.0; MOST]; 3]; 3];
    for (rows, [inv, near, far]) in axes.iter_mut().zip(slabs::<S, L>(simd, packet)) {
        packet::store::<S, L>(inv, &mut rows[INV]);
        packet::store::<S, L>(near, &mut rows[NEAR]);
        packet::store::<S, L>(far, &mut rows[FAR]);
    }
    axes
}

/// Traverses the tree with one group of a packet of at least eight. All visits are counted for the group's first ray.
#[inline(always)]
fn trace<S: Simd, T: Nodes, Q: Query, C: Counters, L: Width>(
    simd: S,
    tree: &T,
    input: Input<'_>,
    packet: &mut Packet,
    group: Group,
    stack: &mut [NodeEntry<T::Node>],
    counters: &mut [C],
) {
    let charged = packet.places[group.lead];
    let axes = axes::<S, L>(simd, packet);
    stack[0] = NodeEntry {
        node: tree.root(),
        enter: packet.enter(group),
        leave: packet.reach,
    };
    let mut size = 1;
    while size != 0 {
        // Pop the nearest node, and end each ray at its best hit.
        size -= 1;
        let own = stack[size];
        let reach = packet::load::<S, L>(simd, &packet.reach);
        let enter = packet::load::<S, L>(simd, &own.enter);
        let leave = packet::load::<S, L>(simd, &own.leave).min(reach);
        let lanes = packet::live::<S, L>(enter, leave) & group.lanes;
        if lanes == 0 {
            continue;
        }
        packet.join(lanes, group, counters);
        let Some(leaf) = tree.leaf(&own.node) else {
            tree.count(&own.node, &mut counters[charged]);
            let mut visit = Visit {
                axes: &axes,
                packet,
                group,
                rays: L::RAYS,
                own,
                stack,
                size,
            };
            tree.visit(simd, &own.node, &mut visit);
            size = visit.size;
            if let Some(next) = stack[..size].last() {
                tree.fetch_ahead(&next.node, input.blocks);
            }
            continue;
        };
        counters[charged].leaf(leaf.count);
        let active = Active {
            lanes,
            leave: &leave,
        };
        leaf::test::<S, Q, C, L>(simd, input, leaf, packet, active, counters);
    }
}

/// Implements packets for a tree; rays alone in their group take the traversal of single rays.
macro_rules! packets {
    ([$($of:tt)*] $tree:ty, $single:ty, |$own:ident| $alone:expr) => {
        impl<$($of)*> PacketTree for $tree {
            type Entry<'a>
                = NodeEntry<<Self as Nodes>::Node>
            where
                Self: 'a;
            type Single<'a>
                = $single
            where
                Self: 'a;

            fn single(&self) -> Self::Single<'_> {
                let $own = self;
                $alone
            }

            fn stack(&self) -> Vec<Self::Entry<'_>> {
                stack(self)
            }

            #[inline(always)]
            fn trace_group<'a, S: Simd, Q: Query, C: Counters, L: Width>(
                &'a self,
                simd: S,
                input: Input<'_>,
                packet: &mut Packet,
                group: Group,
                stack: &mut [Self::Entry<'a>],
                counters: &mut [C],
            ) {
                trace::<S, _, Q, C, L>(simd, self, input, packet, group, stack, counters);
            }
        }
    };
}

packets!([] WideTree, SingleSteps<PlaneSteps<'a>>, |tree| SingleSteps(
    PlaneSteps(tree)
));
packets!([N: SlabNode] SlabTree<N>, IntervalTraversal<'a, SlabTree<N>>, |tree| IntervalTraversal(tree));
packets!([const W: usize] WideSlabs<W>, IntervalTraversal<'a, WideSlabs<W>>, |tree| IntervalTraversal(tree));
packets!([] SlantTree, IntervalTraversal<'a, SlantTree>, |tree| IntervalTraversal(tree));
packets!([] Grid, grid::GridTraversal<'a>, |tree| grid::GridTraversal(tree));
packets!([] Octree, param::OctreeTraversal<'a>, |tree| param::OctreeTraversal(tree));
