// SPDX-License-Identifier: GPL-3.0-or-later
//! The nodes of bounding interval hierarchies: two planes in twelve bytes, or one in eight.

use super::bound::{keep_max, keep_min};
use super::frame::FrameRay;
use crate::build::tighten::{Cut, Sides};
use crate::geom::Aabb;

/// Instead of an axis: a leaf.
const LEAF: u32 = 3;

/// Set for a node with one child.
const ALONE: u32 = 4;

/// Set for a node with one plane when that bounds the child above; clear, the one below.
const ABOVE: u32 = 8;

/// Bits below the link. Above them is the first of the children, which stand side by side, or a leaf's
/// number of triangles.
const LOW_BITS: u32 = 4;

/// No tree has more nodes.
pub const MOST: usize = 1 << (32 - LOW_BITS);

/// What a node is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A leaf.
    Leaf {
        /// Where its data begins.
        first: u32,
        /// How many triangles it holds.
        count: usize,
    },
    /// An inner node with two children side by side.
    Pair {
        /// 0, 1 or 2.
        axis: usize,
        /// The child below; the one above is the next.
        link: u32,
    },
    /// An inner node with one child.
    Only {
        /// 0, 1 or 2.
        axis: usize,
        /// The child.
        link: u32,
    },
}

/// A node of two or one planes.
pub trait SlabNode: Copy + PartialEq + Sync + std::fmt::Debug {
    /// A leaf without triangles.
    const EMPTY: Self;

    /// On how many sides nodes with one child cut.
    const ONLY: Sides;

    /// A leaf.
    fn leaf(first: u32, count: usize) -> Self;

    /// A node parted along `axis`, its children at `link`; `children` are their boxes and their numbers
    /// of triangles.
    fn pair(axis: usize, link: usize, region: &Aabb, children: [(Aabb, usize); 2]) -> Self;

    /// A node with one child, at `link`.
    fn only(link: usize, cut: &Cut) -> Self;

    /// What the node is.
    fn kind(&self) -> Kind;

    /// What the planes leave of a region, for the child below, or an only child, and the one above.
    fn parts(&self, axis: usize, region: &Aabb) -> [Aabb; 2];

    /// Where the ray leaves the near child and where it enters the far one, error bounds included; for
    /// an only child, where it leaves and where it enters that. NaN leaves the whole interval.
    fn intervals(&self, axis: usize, frame: &FrameRay, whole: (f32, f32)) -> (f32, f32);
}

/// Two planes: where the child below ends and where the child above begins; of an only child, where it
/// begins and where it ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Double {
    word: u32,
    /// Bits of two floats; the first is where a leaf's data begins.
    planes: [u32; 2],
}

/// One plane: where the child below ends or where the child above begins. The other one is not bounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Single {
    word: u32,
    /// Bits of a float, or where a leaf's data begins.
    plane: u32,
}

fn word(link: usize, low: u32) -> u32 {
    u32::try_from(link).expect("checked by the layout") << LOW_BITS | low
}

fn axis_bits(axis: usize) -> u32 {
    u32::try_from(axis).expect("an axis")
}

/// What a node's first word and a leaf's second say.
#[inline(always)]
fn kind(word: u32, first: u32) -> Kind {
    let link = word >> LOW_BITS;
    let axis = (word & LEAF) as usize;
    if axis == 3 {
        Kind::Leaf {
            first,
            count: link as usize,
        }
    } else if word & ALONE == 0 {
        Kind::Pair { axis, link }
    } else {
        Kind::Only { axis, link }
    }
}

/// Distance to a plane.
#[inline(always)]
fn distance(plane: u32, axis: usize, frame: &FrameRay) -> f32 {
    (f32::from_bits(plane) - frame.o[axis]) * frame.inv[axis]
}

impl SlabNode for Double {
    const EMPTY: Self = Self {
        word: LEAF,
        planes: [0; 2],
    };
    const ONLY: Sides = Sides::Both;

    fn leaf(first: u32, count: usize) -> Self {
        Self {
            word: word(count, LEAF),
            planes: [first, 0],
        }
    }

    fn pair(axis: usize, link: usize, _: &Aabb, [below, above]: [(Aabb, usize); 2]) -> Self {
        Self {
            word: word(link, axis_bits(axis)),
            planes: [below.0.max[axis], above.0.min[axis]].map(f32::to_bits),
        }
    }

    fn only(link: usize, cut: &Cut) -> Self {
        Self {
            word: word(link, axis_bits(cut.axis) | ALONE),
            planes: [cut.inside.min[cut.axis], cut.inside.max[cut.axis]].map(f32::to_bits),
        }
    }

    #[inline(always)]
    fn kind(&self) -> Kind {
        kind(self.word, self.planes[0])
    }

    #[inline(always)]
    fn parts(&self, axis: usize, region: &Aabb) -> [Aabb; 2] {
        let [first, second] = self.planes.map(f32::from_bits);
        let (mut below, mut above) = (*region, *region);
        if self.word & ALONE == 0 {
            below.max[axis] = first;
            above.min[axis] = second;
        } else {
            (below.min[axis], below.max[axis]) = (first, second);
            above = Aabb::EMPTY;
        }
        [below, above]
    }

    #[inline(always)]
    fn intervals(&self, axis: usize, frame: &FrameRay, (enter, leave): (f32, f32)) -> (f32, f32) {
        // An only child is entered at the plane where the near one of two is left.
        let alone = u32::from(self.word & ALONE != 0);
        let side = frame.negative[axis] ^ alone;
        let at = |side: u32| distance(self.planes[side as usize & 1], axis, frame);
        let slack = frame.slack[axis];
        (
            keep_min(at(side) + slack, leave),
            keep_max(at(side ^ 1) - slack, enter),
        )
    }
}

impl SlabNode for Single {
    const EMPTY: Self = Self {
        word: LEAF,
        plane: 0,
    };
    const ONLY: Sides = Sides::One;

    fn leaf(first: u32, count: usize) -> Self {
        Self {
            word: word(count, LEAF),
            plane: first,
        }
    }

    /// Bounds the child for which that saves more tests, by the surface area heuristic.
    fn pair(axis: usize, link: usize, region: &Aabb, [below, above]: [(Aabb, usize); 2]) -> Self {
        let (mut low, mut high) = (*region, *region);
        low.max[axis] = below.0.max[axis];
        high.min[axis] = above.0.min[axis];
        let saved = |part: Aabb, count: usize| (region.area() - part.area()) * count as f64;
        let (side, plane) = if saved(high, above.1) > saved(low, below.1) {
            (ABOVE, high.min[axis])
        } else {
            (0, low.max[axis])
        };
        Self {
            word: word(link, axis_bits(axis) | side),
            plane: plane.to_bits(),
        }
    }

    fn only(link: usize, cut: &Cut) -> Self {
        let (side, plane) = if cut.full == 1 {
            (ABOVE, cut.inside.min[cut.axis])
        } else {
            (0, cut.inside.max[cut.axis])
        };
        Self {
            word: word(link, axis_bits(cut.axis) | side | ALONE),
            plane: plane.to_bits(),
        }
    }

    #[inline(always)]
    fn kind(&self) -> Kind {
        kind(self.word, self.plane)
    }

    #[inline(always)]
    fn parts(&self, axis: usize, region: &Aabb) -> [Aabb; 2] {
        let (mut bounded, plane) = (*region, f32::from_bits(self.plane));
        let above = self.word & ABOVE != 0;
        if above {
            bounded.min[axis] = plane;
        } else {
            bounded.max[axis] = plane;
        }
        if self.word & ALONE != 0 {
            [bounded, Aabb::EMPTY]
        } else if above {
            [*region, bounded]
        } else {
            [bounded, *region]
        }
    }

    #[inline(always)]
    fn intervals(&self, axis: usize, frame: &FrameRay, (enter, leave): (f32, f32)) -> (f32, f32) {
        let at = distance(self.plane, axis, frame);
        let slack = frame.slack[axis];
        let above = u32::from(self.word & ABOVE != 0);
        if above == frame.negative[axis] {
            // The near child is the bounded one.
            (keep_min(at + slack, leave), enter)
        } else {
            (leave, keep_max(at - slack, enter))
        }
    }
}
