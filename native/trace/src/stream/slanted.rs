// SPDX-License-Identifier: GPL-3.0-or-later
//! Streams through interval hierarchies along thirteen directions: the steps of [`crate::single::objects::slanted`]
//! with one ray per lane. The first ray of a list decides the order of the children, and each ray keeps its own
//! interval in both.

use crate::stream::Steps;
use crate::stream::intervals::{Group, Inside};
use crate::stream::lists::{Entry, Stream};
use crate::stream::ray_state::RayState;
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, f32x8, mask32x8};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::dop_tree::NORMALS;
use halfspace_nodes::slant_tree::{Node, SlantKind, SlantTree};
use halfspace_ray::query::Counters;
use prefetch_index::prefetch_index;

impl Steps for SlantTree {
    /// The node itself.
    type Node = Node;
    type Scratch<S: Simd> = ();
    const INTERVALS: bool = true;

    fn root(&self) -> Node {
        self.nodes[0]
    }

    #[inline(always)]
    fn leaf(&self, node: &Node) -> Option<Leaf> {
        match node.kind() {
            SlantKind::Leaf { first, count } => Some(Leaf { first, count }),
            SlantKind::Inner { .. } => None,
        }
    }

    #[inline(always)]
    fn fetch_ahead(&self, node: &Node, blocks: &Blocks) {
        match node.kind() {
            SlantKind::Leaf { first, .. } => blocks.fetch_ahead(first),
            SlantKind::Inner { link, .. } => {
                // The second child may begin in the next cache line.
                prefetch_index(&self.nodes, link as usize);
                prefetch_index(&self.nodes, link as usize + 1);
            }
        }
    }

    #[inline(always)]
    fn count<C: Counters>(&self, node: &Node, counters: &mut C) {
        match node.kind() {
            SlantKind::Inner {
                direction: 0..3, ..
            } => counters.step_boxes(),
            _ => counters.step_oblique(),
        }
    }

    #[inline(always)]
    fn visit<S: Simd>(
        &self,
        simd: S,
        stream: &mut Stream<Node>,
        own: Entry<Node>,
        states: &[RayState],
        (): &mut (),
    ) {
        let SlantKind::Inner {
            direction,
            alone,
            planes,
            link,
        } = own.node.kind()
        else {
            return;
        };
        let normal = NORMALS[direction % NORMALS.len()];
        let link = link as usize;
        if alone {
            // The only child lies between the planes.
            stream.distribute(
                simd,
                own,
                states,
                [Some(self.nodes[link])],
                #[inline(always)]
                |group| {
                    let cut = Cut::new(simd, group, normal);
                    let above = cut.above(simd, group.inside, planes[0]);
                    [cut.below(simd, above, planes[1])]
                },
            );
            return;
        }
        // The first ray decides the order of the children.
        let [x, y, z, _] = states[stream.lists[own.first as usize] as usize].direction;
        let speed = normal[0] * x + normal[1] * y + normal[2] * z;
        let down = speed.is_sign_negative();
        let places =
            [usize::from(!down), usize::from(down)].map(|side| Some(self.nodes[link + side]));
        stream.distribute(
            simd,
            own,
            states,
            places,
            #[inline(always)]
            |group| {
                let cut = Cut::new(simd, group, normal);
                let below = cut.below(simd, group.inside, planes[0]);
                let above = cut.above(simd, group.inside, planes[1]);
                if down { [below, above] } else { [above, below] }
            },
        );
    }

    fn bytes(&self) -> usize {
        SlantTree::bytes(self)
    }
}

/// What eight rays need to cross planes of one normal.
struct Cut<S: Simd> {
    /// Reciprocal speeds along the normal.
    inv: f32x8<S>,
    /// Heights of the origins.
    height: f32x8<S>,
    /// Error bounds of distances.
    slack: f32x8<S>,
    /// The rays that go down along the normal.
    down: mask32x8<S>,
    reach: f32x8<S>,
}

impl<S: Simd> Cut<S> {
    #[inline(always)]
    fn new(simd: S, group: &Group<'_, S>, normal: [f32; 3]) -> Self {
        let splat = |x: f32| f32x8::splat(simd, x);
        let [x, y, z] = normal.map(splat);
        let along = |v: &[f32x8<S>; 4]| v[0] * x + v[1] * y + v[2] * z;
        let (origins, directions) = (group.origins(), group.directions());
        // The smallest normal number keeps the reciprocal finite for rays along the planes.
        let speed = along(&directions);
        let inv = splat(1.0) / (speed + splat(f32::MIN_POSITIVE).copysign(speed));
        Self {
            inv,
            height: along(&origins),
            // The frame's bound is 28 u for normals of unit length; these need 30 u.
            slack: splat(2.0) * origins[3] * inv.abs(),
            down: inv.simd_lt(splat(0.0)),
            reach: group.reach(),
        }
    }

    /// The bounds between which the rays cross a plane.
    #[inline(always)]
    fn crossing(&self, simd: S, plane: f32) -> [f32x8<S>; 2] {
        let distance = (f32x8::splat(simd, plane) - self.height) * self.inv;
        [distance - self.slack, distance + self.slack]
    }

    /// The parts of the rays below a plane and before their best hits. A distance that is NaN cuts off nothing.
    #[inline(always)]
    fn below(&self, simd: S, inside: Inside<S>, plane: f32) -> Inside<S> {
        let [soon, late] = self.crossing(simd, plane);
        let Inside { enter, leave } = inside;
        let leave = keep_min_each(leave, self.reach);
        Inside {
            enter: self.down.select(keep_max_each(soon, enter), enter),
            leave: self.down.select(leave, keep_min_each(late, leave)),
        }
    }

    /// The parts above a plane.
    #[inline(always)]
    fn above(&self, simd: S, inside: Inside<S>, plane: f32) -> Inside<S> {
        let [soon, late] = self.crossing(simd, plane);
        let Inside { enter, leave } = inside;
        let leave = keep_min_each(leave, self.reach);
        Inside {
            enter: self.down.select(enter, keep_max_each(soon, enter)),
            leave: self.down.select(keep_min_each(late, leave), leave),
        }
    }
}
