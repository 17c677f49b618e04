// SPDX-License-Identifier: GPL-3.0-or-later
//! Partitions of objects that read the node's own box: its longest side is halved in the middle, or where half of the
//! objects lie on either side. These are the classical candidates of interval hierarchies, which must read all boxes of
//! a node before they choose, unlike the grid ([`crate::global`]).

use crate::object::{Node, ObjectPolicy, Partition};
use halfspace_geom::Aabb;

/// Where the longest side of a node's box is split.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum At {
    /// In its middle.
    Middle,
    /// Where half of the objects lie on either side.
    Median,
}

/// Partitions objects along the longest side of the box around them.
pub struct Longest {
    /// Nodes of at most this number of objects are leaves.
    pub leaf_size: usize,
    /// Where the side is split.
    pub at: At,
}

impl ObjectPolicy for Longest {
    type Region = ();

    fn root(&self, _: Aabb) {}

    fn partition(&self, node: &Node<'_, ()>) -> Partition<()> {
        if node.objects.len() <= self.leaf_size {
            return Partition::Leaf;
        }
        let (bounds, centres) = node.measure();
        // Objects with one common centre stay together, as in the grid: no plane between centres separates them.
        if (0..3).all(|k| centres.extent(k) == 0.0) {
            return Partition::Leaf;
        }
        let axis = (1..3).fold(0, |best, k| {
            if bounds.extent(k) > bounds.extent(best) {
                k
            } else {
                best
            }
        });
        let regions = [(); 2];
        match self.at {
            At::Middle => Partition::Centre {
                axis,
                at: 0.5 * bounds.min[axis] + 0.5 * bounds.max[axis],
                regions,
            },
            At::Median => Partition::Median { axis, regions },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object;
    use halfspace_base::Monitor;
    use halfspace_nodes::object_tree::ItemKind;
    use halfspace_ray::frame::Frame;
    use halfspace_scene::Triangles;

    /// Returns the number of triangles below the root's partition of eight along x, seven of them close together.
    fn below(at: At) -> usize {
        let mut vertices = Vec::new();
        for x in [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 8.0_f32] {
            vertices.extend([[x, 0.0, 0.0], [x + 0.05, 1.0, 0.0], [x + 0.05, 0.0, 1.0]]);
        }
        let indices = (0..8).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let scene = Triangles::new(vertices, indices).unwrap();
        let frame = Frame::new(scene.bounds());
        let policy = Longest { leaf_size: 7, at };
        let tree = object::build(&scene, &frame, &policy, &Monitor::new()).unwrap();
        let ItemKind::Inner { axis, children } = tree.kind(0) else {
            panic!("eight triangles are split");
        };
        assert_eq!(axis, 0);
        let ItemKind::Leaf { count } = tree.kind(children[0]) else {
            panic!("up to seven triangles are a leaf");
        };
        count
    }

    #[test]
    fn the_middle_halves_the_box_and_the_median_the_objects() {
        assert_eq!((below(At::Middle), below(At::Median)), (7, 4));
    }
}
