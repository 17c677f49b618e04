// SPDX-License-Identifier: GPL-3.0-or-later
//! Traversal of uniform grids from cell to cell (Amanatides and Woo 1987; Cleary and Wyvill 1988).
//!
//! The published traversal finds the next cell wall and adds a step to its distance, so errors accumulate, and
//! where the ray crosses two walls at the same distance it may skip the cell in which the ray touches a
//! triangle. Here each distance is computed from the wall's own coordinate, with the frame's error bound on
//! both sides. Along each axis the ray may be, at any distance, in the cells from the one it has not provably
//! left to the one it may have entered; nearly always these are the same cell.
//!
//! When the ray may have entered a new cell along one axis, that cell is visited together with all cells the
//! ray may be in along the other two axes. So each cell whose three intervals intersect is visited exactly
//! once, at the first distance the intervals share, and no other cell is. No step goes back, so the traversal
//! ends.

use crate::single_rays;
use fearless_simd::Simd;
use halfspace_geom::bound::{keep_max, keep_min};
use halfspace_geom::vec3::map;
use halfspace_leaf::Job;
use halfspace_nodes::grid::Grid;
use halfspace_ray::query::{Best, Counters, NoCount, Query};
use halfspace_ray::{FrameRay, RayRef};
use halfspace_trace::batch::SingleTraversal;

/// The cell walls across one axis, counted in the direction of the ray.
#[derive(Clone, Copy)]
struct Axis<'a> {
    /// Coordinates of the walls in the frame, ascending.
    walls: &'a [f32],
    /// Number of cells along the axis.
    count: usize,
    /// Whether the ray goes towards lower coordinates, so that cells and walls are counted from the upper end.
    backwards: bool,
    o: f32,
    inv: f32,
    slack: f32,
}

impl<'a> Axis<'a> {
    /// The walls across axis `k` for a ray.
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

    /// Distance at which the ray crosses a wall, without error bound.
    #[inline(always)]
    fn distance(&self, wall: usize) -> f32 {
        let index = if self.backwards {
            self.count - wall
        } else {
            wall
        };
        (self.walls[index] - self.o) * self.inv
    }

    /// Lower bound on the distance at which the ray enters a cell. The outer faces of the grid are unbounded: a
    /// ray along one may seem to be outside, and it is clipped to the scene's box with its own error bound.
    #[inline(always)]
    fn enters(&self, cell: usize) -> f32 {
        if cell >= self.count {
            f32::INFINITY
        } else if cell == 0 {
            f32::NEG_INFINITY
        } else {
            // NaN bounds nothing.
            keep_max(self.distance(cell) - self.slack, f32::NEG_INFINITY)
        }
    }

    /// Upper bound on the distance at which the ray leaves a cell.
    #[inline(always)]
    fn leaves(&self, cell: usize) -> f32 {
        if cell + 1 == self.count {
            f32::INFINITY
        } else {
            keep_min(self.distance(cell + 1) + self.slack, f32::INFINITY)
        }
    }

    /// The index in the grid of a cell counted in the direction of the ray.
    #[inline(always)]
    fn index(&self, cell: usize) -> usize {
        if self.backwards {
            self.count - 1 - cell
        } else {
            cell
        }
    }

    /// The first and the last cell that the ray may be in at distance `t`, where its coordinate is about `x`;
    /// `per_unit` is the number of cells per unit of length.
    #[inline(always)]
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "saturates"
    )]
    fn window(&self, x: f32, per_unit: f32, t: f32) -> [usize; 2] {
        let guess = ((x - self.walls[0]) * per_unit) as usize;
        // Correct the guess by the bounds: it may be a cell off, or more in a grid of tiny cells.
        let mut last = self.index(guess.min(self.count - 1));
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

/// The cells that the ray may be in, from the first to the last, per axis.
type Cells = [[usize; 2]; 3];

/// A grid and its walls across the three axes, as one ray meets them.
struct Walls<'a> {
    grid: &'a Grid,
    axes: [Axis<'a>; 3],
}

impl Walls<'_> {
    /// Tests the triangles of some cells; returns whether the traversal may end.
    #[inline(always)]
    fn visit<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        cells: &Cells,
        best: &mut Best,
        counters: &mut C,
    ) -> bool {
        let axes = &self.axes;
        for z in cells[2][0]..=cells[2][1] {
            for y in cells[1][0]..=cells[1][1] {
                for x in cells[0][0]..=cells[0][1] {
                    let cell = [axes[0].index(x), axes[1].index(y), axes[2].index(z)];
                    let leaf = self.grid.cell(cell);
                    counters.leaf(leaf.count);
                    if leaf.count == 0 {
                        continue;
                    }
                    // A hit counts up to the distance at which the ray has provably left the cell.
                    let sides = keep_min(axes[0].leaves(x), axes[1].leaves(y));
                    let leave = keep_min(sides, keep_min(axes[2].leaves(z), ray.frame.t_max));
                    if job.test::<S, Q, C>(simd, leaf, ray, leave, best, counters) {
                        return true;
                    }
                }
            }
        }
        false
    }
}

/// The traversal of one grid.
pub struct GridTraversal<'a>(pub &'a Grid);

impl SingleTraversal for GridTraversal<'_> {
    type Scratch = ();
    type Uncounted = NoCount;

    fn scratch(&self) {}

    #[inline(always)]
    fn cast<S: Simd, Q: Query, C: Counters>(
        &self,
        simd: S,
        job: Job<'_>,
        ray: RayRef<'_>,
        (): &mut (),
        counters: &mut C,
    ) -> Best {
        let (grid, frame) = (self.0, ray.frame);
        let mut best = Best::new(frame);
        // Find the cells the ray may start in, and the distance to the next wall of each axis.
        let axes = map(
            [0, 1, 2],
            #[inline(always)]
            |k: usize| Axis::new(grid, frame, k),
        );
        let walls = Walls { grid, axes };
        let start = frame.t_min;
        let mut may: Cells = map(
            [0, 1, 2],
            #[inline(always)]
            |k: usize| axes[k].window(frame.o[k] + start * frame.d[k], grid.per_unit(k), start),
        );
        let mut next = map(
            [0, 1, 2],
            #[inline(always)]
            |k: usize| axes[k].enters(may[k][1] + 1),
        );
        // The cells to visit in this step: the newly entered cell on its axis, all possible ones on the others.
        let mut fresh = may;
        loop {
            counters.step_boxes();
            if walls.visit::<S, Q, C>(simd, job, ray, &fresh, &mut best, counters) {
                return best;
            }
            // Choose the axis whose next wall may be crossed first.
            let mut axis = 0;
            if next[1] < next[axis] {
                axis = 1;
            }
            if next[2] < next[axis] {
                axis = 2;
            }
            let now = next[axis];
            if now > best.reach || now > frame.t_max || now == f32::INFINITY {
                return best;
            }
            // Drop the cells that the ray has provably left by then.
            for k in 0..3 {
                while may[k][0] < may[k][1] && axes[k].leaves(may[k][0]) < now {
                    may[k][0] += 1;
                }
            }
            // Enter the next cell of that axis.
            may[axis][1] += 1;
            next[axis] = axes[axis].enters(may[axis][1] + 1);
            fresh = may;
            fresh[axis][0] = fresh[axis][1];
        }
    }
}

single_rays! {
    /// Single rays from cell to cell of a grid.
    fn grid(Grid) -> GridTraversal<'a> {
        |kernel| GridTraversal(&kernel.tree)
    }
}
