// SPDX-License-Identifier: GPL-3.0-or-later
//! Partitions of objects by a regular grid: each cell is halved along its longest side, and each object goes to
//! the half that contains its centre (the global heuristic of Wächter and Keller 2006). It reads only the centres,
//! so it is as fast as a quicksort.

use crate::object::{Node, ObjectPolicy, Partition};
use halfspace_geom::Aabb;

/// Partitions objects at the middle of the grid's cell.
pub struct Global {
    /// Nodes of at most this number of objects are leaves.
    pub leaf_size: usize,
    /// Number of parts, a power of two, into which cells are split along one axis before an axis is chosen again.
    pub ways: usize,
}

/// A cell of the grid that covers a node.
#[derive(Debug, Clone, Copy)]
pub struct Cell {
    /// Bounds of the cell, which contain the centres.
    bounds: Aabb,
    /// Axis along which the parent was split.
    axis: usize,
    /// Number of parts into which the cell is still to be split along that axis; 1 for none.
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

    fn partition(&self, node: &Node<'_, Cell>) -> Partition<Cell> {
        if node.objects.len() <= self.leaf_size {
            return Partition::Leaf;
        }
        let Cell {
            bounds: mut cell,
            axis,
            ways,
        } = *node.region;
        let follow = ways > 1;
        // Continue along the parent's axis, or choose the longest side.
        let (mut axis, mut at) = if follow {
            (axis, middle(&cell, axis))
        } else {
            longest_middle(&cell)
        };
        let mut ways = if follow { ways } else { self.ways };
        // Check whether the middle separates any objects.
        let below = |i: usize| node.objects[i].centre(axis) <= at;
        let first = below(0);
        if (1..node.objects.len()).all(|i| below(i) == first) {
            // Halve the cell on the box of centres alone, without reading the objects again, until it splits that
            // box.
            let (_, centres) = node.measure();
            let widest = longest(&centres);
            if centres.extent(widest) == 0.0 {
                return Partition::Leaf;
            }
            ways = self.ways;
            loop {
                (axis, at) = longest_middle(&cell);
                // Keep the half that contains all centres, unless the cell cannot shrink any more.
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
        // Halve the cell, and count down the parts left along this axis.
        let region = |bounds| Cell {
            bounds,
            axis,
            ways: ways / 2,
        };
        let (mut low, mut high) = (cell, cell);
        low.max[axis] = at;
        high.min[axis] = at;
        Partition::Centre {
            axis,
            at,
            regions: [region(low), region(high)],
        }
    }
}

/// Returns a median partition, for a cell so small that its middle rounds to one of its ends.
fn median(bounds: Aabb, axis: usize) -> Partition<Cell> {
    let cell = Cell {
        bounds,
        axis,
        ways: 1,
    };
    Partition::Median {
        axis,
        regions: [cell; 2],
    }
}

/// Returns the middle of a side.
fn middle(cell: &Aabb, axis: usize) -> f32 {
    0.5 * cell.min[axis] + 0.5 * cell.max[axis]
}

/// Returns the longest side and its middle.
fn longest_middle(cell: &Aabb) -> (usize, f32) {
    let axis = longest(cell);
    (axis, middle(cell, axis))
}

/// Returns the axis of the longest side, the first of equal ones.
fn longest(cell: &Aabb) -> usize {
    (1..3).fold(0, |best, k| {
        if cell.extent(k) > cell.extent(best) {
            k
        } else {
            best
        }
    })
}
