// SPDX-License-Identifier: GPL-3.0-or-later
//! Tile traversal of plane trees by rays with a common origin: one comparison of intervals per node decides for
//! all rays (as in Reshetov et al. 2005 and in beam tracing, for planes of any direction).
//!
//! The near child is the one that holds the origin. All rays that cross the plane do so between the distances
//! of the fastest and the slowest ray, so the near child ends at the latest crossing and the far one begins at
//! the earliest. The tile visits every node of each ray's own traversal, and others, where that ray hits
//! nothing. A tile that exceeds the work expected of coherent rays is continued in packets, each ray up to the
//! best hit found so far.

use crate::tile::leaf::{self, Resolver};
use crate::tile::nearest::join;
use crate::tile::traversal::TileTree;
use crate::tile::{LANES, Tile, load, splat};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16, mask32x16};
use halfspace_leaf::Leaf;
use halfspace_nodes::lazy_tree::LazyTree;
use halfspace_nodes::plane_tree::{MAX_DEPTH, Node, PlaneTree};
use halfspace_nodes::planes::{Inside, Planes};
use halfspace_nodes::projected_tree::{CODES, ProjectedTree};
use halfspace_ray::Interval;
use halfspace_ray::frame::U;
use halfspace_ray::query::Counters;
use halfspace_trace::input::Input;
use halfspace_trace::stack::{NodeEntry, pop_within};

/// Error bound of `n . d` for `|n| <= 1` and components of `d` below 2. Derived: 3 roundings of values of at most
/// `2 sqrt(3)` make less than 11 u.
const SPEED_ERROR: f32 = 16.0 * U;

/// Implements tiles for a binary tree of planes.
macro_rules! tiles_of_planes {
    ($tree:ty) => {
        impl TileTree for $tree {
            /// The stack is a local array of the traversal.
            type Room = ();

            fn room(&self) {}

            #[inline(always)]
            fn trace_tile<S: Simd, C: Counters, J: Resolver<R>, const R: usize>(
                &self,
                simd: S,
                input: Input<'_>,
                tile: &mut Tile<R>,
                resolver: &mut J,
                (): &mut (),
                counters: &mut [C],
            ) -> bool {
                trace(simd, self, input, tile, resolver, counters)
            }
        }
    };
}

tiles_of_planes!(PlaneTree);
tiles_of_planes!(LazyTree);
tiles_of_planes!(ProjectedTree);

/// Nodes still to visit.
struct Stack<A> {
    entries: [NodeEntry<A>; MAX_DEPTH + 1],
    size: usize,
}

impl<A: Copy> Stack<A> {
    /// An empty stack; `node` is any node.
    #[inline(always)]
    fn new(node: A) -> Self {
        Self {
            entries: [NodeEntry::blank(node); MAX_DEPTH + 1],
            size: 0,
        }
    }
}

/// A plane relative to the origin of a tile.
#[derive(Clone, Copy)]
pub(super) struct Cut {
    /// The child that holds the origin.
    pub near: u32,
    /// Mask of the children that are empty leaves.
    empty: u32,
    /// Distances between which the rays cross the plane.
    pub crossing: Interval,
}

impl Cut {
    /// The cut by a plane of unknown position.
    pub const NONE: Self = Self {
        near: 0,
        empty: 0,
        crossing: ANYWHERE,
    };
}

/// Traverses the tree with a tile; returns whether it finished within its budget. Steps and leaves are counted for the
/// tile's first ray, visits for each active ray.
#[inline(always)]
fn trace<S: Simd, T: Planes, C: Counters, J: Resolver<R>, const R: usize>(
    simd: S,
    tree: T,
    input: Input<'_>,
    tile: &mut Tile<R>,
    resolver: &mut J,
    counters: &mut [C],
) -> bool {
    let (whole, mut input) = (input.job(), input);
    let mut stack = Stack::new(tree.root());
    let mut budget = J::BUDGET * R * LANES;
    let mut node = tree.root();
    let mut inside = tile.inside;
    let finished = loop {
        match tree.node(node) {
            Node::Axis {
                axis,
                split,
                children,
                empty,
                ..
            } => {
                counters[0].step_axis();
                join(tile, counters);
                let cut = across(tile, axis, split, children, empty);
                (node, inside) = step(tree, node, &cut, inside, &mut stack);
                continue;
            }
            Node::Oblique {
                normal,
                offset,
                children,
                empty,
            } => {
                counters[0].step_oblique();
                join(tile, counters);
                let cut = match tree.direction(node) {
                    Some(direction) => {
                        let along = projected(simd, tile, direction, normal);
                        crossed(tile, along, offset, children, empty)
                    }
                    None => oblique(simd, tile, Plane { normal, offset }, children, empty),
                };
                (node, inside) = step(tree, node, &cut, inside, &mut stack);
                continue;
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
                counters[0].leaf(count);
                join(tile, counters);
                if count != 0 {
                    // In a tree built in parts, decide the hits in the blocks of the part that is left.
                    if T::PARTS && !std::ptr::eq(blocks, input.blocks) {
                        resolver.change_blocks(simd, input, tile, counters);
                        input = input.with(blocks);
                    }
                    let kept = leaf::test(simd, input, own, inside, tile, resolver, counters);
                    // Pay for the leaf: a fixed part, and one unit per triangle that the tile may hit.
                    match budget.checked_sub(4 + kept) {
                        Some(left) => budget = left,
                        None => break false,
                    }
                }
            }
        }
        // Continue with the next node on the stack that starts before the farthest ray's end.
        match pop_within(&stack.entries, &mut stack.size, tile.far) {
            Some(child) => {
                node = child.node;
                inside = Interval::new(child.interval.enter, child.interval.leave.min(tile.far));
            }
            None => break true,
        }
    };
    if T::PARTS {
        resolver.change_blocks(simd, input, tile, counters);
    }
    finished
}

/// The child to visit next and its interval; pushes the other one if the tile meets both. An empty child is
/// skipped.
#[inline(always)]
fn step<T: Planes>(
    tree: T,
    node: T::At,
    cut: &Cut,
    inside: Interval,
    stack: &mut Stack<T::At>,
) -> (T::At, Interval) {
    let &Cut {
        near,
        empty,
        crossing,
    } = cut;
    let Interval { enter, leave } = inside;
    let (side, other) = (near & 1, tree.sibling(node, near ^ 1));
    let near = tree.sibling(node, near);
    if crossing.enter > leave {
        return (near, inside);
    }
    let beyond = Interval::new(enter.max(crossing.enter), leave);
    if crossing.leave < enter || empty >> side & 1 == 1 {
        return (other, beyond);
    }
    if empty == 0 {
        stack.entries[stack.size] = NodeEntry {
            node: other,
            interval: beyond,
        };
        stack.size += 1;
    }
    (near, Interval::new(enter, leave.min(crossing.leave)))
}

/// The interval of crossings of which nothing is known.
const ANYWHERE: Interval = Interval {
    enter: f32::NEG_INFINITY,
    leave: f32::INFINITY,
};

/// The cut of a tile by an axis plane. The crossings lie between those of the fastest and the slowest ray; if the
/// origin is within its error bound of the plane, nothing is known of them.
#[inline(always)]
pub(super) fn across<const R: usize>(
    tile: &Tile<R>,
    axis: usize,
    split: f32,
    children: u32,
    empty: u32,
) -> Cut {
    let gap = split - tile.o[axis];
    let (size, pad) = (gap.abs(), tile.pad[axis]);
    if size > pad {
        let up = gap > 0.0;
        let pace = &tile.pace[axis][usize::from(up)];
        Cut {
            near: children + u32::from(!up),
            empty,
            crossing: Interval::new((size - pad) * pace.least, (size + pad) * pace.most),
        }
    } else {
        Cut {
            near: children + u32::from(!tile.up[axis]),
            empty,
            crossing: ANYWHERE,
        }
    }
}

/// A plane `normal . x = offset`.
#[derive(Clone, Copy)]
pub(super) struct Plane {
    pub normal: [f32; 3],
    pub offset: f32,
}

/// The cut of a tile by an oblique plane.
#[inline(always)]
pub(super) fn oblique<S: Simd, const R: usize>(
    simd: S,
    tile: &Tile<R>,
    Plane { normal, offset }: Plane,
    children: u32,
    empty: u32,
) -> Cut {
    crossed(tile, project(simd, tile, normal), offset, children, empty)
}

/// The smallest and the largest speed along a direction, and the height of the origin.
#[inline(always)]
fn project<S: Simd, const R: usize>(simd: S, tile: &Tile<R>, normal: [f32; 3]) -> [f32; 3] {
    let [low, high] = speeds(simd, tile, normal);
    let o = tile.o;
    let height = normal[0] * o[0] + normal[1] * o[1] + normal[2] * o[2];
    [low, high, height]
}

/// [`project()`] for a numbered direction, computed once for each tile. Rays that end later stay in the range.
#[inline(always)]
fn projected<S: Simd, const R: usize>(
    simd: S,
    tile: &mut Tile<R>,
    direction: usize,
    normal: [f32; 3],
) -> [f32; 3] {
    let direction = direction % CODES;
    if tile.known >> direction & 1 == 0 {
        tile.projections[direction] = project(simd, tile, normal);
        tile.known |= 1 << direction;
    }
    tile.projections[direction]
}

/// The cut of a tile by a plane at `offset` along the direction of a projection.
#[inline(always)]
fn crossed<const R: usize>(
    tile: &Tile<R>,
    [low, high, height]: [f32; 3],
    offset: f32,
    children: u32,
    empty: u32,
) -> Cut {
    let gap = offset - height;
    // An origin within the error bound of the plane bounds nothing.
    let (size, pad) = (gap.abs(), tile.oblique_pad);
    if size <= pad || size.is_nan() {
        return Cut {
            near: children + u32::from(low + high <= 0.0),
            empty,
            crossing: ANYWHERE,
        };
    }
    let up = gap > 0.0;
    let (slowest, quickest) = if up { (low, high) } else { (-high, -low) };
    // Round the quotients outwards.
    let first = if quickest > 0.0 {
        (size - pad) / quickest * (1.0 - 4.0 * U)
    } else {
        f32::INFINITY
    };
    let last = if slowest > 0.0 {
        (size + pad) / slowest * (1.0 + 4.0 * U)
    } else {
        f32::INFINITY
    };
    Cut {
        near: children + u32::from(!up),
        empty,
        crossing: Interval::new(first, last),
    }
}

/// The smallest and the largest speed of the active rays along a direction, with the errors of their rounding.
#[inline(always)]
pub(super) fn speeds<S: Simd, const R: usize>(
    simd: S,
    tile: &Tile<R>,
    normal: [f32; 3],
) -> [f32; 2] {
    let mut low = splat(simd, f32::INFINITY);
    let mut high = splat(simd, f32::NEG_INFINITY);
    for row in 0..R {
        let active = mask32x16::from_bitmask(simd, u64::from(tile.active[row]));
        let [x, y, z] = &tile.d[row];
        let planar = load(simd, z) * splat(simd, normal[2]);
        let planar = load(simd, y).mul_add(splat(simd, normal[1]), planar);
        let speed = load(simd, x).mul_add(splat(simd, normal[0]), planar);
        let below: f32x16<S> = active.select(speed, splat(simd, f32::INFINITY));
        let above: f32x16<S> = active.select(speed, splat(simd, f32::NEG_INFINITY));
        low = low.min(below);
        high = high.max(above);
    }
    [
        low.reduce_min() - SPEED_ERROR,
        high.reduce_max() + SPEED_ERROR,
    ]
}
