// SPDX-License-Identifier: GPL-3.0-or-later
//! Uniform grids: the walls of equal cells along each axis, and the leaf of each cell (Cleary and Wyvill 1988).

use halfspace_geom::Aabb;

/// A uniform grid over a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Per axis the walls in ascending order, one more than there are cells.
    pub walls: [Vec<f32>; 3],
    /// Cells per unit of length.
    pub per_unit: [f32; 3],
    /// Where each cell's blocks begin and how many triangles they hold; x runs fastest, z slowest.
    pub cells: Vec<[u32; 2]>,
}

impl Grid {
    /// How many cells there are between the walls.
    pub fn number(&self) -> usize {
        self.count(0) * self.count(1) * self.count(2)
    }

    /// The walls across an axis, in ascending order.
    #[inline(always)]
    pub fn walls(&self, axis: usize) -> &[f32] {
        &self.walls[axis]
    }

    /// Cells per unit of length along an axis; means nothing for an axis along which the scene is flat.
    #[inline(always)]
    pub fn per_unit(&self, axis: usize) -> f32 {
        self.per_unit[axis]
    }

    /// How many cells there are along an axis.
    #[inline(always)]
    pub fn count(&self, axis: usize) -> usize {
        self.walls[axis].len() - 1
    }

    /// Where a cell is kept.
    #[inline(always)]
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.count(1) + y) * self.count(0) + x
    }

    /// Where a cell's blocks begin, and how many triangles they hold.
    #[inline(always)]
    pub fn cell(&self, place: [usize; 3]) -> (u32, usize) {
        let [first, count] = self.cells[self.index(place)];
        (first, count as usize)
    }

    /// The box of a cell.
    pub fn bounds(&self, place: [usize; 3]) -> Aabb {
        Aabb {
            min: [0, 1, 2].map(|k| self.walls[k][place[k]]),
            max: [0, 1, 2].map(|k| self.walls[k][place[k] + 1]),
        }
    }

    /// Visits all cells, x fastest.
    pub fn visit(&self, mut see: impl FnMut([usize; 3], (u32, usize))) {
        for z in 0..self.count(2) {
            for y in 0..self.count(1) {
                for x in 0..self.count(0) {
                    see([x, y, z], self.cell([x, y, z]));
                }
            }
        }
    }

    /// Size in bytes.
    pub fn bytes(&self) -> usize {
        let walls: usize = self.walls.iter().map(|walls| size_of_val(&**walls)).sum();
        walls + size_of_val(&*self.cells)
    }
}
