// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams through the boxes that intervals leave. Lists hold indices of rays alone: the box of a node, derived once
//! for the whole list, takes the place of an interval per ray.

use crate::Steps;
use crate::lists::{Entry, Stream, small};
use crate::ray_state::{Line, RayState};
use fearless_simd::Simd;
use halfspace_geom::Aabb;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_group::visits::{FAR, INV, NEAR};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::slab_boxes::{BoxedNode, SlabBoxes};
use halfspace_nodes::slab_node::{SlabKind, SlabNode};
use halfspace_ray::query::Counters;
use prefetch_index::prefetch_index;

/// A node with its box, and the sides of the box through which the rays enter.
#[derive(Clone, Copy)]
pub struct Child {
    own: BoxedNode,
    near: [f32; 3],
}

impl Steps for SlabBoxes {
    type Node = Child;
    type Scratch<S: Simd> = ();
    const INTERVALS: bool = false;
    const INDICES: bool = true;

    fn root(&self) -> Child {
        Child {
            own: SlabBoxes::root(self),
            // NaN bounds nothing: all rays enter the root.
            near: [f32::NAN; 3],
        }
    }

    #[inline(always)]
    fn leaf(&self, node: &Child) -> Option<Leaf> {
        node.own.leaf()
    }

    #[inline(always)]
    fn fetch_ahead(&self, node: &Child, blocks: &Blocks) {
        match node.own.node.kind() {
            SlabKind::Leaf { first, .. } => blocks.fetch_ahead(first),
            SlabKind::Pair { link, .. } | SlabKind::Only { link, .. } => {
                prefetch_index(&self.tree.nodes, link as usize);
            }
        }
    }

    #[inline(always)]
    fn enters(node: &Child, line: &Line) -> bool {
        line.enters(node.near)
    }

    #[inline(always)]
    fn count<C: Counters>(&self, _: &Child, counters: &mut C) {
        counters.step_boxes();
    }

    #[inline(always)]
    fn visit<S: Simd>(
        &self,
        _: S,
        stream: &mut Stream<Child>,
        own: Entry<Child>,
        states: &[RayState],
        (): &mut (),
    ) {
        let octant = stream.octant;
        let children = self.children(&own.node.own, octant);
        // The list of the near child follows the parent's, which the far child's replaces.
        let (first, end) = (own.first as usize, (own.first + own.rays) as usize);
        stream.make_room(end + own.rays as usize, false);
        let mut ends = [first, end];
        let sides = children.map(|child| child.map(|child| sides(&child.region, octant)));
        for at in first..end {
            let ray = stream.lists[at];
            let line = &states[ray as usize].line;
            // Append without a branch: an index that is not counted is overwritten.
            for (to, sides) in ends.iter_mut().zip(&sides) {
                stream.lists[*to] = ray;
                *to += usize::from(sides.is_some_and(|sides| meets(line, sides)));
            }
        }
        let begins = [first, end];
        for (i, child) in children.into_iter().enumerate() {
            let Some((child, sides)) = child.zip(sides[i]) else {
                continue;
            };
            let node = Child {
                own: child,
                near: sides[0],
            };
            let entry = Entry {
                node,
                first: small(begins[i]),
                rays: small(ends[i] - begins[i]),
            };
            stream.push(entry, ends[i] != begins[i]);
        }
    }

    fn bytes(&self) -> usize {
        size_of_val(&*self.tree.nodes)
    }
}

/// The sides of a box through which rays of an octant enter and leave.
#[inline(always)]
fn sides(region: &Aabb, octant: usize) -> [[f32; 3]; 2] {
    let Aabb { min, max } = region;
    [0, 1].map(|exit| {
        [0, 1, 2].map(|k: usize| {
            if octant >> k & 1 == exit {
                min[k]
            } else {
                max[k]
            }
        })
    })
}

/// Whether the ray meets a box before its best hit. A distance that is NaN cuts off nothing.
#[inline(always)]
fn meets(line: &Line, [near, far]: [[f32; 3]; 2]) -> bool {
    let (mut enter, mut leave) = (line.start, line.reach());
    for (k, axis) in line.axes.iter().enumerate() {
        enter = keep_max(near[k] * axis[INV] + axis[NEAR], enter);
        leave = keep_min(far[k] * axis[INV] + axis[FAR], leave);
    }
    enter <= leave
}
