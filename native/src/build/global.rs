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
}

impl ObjectPolicy for Global {
    /// The cell of the grid that holds the centres.
    type Region = Aabb;

    fn root(&self, bounds: Aabb) -> Aabb {
        bounds
    }

    fn part(&self, node: &Node<'_, Aabb>) -> Parting<Aabb> {
        if node.objects.len() <= self.leaf_size {
            return Parting::Leaf;
        }
        let mut cell = *node.region;
        let (mut axis, mut at) = middle(&cell);
        let below = |i: usize| node.objects[i].centre(axis) <= at;
        let first = below(0);
        if (1..node.objects.len()).all(|i| below(i) == first) {
            // Halve on without looking at the objects again, until their box of centres is parted.
            let (_, centres) = node.measure();
            let widest = longest(&centres);
            if centres.extent(widest) == 0.0 {
                return Parting::Leaf;
            }
            loop {
                (axis, at) = middle(&cell);
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
        let mut regions = [cell; 2];
        regions[0].max[axis] = at;
        regions[1].min[axis] = at;
        Parting::Centre { axis, at, regions }
    }
}

/// What is left where the cell is as small as floats allow.
fn median(cell: Aabb, axis: usize) -> Parting<Aabb> {
    Parting::Median {
        axis,
        regions: [cell; 2],
    }
}

/// The longest side and its middle.
fn middle(cell: &Aabb) -> (usize, f32) {
    let axis = longest(cell);
    (axis, 0.5 * cell.min[axis] + 0.5 * cell.max[axis])
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
