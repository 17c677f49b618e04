// SPDX-License-Identifier: GPL-3.0-or-later
//! Uniform grids: the walls of equal cells along each axis, and the leaf of each cell (Cleary and Wyvill 1988).

use crate::cells::{Cells, NodeId, NodeView, Steps, axis_kind};
use crate::check;
use crate::tree::{Body, Tree, same};
use halfspace_geom::Aabb;
use halfspace_geom::cell::{Direction, Plane};
use halfspace_geom::region::Region;
use halfspace_leaf::Leaf;

/// A uniform grid over a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Per axis the walls in ascending order, one more than there are cells.
    pub walls: [Vec<f32>; 3],
    /// Cells per unit of length.
    pub per_unit: [f32; 3],
    /// Position of the first block and number of triangles of each cell; x runs fastest, z slowest.
    pub cells: Vec<[u32; 2]>,
}

impl Grid {
    /// Returns the number of cells.
    pub fn number(&self) -> usize {
        self.count(0) * self.count(1) * self.count(2)
    }

    /// Returns the walls across an axis, in ascending order.
    #[inline(always)]
    pub fn walls(&self, axis: usize) -> &[f32] {
        &self.walls[axis]
    }

    /// Returns the cells per unit of length along an axis; undefined for an axis along which the scene is flat.
    #[inline(always)]
    pub fn per_unit(&self, axis: usize) -> f32 {
        self.per_unit[axis]
    }

    /// Returns the number of cells along an axis.
    #[inline(always)]
    pub fn count(&self, axis: usize) -> usize {
        self.walls[axis].len() - 1
    }

    /// Returns the index of a cell.
    #[inline(always)]
    pub fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.count(1) + y) * self.count(0) + x
    }

    /// Returns the leaf of a cell.
    #[inline(always)]
    pub fn cell(&self, cell: [usize; 3]) -> Leaf {
        let [first, count] = self.cells[self.index(cell)];
        Leaf {
            first,
            count: count as usize,
        }
    }

    /// Returns the box of a cell.
    pub fn bounds(&self, cell: [usize; 3]) -> Aabb {
        Aabb {
            min: [0, 1, 2].map(|k| self.walls[k][cell[k]]),
            max: [0, 1, 2].map(|k| self.walls[k][cell[k] + 1]),
        }
    }

    /// Calls `see` for all cells, x fastest.
    pub fn visit(&self, mut see: impl FnMut([usize; 3], Leaf)) {
        for z in 0..self.count(2) {
            for y in 0..self.count(1) {
                for x in 0..self.count(0) {
                    see([x, y, z], self.cell([x, y, z]));
                }
            }
        }
    }

    /// Returns the size in bytes.
    pub fn bytes(&self) -> usize {
        let walls: usize = self.walls.iter().map(|walls| size_of_val(&**walls)).sum();
        walls + size_of_val(&*self.cells)
    }
}

impl Tree for Grid {
    fn bytes(&self) -> usize {
        Grid::bytes(self)
    }

    fn cells(&self) -> Option<&dyn Cells> {
        Some(self)
    }

    fn leaves(&self, see: &mut dyn FnMut(u32, usize)) {
        self.visit(|_, Leaf { first, count }| see(first, count));
    }

    fn validate(&self, body: &Body<'_>, broken: &mut Vec<String>) {
        check::grid::grid(body, self, broken);
    }

    fn same(&self, other: &dyn Tree) -> bool {
        same(self, other)
    }
}

/// A grid as a tree of three levels: slices along x, in each of them rows along y, and in those the cells. A node is
/// named by its level and by one coordinate per level above it.
impl Cells for Grid {
    fn root(&self, bounds: Aabb) -> (NodeId, Region) {
        ([0; 4], Region::of_scene(bounds))
    }

    fn node(&self, [level, x, y, z]: NodeId, region: &Region) -> NodeView {
        let (axis, at) = (level as usize, [x, y, z]);
        if axis == 3 {
            let Leaf { first, count } = self.cell(at.map(|i| i as usize));
            return NodeView::leaf(first, count);
        }
        // Divide the box along the axis of the level.
        let bounds = region.bounds().expect("a box within a grid");
        let walls = self.walls(axis);
        let planes = walls[1..self.count(axis)].iter().map(|&offset| {
            let direction = Direction::Axis(axis);
            (Plane { direction, offset }, axis_kind(axis))
        });
        let children = (0_u32..).zip(walls.windows(2)).map(|(number, walls)| {
            let (mut at, mut part) = (at, bounds);
            at[axis] = number;
            (part.min[axis], part.max[axis]) = (walls[0], walls[1]);
            ([level + 1, at[0], at[1], at[2]], region.part(part))
        });
        NodeView {
            planes: planes.collect(),
            children: children.collect(),
            ..NodeView::default()
        }
    }

    fn partitions(&self) -> bool {
        true
    }

    /// A ray steps from cell to cell; the levels above the cells exist for drawing only.
    fn steps(&self, node: &NodeView) -> Steps {
        Steps {
            axis: u32::from(node.leaf.is_some()),
            oblique: 0,
        }
    }
}
