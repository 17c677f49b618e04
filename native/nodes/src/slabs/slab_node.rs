// SPDX-License-Identifier: GPL-3.0-or-later
//! Nodes of bounding interval hierarchies: two planes in twelve bytes, or one plane in eight.

use crate::refit::{Below, FitNode, Fitted};
use halfspace_geom::Aabb;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_geom::tighten::{Cut, Sides};
use halfspace_leaf::Leaf;
use halfspace_ray::{FrameRay, Interval};

/// Stands in place of the axis in leaves.
const LEAF: u32 = 3;

/// Flag of a node with one child.
const ALONE: u32 = 4;

/// Flag of a node with one plane: set if it bounds the child above, clear for the child below.
const ABOVE: u32 = 8;

/// Number of bits below the link. The link is the number of the first child, whose sibling is the next node, or
/// a leaf's number of triangles.
const LOW_BITS: u32 = 4;

/// Largest number of nodes in a tree, from the bits of the link.
pub const MOST: usize = 1 << (32 - LOW_BITS);

/// A decoded node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SlabKind {
    /// A leaf.
    Leaf {
        /// First block of its triangles.
        first: u32,
        /// Number of triangles.
        count: usize,
    },
    /// An inner node with two children at consecutive numbers.
    Pair {
        /// Axis 0, 1 or 2.
        axis: usize,
        /// The child below the split; the one above is the next node.
        link: u32,
    },
    /// An inner node with one child.
    Only {
        /// Axis 0, 1 or 2.
        axis: usize,
        /// The child.
        link: u32,
    },
}

/// A node with two planes or one.
pub trait SlabNode: Copy + PartialEq + Send + Sync + std::fmt::Debug + 'static {
    /// An empty leaf.
    const EMPTY: Self;

    /// Number of sides on which nodes with one child cut off space.
    const ONLY: Sides;

    /// Makes a leaf of `count` triangles from block `first` on.
    fn leaf(first: u32, count: usize) -> Self;

    /// Makes a node split along `axis` with children at `link` and `link + 1`; `children` are their boxes and
    /// numbers of triangles, `region` is the node's own box.
    fn pair(axis: usize, link: usize, region: &Aabb, children: [(Aabb, usize); 2]) -> Self;

    /// Makes a node with one child at `link`.
    fn only(link: usize, cut: &Cut) -> Self;

    /// Returns the decoded node.
    fn kind(&self) -> SlabKind;

    /// Moves the planes to the triangles of the children below and above; those of an only child are passed twice.
    fn move_planes(&mut self, axis: usize, children: [Fitted; 2]);

    /// Returns the boxes of the children below and above, or of an only child, inside the node's region.
    fn parts(&self, axis: usize, region: &Aabb) -> [Aabb; 2];

    /// Returns the distances at which the ray leaves the near child and enters the far one, with error bounds; for an
    /// only child, those at which it leaves and enters that child. NaN distances keep the ends of `whole`.
    fn intervals(&self, axis: usize, frame: &FrameRay, whole: Interval) -> (f32, f32);
}

/// Two planes: the end of the child below and the start of the child above; for an only child, its start and
/// its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Double {
    word: u32,
    /// Bits of two f32 heights; in a leaf the first is its first block.
    planes: [u32; 2],
}

/// One plane: the end of the child below or the start of the child above. The other child is unbounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Single {
    word: u32,
    /// Bits of an f32 height, or a leaf's first block.
    plane: u32,
}

/// Packs a link and the bits below it.
fn word(link: usize, low: u32) -> u32 {
    u32::try_from(link).expect("checked by the layout") << LOW_BITS | low
}

/// Returns the bits of an axis.
fn axis_bits(axis: usize) -> u32 {
    u32::try_from(axis).expect("an axis")
}

/// Decodes a node's word; `first` is the word after it, a leaf's first block.
#[inline(always)]
fn kind(word: u32, first: u32) -> SlabKind {
    let link = word >> LOW_BITS;
    let axis = (word & LEAF) as usize;
    if axis == 3 {
        SlabKind::Leaf {
            first,
            count: link as usize,
        }
    } else if word & ALONE == 0 {
        SlabKind::Pair { axis, link }
    } else {
        SlabKind::Only { axis, link }
    }
}

/// Returns the distance along the ray to a plane of this axis.
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
    fn kind(&self) -> SlabKind {
        kind(self.word, self.planes[0])
    }

    #[inline(always)]
    fn move_planes(&mut self, axis: usize, [below, above]: [Fitted; 2]) {
        let planes = if self.word & ALONE == 0 {
            [below.high(axis), above.low(axis)]
        } else {
            [below.low(axis), below.high(axis)]
        };
        self.planes = planes.map(f32::to_bits);
    }

    #[inline(always)]
    fn parts(&self, axis: usize, region: &Aabb) -> [Aabb; 2] {
        let [first, second] = self.planes.map(f32::from_bits);
        // Select by axis: writes to a variable place stall the copies of the box after them.
        let along = |side: [f32; 3], plane: f32| -> [f32; 3] {
            std::array::from_fn(|k| if k == axis { plane } else { side[k] })
        };
        let Aabb { min, max } = *region;
        if self.word & ALONE == 0 {
            let below = Aabb {
                min,
                max: along(max, first),
            };
            let above = Aabb {
                min: along(min, second),
                max,
            };
            [below, above]
        } else {
            let only = Aabb {
                min: along(min, first),
                max: along(max, second),
            };
            [only, Aabb::EMPTY]
        }
    }

    #[inline(always)]
    fn intervals(&self, axis: usize, frame: &FrameRay, whole: Interval) -> (f32, f32) {
        let Interval { enter, leave } = whole;
        // An only child is entered through the plane where the near one of two children would be left.
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

    /// Bounds the child for which this saves more triangle tests by the surface area heuristic.
    fn pair(axis: usize, link: usize, region: &Aabb, [below, above]: [(Aabb, usize); 2]) -> Self {
        let (mut low, mut high) = (*region, *region);
        low.max[axis] = below.0.max[axis];
        high.min[axis] = above.0.min[axis];
        let saved = |part: Aabb, count: usize| (region.area() - part.area()) * count as f64;
        // Store the plane that saves more.
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
    fn kind(&self) -> SlabKind {
        kind(self.word, self.plane)
    }

    /// The plane goes on bounding the child that it bounds.
    #[inline(always)]
    fn move_planes(&mut self, axis: usize, [below, above]: [Fitted; 2]) {
        let plane = if self.word & ABOVE == 0 {
            below.high(axis)
        } else {
            above.low(axis)
        };
        self.plane = plane.to_bits();
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
    fn intervals(&self, axis: usize, frame: &FrameRay, whole: Interval) -> (f32, f32) {
        let Interval { enter, leave } = whole;
        let at = distance(self.plane, axis, frame);
        let slack = frame.slack[axis];
        let above = u32::from(self.word & ABOVE != 0);
        if above == frame.negative[axis] {
            // The plane bounds the near child.
            (keep_min(at + slack, leave), enter)
        } else {
            (leave, keep_max(at - slack, enter))
        }
    }
}

/// Fits a node with two planes or one.
#[inline(always)]
fn fit<N: SlabNode>(node: &mut N, mut child: impl FnMut(Below) -> Fitted) -> Fitted {
    match node.kind() {
        SlabKind::Leaf { first, count } => {
            let fitted = child(Below::Leaf(Leaf { first, count }));
            *node = N::leaf(first, fitted.count as usize);
            fitted
        }
        SlabKind::Pair { axis, link } => {
            // Two calls: those of `array::map` are not inlined.
            let below = child(Below::Node(link));
            let above = child(Below::Node(link + 1));
            node.move_planes(axis, [below, above]);
            below.join(above)
        }
        SlabKind::Only { axis, link } => {
            let only = child(Below::Node(link));
            node.move_planes(axis, [only; 2]);
            only
        }
    }
}

impl FitNode for Double {
    #[inline(always)]
    fn fit(&mut self, child: impl FnMut(Below) -> Fitted) -> Fitted {
        fit(self, child)
    }
}

impl FitNode for Single {
    #[inline(always)]
    fn fit(&mut self, child: impl FnMut(Below) -> Fitted) -> Fitted {
        fit(self, child)
    }
}
