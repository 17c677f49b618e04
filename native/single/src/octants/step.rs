// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of octrees from leaf to leaf: find where the ray leaves a cell, and which neighbour it enters.
//! Glassner 1984, Samet 1989, and Endl and Sommer 1994 differ only in how they find the neighbour
//! ([`Neighbours`]).
//!
//! Cells are integers on the grid of the smallest cells, mirrored along the axes on which the ray runs
//! backwards, so that coordinates only increase along it. When the ray leaves a cell, the coordinate along the
//! exit axis is the next cell's, exactly; the other two come from the exit point, clamped to the face and never
//! below their previous values. So every step increases a coordinate, a traversal ends after at most three
//! times as many steps as the grid has cells along an axis, and no cell is skipped, whatever the rounding:
//! rounding can only assign a point of the ray to a cell from which it is less than [`Cube::step_margin`] away,
//! and the leaves contain all triangles within that distance.
//!
//! A ray that leaves through an edge or a corner crosses one face after the other, x before y before z, each
//! with an interval of length 0. A ray in a wall stays on the side given by the sign of its zero component.
//!
//! [`Cube::step_margin`]: halfspace_nodes::octants::Cube::step_margin

use crate::octants::param::{Entries, OctreeTraversal};
use fearless_simd::{Simd, SimdBase, f32x8};
use halfspace_geom::bound::keep_max;
use halfspace_geom::vec3::map;
use halfspace_leaf::Job;
use halfspace_nodes::octree_nodes::{Node, OUTSIDE, Octree};
use halfspace_ray::RayRef;
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_trace::batch::SingleTraversal;

/// A leaf and its number among the nodes.
#[derive(Clone, Copy)]
pub struct NumberedLeaf {
    /// Its number.
    pub index: u32,
    /// The leaf.
    pub node: Node,
}

/// A method of finding the node across a face.
pub trait Neighbours: Sync {
    /// A node that contains the region across the face on side `side` (0 lower, 1 upper) of axis `axis` of a leaf:
    /// the neighbour, or an ancestor of the neighbours. Returns `OUTSIDE` only if the face is on the root's
    /// boundary. Counts the nodes it visits.
    fn across<C: Counters>(
        tree: &Octree,
        leaf: NumberedLeaf,
        axis: usize,
        side: u32,
        counters: &mut C,
    ) -> u32;
}

/// The traversal of one tree by single rays with one method of finding neighbours.
pub struct NeighbourTraversal<'a, N>(pub &'a Octree, pub N);

/// The grid of the smallest cells as a ray crosses it: planes and cells are counted in the ray's own direction.
#[derive(Clone, Copy)]
pub struct Grid {
    /// Coordinate where counting begins, per axis: the lower or the upper end of the root.
    base: [f32; 3],
    /// Edge of the smallest cells; negative for axes that are counted backwards.
    step: [f32; 3],
    /// Reciprocal of `step`; exact, because it is a power of two.
    per_step: [f32; 3],
    /// Number of smallest cells along an axis.
    pub size: u32,
    /// Depth of the smallest cells.
    depth: u32,
    /// Bit `k` is set if axis `k` is counted backwards.
    pub signs: u32,
}

impl Grid {
    /// The grid of a tree for the rays whose directions have these sign bits.
    #[inline(always)]
    pub fn new(tree: &Octree, signs: u32) -> Self {
        // Mirror the axes on which the ray runs backwards.
        let cube = tree.cube();
        let unit = cube.unit();
        let back = |k: usize| signs >> k & 1 == 1;
        let step = map([0, 1, 2], |k: usize| if back(k) { -unit } else { unit });
        Self {
            base: map([0, 1, 2], |k: usize| {
                if back(k) {
                    cube.corner[k] + cube.side
                } else {
                    cube.corner[k]
                }
            }),
            step,
            per_step: map(step, |x: f32| 1.0 / x),
            size: 1 << cube.depth,
            depth: cube.depth,
            signs: signs & 7,
        }
    }

    /// The coordinate of plane `number` across an axis; exact.
    #[inline(always)]
    pub fn plane(&self, axis: usize, number: u32) -> f32 {
        self.base[axis] + number as f32 * self.step[axis]
    }

    /// Offset of a plane from origin coordinate `o` along an axis. The root's far faces are at infinity: a ray
    /// along one may seem to leave long before it does, so it is clipped to the scene's box with its own error
    /// bound.
    #[inline(always)]
    pub fn ahead(&self, axis: usize, number: u32, o: f32) -> f32 {
        if number == self.size {
            f32::INFINITY.copysign(self.step[axis])
        } else {
            self.plane(axis, number) - o
        }
    }

    /// [`Self::ahead`] for eight rays.
    #[inline(always)]
    pub fn all_ahead<S: Simd>(&self, simd: S, axis: usize, number: u32, o: f32x8<S>) -> f32x8<S> {
        let splat = |x: f32| f32x8::splat(simd, x);
        if number == self.size {
            splat(f32::INFINITY.copysign(self.step[axis]))
        } else {
            splat(self.plane(axis, number)) - o
        }
    }

    /// The smallest cell that contains coordinate `x`, clamped to `least` and `most`.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates"
    )]
    pub fn cell(&self, axis: usize, x: f32, least: u32, most: u32) -> u32 {
        let number = ((x - self.base[axis]) * self.per_step[axis]) as u32;
        number.clamp(least, most)
    }

    /// The indices of the smallest cells of eight coordinates, before rounding to integers.
    #[inline(always)]
    pub fn numbers<S: Simd>(&self, simd: S, axis: usize, x: f32x8<S>) -> f32x8<S> {
        (x - f32x8::splat(simd, self.base[axis])) * f32x8::splat(simd, self.per_step[axis])
    }

    /// The edge of a node, in smallest cells.
    #[inline(always)]
    pub fn edge(&self, node: Node) -> u32 {
        1 << (self.depth - node.level())
    }

    /// Descends from node `index` to the leaf that contains the smallest cell `at`.
    #[inline(always)]
    pub fn descend<C: Counters>(
        &self,
        tree: &Octree,
        mut index: u32,
        at: [u32; 3],
        counters: &mut C,
    ) -> NumberedLeaf {
        loop {
            let node = tree.node(index);
            if !node.is_inner() {
                return NumberedLeaf { index, node };
            }
            counters.step_boxes();
            let bit = self.depth - node.level() - 1;
            let octant = at[0] >> bit & 1 | (at[1] >> bit & 1) << 1 | (at[2] >> bit & 1) << 2;
            index = node.children() + (octant ^ self.signs);
        }
    }
}

/// Where a ray is: a leaf, the smallest cell in it, and the distance at which the ray enters that cell.
#[derive(Clone, Copy)]
pub struct Position {
    /// The leaf.
    pub leaf: NumberedLeaf,
    /// The smallest cell, counted in the direction of the ray.
    pub at: [u32; 3],
    /// The distance.
    pub enter: f32,
}

impl<N: Neighbours> SingleTraversal for NeighbourTraversal<'_, N> {
    type Scratch = Entries;
    type Uncounted = NoCount;

    fn scratch(&self) -> Self::Scratch {
        OctreeTraversal(self.0).scratch()
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        entries: &mut Self::Scratch,
        counters: &mut C,
    ) -> Best {
        let (tree, frame) = (self.0, ray.frame);
        // The leaves are inflated for the rounding of the scene's own rays from near origins; other rays go top
        // down.
        if !tree.is_near(frame.o) || frame.is_blurred() {
            return OctreeTraversal(tree).cast::<S, Q, C>(simd, job, ray, entries, counters);
        }
        let grid = Grid::new(tree, frame.signs);
        // Locate the leaf at the entry point.
        let at = map([0, 1, 2], |k: usize| {
            let x = frame.o[k] + frame.t_min * frame.d[k];
            grid.cell(k, x, 0, grid.size - 1)
        });
        let start = Position {
            leaf: grid.descend(tree, 0, at, counters),
            at,
            enter: frame.t_min,
        };
        let mut best = Best::new(frame);
        let steps = Steps { tree, grid: &grid };
        steps.follow::<S, Q, C, N>(simd, job, ray, start, &mut best, counters);
        best
    }
}

/// A tree and the grid of its smallest cells for one ray.
pub struct Steps<'a> {
    /// The tree.
    pub tree: &'a Octree,
    /// The grid.
    pub grid: &'a Grid,
}

impl Steps<'_> {
    /// Traces a ray from a position in a leaf to its best hit.
    #[inline(always)]
    pub fn follow<S: Simd, Q: Query, C: Counters, N: Neighbours>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        from: Position,
        best: &mut Best,
        counters: &mut C,
    ) {
        let Self { tree, grid } = *self;
        let frame = ray.frame;
        let Position {
            mut leaf,
            mut at,
            mut enter,
        } = from;
        loop {
            // Find the planes ahead, and the axis of the first one crossed.
            let edge = grid.edge(leaf.node);
            let next = map(at, |x| (x & !(edge - 1)) + edge);
            let times: [f32; 3] = map([0, 1, 2], |k: usize| {
                grid.ahead(k, next[k], frame.o[k]) * frame.inv[k]
            });
            let mut axis = 0;
            if times[1] < times[axis] {
                axis = 1;
            }
            if times[2] < times[axis] {
                axis = 2;
            }
            // Test the leaf's triangles, and end after its exit if a hit lies before, or at the root's boundary.
            let leave = keep_max(times[axis], enter);
            let triangles = leaf.node.blocks();
            counters.leaf(triangles.count);
            if triangles.count != 0
                && job.test::<S, Q, C>(simd, triangles, ray, leave, best, counters)
            {
                return;
            }
            if leave > best.reach || next[axis] == grid.size {
                return;
            }
            // Step to the smallest cell behind the exit face.
            for k in 0..3 {
                at[k] = if k == axis {
                    next[k]
                } else {
                    grid.cell(k, frame.o[k] + leave * frame.d[k], at[k], next[k] - 1)
                };
            }
            // Find the leaf there.
            enter = leave;
            let side = u32::from(grid.signs >> axis & 1 == 0);
            let neighbour = N::across(tree, leaf, axis, side, counters);
            if neighbour == OUTSIDE {
                return;
            }
            leaf = grid.descend(tree, neighbour, at, counters);
        }
    }
}
