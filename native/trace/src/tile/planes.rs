// SPDX-License-Identifier: GPL-3.0-or-later
//! Tile traversal of plane trees by rays with a common origin: one comparison of intervals per node decides for
//! all rays (as in Reshetov et al. 2005 and in beam tracing, for planes of any direction).
//!
//! The near child is the one that holds the origin. All rays that cross the plane do so between the distances
//! of the fastest and the slowest ray, so the near child ends at the latest crossing and the far one begins at
//! the earliest. The tile visits every node of each ray's own traversal, and others, where that ray hits
//! nothing. A tile that exceeds the work expected of coherent rays is continued in packets, each ray up to the
//! best hit found so far.

use crate::pending::{Pending, next};
use crate::tile::leaf::Judge;
use crate::tile::walk::TileTree;
use crate::tile::{LANES, Tile, leaf as tile_leaf, load, splat};
use fearless_simd::{Select, Simd, SimdBase, SimdFloat, SimdMask, f32x16, mask32x16};
use halfspace_leaf::{Job, Leaf};
use halfspace_nodes::lazy_tree::LazyTree;
use halfspace_nodes::plane_tree::{MAX_DEPTH, Node, PlaneTree};
use halfspace_nodes::planes::{Inside, Planes};
use halfspace_ray::Ray;
use halfspace_ray::frame::U;
use halfspace_ray::query::Counters;

/// Error bound of `n . d` for `|n| <= 1` and components of `d` below 2. Derived: 3 roundings of at most
/// `sqrt(3) 2` each, and room.
const SPEED_ERROR: f32 = 16.0 * U;

macro_rules! tiles_of_planes {
    ($tree:ty) => {
        impl TileTree for $tree {
            /// The stack is a local array of the traversal.
            type Room = ();

            fn room(&self) {}

            #[inline(always)]
            fn follow<S: Simd, C: Counters, J: Judge<R>, const R: usize>(
                &self,
                simd: S,
                triangles: Job<'_>,
                tile: (&mut Tile<R>, &[Ray], &mut J),
                (): &mut (),
                counters: &mut [C],
            ) -> bool {
                follow(simd, self, triangles, tile, counters)
            }
        }
    };
}

tiles_of_planes!(PlaneTree);
tiles_of_planes!(LazyTree);

/// Traverses the tree with a tile; returns whether it finished within its budget.
#[inline(always)]
fn follow<S: Simd, T: Planes, C: Counters, J: Judge<R>, const R: usize>(
    simd: S,
    tree: T,
    Job { scene, mut blocks }: Job<'_>,
    (tile, rays, judge): (&mut Tile<R>, &[Ray], &mut J),
    counters: &mut [C],
) -> bool {
    let whole = blocks;
    let mut stack = [Pending {
        node: tree.root(),
        enter: 0.0,
        leave: 0.0,
    }; MAX_DEPTH + 1];
    let mut waiting = 0;
    let mut budget = J::BUDGET * R * LANES;
    let mut node = tree.root();
    let (mut enter, mut leave) = tile.inside;
    loop {
        match tree.node(node) {
            Node::Axis {
                axis,
                split,
                children,
                empty,
                ..
            } => {
                // Count the visits of a tile for its first ray.
                counters[0].step_axis();
                // Bound the crossings by the fastest and the slowest ray; near the plane, by nothing.
                let gap = split - tile.o[axis];
                let (size, pad) = (gap.abs(), tile.pad[axis]);
                let part = if size > pad {
                    let up = gap > 0.0;
                    let pace = &tile.pace[axis][usize::from(up)];
                    let crossing = ((size - pad) * pace.least, (size + pad) * pace.most);
                    (children + u32::from(!up), crossing)
                } else {
                    let near = children + u32::from(!tile.up[axis]);
                    (near, (f32::NEG_INFINITY, f32::INFINITY))
                };
                (node, enter, leave) = step(
                    tree,
                    (node, empty),
                    part,
                    (enter, leave),
                    (&mut stack, &mut waiting),
                );
                continue;
            }
            Node::Oblique {
                normal,
                offset,
                children,
                empty,
            } => {
                counters[0].step_oblique();
                let part = oblique(simd, tile, (normal, offset), children);
                (node, enter, leave) = step(
                    tree,
                    (node, empty),
                    part,
                    (enter, leave),
                    (&mut stack, &mut waiting),
                );
                continue;
            }
            Node::Leaf { first, count } => {
                let own = match tree.inside(
                    node,
                    Leaf { first, count },
                    Job {
                        scene,
                        blocks: whole,
                    },
                ) {
                    Inside::Triangles(own) => own,
                    Inside::Part(root) => {
                        node = root;
                        continue;
                    }
                };
                counters[0].leaf(count);
                if count != 0 {
                    let leaf = Leaf { first, count };
                    // In a tree built in parts, finish the hits in the blocks of the part that is left.
                    if T::PARTS && !std::ptr::eq(own, blocks) {
                        judge.leave(simd, blocks, (&mut *tile, rays), counters);
                        blocks = own;
                    }
                    let kept = tile_leaf::test(
                        simd,
                        blocks,
                        leaf,
                        (enter, leave),
                        (&mut *tile, rays, &mut *judge),
                        counters,
                    );
                    // Pay for the leaf: a fixed part, and one unit per triangle that the tile may hit.
                    let Some(left) = budget.checked_sub(4 + kept) else {
                        if T::PARTS {
                            judge.leave(simd, blocks, (tile, rays), counters);
                        }
                        return false;
                    };
                    budget = left;
                }
            }
        }
        // Continue with the next node on the stack that starts before the farthest ray's end.
        let Some(child) = next(&stack, &mut waiting, tile.far) else {
            if T::PARTS {
                judge.leave(simd, blocks, (tile, rays), counters);
            }
            return true;
        };
        (node, enter, leave) = (child.node, child.enter, child.leave.min(tile.far));
    }
}

/// The child to visit next and its interval; pushes the other one if the tile meets both. An empty child is
/// skipped.
#[inline(always)]
fn step<T: Planes>(
    tree: T,
    (node, empty): (T::At, u32),
    (near, (first, last)): (u32, (f32, f32)),
    (enter, leave): (f32, f32),
    (stack, waiting): (&mut [Pending<T::At>; MAX_DEPTH + 1], &mut usize),
) -> (T::At, f32, f32) {
    let (side, other) = (near & 1, tree.sibling(node, near ^ 1));
    let near = tree.sibling(node, near);
    if first > leave {
        return (near, enter, leave);
    }
    let far = (other, enter.max(first), leave);
    if last < enter || empty >> side & 1 == 1 {
        return far;
    }
    if empty == 0 {
        stack[*waiting] = Pending {
            node: far.0,
            enter: far.1,
            leave: far.2,
        };
        *waiting += 1;
    }
    (near, enter, leave.min(last))
}

/// The near child of an oblique node, and the interval of distances in which rays cross its plane.
#[inline(always)]
fn oblique<S: Simd, const R: usize>(
    simd: S,
    tile: &Tile<R>,
    (normal, offset): ([f32; 3], f32),
    children: u32,
) -> (u32, (f32, f32)) {
    // Find the smallest and the largest speed along the normal among the active rays.
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
    // Include the rounding of the speeds.
    let (low, high) = (
        low.reduce_min() - SPEED_ERROR,
        high.reduce_max() + SPEED_ERROR,
    );
    let o = tile.o;
    let gap = offset - (normal[0] * o[0] + normal[1] * o[1] + normal[2] * o[2]);
    // An origin within the error bound of the plane bounds nothing.
    let (size, pad) = (gap.abs(), tile.oblique_pad);
    if size <= pad || size.is_nan() {
        let near = children + u32::from(low + high <= 0.0);
        return (near, (f32::NEG_INFINITY, f32::INFINITY));
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
    (children + u32::from(!up), (first, last))
}
