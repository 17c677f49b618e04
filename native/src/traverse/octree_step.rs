// SPDX-License-Identifier: GPL-3.0-or-later
//! Octrees walked from leaf to leaf: where the ray leaves a cell, and into which neighbour. How the
//! neighbour is found is the one thing in which Glassner 1984, Samet 1989 and Endl and Sommer 1994
//! differ ([`Neighbours`]).
//!
//! Cells are integers on the grid of the smallest cells, mirrored along the axes on which the ray
//! runs backwards, so that it always counts up. Leaving a cell, the coordinate along the exit axis
//! is the next cell's, exactly; the other two come from the exit point, kept inside the face and
//! never below what they were. So every step counts up, a walk ends after at most three times as
//! many steps as the grid is wide, and no cell is skipped, whatever rounding does: it can only count
//! a moment to a cell from which the ray is off by less than [`Cube::step_margin`], and the leaves
//! hold all triangles within that.
//!
//! Exit through an edge or a corner crosses one face after the other, x before y before z, each with
//! an interval of one moment. A ray along a wall walks on the side that the sign of its zero names.
//!
//! [`Cube::step_margin`]: crate::build::octree::Cube::step_margin

use super::batch;
use super::blocks::Blocks;
use super::bound::keep_max;
use super::frame::FrameRay;
use super::octree_param;
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::octree_nodes::{Node, OUTSIDE, Octree};
use crate::geom::vec3::map;
use crate::scene::Triangles;
use fearless_simd::{Simd, SimdBase, f32x8};

/// How to find the node across a face.
pub trait Neighbours: Sync {
    /// The node across the face on side `side` (0 below, 1 above) of axis `axis` of a leaf, or an
    /// ancestor of it; not smaller than the leaf unless it is an ancestor of what lies there.
    /// `OUTSIDE` only when the face is on the root's boundary. Counts the nodes it visits.
    fn across<C: Counters>(
        tree: &Octree,
        leaf: (u32, Node),
        axis: usize,
        side: u32,
        counters: &mut C,
    ) -> u32;
}

/// The walk over one tree.
pub struct Walk<'a, N>(pub &'a Octree, pub N);

/// A ray's view of the grid: planes by number, counted in its own direction.
#[derive(Clone, Copy)]
pub struct Grid {
    /// Where the counting begins, per axis: one or the other end of the root.
    base: [f32; 3],
    /// Edge of the smallest cells, negative for axes that are counted backwards.
    step: [f32; 3],
    /// Its reciprocal; exact.
    per_step: [f32; 3],
    /// Number of smallest cells along an axis.
    pub size: u32,
    depth: u32,
    /// Bit `k`: axis `k` is counted backwards.
    pub signs: u32,
}

impl Grid {
    /// The grid of a tree for the rays whose directions have these sign bits.
    #[inline(always)]
    pub fn new(tree: &Octree, signs: u32) -> Self {
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

    /// The coordinate of a plane; exact.
    #[inline(always)]
    pub fn plane(&self, axis: usize, number: u32) -> f32 {
        self.base[axis] + number as f32 * self.step[axis]
    }

    /// How far along an axis a plane lies ahead. The root's own faces are no planes: a ray along one
    /// may seem to leave long before it does, so it ends with the scene's box and its allowance.
    #[inline(always)]
    pub fn ahead(&self, axis: usize, number: u32, o: f32) -> f32 {
        if number == self.size {
            f32::INFINITY.copysign(self.step[axis])
        } else {
            self.plane(axis, number) - o
        }
    }

    /// The same for eight rays.
    #[inline(always)]
    pub fn all_ahead<S: Simd>(&self, simd: S, axis: usize, number: u32, o: f32x8<S>) -> f32x8<S> {
        let splat = |x: f32| f32x8::splat(simd, x);
        if number == self.size {
            splat(f32::INFINITY.copysign(self.step[axis]))
        } else {
            splat(self.plane(axis, number)) - o
        }
    }

    /// The smallest cell that holds a coordinate, not below `least` nor above `most`.
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

    /// The numbers of eight coordinates' smallest cells, before they are cut to whole numbers.
    #[inline(always)]
    pub fn numbers<S: Simd>(&self, simd: S, axis: usize, x: f32x8<S>) -> f32x8<S> {
        (x - f32x8::splat(simd, self.base[axis])) * f32x8::splat(simd, self.per_step[axis])
    }

    /// The edge of a node in smallest cells.
    #[inline(always)]
    pub fn edge(&self, node: Node) -> u32 {
        1 << (self.depth - node.level())
    }

    /// Goes down from a node to the leaf that holds the smallest cell `at`.
    #[inline(always)]
    pub fn descend<C: Counters>(
        &self,
        tree: &Octree,
        mut index: u32,
        at: [u32; 3],
        counters: &mut C,
    ) -> (u32, Node) {
        loop {
            let node = tree.node(index);
            if !node.is_inner() {
                return (index, node);
            }
            counters.step_axis();
            let bit = self.depth - node.level() - 1;
            let octant = at[0] >> bit & 1 | (at[1] >> bit & 1) << 1 | (at[2] >> bit & 1) << 2;
            index = node.children() + (octant ^ self.signs);
        }
    }
}

impl<N: Neighbours> batch::Walk for Walk<'_, N> {
    type Scratch = octree_param::Stack;

    fn scratch(&self) -> Self::Scratch {
        octree_param::Walk(self.0).scratch()
    }

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        triangles: (&Triangles, &Blocks),
        (ray, frame): (&Ray, &FrameRay),
        stack: &mut Self::Scratch,
        counters: &mut C,
    ) -> Hit {
        let tree = self.0;
        // The leaves allow for the rounding of the scene's own rays, and no more.
        if !tree.is_near(frame.o) || frame.place.is_some() {
            let walk = octree_param::Walk(tree);
            return walk.cast::<S, Q, C>(simd, triangles, (ray, frame), stack, counters);
        }
        let grid = Grid::new(tree, frame.signs);
        let at = map([0, 1, 2], |k: usize| {
            let x = frame.o[k] + frame.t_min * frame.d[k];
            grid.cell(k, x, 0, grid.size - 1)
        });
        let leaf = grid.descend(tree, 0, at, counters);
        let mut best = Best::new(frame);
        let start = (leaf, at, frame.t_min);
        go_on::<S, Q, C, N>(
            simd,
            tree,
            triangles,
            (ray, frame, &grid),
            start,
            &mut best,
            counters,
        );
        best.hit()
    }
}

/// Walks on from a leaf in which the ray is at the smallest cell `at`, at the time `enter`.
#[inline(always)]
pub fn go_on<S: Simd, Q: Query, C: Counters, N: Neighbours>(
    simd: S,
    tree: &Octree,
    (scene, blocks): (&Triangles, &Blocks),
    (ray, frame, grid): (&Ray, &FrameRay, &Grid),
    ((mut index, mut leaf), mut at, mut enter): ((u32, Node), [u32; 3], f32),
    best: &mut Best,
    counters: &mut C,
) {
    loop {
        let edge = grid.edge(leaf);
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
        let leave = keep_max(times[axis], enter);
        let (first, count) = leaf.blocks();
        counters.leaf(count);
        if count != 0
            && blocks.test::<S, Q, C>(
                simd,
                (first, count),
                scene,
                (ray, frame, leave),
                best,
                counters,
            )
        {
            return;
        }
        if leave > best.reach || next[axis] == grid.size {
            return;
        }
        for k in 0..3 {
            at[k] = if k == axis {
                next[k]
            } else {
                grid.cell(k, frame.o[k] + leave * frame.d[k], at[k], next[k] - 1)
            };
        }
        enter = leave;
        let side = u32::from(grid.signs >> axis & 1 == 0);
        let neighbour = N::across(tree, (index, leaf), axis, side, counters);
        if neighbour == OUTSIDE {
            return;
        }
        (index, leaf) = grid.descend(tree, neighbour, at, counters);
    }
}
