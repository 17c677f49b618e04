// SPDX-License-Identifier: GPL-3.0-or-later
//! Partitions of objects by a regular grid: each cell is halved along its longest side, and objects go
//! to the half that holds their centre (the global heuristic of Wächter and Keller 2006). It looks
//! at nothing but centres, so it is as quick as a quicksort.

use super::object::{Node, ObjectPolicy, Parting};
use crate::geom::Aabb;

/// Parts objects by the middle of the grid's cell.
pub struct Global {
    /// Nodes of at most this many objects are leaves.
    pub leaf_size: usize,
    /// Cells are parted this many ways along one axis, a power of two, before it is chosen anew.
    pub ways: usize,
}

/// A cell of the grid.
#[derive(Debug, Clone, Copy)]
pub struct Cell {
    /// It holds the centres.
    bounds: Aabb,
    /// The axis along which its parent was parted.
    axis: usize,
    /// In how many more ways it is to be parted along that axis; 1 for none.
    ways: usize,
}

impl ObjectPolicy for Global {
    type Region = Cell;

    fn root(&self, bounds: Aabb) -> Cell {
        Cell {
            bounds,
            axis: 0,
            ways: 1,
        }
    }

    fn part(&self, node: &Node<'_, Cell>) -> Parting<Cell> {
        if node.objects.len() <= self.leaf_size {
            return Parting::Leaf;
        }
        let Cell {
            bounds: mut cell,
            axis,
            ways,
        } = *node.region;
        let follow = ways > 1;
        let (mut axis, mut at) = if follow {
            (axis, middle(&cell, axis))
        } else {
            longest_middle(&cell)
        };
        let mut ways = if follow { ways } else { self.ways };
        let below = |i: usize| node.objects[i].centre(axis) <= at;
        let first = below(0);
        if (1..node.objects.len()).all(|i| below(i) == first) {
            // Halve on without looking at the objects again, until their box of centres is parted.
            let (_, centres) = node.measure();
            let widest = longest(&centres);
            if centres.extent(widest) == 0.0 {
                return Parting::Leaf;
            }
            ways = self.ways;
            loop {
                (axis, at) = longest_middle(&cell);
                if centres.min[axis] > at {
                    if cell.min[axis] >= at {
                        return median(cell, widest);
                    }
                    cell.min[axis] = at;
                } else if centres.max[axis] <= at {
                    if cell.max[axis] <= at {
                        return median(cell, widest);
                    }
                    cell.max[axis] = at;
                } else {
                    break;
                }
            }
        }
        let region = |bounds| Cell {
            bounds,
            axis,
            ways: ways / 2,
        };
        let (mut low, mut high) = (cell, cell);
        low.max[axis] = at;
        high.min[axis] = at;
        Parting::Centre {
            axis,
            at,
            regions: [region(low), region(high)],
        }
    }
}

/// What is left where the cell is as small as floats allow.
fn median(bounds: Aabb, axis: usize) -> Parting<Cell> {
    let cell = Cell {
        bounds,
        axis,
        ways: 1,
    };
    Parting::Median {
        axis,
        regions: [cell; 2],
    }
}

/// The middle of a side.
fn middle(cell: &Aabb, axis: usize) -> f32 {
    0.5 * cell.min[axis] + 0.5 * cell.max[axis]
}

/// The longest side and its middle.
fn longest_middle(cell: &Aabb) -> (usize, f32) {
    let axis = longest(cell);
    (axis, middle(cell, axis))
}

/// The longest side; of equal ones the first.
fn longest(cell: &Aabb) -> usize {
    (1..3).fold(0, |best, k| {
        if cell.extent(k) > cell.extent(best) {
            k
        } else {
            best
        }
    })
}
