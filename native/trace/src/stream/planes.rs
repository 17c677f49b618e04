// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams through binary trees of split planes: the steps of [`crate::single::planes::dir`] with one ray per lane.
//! The rays of a stream may disagree about the near side of an oblique plane; the first ray decides the order, and
//! each ray keeps its own interval in both children.

use crate::stream::Steps;
use crate::stream::intervals::{Gap, Inside};
use crate::stream::lists::{Entry, Stream};
use crate::stream::ray_state::RayState;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, f32x8};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::plane_tree::{Node, PlaneTree, Words, near_child};
use halfspace_ray::query::Counters;

impl Steps for PlaneTree {
    /// The node's own words: a visit reads those of its children, which lie side by side.
    type Node = Words;
    type Scratch<S: Simd> = ();
    const INTERVALS: bool = true;

    fn root(&self) -> Words {
        self.words(PlaneTree::root(self))
    }

    #[inline(always)]
    fn leaf(&self, node: &Words) -> Option<Leaf> {
        node.leaf()
    }

    #[inline(always)]
    fn fetch_ahead(&self, node: &Words, blocks: &Blocks) {
        match node.leaf() {
            Some(leaf) => blocks.fetch_ahead(leaf.first),
            None => self.fetch_children(*node),
        }
    }

    #[inline(always)]
    fn count<C: Counters>(&self, node: &Words, counters: &mut C) {
        match self.decode(*node) {
            Node::Axis { .. } => counters.step_axis(),
            Node::Oblique { .. } => counters.step_oblique(),
            Node::Leaf { .. } => {}
        }
    }

    #[inline(always)]
    fn visit<S: Simd>(
        &self,
        simd: S,
        stream: &mut Stream<Words>,
        own: Entry<Words>,
        states: &[RayState],
        (): &mut (),
    ) {
        match self.decode(own.node) {
            Node::Axis {
                axis,
                split,
                empty,
                link,
                ..
            } => {
                let near = near_child(link, signs(stream.octant));
                let children = [near ^ 1, near].map(|child| self.held(child, empty));
                let gap = Gap {
                    axis,
                    ends: split,
                    begins: split,
                };
                stream.halve(simd, own, states, children, gap);
            }
            Node::Oblique {
                normal,
                offset,
                children,
                empty,
            } => {
                // The first ray decides the order of the children.
                let [x, y, z, _] = states[stream.lists[own.first as usize] as usize].direction;
                let speed = normal[0] * x + normal[1] * y + normal[2] * z;
                let down = speed.is_sign_negative();
                let near = children + u32::from(down);
                let places = [near ^ 1, near].map(|child| self.held(child, empty));
                let plane = Plane { normal, offset };
                stream.distribute(
                    simd,
                    own,
                    states,
                    places,
                    #[inline(always)]
                    |group| {
                        let inside = group.within(&group.axis(0));
                        let (origins, directions) = (group.origins(), group.directions());
                        let [below, above] = oblique(simd, &origins, &directions, inside, plane);
                        if down { [below, above] } else { [above, below] }
                    },
                );
            }
            Node::Leaf { .. } => {}
        }
    }

    fn bytes(&self) -> usize {
        PlaneTree::bytes(self)
    }
}

/// The signs of an octant, repeated in each byte ([`halfspace_ray::FrameRay::signs`]).
#[inline(always)]
fn signs(octant: usize) -> u32 {
    #[expect(clippy::cast_possible_truncation, reason = "three bits")]
    let octant = octant as u32;
    octant * 0x0101_0101
}

/// A plane `normal . x = offset`.
#[derive(Clone, Copy)]
pub struct Plane {
    pub normal: [f32; 3],
    pub offset: f32,
}

/// The intervals of eight rays in the child below and in the child above an oblique plane, given those in the node, and
/// the columns of [`crate::stream::intervals::Group::origins`] and of the directions.
#[inline(always)]
pub fn oblique<S: Simd>(
    simd: S,
    origins: &[f32x8<S>; 4],
    directions: &[f32x8<S>; 4],
    Inside { enter, leave }: Inside<S>,
    plane: Plane,
) -> [Inside<S>; 2] {
    let splat = |x: f32| f32x8::splat(simd, x);
    let [x, y, z] = plane.normal.map(splat);
    let along = |v: &[f32x8<S>; 4]| v[0] * x + v[1] * y + v[2] * z;
    // The smallest normal number keeps the reciprocal finite for rays along the plane.
    let speed = along(directions);
    let inv = splat(1.0) / (speed + splat(f32::MIN_POSITIVE).copysign(speed));
    let distance = (splat(plane.offset) - along(origins)) * inv;
    let slack = origins[3] * inv.abs();
    // Ignore a distance that is NaN: the interval keeps its end.
    let late = keep_min_each(distance + slack, leave);
    let soon = keep_max_each(distance - slack, enter);
    // For rays that go down through the plane, exchange near and far.
    let down = inv.simd_lt(splat(0.0));
    [
        Inside {
            enter: down.select(soon, enter),
            leave: down.select(leave, late),
        },
        Inside {
            enter: down.select(enter, soon),
            leave: down.select(late, leave),
        },
    ]
}
