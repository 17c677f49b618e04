// SPDX-License-Identifier: GPL-3.0-or-later
//! Packet traversal of plane trees: the steps of [`halfspace_single::planes::dir`] with one ray per lane. The rays of a
//! packet may disagree about the near side of an oblique plane; the first ray decides the order, and each ray
//! keeps its own interval in both children.

use crate::packet::leaf::{self, Active};
use crate::packet::traversal::PacketTree;
use crate::packet::{self, Group, MOST, Packet, Width};
use crate::tile::Row;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_nodes::lazy_tree::LazyTree;
use halfspace_nodes::plane_tree::{MAX_DEPTH, Node, PlaneTree, near_child};
use halfspace_nodes::planes::{Inside, Planes};
use halfspace_nodes::projected_tree::{CODES, ProjectedTree};
use halfspace_ray::query::{Counters, Query};
use halfspace_single::planes::dir as plane_dir;
use halfspace_trace::input::Input;

/// A stack entry: a node and the interval of each ray in it.
#[derive(Clone, Copy)]
pub struct PlaneEntry<A> {
    node: A,
    enter: Row,
    leave: Row,
}

/// Implements packets for a binary tree of planes.
macro_rules! packets_of_planes {
    ($tree:ty, $one_store:literal) => {
        impl PacketTree for $tree {
            type Entry<'a> = PlaneEntry<<&'a $tree as Planes>::At>;
            type Single<'a> = plane_dir::PlaneTraversal<&'a $tree>;
            const ONE_STORE: bool = $one_store;

            fn single(&self) -> Self::Single<'_> {
                plane_dir::PlaneTraversal(self)
            }

            fn stack(&self) -> Vec<Self::Entry<'_>> {
                let blank = PlaneEntry {
                    node: Planes::root(self),
                    enter: [0.0; MOST],
                    leave: [0.0; MOST],
                };
                vec![blank; MAX_DEPTH + 1]
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

packets_of_planes!(PlaneTree, true);
packets_of_planes!(LazyTree, false);
packets_of_planes!(ProjectedTree, true);

/// The interval of each ray in a node.
struct Intervals<S: Simd, L: Width> {
    enter: L::Vector<S>,
    leave: L::Vector<S>,
}

impl<S: Simd, L: Width> Clone for Intervals<S, L> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}

impl<S: Simd, L: Width> Copy for Intervals<S, L> {}

impl<S: Simd, L: Width> Intervals<S, L> {
    /// Mask of the rays that are inside the node.
    #[inline(always)]
    fn live(self) -> u64 {
        packet::live::<S, L>(self.enter, self.leave)
    }
}

/// A child and the interval of each ray in it.
struct Part<S: Simd, L: Width> {
    child: u32,
    inside: Intervals<S, L>,
}

impl<S: Simd, L: Width> Part<S, L> {
    /// Whether the child is not an empty leaf and some ray meets it.
    #[inline(always)]
    fn is_met(&self, empty: u32) -> bool {
        empty >> (self.child & 1) & 1 == 0 && self.inside.live() != 0
    }
}

/// Traverses the tree with one group of a packet. All visits are counted for the group's first ray.
#[inline(always)]
fn trace<S: Simd, T: Planes, Q: Query, C: Counters, L: Width>(
    simd: S,
    tree: T,
    input: Input<'_>,
    packet: &mut Packet,
    group: Group,
    stack: &mut [PlaneEntry<T::At>],
    counters: &mut [C],
) {
    let (whole, mut input) = (input.job(), input);
    let charged = packet.places[group.lead];
    let mut size = 0;
    let mut node = tree.root();
    let mut inside = Intervals {
        enter: packet::load::<S, L>(simd, &packet.enter(group)),
        leave: packet::load::<S, L>(simd, &packet.reach),
    };
    loop {
        // Cut the interval of each ray at the plane, or test the leaf and continue on the stack.
        let (parts, empty) = match tree.node(node) {
            Node::Axis {
                axis,
                split,
                empty,
                link,
                ..
            } => {
                counters[charged].step_axis();
                packet.join(inside.live(), group, counters);
                let near = near_child(link, group.signs);
                (across(simd, packet, axis, split, near, inside), empty)
            }
            Node::Oblique {
                normal,
                offset,
                children,
                empty,
            } => {
                counters[charged].step_oblique();
                packet.join(inside.live(), group, counters);
                let crossing = match tree.direction(node) {
                    Some(direction) => projected::<S, L>(simd, packet, direction, normal),
                    None => project::<S, L>(simd, packet, normal),
                };
                let plane = (offset, children);
                (oblique(simd, group.lead, plane, crossing, inside), empty)
            }
            Node::Leaf { first, count } => {
                let own = Leaf { first, count };
                let blocks = match tree.inside(node, own, whole) {
                    Inside::Triangles(blocks) => blocks,
                    Inside::Part(root) => {
                        node = root;
                        continue;
                    }
                };
                counters[charged].leaf(count);
                packet.join(inside.live(), group, counters);
                if count != 0 {
                    // In a tree built in parts, decide the hits in the blocks of the part that is left.
                    if T::PARTS && !std::ptr::eq(blocks, input.blocks) {
                        packet.decide_deferred::<S, Q, C>(simd, input, counters);
                        input = input.with(blocks);
                    }
                    let active = Active {
                        lanes: inside.live() & group.lanes,
                        leave: &inside.leave,
                    };
                    leaf::test::<S, Q, C, L>(simd, input, own, packet, active, counters);
                }
                let reach = packet::load::<S, L>(simd, &packet.reach);
                match pop::<S, _, L>(simd, stack, &mut size, reach) {
                    Some(next) => (node, inside) = next,
                    None => break,
                }
                continue;
            }
        };
        (node, inside) = descend(tree, node, &parts, empty, stack, &mut size);
    }
    if T::PARTS {
        packet.decide_deferred::<S, Q, C>(simd, input, counters);
    }
}

/// The first child that some ray meets and that is not empty; pushes the second if it is met, too.
#[inline(always)]
fn descend<S: Simd, T: Planes, L: Width>(
    tree: T,
    node: T::At,
    [first, second]: &[Part<S, L>; 2],
    empty: u32,
    stack: &mut [PlaneEntry<T::At>],
    size: &mut usize,
) -> (T::At, Intervals<S, L>) {
    if !first.is_met(empty) {
        // The second child may be empty or missed too; its own node or leaf then ends the branch.
        return (tree.sibling(node, second.child), second.inside);
    }
    if second.is_met(empty) {
        let next = &mut stack[*size];
        next.node = tree.sibling(node, second.child);
        packet::store::<S, L>(second.inside.enter, &mut next.enter);
        packet::store::<S, L>(second.inside.leave, &mut next.leave);
        *size += 1;
    }
    (tree.sibling(node, first.child), first.inside)
}

/// Pops entries until one is met by a ray without a nearer hit.
#[inline(always)]
fn pop<S: Simd, A: Copy, L: Width>(
    simd: S,
    stack: &[PlaneEntry<A>],
    size: &mut usize,
    reach: L::Vector<S>,
) -> Option<(A, Intervals<S, L>)> {
    while *size != 0 {
        *size -= 1;
        let next = &stack[*size];
        let inside = Intervals::<S, L> {
            enter: packet::load::<S, L>(simd, &next.enter),
            leave: packet::load::<S, L>(simd, &next.leave).min(reach),
        };
        if inside.live() != 0 {
            return Some((next.node, inside));
        }
    }
    None
}

/// The two children of an axis node with the interval of each ray in them, the child `near` first.
#[inline(always)]
fn across<S: Simd, L: Width>(
    simd: S,
    packet: &Packet,
    axis: usize,
    split: f32,
    near: u32,
    Intervals { enter, leave }: Intervals<S, L>,
) -> [Part<S, L>; 2] {
    let o = packet::load::<S, L>(simd, &packet.o[axis]);
    let inv = packet::load::<S, L>(simd, &packet.inv[axis]);
    let slack = packet::load::<S, L>(simd, &packet.slack[axis]);
    let distance = (L::Vector::splat(simd, split) - o) * inv;
    // Ignore a distance that is NaN: the interval keeps its end.
    let near_leave = keep_min_each(distance + slack, leave);
    let far_enter = keep_max_each(distance - slack, enter);
    [
        Part {
            child: near,
            inside: Intervals {
                enter,
                leave: near_leave,
            },
        },
        Part {
            child: near ^ 1,
            inside: Intervals {
                enter: far_enter,
                leave,
            },
        },
    ]
}

/// The rays along a direction.
struct Projection<S: Simd, L: Width> {
    /// Heights of the origins.
    height: L::Vector<S>,
    /// Inverse speeds.
    inv: L::Vector<S>,
    /// Error bounds of distances to planes.
    slack: L::Vector<S>,
}

/// Projects the rays onto a direction.
#[inline(always)]
fn project<S: Simd, L: Width>(simd: S, packet: &Packet, normal: [f32; 3]) -> Projection<S, L> {
    let speed = along::<S, L>(simd, normal, &packet.d);
    let least = L::Vector::splat(simd, f32::MIN_POSITIVE).copysign(speed);
    let inv = L::Vector::splat(simd, 1.0) / (speed + least);
    Projection {
        height: along::<S, L>(simd, normal, &packet.o),
        inv,
        slack: packet::load::<S, L>(simd, &packet.oblique_pad) * inv.abs(),
    }
}

/// [`project()`] for a numbered direction, computed once for each packet.
#[inline(always)]
fn projected<S: Simd, L: Width>(
    simd: S,
    packet: &mut Packet,
    direction: usize,
    normal: [f32; 3],
) -> Projection<S, L> {
    let direction = direction % CODES;
    if packet.projections.known >> direction & 1 == 0 {
        let Projection { height, inv, slack } = project::<S, L>(simd, packet, normal);
        let rows = &mut packet.projections.rows[direction];
        packet::store::<S, L>(height, &mut rows[0]);
        packet::store::<S, L>(inv, &mut rows[1]);
        packet::store::<S, L>(slack, &mut rows[2]);
        packet.projections.known |= 1 << direction;
    }
    let [height, inv, slack] = packet::load3::<S, L>(simd, &packet.projections.rows[direction]);
    Projection { height, inv, slack }
}

/// The two children of an oblique node, given by the offset of its plane and the child below, with the interval of each
/// ray in them, the near child of the ray `lead` first.
#[inline(always)]
fn oblique<S: Simd, L: Width>(
    simd: S,
    lead: usize,
    (offset, children): (f32, u32),
    Projection { height, inv, slack }: Projection<S, L>,
    Intervals { enter, leave }: Intervals<S, L>,
) -> [Part<S, L>; 2] {
    let distance = (L::Vector::splat(simd, offset) - height) * inv;
    // Ignore a distance that is NaN: the interval keeps its end.
    let near_leave = keep_min_each(distance + slack, leave);
    let far_enter = keep_max_each(distance - slack, enter);
    // For rays that go down through the plane, exchange near and far.
    let down = inv.simd_lt(L::Vector::splat(simd, 0.0));
    let below = Part {
        child: children,
        inside: Intervals {
            enter: down.select(far_enter, enter),
            leave: down.select(leave, near_leave),
        },
    };
    let above = Part {
        child: children + 1,
        inside: Intervals {
            enter: down.select(enter, far_enter),
            leave: down.select(near_leave, leave),
        },
    };
    if down.to_bitmask() >> lead & 1 == 1 {
        [above, below]
    } else {
        [below, above]
    }
}

/// Dot products of a normal with one vector per lane.
#[inline(always)]
pub(super) fn along<S: Simd, L: Width>(simd: S, [x, y, z]: [f32; 3], v: &[Row; 3]) -> L::Vector<S> {
    let first = packet::load::<S, L>(simd, &v[0]) * L::Vector::splat(simd, x);
    let second = packet::load::<S, L>(simd, &v[1]) * L::Vector::splat(simd, y);
    let third = packet::load::<S, L>(simd, &v[2]) * L::Vector::splat(simd, z);
    first + second + third
}
