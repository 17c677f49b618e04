// SPDX-License-Identifier: GPL-3.0-or-later
//! Uniform grids: the scene's box in equal cells, a given number per triangle, as close to cubes as integer counts
//! allow (Cleary and Wyvill 1988).
//!
//! The walls are f32, and a triangle is in every cell that contains one of its points, walls included. Nothing is
//! widened here, because the traversal bounds the error of its own distances. The result is a pure function of the
//! triangles and the parameters, for any number of threads.

use halfspace_base::error::{Error, Result};
use halfspace_base::{Monitor, footprint};
use halfspace_geom::Aabb;
use halfspace_geom::overlap::TriangleBox;
use halfspace_geom::vec3::map;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::grid::Grid;
use halfspace_ray::FramedScene;
use halfspace_ray::frame::U;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Smallest thickness of a cell, per unit of the scene's largest coordinate: walls closer together than the
/// rounding of a ray's distances only add steps.
const THINNEST: f32 = 256.0 * U;

/// Largest number of cells along one axis.
const LONGEST: f64 = 4096.0;

/// Largest number of references per triangle and cell of a large grid; grids with more are rebuilt with fewer cells.
/// Rooms and scans have one or two. For thousands of triangles as large as the scene the references grow with the power
/// 5/3 of their number, and time and memory with them; fewer cells cost the rays more tests.
const CROWDED: usize = 16;

/// As [`CROWDED`], of a grid of at most [`SMALL`] references: a few hundred triangles as large as the scene have fewer.
const CROWDED_SMALL: usize = 64;

/// Largest number of references of a small grid (chosen): eleven megabytes.
const SMALL: usize = 1 << 18;

/// Factor on the number of cells of a crowded grid, applied until it is no longer crowded.
const FEWER: f64 = 0.25;

/// Blocks of more cells than this are tested against a triangle as a whole before their cells are (chosen).
const BLOCK: usize = 8;

/// Number of triangles that one task sorts into cells.
const TASK: usize = 1024;

/// Returns the number of cells along each axis, so that their product is about `cells`. Axes along which even one
/// cell is too long, or the scene too thin for two, leave their share of the cells to the others.
#[expect(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "at most LONGEST"
)]
pub fn resolution(bounds: &Aabb, cells: f64) -> [usize; 3] {
    // Find the axes that can be divided.
    let extent = [0, 1, 2].map(|k| bounds.extent(k));
    let thinnest = f64::from(THINNEST * bounds.magnitude());
    let most = extent.map(|e| (e / thinnest).min(LONGEST));
    let mut open: Vec<usize> = (0..3)
        .filter(|&k| extent[k] > 0.0 && most[k] >= 2.0)
        .collect();
    let mut left = cells;
    let mut out = [1.0_f64; 3];
    // Divide the axes evenly by length, and fix one axis at a time that leaves its range.
    loop {
        let volume: f64 = open.iter().map(|&k| extent[k]).product();
        let per_unit = (left / volume).powf(1.0 / open.len() as f64);
        for &k in &open {
            out[k] = (extent[k] * per_unit).round();
        }
        // Fix the axis farthest out of its range at the end of the range.
        let excess = |k: usize| (out[k] / most[k]).max(1.0 / out[k]);
        let worst = (open.iter().copied()).max_by(|&a, &b| excess(a).total_cmp(&excess(b)));
        match worst {
            Some(k) if !(1.0 <= out[k] && out[k] <= most[k]) => {
                out[k] = if out[k] > most[k] {
                    most[k].floor()
                } else {
                    1.0
                };
                left /= out[k];
                open.retain(|&other| other != k);
            }
            _ => break,
        }
    }
    out.map(|n| n as usize)
}

/// Returns the number of cells of a grid of about `cells` cells over a box.
pub fn cell_count(bounds: &Aabb, cells: f64) -> usize {
    Filling::empty(bounds, cells).0.number()
}

/// Builds a grid of about `cells` cells, fewer if the cells would have too many triangles, and writes the triangles of
/// each cell to `blocks`.
///
/// # Errors
/// [`Error::Cancelled`] and [`Error::Memory`] as the monitor returns them; [`Error::Memory`] for more references than
/// can be numbered.
pub fn build(
    framed: FramedScene<'_>,
    cells: f64,
    blocks: &mut Blocks,
    monitor: &Monitor,
) -> Result<Grid> {
    let FramedScene { scene, frame } = framed;
    // Reduce the number of cells until the grid is not crowded.
    let mut grid = Filling::empty(&frame.bounds(), cells);
    while grid.is_crowded(framed, monitor)? {
        grid = Filling::empty(&frame.bounds(), FEWER * grid.0.number() as f64);
    }
    let number = grid.0.number();
    monitor.take(number * footprint::leaf::<()>(0, 8))?;
    grid.0.cells = vec![[0; 2]; number];

    // Find the cells of each triangle.
    let tasks = scene.live().len().div_ceil(TASK).max(1) as f64;
    let references: Vec<Vec<(u32, u32)>> = scene
        .live()
        .par_chunks(TASK)
        .map(|ids| {
            let found = grid.sort(framed, ids, monitor)?;
            monitor.advance(1.0 / tasks);
            Ok(found)
        })
        .collect::<Result<_>>()?;
    monitor.check()?;
    // Count the references of each cell.
    for (cell, _) in references.iter().flatten() {
        grid.0.cells[*cell as usize][1] += 1;
    }
    let sum: usize = references.iter().map(Vec::len).sum();
    if sum >= 1 << 28 {
        return Err(Error::Memory(format!(
            "the grid would have {sum} references; fewer than 2^28 are possible"
        )));
    }
    // Accumulate the counts to the first slot of each cell.
    let mut next = Vec::with_capacity(number);
    let mut before = 0_u32;
    for [_, count] in &grid.0.cells {
        next.push(before);
        before += count;
    }
    // Sort the triangles by cell; they are in ascending order, and so are those of each cell.
    let mut ids = vec![0; sum];
    for (cell, id) in references.into_iter().flatten() {
        let slot = &mut next[cell as usize];
        ids[*slot as usize] = id;
        *slot += 1;
    }
    // Write the leaf of each cell.
    let mut ids = ids.as_slice();
    for cell in &mut grid.0.cells {
        let (own, rest) = ids.split_at(cell[1] as usize);
        ids = rest;
        if !own.is_empty() {
            cell[0] = blocks.push_leaf(scene, frame, own);
        }
    }
    blocks.seal();
    Ok(grid.0)
}

/// A grid whose cells are being filled.
struct Filling(Grid);

impl Filling {
    /// Makes the walls of about `cells` cells, without cells.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "an estimate, corrected by the walls"
    )]
    fn empty(bounds: &Aabb, cells: f64) -> Self {
        let counts = if bounds.is_empty() {
            [1; 3]
        } else {
            resolution(bounds, cells)
        };
        Self(Grid {
            walls: [0, 1, 2].map(|k| walls(bounds, k, counts[k])),
            per_unit: [0, 1, 2].map(|k| (counts[k] as f64 / bounds.extent(k)) as f32),
            cells: Vec::new(),
        })
    }

    /// Returns whether the triangles have more references than allowed and fewer cells are possible.
    #[expect(
        clippy::cast_possible_truncation,
        clippy::cast_sign_loss,
        reason = "at least 0, at most the cells along an axis"
    )]
    fn is_crowded(&self, framed: FramedScene<'_>, monitor: &Monitor) -> Result<bool> {
        let live = framed.scene.live();
        let number = self.0.number();
        // Allow a constant number of references per triangle and per cell.
        let both = live.len() + number;
        let most = (CROWDED_SMALL * both).min(SMALL.max(CROWDED * both));
        // Bound the references by the triangles' boxes, which nearly always suffices.
        let boxes: usize = (live.par_iter())
            .map(|&id| {
                let bounds = Aabb::of_triangle(corners(framed, id));
                let along = |k: usize| bounds.extent(k) * f64::from(self.0.per_unit[k]);
                let reached = map([0, 1, 2], |k| (along(k) as usize + 2).min(self.0.count(k)));
                reached[0] * reached[1] * reached[2]
            })
            .sum();
        if number == 1 || boxes <= most {
            return Ok(false);
        }
        // Count the references exactly, until there are too many.
        let references = AtomicUsize::new(0);
        live.par_chunks(TASK).try_for_each(|ids| {
            for &id in ids {
                monitor.check()?;
                let mut own = 0;
                self.each_cell(framed, id, &mut |_| {
                    own += 1;
                    Ok(())
                })?;
                // Whether the sum exceeds the limit does not depend on the order of the threads.
                if references.fetch_add(own, Ordering::Relaxed) + own > most {
                    break;
                }
            }
            Ok(())
        })?;
        Ok(references.into_inner() > most)
    }

    /// Returns the pairs of cell and triangle for each of the triangles `ids`.
    fn sort(
        &self,
        framed: FramedScene<'_>,
        ids: &[u32],
        monitor: &Monitor,
    ) -> Result<Vec<(u32, u32)>> {
        let (mut out, mut gathered) = (Vec::new(), 0);
        for &id in ids {
            // Check for cancellation per triangle: one may be in millions of cells.
            monitor.check()?;
            self.each_cell(framed, id, &mut |cell| {
                // Charge each reference, since their number is unknown in advance.
                monitor.charge(&mut gathered, footprint::leaf::<()>(1, 0))?;
                #[expect(clippy::cast_possible_truncation, reason = "far fewer than 4096^3")]
                out.push((self.0.index(cell) as u32, id));
                Ok(())
            })?;
        }
        monitor.take(gathered)?;
        Ok(out)
    }

    /// Calls `see` for each cell that a triangle is in.
    fn each_cell(
        &self,
        framed: FramedScene<'_>,
        id: u32,
        see: &mut impl FnMut([usize; 3]) -> Result<()>,
    ) -> Result<()> {
        let corners = corners(framed, id);
        let triangle = TriangleBox::new(corners, framed.frame.bounds().magnitude());
        self.each_of(
            &triangle,
            self.reached(&Aabb::of_triangle(corners)),
            &mut |cell| see(cell),
        )
    }

    /// Calls `see` for each cell of a block that a triangle is in. A block is given by its first and last cell
    /// along each axis.
    fn each_of(
        &self,
        triangle: &TriangleBox,
        block: [[usize; 2]; 3],
        see: &mut dyn FnMut([usize; 3]) -> Result<()>,
    ) -> Result<()> {
        let sides = map(block, |[first, last]| last - first + 1);
        let several = sides[0] * sides[1] * sides[2];
        // Reject whole blocks early: a large triangle is in few of the cells that its box touches.
        if (several == 1 || several > BLOCK) && !self.meets(triangle, block) {
            return Ok(());
        }
        if several == 1 {
            return see(map(block, |[first, _]| first));
        }
        // Halve the block along its longest side.
        let longest = (0..3).fold(0, |k, j| if sides[j] > sides[k] { j } else { k });
        let [first, last] = block[longest];
        let middle = first + sides[longest] / 2;
        for half in [[first, middle - 1], [middle, last]] {
            let mut part = block;
            part[longest] = half;
            self.each_of(triangle, part, see)?;
        }
        Ok(())
    }

    /// Returns whether a triangle may be in any cell of a block.
    fn meets(&self, triangle: &TriangleBox, block: [[usize; 2]; 3]) -> bool {
        let wall = |k: usize, i: usize| f64::from(self.0.walls[k][i]);
        let low = map([0, 1, 2], |k| wall(k, block[k][0]));
        let high = map([0, 1, 2], |k| wall(k, block[k][1] + 1));
        // The walls are f32, so centre and half sides are exact enough in f64 for the margins of the test.
        let centre = map([0, 1, 2], |k| 0.5 * (low[k] + high[k]));
        let reach = map([0, 1, 2], |k| 0.5 * (high[k] - low[k]));
        triangle.meets_box(centre, reach)
    }

    /// Returns, per axis, the first and the last cell that have a point in common with a box.
    fn reached(&self, bounds: &Aabb) -> [[usize; 2]; 3] {
        map([0, 1, 2], |k| {
            let walls = &self.0.walls[k];
            let last = walls.len() - 2;
            // Closed cells: a box that touches a wall is in the cells on both sides.
            let first = walls[1..].partition_point(|wall| *wall < bounds.min[k]);
            let end = walls.partition_point(|wall| *wall <= bounds.max[k]);
            [first.min(last), end.saturating_sub(1).min(last)]
        })
    }
}

/// Returns the vertices of a triangle in the structure's frame.
fn corners(framed: FramedScene<'_>, id: u32) -> [[f32; 3]; 3] {
    map(framed.scene.corners(id), |p| framed.frame.point(p))
}

/// Returns the walls of `count` equal cells, each rounded to f32.
#[expect(
    clippy::cast_possible_truncation,
    reason = "the rounded walls are the walls"
)]
fn walls(bounds: &Aabb, axis: usize, count: usize) -> Vec<f32> {
    let (low, high) = (bounds.min[axis], bounds.max[axis]);
    let step = (f64::from(high) - f64::from(low)) / count as f64;
    let inner = (1..count).map(|i| ((f64::from(low) + i as f64 * step) as f32).clamp(low, high));
    // Adding 0.0 turns -0.0 to 0.0.
    let all = std::iter::once(low).chain(inner).chain([high]);
    all.map(|x| x + 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bounds(max: [f32; 3]) -> Aabb {
        Aabb { min: [0.0; 3], max }
    }

    #[test]
    fn cells_are_as_cubic_as_integer_counts_allow() {
        assert_eq!(resolution(&bounds([1.0; 3]), 1000.0), [10; 3]);
        assert_eq!(resolution(&bounds([4.0, 2.0, 1.0]), 64.0), [8, 4, 2]);
        // The other axes get the cells that a thin axis cannot take.
        assert_eq!(resolution(&bounds([1.0, 1.0, 0.0]), 100.0), [10, 10, 1]);
        assert_eq!(resolution(&bounds([1.0, 1.0, 1e-9]), 100.0), [10, 10, 1]);
        assert_eq!(resolution(&bounds([1.0, 0.0, 0.0]), 100.0), [100, 1, 1]);
        assert_eq!(resolution(&bounds([0.0; 3]), 100.0), [1; 3]);
        assert_eq!(resolution(&bounds([1.0; 3]), 0.01), [1; 3]);
        // Far from the origin, cells are as wide as rounding requires.
        let far = Aabb {
            min: [1e6; 3],
            max: [1e6 + 1.0, 1e6 + 64.0, 1e6 + 64.0],
        };
        let [x, y, z] = resolution(&far, 1e6);
        assert!(x == 1 && y == 4 && z == 4, "{x} {y} {z}");
    }

    #[test]
    fn walls_ascend_and_end_at_the_box() {
        let far = Aabb {
            min: [-3.0, 1e6, 0.5],
            max: [7.0, 1e6 + 64.0, 0.5],
        };
        for (axis, count) in [(0, 7), (1, 4), (2, 1)] {
            let walls = walls(&far, axis, count);
            assert_eq!(walls.len(), count + 1);
            assert_eq!((walls[0], walls[count]), (far.min[axis], far.max[axis]));
            assert!(walls.is_sorted());
        }
    }
}
