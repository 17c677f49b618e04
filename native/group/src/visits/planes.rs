// SPDX-License-Identifier: GPL-3.0-or-later
//! Binary trees of split planes: the steps of [`halfspace_single::planes::dir`] with one ray per lane. The rays of a
//! visit may disagree about the near side of an oblique plane; the first ray decides the order, and each ray keeps its
//! own interval in both children.

use crate::visits::{Cut, CutOne, Gap, Inside, Lanes, Nodes, OneRay, Visitor};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, f32x8};
use halfspace_geom::bound::{keep_max, keep_max_each, keep_min, keep_min_each};
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::plane_tree::{Node, PlaneTree, Words, near_child};
use halfspace_ray::Interval;
use halfspace_ray::query::Counters;

impl Nodes for PlaneTree {
    /// The node's own words: a visit reads those of its children, which lie side by side.
    type Node = Words;
    const CHILDREN: usize = 2;

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
    fn visit<S: Simd>(&self, simd: S, node: &Words, visitor: &mut impl Visitor<Words>) {
        match self.decode(*node) {
            Node::Axis {
                axis,
                split,
                empty,
                link,
                ..
            } => {
                let near = near_child(link, signs(visitor.octant()));
                let children = [near ^ 1, near].map(|child| self.held(child, empty));
                let gap = Gap {
                    axis,
                    ends: split,
                    begins: split,
                };
                visitor.halve(simd, children, &gap);
            }
            Node::Oblique {
                normal,
                offset,
                children,
                empty,
            } => {
                // The first ray decides the order of the children.
                let [x, y, z] = visitor.lead();
                let speed = normal[0] * x + normal[1] * y + normal[2] * z;
                let down = speed.is_sign_negative();
                let near = children + u32::from(down);
                let places = [near ^ 1, near].map(|child| self.held(child, empty));
                let plane = Plane { normal, offset };
                visitor.halve(simd, places, &Crossing { plane, down });
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

/// An oblique plane, and whether the first ray descends through it.
struct Crossing {
    plane: Plane,
    down: bool,
}

/// The formulas of [`oblique`].
impl CutOne for Crossing {
    #[inline(always)]
    fn cut_one(&self, ray: &OneRay<'_>, inside: Interval) -> [Interval; 2] {
        let Plane { normal, offset } = self.plane;
        let [o_x, o_y, o_z, pad] = ray.origin;
        let along = |v: [f32; 3]| v[0] * normal[0] + v[1] * normal[1] + v[2] * normal[2];
        let speed = along(ray.direction);
        let inv = 1.0 / (speed + f32::MIN_POSITIVE.copysign(speed));
        let distance = (offset - along([o_x, o_y, o_z])) * inv;
        let slack = pad * inv.abs();
        // Ignore a distance that is NaN: the interval keeps its end.
        let behind = Interval::new(keep_max(distance - slack, inside.enter), inside.leave);
        let before = Interval::new(inside.enter, keep_min(distance + slack, inside.leave));
        // A ray that crosses the plane the other way exchanges far and near.
        if (inv < 0.0) == self.down {
            [behind, before]
        } else {
            [before, behind]
        }
    }
}

impl<S: Simd> Cut<S, 2> for Crossing {
    #[inline(always)]
    fn cut<L: Lanes<S>>(&self, simd: S, lanes: &L) -> [Inside<S>; 2] {
        let inside = lanes.within(&lanes.axis(0));
        let (origins, directions) = (lanes.origins(), lanes.directions());
        let [below, above] = oblique(simd, &origins, &directions, inside, self.plane);
        if self.down {
            [below, above]
        } else {
            [above, below]
        }
    }
}

/// The intervals of eight rays in the child below and in the child above an oblique plane, given those in the node, and
/// the columns of [`Lanes::origins`] and [`Lanes::directions`].
#[inline(always)]
pub fn oblique<S: Simd>(
    simd: S,
    origins: &[f32x8<S>; 4],
    directions: &[f32x8<S>; 3],
    Inside { enter, leave }: Inside<S>,
    plane: Plane,
) -> [Inside<S>; 2] {
    let splat = |x: f32| f32x8::splat(simd, x);
    let [x, y, z] = plane.normal.map(splat);
    let along = |v: [f32x8<S>; 3]| v[2].mul_add(z, v[1].mul_add(y, v[0] * x));
    let [o_x, o_y, o_z, pad] = *origins;
    // The smallest normal number keeps the reciprocal finite for rays along the plane.
    let speed = along(*directions);
    let inv = splat(1.0) / (speed + splat(f32::MIN_POSITIVE).copysign(speed));
    let distance = (splat(plane.offset) - along([o_x, o_y, o_z])) * inv;
    let slack = pad * inv.abs();
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
