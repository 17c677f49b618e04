// SPDX-License-Identifier: GPL-3.0-or-later
//! Interval hierarchies along thirteen directions: the steps of [`halfspace_single::objects::slanted`] with one ray per
//! lane. The first ray decides the order of the children, and each ray keeps its own interval in both.

use crate::visits::{Cut, Inside, Lanes, Nodes, Visitor};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, f32x8, mask32x8};
use halfspace_geom::bound::{keep_max_each, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::dop_tree::NORMALS;
use halfspace_nodes::slant_tree::{Node, SlantKind, SlantTree};
use halfspace_ray::query::Counters;
use prefetch_index::prefetch_index;

impl Nodes for SlantTree {
    /// The node itself.
    type Node = Node;
    const CHILDREN: usize = 2;

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
    fn visit<S: Simd>(&self, simd: S, node: &Node, visitor: &mut impl Visitor<Node>) {
        let SlantKind::Inner {
            direction,
            alone,
            planes,
            link,
        } = node.kind()
        else {
            return;
        };
        let normal = NORMALS[direction % NORMALS.len()];
        let link = link as usize;
        if alone {
            // The only child lies between the planes.
            visitor.distribute(simd, [Some(self.nodes[link])], &Between { normal, planes });
            return;
        }
        // The first ray decides the order of the children.
        let [x, y, z] = visitor.lead();
        let speed = normal[0] * x + normal[1] * y + normal[2] * z;
        let down = speed.is_sign_negative();
        let places =
            [usize::from(!down), usize::from(down)].map(|side| Some(self.nodes[link + side]));
        let apart = Apart {
            normal,
            planes,
            down,
        };
        visitor.distribute(simd, places, &apart);
    }

    fn bytes(&self) -> usize {
        SlantTree::bytes(self)
    }
}

/// The only child of a node lies between its planes.
struct Between {
    normal: [f32; 3],
    planes: [f32; 2],
}

impl<S: Simd> Cut<S, 1> for Between {
    #[inline(always)]
    fn cut<L: Lanes<S>>(&self, simd: S, lanes: &L) -> [Inside<S>; 1] {
        let crossing = Crossing::new(simd, lanes, self.normal);
        let above = crossing.above(simd, lanes.inside(), self.planes[0]);
        [crossing.below(simd, above, self.planes[1])]
    }
}

/// The lower child lies below the first plane, the upper one above the second. `down`: whether the first ray descends.
struct Apart {
    normal: [f32; 3],
    planes: [f32; 2],
    down: bool,
}

impl<S: Simd> Cut<S, 2> for Apart {
    #[inline(always)]
    fn cut<L: Lanes<S>>(&self, simd: S, lanes: &L) -> [Inside<S>; 2] {
        let crossing = Crossing::new(simd, lanes, self.normal);
        let below = crossing.below(simd, lanes.inside(), self.planes[0]);
        let above = crossing.above(simd, lanes.inside(), self.planes[1]);
        if self.down {
            [below, above]
        } else {
            [above, below]
        }
    }
}

/// Quantities of eight rays for crossings of planes with one normal.
struct Crossing<S: Simd> {
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

impl<S: Simd> Crossing<S> {
    #[inline(always)]
    fn new<L: Lanes<S>>(simd: S, lanes: &L, normal: [f32; 3]) -> Self {
        let splat = |x: f32| f32x8::splat(simd, x);
        let [x, y, z] = normal.map(splat);
        let along = |v: [f32x8<S>; 3]| v[0] * x + v[1] * y + v[2] * z;
        let [o_x, o_y, o_z, pad] = lanes.origins();
        // The smallest normal number keeps the reciprocal finite for rays along the planes.
        let speed = along(lanes.directions());
        let inv = splat(1.0) / (speed + splat(f32::MIN_POSITIVE).copysign(speed));
        Self {
            inv,
            height: along([o_x, o_y, o_z]),
            // The frame's bound is 28 u for normals of unit length; these need 30 u (`halfspace_nodes::dop_tree`).
            slack: splat(2.0) * pad * inv.abs(),
            down: inv.simd_lt(splat(0.0)),
            reach: lanes.reach(),
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
