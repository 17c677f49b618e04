// SPDX-License-Identifier: GPL-3.0-or-later
//! The policy of a tree of split planes: the directions to try at each node.

use crate::piece::Piece;
use halfspace_base::Monitor;
use halfspace_geom::Aabb;
use halfspace_geom::cell::{Cell, Direction, Plane};

/// The policy of a plane tree: the only part of the build in which plane trees differ.
pub trait PlanePolicy: Sync {
    /// Type of the cells: boxes if all planes are axis-aligned, otherwise convex polytopes.
    type Cell: Cell;
    /// Data that a node keeps per triangle.
    type Piece: Piece;
    /// Returns the bytes that the policy holds, which a tree keeps while it is built on demand.
    fn bytes(&self) -> usize {
        0
    }
    /// Returns the cell of the whole scene; `bounds` is the scene's box in the frame of the tree.
    fn root(&self, bounds: Aabb) -> Self::Cell;
    /// Writes the directions to sweep at a node to `out`, which is empty. Among equally cheap planes, the one with the
    /// earlier direction is chosen.
    fn directions(&self, node: &Node<'_, Self::Piece>, out: &mut Vec<Direction>);
    /// Writes the single planes to try in addition to the sweeps to `out`, which is empty.
    fn planes(&self, _: &Node<'_, Self::Piece>, _: &mut Vec<Plane>) {}
    /// Appends further directions to `out`. Called only if the cheapest plane of [`Self::directions`] costs more than
    /// [`crate::space::Params::enough`].
    fn further(&self, _: &Node<'_, Self::Piece>, _: &mut Vec<Direction>) {}
    /// Writes further directions to `out`, which is empty. Called for a node that would otherwise become a leaf.
    fn more(&self, _: &Node<'_, Self::Piece>, _: &mut Vec<Direction>) {}
    /// Writes further directions to `out`, which is empty. Called for a node that is too large for a leaf and that no
    /// plane of [`Self::directions`] splits.
    fn last_resort(&self, _: &Node<'_, Self::Piece>, _: &mut Vec<Direction>) {}
}

/// The data of a node that a policy receives.
#[derive(Debug, Clone, Copy)]
pub struct Node<'a, P> {
    /// The node's triangles.
    pub pieces: &'a [P],
    /// Depth of the node; the root has depth 0.
    pub depth: usize,
    /// Random number of the node, which depends only on its path from the root: the seed of the policy's random
    /// choices.
    pub key: u64,
    /// The monitor of the build: a policy that takes long at a node returns when it is cancelled.
    pub monitor: &'a Monitor,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::piece::Boxed;
    use crate::space::{ObliqueStep, Params, Stop, build};
    use crate::sweep::Ties;
    use halfspace_base::error::Error;
    use halfspace_geom::cell::BoxCell;
    use halfspace_nodes::cost::Costs;
    use halfspace_ray::frame::Frame;
    use halfspace_scene::Triangles;

    /// Proposes nothing; a monitor that is to be cancelled is cancelled meanwhile.
    struct Endless {
        cancels: bool,
    }

    impl PlanePolicy for Endless {
        type Cell = BoxCell;
        type Piece = Boxed;

        fn root(&self, bounds: Aabb) -> BoxCell {
            BoxCell(bounds)
        }

        fn directions(&self, node: &Node<'_, Boxed>, _: &mut Vec<Direction>) {
            if self.cancels {
                node.monitor.cancel();
            }
        }
    }

    #[test]
    fn a_node_at_which_the_build_is_cancelled_is_no_leaf() {
        let vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 1.0]];
        let scene = Triangles::new(vertices, vec![[0, 1, 2]; 20]).expect("valid");
        let params = Params {
            costs: Costs::THESIS,
            oblique: ObliqueStep::Fixed(f32::INFINITY),
            ties: Ties::Clean,
            slab: 0.0,
            leaf_size: 1,
            leaf_most: usize::MAX,
            area_stop: 0.0,
            max_depth: 8,
            stop: Stop::Cheapest,
            sorted: false,
            early: false,
            enough: 0.0,
        };
        let built = |cancels| {
            let frame = Frame::new(scene.bounds());
            let policy = Endless { cancels };
            build(&scene, &frame, &policy, &params, &Monitor::new())
        };
        assert_eq!(built(false).expect("not cancelled").ids.len(), 20);
        assert!(matches!(built(true), Err(Error::Cancelled)));
    }
}
