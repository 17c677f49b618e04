// SPDX-License-Identifier: GPL-3.0-or-later
//! Uniform grids walked from cell to cell, wall by wall (Amanatides and Woo 1987; Cleary and Wyvill 1988).
//!
//! The textbook's walk asks which wall comes next and adds a step to its distance, so errors add up,
//! and where two walls come at the same moment, it may pass the cell in which the ray touches something.
//! Here every distance is worked out from the wall's own coordinate, with the frame's error bound on both
//! sides. Along each axis the ray may be, at any moment, in the cells from the one that it has perhaps not left
//! to the one that it has perhaps entered. Nearly always these are the same. When the ray may have entered
//! another along one axis, that one is visited together with all that it may be in along the other two: so
//! each cell whose three intervals have a moment in common is visited, once, at the first such
//! moment, and no other. No step goes back, so the walk ends.

use super::batch;
use super::blocks::Blocks;
use super::bound::{keep_max, keep_min};
use super::frame::FrameRay;
use super::query::{Best, Counters, Query};
use super::ray::{Hit, Ray};
use crate::build::grid::Grid;
use crate::geom::vec3::map;
use crate::scene::Triangles;
use fearless_simd::Simd;

/// The walk over one grid.
pub struct Walk<'a>(pub &'a Grid);

/// The walls across one axis as a ray meets them, counted in its own direction.
#[derive(Clone, Copy)]
struct Axis<'a> {
    walls: &'a [f32],
    /// The number of cells.
    count: usize,
    backwards: bool,
    o: f32,
    inv: f32,
    slack: f32,
}

impl<'a> Axis<'a> {
    #[inline(always)]
    fn new(grid: &'a Grid, ray: &FrameRay, k: usize) -> Self {
        Self {
            walls: grid.walls(k),
            count: grid.count(k),
            backwards: ray.negative[k] == 1,
            o: ray.o[k],
            inv: ray.inv[k],
            slack: ray.slack[k],
        }
    }

    #[inline(always)]
    fn distance(&self, wall: usize) -> f32 {
        let place = if self.backwards {
            self.count - wall
        } else {
            wall
        };
        (self.walls[place] - self.o) * self.inv
    }

    /// Not later than the ray enters a cell. The scene's own faces are no walls: a ray along one may
    /// seem to be outside; it ends with the scene's box and its allowance.
    #[inline(always)]
    fn enters(&self, cell: usize) -> f32 {
        if cell >= self.count {
            f32::INFINITY
        } else if cell == 0 {
            f32::NEG_INFINITY
        } else {
            // What is not a number bounds nothing.
            keep_max(self.distance(cell) - self.slack, f32::NEG_INFINITY)
        }
    }

    /// Not sooner than it leaves one.
    #[inline(always)]
    fn leaves(&self, cell: usize) -> f32 {
        if cell + 1 == self.count {
            f32::INFINITY
        } else {
            keep_min(self.distance(cell + 1) + self.slack, f32::INFINITY)
        }
    }

    /// The cell's place in the grid.
    #[inline(always)]
    fn place(&self, cell: usize) -> usize {
        if self.backwards {
            self.count - 1 - cell
        } else {
            cell
        }
    }

    /// The first and the last cell that a ray may be in at `t`, where its coordinate is about `x`.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates"
    )]
    fn window(&self, x: f32, per_unit: f32, t: f32) -> [usize; 2] {
        let guess = ((x - self.walls[0]) * per_unit) as usize;
        let mut last = self.place(guess.min(self.count - 1));
        while self.enters(last) > t {
            last -= 1;
        }
        while last + 1 < self.count && self.enters(last + 1) <= t {
            last += 1;
        }
        let mut first = last;
        while first > 0 && self.leaves(first - 1) >= t {
            first -= 1;
        }
        [first, last]
    }
}

impl batch::Walk for Walk<'_> {
    type Scratch = ();

    fn scratch(&self) {}

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        (scene, blocks): (&Triangles, &Blocks),
        (ray, frame): (&Ray, &FrameRay),
        (): &mut (),
        counters: &mut C,
    ) -> Hit {
        let grid = self.0;
        let mut best = Best::new(frame);
        let axes = map(
            [0, 1, 2],
            #[inline(always)]
            |k: usize| Axis::new(grid, frame, k),
        );
        let start = frame.t_min;
        // Per axis the first and the last cell that the ray may be in.
        let mut may = map(
            [0, 1, 2],
            #[inline(always)]
            |k: usize| axes[k].window(frame.o[k] + start * frame.d[k], grid.per_unit(k), start),
        );
        let mut next = map(
            [0, 1, 2],
            #[inline(always)]
            |k: usize| axes[k].enters(may[k][1] + 1),
        );
        let mut fresh = may;
        loop {
            counters.step_axis();
            for z in fresh[2][0]..=fresh[2][1] {
                for y in fresh[1][0]..=fresh[1][1] {
                    for x in fresh[0][0]..=fresh[0][1] {
                        let place = [axes[0].place(x), axes[1].place(y), axes[2].place(z)];
                        let (first, count) = grid.cell(place);
                        counters.leaf(count);
                        if count == 0 {
                            continue;
                        }
                        let sides = keep_min(axes[0].leaves(x), axes[1].leaves(y));
                        let leave = keep_min(sides, keep_min(axes[2].leaves(z), frame.t_max));
                        let leaf = (first, count);
                        let ray = (ray, frame, leave);
                        if blocks.test::<S, Q, C>(simd, leaf, scene, ray, &mut best, counters) {
                            return best.hit();
                        }
                    }
                }
            }
            let mut axis = 0;
            if next[1] < next[axis] {
                axis = 1;
            }
            if next[2] < next[axis] {
                axis = 2;
            }
            let now = next[axis];
            if now > best.reach || now > frame.t_max || now == f32::INFINITY {
                return best.hit();
            }
            // What the ray has certainly left by now.
            for k in 0..3 {
                while may[k][0] < may[k][1] && axes[k].leaves(may[k][0]) < now {
                    may[k][0] += 1;
                }
            }
            may[axis][1] += 1;
            next[axis] = axes[axis].enters(may[axis][1] + 1);
            fresh = may;
            fresh[axis][0] = fresh[axis][1];
        }
    }
}
