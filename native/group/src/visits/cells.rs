// SPDX-License-Identifier: GPL-3.0-or-later
//! Uniform grids as implicit trees: a node is a range of cells, and the middle wall across its longest side halves it.
//! Several rays thus find their cells together, in the order of their octant; a ray alone steps from cell to cell
//! ([`halfspace_single::grid`]). As for single rays, the outer faces of the grid bound nothing.

use crate::visits::{Gap, Nodes, Visitor};
use fearless_simd::Simd;
use halfspace_leaf::Leaf;
use halfspace_leaf::blocks::Blocks;
use halfspace_nodes::grid::Grid;
use halfspace_ray::query::Counters;
use prefetch_index::prefetch_index;

/// A range of cells: the first along each axis, and the first beyond.
#[derive(Clone, Copy)]
pub struct Range {
    first: [u32; 3],
    end: [u32; 3],
}

/// The wall that halves a range.
#[derive(Clone, Copy)]
pub struct Wall {
    /// The axis.
    pub axis: usize,
    /// The height.
    pub at: f32,
    /// Its number.
    number: u32,
}

impl Range {
    /// The first cell.
    fn cell(&self) -> [usize; 3] {
        self.first.map(|x| x as usize)
    }

    /// Number of cells along an axis.
    #[inline(always)]
    fn count(&self, axis: usize) -> u32 {
        self.end[axis] - self.first[axis]
    }

    /// The wall that halves a range of several cells.
    #[inline(always)]
    pub fn wall(&self, grid: &Grid) -> Wall {
        let axis = (1..3).fold(0, |a, b| if self.count(b) > self.count(a) { b } else { a });
        let number = self.first[axis] + self.count(axis) / 2;
        Wall {
            axis,
            at: grid.walls(axis)[number as usize],
            number,
        }
    }

    /// The part below (0) or above (1) a wall, `None` for an empty cell.
    #[inline(always)]
    pub fn part(&self, grid: &Grid, wall: Wall, side: usize) -> Option<Self> {
        let mut part = *self;
        if side == 0 {
            part.end[wall.axis] = wall.number;
        } else {
            part.first[wall.axis] = wall.number;
        }
        let empty = Nodes::leaf(grid, &part).is_some_and(|leaf| leaf.count == 0);
        (!empty).then_some(part)
    }
}

impl Nodes for Grid {
    type Node = Range;
    const CHILDREN: usize = 2;

    fn root(&self) -> Range {
        let end = [0, 1, 2].map(|axis| u32::try_from(self.count(axis)).expect("cells fit"));
        Range { first: [0; 3], end }
    }

    #[inline(always)]
    fn leaf(&self, node: &Range) -> Option<Leaf> {
        let single = (0..3).all(|axis| node.count(axis) == 1);
        single.then(|| self.cell(node.cell()))
    }

    #[inline(always)]
    fn fetch_ahead(&self, node: &Range, blocks: &Blocks) {
        match Nodes::leaf(self, node) {
            Some(leaf) => blocks.fetch_ahead(leaf.first),
            None => prefetch_index(&self.cells, self.index(node.cell())),
        }
    }

    #[inline(always)]
    fn count<C: Counters>(&self, _: &Range, counters: &mut C) {
        counters.step_axis();
    }

    #[inline(always)]
    fn visit<S: Simd>(&self, simd: S, node: &Range, visitor: &mut impl Visitor<Range>) {
        let wall = node.wall(self);
        let near = visitor.octant() >> wall.axis & 1;
        let children = [near ^ 1, near].map(|side| node.part(self, wall, side));
        let gap = Gap {
            axis: wall.axis,
            ends: wall.at,
            begins: wall.at,
        };
        visitor.halve(simd, children, &gap);
    }

    fn bytes(&self) -> usize {
        Grid::bytes(self)
    }
}
